/* How much room a side has in front of it. SPDX-License-Identifier: GPL-3.0-or-later */
#include "patches.h"

void pl_openness(const pl_scene *scene, const pl_patches *patches, const float *reaches, size_t first, size_t count,
                 uint32_t rays, uint32_t seed, float *out_openness) {
    for (size_t side = first; side < first + count; ++side) {
        const uint32_t side_seed = hash_pair(seed, (uint32_t)side);
        uint32_t open = 0, k = 0;
        for (; k < rays; ++k) {
            if (2 * k >= rays && (open == 0 || open == k))
                break;
            const pl_side_point from = side_point(scene, patches, side, sobol(k, 0, side_seed), sobol(k, 1, side_seed));
            const vec3 direction =
                cosine_direction(sobol(k, 2, side_seed), sobol(k, 3, side_seed), from.u, from.v, from.normal);
            open += !is_occluded(scene, from.origin, direction, reaches[side]);
        }
        out_openness[side] = (float)open / (float)(k ? k : 1);
    }
}
