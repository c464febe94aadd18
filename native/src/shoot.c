/*
 * Stochastic Jacobi's step: local lines that carry flux (Bekaert 1999, ch. 6).
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "clear.h"
#include "patches.h"

#include <string.h>

enum { MOST_LANDINGS = 256 }; /* of a ray, on surfaces whose other side is open */

/* Sums of integers do not depend on the order, so any number of threads gives the same bytes. */
static void add_flux(uint64_t *io_rgb, const uint64_t *rgb) {
    for (int k = 0; k < 3; ++k)
        if (rgb[k])
            __atomic_fetch_add(io_rgb + k, rgb[k], __ATOMIC_RELAXED);
}

/* The index of the side that owns ray `ray`: of the last whose first ray is not after it. */
static size_t owner_of_ray(const uint64_t *first_rays, size_t side_count, uint64_t ray) {
    size_t low = 0, high = side_count;
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        if (first_rays[middle] <= ray)
            low = middle;
        else
            high = middle;
    }
    return low;
}

void pl_shoot(const pl_scene *scene, const pl_patches *patches, const int32_t *sides, size_t side_count,
              const uint64_t *first_rays, const uint32_t *first_samples, const uint64_t *ray_flux, uint64_t first,
              uint64_t count, uint32_t seed, uint64_t *io_received, uint64_t *io_escaped) {
    if (!count)
        return;
    size_t i = owner_of_ray(first_rays, side_count, first), side = (size_t)sides[i];

    for (uint64_t ray = first; ray < first + count; ++ray) {
        if (ray >= first_rays[i + 1]) {
            i = owner_of_ray(first_rays, side_count, ray);
            side = (size_t)sides[i];
        }
        const uint32_t side_seed = hash_pair(seed, (uint32_t)side);
        const uint32_t k = first_samples[i] + (uint32_t)(ray - first_rays[i]);
        const pl_side_point from = side_point(scene, patches, side, sobol(k, 0, side_seed), sobol(k, 1, side_seed));
        const vec3 direction =
            cosine_direction(sobol(k, 2, side_seed), sobol(k, 3, side_seed), from.u, from.v, from.normal);

        float through[3] = {1, 1, 1}, near = 0;
        for (int landings = 0; landings < MOST_LANDINGS && near < INFINITY; ++landings) {
            const pl_hit hit = next_landing(scene, from.origin, direction, &near, through);
            uint64_t flux[3];
            for (size_t c = 0; c < 3; ++c)
                flux[c] = through[c] == 1 ? ray_flux[3 * i + c] : (uint64_t)((double)ray_flux[3 * i + c] * through[c]);
            add_flux(hit.triangle < 0 ? io_escaped : io_received + 3 * hit_side(patches, &hit), flux);
        }
    }
}
