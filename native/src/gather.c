/*
 * Final gather: the irradiance at a receiver is the mean radiosity that cosine rays see.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "patches.h"
#include "receivers.h"

/*
 * The side that a ray of a smooth receiver takes its light from. Such a ray may start below the plane of its
 * own triangle, or pass below a neighbour's: there the smooth surface that the triangles stand for has
 * nothing, and the light lost to the inside would darken every smooth object. Its front is what is seen.
 */
static size_t smooth_side(const pl_patches *patches, const pl_receiver_frame *frame, vec3 direction,
                          const pl_hit *hit) {
    const size_t side = hit_side(patches, hit);
    const bool starts_below = vec3_dot(frame->geometric, direction) <= 0;
    return starts_below && hit->is_back != frame->side ? side ^ 1u : side;
}

/* Add what one ray sees to the sum. */
static void gather_ray(const pl_scene *scene, const pl_patches *patches, const float *radiosity,
                       const float *sky_radiosity, const pl_receiver_frame *frame, vec3 direction,
                       float *io_sum) {
    const pl_hit hit = closest_hit(scene, frame->origin, direction, 0);
    const float *seen = sky_radiosity;
    if (hit.triangle >= 0) {
        const size_t side = frame->is_smooth ? smooth_side(patches, frame, direction, &hit)
                                             : hit_side(patches, &hit);
        seen = radiosity + 3 * side;
    }
    float through[3] = {1, 1, 1};
    if (scene->clear.bvh)
        transmit(scene, frame->origin, direction, hit.distance, through);
    for (int k = 0; k < 3; ++k)
        io_sum[k] += seen[k] * through[k];
}

void pl_gather(const pl_scene *scene, const pl_patches *patches, const float *radiosity,
               const float sky_radiosity[3], const pl_receivers *receivers, const uint32_t *selected,
               size_t count, pl_gather_rays rays, float *io_sums) {
    for (size_t i = 0; i < count; ++i) {
        const pl_receiver_frame frame = receiver_frame(scene, receivers, selected[i]);
        vec3 u, v;
        vec3_basis(frame.shading, &u, &v);
        for (uint32_t replicate = 0; replicate < rays.replicates; ++replicate) {
            const uint32_t seed = hash_pair(hash_pair(rays.seed, replicate), selected[i]);
            float *sum = io_sums + 3 * ((size_t)selected[i] * rays.replicates + replicate);
            for (uint32_t k = rays.first; k < rays.first + rays.count; ++k) {
                const vec3 direction = cosine_direction(sobol(k, 0, seed), sobol(k, 1, seed), u, v,
                                                        frame.shading);
                gather_ray(scene, patches, radiosity, sky_radiosity, &frame, direction, sum);
            }
        }
    }
}
