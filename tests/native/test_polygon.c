/* Polygons about the horizon. SPDX-License-Identifier: GPL-3.0-or-later */
#include "check.h"
#include "polygon.h"

static const dvec3 up = {0, 0, 1};

static void a_flat_square_leaves_no_more_than_five_corners(void) {
    dvec3 clipped[MAX_CLIPPED];
    const dvec3 above[4] = {{-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}};
    const dvec3 corner_below[4] = {{0, -1, 1}, {1, 0, 3}, {0, 1, 1}, {-1, 0, -1}};
    const dvec3 below[4] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}};
    CHECK(clip_to_horizon(above, 4, up, clipped) == 4);
    CHECK(clip_to_horizon(corner_below, 4, up, clipped) == 5);
    CHECK(clip_to_horizon(below, 4, up, clipped) == 0);
}

/* Every pattern of signs that rounding can give a square that lies in the horizon: the sanitizer sees what overflows.
 */
static void a_square_in_the_horizon_has_room_however_it_was_rounded(void) {
    for (unsigned int signs = 0; signs < 16; ++signs) {
        const double one_ulp = 1e-7;
        dvec3 square[4] = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, clipped[MAX_CLIPPED];
        vec3 corners[4];
        for (int k = 0; k < 4; ++k) {
            square[k].z = signs >> k & 1 ? -one_ulp : one_ulp;
            corners[k] = (vec3){(float)square[k].x + 2, (float)square[k].y, (float)square[k].z};
        }
        const int left = clip_to_horizon(square, 4, up, clipped);
        CHECK(left <= MAX_CLIPPED);
        for (int k = 0; k < left; ++k)
            CHECK(clipped[k].z >= 0);
        /* seen edge on from beside it, it gives nothing */
        const double seen = point_to_polygon((vec3){0, 0, 0}, (vec3){0, 0, 1}, corners, 4);
        CHECK(seen >= 0 && seen < 1e-6);
    }
}

int main(void) {
    a_flat_square_leaves_no_more_than_five_corners();
    a_square_in_the_horizon_has_room_however_it_was_rounded();
    return 0;
}
