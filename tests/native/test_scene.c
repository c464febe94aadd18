/* Scenes whole, empty and broken. SPDX-License-Identifier: GPL-3.0-or-later */
#include "check.h"
#include "embree.h"
#include "patches.h"
#include "patchlight.h"

#include <math.h>

static const double tetrahedron[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
static const int32_t faces[] = {0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2}; /* seen from inside */

static pl_embree *open_embree(void) {
    pl_embree *embree = NULL;
    const char *path = getenv("PATCHLIGHT_EMBREE");
    CHECK(path);
    CHECK(pl_embree_open(path, &embree) == PL_OK);
    return embree;
}

static pl_hit hit_along(const pl_scene *scene, const double origin[3], const float direction[3]) {
    pl_hit hit = {.triangle = -2};
    float found[3] = {NAN, NAN, NAN};
    pl_closest_hits(scene, origin, direction, 1, &hit.triangle, found);
    hit.u = found[0], hit.v = found[1], hit.distance = found[2];
    return hit;
}

static void indices_out_of_range_are_refused(const pl_embree *embree) {
    pl_scene *scene = NULL;
    const int32_t above[] = {0, 1, 4}, below[] = {0, -1, 2};
    CHECK(pl_scene_create(embree, tetrahedron, 4, above, 1, NULL, &scene) == PL_ERR_ARGUMENT);
    CHECK(pl_scene_create(embree, tetrahedron, 4, below, 1, NULL, &scene) == PL_ERR_ARGUMENT);
    CHECK(!scene);
}

static int out_of_memory(RTCDevice device) {
    (void)device;
    return 4;
}

static void a_tree_that_was_not_built_is_no_scene(const pl_embree *embree) {
    pl_scene *scene = NULL;
    pl_embree failing = *embree;
    failing.device_error = out_of_memory;
    CHECK(pl_scene_create(&failing, tetrahedron, 4, faces, 4, NULL, &scene) == PL_ERR_MEMORY);
    CHECK(!scene);
}

static void a_scene_of_nothing_has_no_hits(const pl_embree *embree) {
    pl_scene *scene = NULL;
    const double origin[] = {0, 0, 0}, to[] = {1, 1, 1};
    const float direction[] = {1, 2, 3};
    uint8_t occluded = 2;
    CHECK(pl_scene_create(embree, tetrahedron, 0, faces, 0, NULL, &scene) == PL_OK);
    CHECK(hit_along(scene, origin, direction).triangle == -1);
    pl_occluded(scene, origin, to, 1, &occluded);
    CHECK(occluded == 0);
    pl_scene_destroy(scene);
}

static void degenerate_triangles_are_never_hit(const pl_embree *embree) {
    /* a line whose corners no float holds exactly, a doubled corner, a point */
    const double vertices[] = {0.2, 0.2, 1, 0.4, 0.4, 1, 0.8, 0.8, 1, 0.5, 0.1, 1};
    const int32_t triangles[] = {0, 1, 2, 0, 3, 3, 1, 1, 1};
    pl_scene *scene = NULL;
    CHECK(pl_scene_create(embree, vertices, 4, triangles, 3, NULL, &scene) == PL_OK);
    for (int k = 0; k <= 1000; ++k) {
        const double along = 0.2 + 0.6 * k / 1000;
        const double origin[] = {along, along, 0};
        const float up[] = {0, 0, 1}, slanted[] = {0.1f, 0.1f, 1};
        CHECK(hit_along(scene, origin, up).triangle == -1);
        CHECK(hit_along(scene, origin, slanted).triangle == -1);
    }
    pl_scene_destroy(scene);
}

static void directions_need_not_be_unit(const pl_scene *scene) {
    const double origin[] = {0.2, 0.2, 0.2};
    const float down[] = {0, 0, -4};
    const pl_hit hit = hit_along(scene, origin, down);
    CHECK(hit.triangle == 0);
    CHECK(fabsf(hit.distance - 0.05f) < 1e-6f);
}

static void rows_are_finite_and_closed(const pl_scene *scene) {
    enum { SIDES = 8 };
    const uint8_t apexes[] = {0, 0, 0, 0};
    const int32_t one_each[] = {0, 1, 2, 3, 4}, sides[] = {0, 2, 4, 6};
    pl_patches *patches = NULL;
    double factors[4 * SIDES];
    const pl_patch_layout layout = {apexes, one_each, one_each, one_each, 4, 4, 4, NULL, NULL, 0};
    CHECK(pl_patches_create(&layout, &patches) == PL_OK);
    for (int estimator = 0; estimator < 2; ++estimator) {
        const pl_status status = estimator ? pl_form_factors_hemicube(scene, patches, sides, 4, 8, 4, 1, factors)
                                           : pl_form_factors_monte_carlo(scene, patches, sides, 4, 512, 1, factors);
        CHECK(status == PL_OK);
        for (int i = 0; i < 4; ++i) {
            double sum = 0;
            for (int k = 0; k < SIDES; ++k) {
                CHECK(isfinite(factors[SIDES * i + k]) && factors[SIDES * i + k] >= 0);
                sum += factors[SIDES * i + k];
            }
            CHECK(fabs(sum - 1) < 1e-9); /* double sums of 768 shares */
        }
    }
    const int32_t outside[] = {SIDES};
    CHECK(pl_form_factors_monte_carlo(scene, patches, outside, 1, 16, 1, factors) == PL_ERR_ARGUMENT);
    CHECK(pl_form_factors_monte_carlo(scene, patches, sides, 1, 0, 1, factors) == PL_ERR_ARGUMENT);
    CHECK(pl_form_factors_hemicube(scene, patches, sides, 1, 3, 1, 1, factors) == PL_ERR_ARGUMENT);
    CHECK(pl_form_factors_hemicube(scene, patches, sides, 1, 4, 0, 1, factors) == PL_ERR_ARGUMENT);
    pl_patches_destroy(patches);
}

/* A patch without area sends rays nowhere sensible, but never a number that is none. */
static void form_factors_of_a_triangle_without_area_are_finite(const pl_embree *embree) {
    const double vertices[] = {0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1};
    const int32_t triangles[] = {0, 1, 2, 3, 4, 5}, one_each[] = {0, 1, 2};
    const int32_t sides[] = {0, 1, 2, 3};
    const uint8_t apexes[] = {0, 0};
    pl_scene *scene = NULL;
    pl_patches *patches = NULL;
    double factors[16];
    CHECK(pl_scene_create(embree, vertices, 6, triangles, 2, NULL, &scene) == PL_OK);
    const pl_patch_layout layout = {apexes, one_each, one_each, one_each, 2, 2, 2, NULL, NULL, 0};
    CHECK(pl_patches_create(&layout, &patches) == PL_OK);
    CHECK(pl_form_factors_monte_carlo(scene, patches, sides, 4, 64, 1, factors) == PL_OK);
    for (int k = 0; k < 16; ++k)
        CHECK(isfinite(factors[k]));
    pl_patches_destroy(patches);
    pl_scene_destroy(scene);
}

int main(void) {
    pl_embree *embree = open_embree();
    pl_scene *scene = NULL;
    indices_out_of_range_are_refused(embree);
    a_tree_that_was_not_built_is_no_scene(embree);
    a_scene_of_nothing_has_no_hits(embree);
    CHECK(pl_scene_create(embree, tetrahedron, 4, faces, 4, NULL, &scene) == PL_OK);
    directions_need_not_be_unit(scene);
    rows_are_finite_and_closed(scene);
    pl_scene_destroy(scene);
    form_factors_of_a_triangle_without_area_are_finite(embree);
    degenerate_triangles_are_never_hit(embree);
    pl_embree_close(embree);
    return 0;
}
