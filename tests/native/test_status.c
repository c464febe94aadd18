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

static void only_a_rising_layout_of_squares_is_taken(void) {
    const uint8_t apexes[] = {0, 2}, bad_apexes[] = {0, 3};
    const int32_t rows[] = {0, 1, 3}, cells[] = {0, 1, 3, 4}, ones[] = {0, 1, 2, 3, 4}, squares[] = {0, 1, 5, 14, 15};
    const int32_t late[] = {1, 2, 3}, empty[] = {0, 0, 3}, falling[] = {0, 4, 3}, few[] = {0, 1, 2};
    const int32_t bad_cells[] = {0, 2, 2, 4}, oblong[] = {0, 2, 3, 4, 5}, huge[] = {0, 289, 290, 291, 292};
    const pl_patch_layout good = {apexes, rows, cells, ones, 2, 3, 4, NULL, NULL, 0};
    const pl_patch_layout bad[] = {
        {bad_apexes, rows, cells, ones, 2, 3, 4, NULL, NULL, 0},
        {apexes, late, cells, ones, 2, 3, 4, NULL, NULL, 0},
        {apexes, empty, cells, ones, 2, 3, 4, NULL, NULL, 0},
        {apexes, falling, cells, ones, 2, 3, 4, NULL, NULL, 0},
        {apexes, few, cells, ones, 2, 3, 4, NULL, NULL, 0},
        {apexes, rows, bad_cells, ones, 2, 3, 4, NULL, NULL, 0},
        {apexes, rows, cells, oblong, 2, 3, 4, NULL, NULL, 0},
        {apexes, rows, cells, huge, 2, 3, 4, NULL, NULL, 0},
    };
    pl_patches *patches = NULL;

    for (size_t k = 0; k < sizeof bad / sizeof *bad; ++k)
        CHECK(pl_patches_create(&bad[k], &patches) == PL_ERR_ARGUMENT);
    CHECK(!patches);
    CHECK(pl_patches_create(&good, &patches) == PL_OK);
    CHECK(pl_patches_count(patches) == 4);
    pl_patches_destroy(patches);
    const pl_patch_layout split = {apexes, rows, cells, squares, 2, 3, 4, NULL, NULL, 0};
    CHECK(pl_patches_create(&split, &patches) == PL_OK);
    CHECK(pl_patches_count(patches) == 15);

    int32_t selected[] = {14, 15}, triangles[2];
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
    only_a_rising_layout_of_squares_is_taken();
    return 0;
}
