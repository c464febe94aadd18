/* Statuses, and what is refused. SPDX-License-Identifier: GPL-3.0-or-later */
#include "check.h"
#include "patchlight.h"

#include <string.h>

static void every_status_has_a_text_of_its_own(void) {
    const pl_status all[] = {PL_OK, PL_ERR_MEMORY, PL_ERR_ARGUMENT, PL_ERR_EMBREE, (pl_status)99};
    for (size_t i = 0; i < sizeof all / sizeof *all; ++i) {
        CHECK(pl_status_text(all[i]) && strlen(pl_status_text(all[i])) > 0);
        for (size_t k = 0; k < i; ++k)
            CHECK(strcmp(pl_status_text(all[i]), pl_status_text(all[k])));
    }
}

static void only_embree_opens_as_embree(void) {
    pl_embree *embree = NULL;
    CHECK(pl_embree_open("/no/such/folder/libembree4.so", &embree) == PL_ERR_EMBREE);
    CHECK(pl_embree_open("", &embree) == PL_ERR_EMBREE);
    CHECK(pl_embree_open("libm.so.6", &embree) == PL_ERR_EMBREE);
    CHECK(!embree);
}

static void nothing_may_be_closed(void) {
    pl_embree_close(NULL);
    pl_scene_destroy(NULL);
    pl_patches_destroy(NULL);
}

static void only_a_rising_layout_is_taken(void) {
    const uint8_t apexes[] = {0, 2}, bad_apexes[] = {0, 3};
    const int32_t rows[] = {0, 1, 3}, columns[] = {0, 2, 4, 5};
    const int32_t late[] = {1, 2, 3}, empty[] = {0, 0, 3}, falling[] = {0, 4, 3}, few[] = {0, 1, 2};
    const int32_t bad_columns[] = {0, 2, 2, 5};
    pl_patches *patches = NULL;

    CHECK(pl_patches_create(bad_apexes, rows, 2, columns, 3, &patches) == PL_ERR_ARGUMENT);
    CHECK(pl_patches_create(apexes, late, 2, columns, 3, &patches) == PL_ERR_ARGUMENT);
    CHECK(pl_patches_create(apexes, empty, 2, columns, 3, &patches) == PL_ERR_ARGUMENT);
    CHECK(pl_patches_create(apexes, falling, 2, columns, 3, &patches) == PL_ERR_ARGUMENT);
    CHECK(pl_patches_create(apexes, few, 2, columns, 3, &patches) == PL_ERR_ARGUMENT);
    CHECK(pl_patches_create(apexes, rows, 2, bad_columns, 3, &patches) == PL_ERR_ARGUMENT);
    CHECK(!patches);
    CHECK(pl_patches_create(apexes, rows, 2, columns, 3, &patches) == PL_OK);
    CHECK(patches);

    int32_t selected[] = {4, 5}, triangles[2];
    float barycentrics[6];
    CHECK(pl_patch_points(patches, selected, 2, 1, 0, triangles, barycentrics) == PL_ERR_ARGUMENT);
    CHECK(pl_patch_points(patches, selected, 1, 2, 0, triangles, barycentrics) == PL_OK);
    CHECK(triangles[0] == 1 && triangles[1] == 1);
    pl_patches_destroy(patches);
}

int main(void) {
    every_status_has_a_text_of_its_own();
    only_embree_opens_as_embree();
    nothing_may_be_closed();
    only_a_rising_layout_is_taken();
    return 0;
}
