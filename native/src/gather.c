/*
 * Final gather: the irradiance at a receiver is the mean radiosity that cosine rays see.
 *
 * Where a patch is too coarse for that (hit from nearby, or lit in part), the ray looks closer: it samples the
 * lights at the point it hits, or goes on from there. So light does not leak along patches that lie half under
 * something, and contact stays dark, at any patch size.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "direct.h"
#include "patches.h"

#include <stdlib.h>

enum { MOST_STEPS = 64 }; /* of a ray caught between surfaces that touch; then a mean has to do */

typedef struct gather_job {
    const pl_scene *scene;
    const pl_patches *patches;
    const pl_solution *solution;
    const pl_lights *lights;
    pl_light_balls balls;
    float *importances; /* room for one number a light */
    uint64_t rays;
} gather_job;

/* Numbers that hang on the ray's number and how often it has been asked; no sequence is shared. */
typedef struct ray_random {
    uint32_t seed, drawn;
} ray_random;

static float draw(ray_random *random) { return unit_float(hash_pair(random->seed, ++random->drawn)); }

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

static void add(float *io_sum, const float *rgb, const float *weight) {
    for (int k = 0; k < 3; ++k)
        io_sum[k] += rgb[k] * weight[k];
}

/* The point a ray hit, moved off the side that it sees. */
static vec3 hit_point(const pl_scene *scene, const pl_hit *hit, vec3 normal) {
    return point_off_triangle(scene, hit->triangle, scene_point(scene, hit->triangle, hit->u, hit->v), normal);
}

static vec3 hit_normal(const pl_scene *scene, const pl_hit *hit, size_t side) {
    return vec3_scale(scene_normal(scene, hit->triangle), side & 1 ? -1.0f : 1.0f);
}

/* Direct light that a side reflects at the point hit: its mean, or sampled anew where it is mixed. */
static void reflect_direct(gather_job *job, const pl_hit *hit, size_t side, ray_random *random, const float *weight,
                           float *io_sum) {
    const pl_solution *solution = job->solution;
    if (solution->kinds[side] != PL_SIDE_MIXED) {
        add(io_sum, solution->direct + 3 * side, weight);
        return;
    }
    const vec3 normal = hit_normal(job->scene, hit, side);
    const float numbers[3] = {draw(random), draw(random), draw(random)};
    float rgb[3];
    job->rays += direct_at_point(job->scene, job->lights, &job->balls, job->importances,
                                 hit_point(job->scene, hit, normal), normal, numbers, rgb);
    for (int k = 0; k < 3; ++k)
        io_sum[k] += rgb[k] * weight[k] * solution->reflectance[3 * (side / 2) + (size_t)k];
}

/* Add what one ray sees to the sum. */
static void gather_ray(gather_job *job, const pl_receiver_frame *frame, vec3 direction, ray_random random,
                       float *io_sum) {
    const pl_solution *solution = job->solution;
    float weight[3] = {1, 1, 1};
    vec3 origin = frame->origin;

    for (int step = 0; step < MOST_STEPS; ++step) {
        const pl_hit hit = closest_hit(job->scene, origin, direction, 0);
        ++job->rays;
        if (job->scene->clear.bvh)
            transmit(job->scene, origin, direction, hit.distance, weight);
        if (hit.triangle < 0) {
            add(io_sum, solution->sky, weight);
            return;
        }
        const size_t side = step == 0 && frame->is_smooth ? smooth_side(job->patches, frame, direction, &hit)
                                                          : hit_side(job->patches, &hit);
        if (step == 0 && solution->kinds[side] == PL_SIDE_LIGHT)
            return;
        const bool is_far = hit.distance >= solution->reaches[side] || step == MOST_STEPS - 1;
        if (is_far && solution->kinds[side] != PL_SIDE_MIXED) {
            add(io_sum, solution->radiosity + 3 * side, weight);
            return;
        }
        reflect_direct(job, &hit, side, &random, weight, io_sum);
        if (is_far) {
            for (size_t k = 3 * side; k < 3 * side + 3; ++k)
                io_sum[k - 3 * side] += weight[k - 3 * side] * (solution->radiosity[k] - solution->direct[k]);
            return;
        }

        /* too near to take the patch's mean: go on as the light would */
        vec3 u, v;
        const vec3 normal = hit_normal(job->scene, &hit, side);
        vec3_basis(normal, &u, &v);
        origin = hit_point(job->scene, &hit, normal);
        const float x = draw(&random), y = draw(&random);
        direction = cosine_direction(x, y, u, v, normal);
        for (int k = 0; k < 3; ++k)
            weight[k] *= solution->reflectance[3 * (side / 2) + (size_t)k];
        /* Russian roulette: what carries little ends early, and what is left stands for it */
        const float survival = fminf(1, fmaxf(weight[0], fmaxf(weight[1], weight[2])));
        if (draw(&random) >= survival)
            return;
        for (int k = 0; k < 3; ++k)
            weight[k] /= survival;
    }
}

pl_status pl_gather(const pl_scene *scene, const pl_patches *patches, const pl_solution *solution,
                    const pl_lights *lights, const pl_receivers *receivers, const uint32_t *selected, size_t count,
                    pl_gather_rays rays, float *io_sums, uint64_t *out_rays) {
    for (size_t i = 0; i < count; ++i)
        if (!receiver_is_valid(scene, receivers, selected[i]))
            return PL_ERR_ARGUMENT;
    if (!lights_are_valid(lights) || !pl_patches_fit(patches, scene))
        return PL_ERR_ARGUMENT;
    gather_job job = {.scene = scene, .patches = patches, .solution = solution, .lights = lights};
    job.importances = malloc(sizeof(float) * (lights->count + 1));
    if (!job.importances || !light_balls_create(lights, &job.balls)) {
        free(job.importances);
        return PL_ERR_MEMORY;
    }
    for (size_t i = 0; i < count; ++i) {
        const pl_receiver_frame frame = receiver_frame(scene, receivers, selected[i]);
        vec3 u, v;
        vec3_basis(frame.shading, &u, &v);
        for (uint32_t replicate = 0; replicate < rays.replicates; ++replicate) {
            const uint32_t seed = hash_pair(hash_pair(rays.seed, replicate), selected[i]);
            float *sum = io_sums + 3 * ((size_t)selected[i] * rays.replicates + replicate);
            for (uint32_t k = rays.first; k < rays.first + rays.count; ++k) {
                const vec3 direction = cosine_direction(sobol(k, 0, seed), sobol(k, 1, seed), u, v, frame.shading);
                gather_ray(&job, &frame, direction, (ray_random){hash_pair(seed, k), 0}, sum);
            }
        }
    }
    *out_rays = job.rays;
    light_balls_destroy(&job.balls);
    free(job.importances);
    return PL_OK;
}
