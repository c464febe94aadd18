/*
 * Final gather: the irradiance at a receiver is the mean radiosity that cosine rays see.
 *
 * Where a patch is too coarse for that (hit from nearby, or lit in part), the ray looks closer: it samples the
 * lights at the point it hits, or goes on from there. So light does not leak along patches that lie half under
 * something, and contact stays dark, at any patch size.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "clear.h"
#include "direct.h"
#include "guide.h"
#include "patches.h"
#include "sky.h"

#include <stdlib.h>
#include <string.h>

enum { MOST_STEPS = 64 }; /* of a ray caught between surfaces that touch; then a mean has to do */

typedef struct gather_job {
    const pl_scene *scene;
    const pl_patches *patches;
    const pl_solution *solution;
    const pl_texel_light *texels;
    const pl_lights *lights;
    pl_light_balls balls;
    float *importances; /* room for one number a light */
    bool has_bright_sides;
    uint64_t rays;
} gather_job;

/* Numbers that hang on the ray's number and how often it has been asked; no sequence is shared. */
typedef struct ray_random {
    uint32_t seed, drawn;
} ray_random;

static float draw(ray_random *random) { return unit_float(hash_pair(random->seed, ++random->drawn)); }

/*
 * Whether a ray sees the back of what it hits. A smooth receiver's ray may start below the plane of its own triangle,
 * or pass below a neighbour's: there the smooth surface that the triangles stand for has nothing, and the light lost
 * to the inside would darken every smooth object. Its front is what is seen.
 */
static bool sees_back(const pl_receiver_frame *frame, vec3 direction, const pl_hit *hit) {
    const bool starts_below = frame->is_smooth && vec3_dot(frame->geometric, direction) <= 0;
    return starts_below && hit->is_back != frame->side ? !hit->is_back : hit->is_back;
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

/* The lights' own light that a side reflects at the point hit, sampled there. */
static void sample_direct(gather_job *job, const pl_hit *hit, size_t side, ray_random *random, const float *weight,
                          float *io_sum) {
    const vec3 normal = hit_normal(job->scene, hit, side);
    float rgb[3];
    job->rays +=
        direct_at_point(job->scene, job->lights, &job->balls, job->importances, hit_point(job->scene, hit, normal),
                        normal, hash_pair(random->seed, ++random->drawn), rgb);
    for (int k = 0; k < 3; ++k)
        io_sum[k] += rgb[k] * weight[k] * job->solution->reflectance[3 * side + (size_t)k];
}

/* Of three floats in one number. */
static float unpacked(uint64_t light, int channel) {
    union {
        uint32_t bits;
        float number;
    } made = {(uint32_t)(light >> (21 * channel) & 0x1fffff) << 10};
    return made.number;
}

/* The radiosity of the texel that a ray hits, and whether it lies on both sides of something; false where there is
 * none. */
static bool texel_hit(const pl_texel_light *texels, const pl_hit *hit, float out_rgb[3], bool *out_is_split) {
    const float *uv = texels->uvs + 6 * (size_t)hit->triangle;
    const float u = uv[0] + hit->u * (uv[2] - uv[0]) + hit->v * (uv[4] - uv[0]);
    const float v = uv[1] + hit->u * (uv[3] - uv[1]) + hit->v * (uv[5] - uv[1]);
    if (!(u >= 0 && v >= 0 && u < (float)texels->width && v < (float)texels->height))
        return false;
    const uint64_t light = texels->light[(size_t)v * (size_t)texels->width + (size_t)u];
    for (int k = 0; k < 3; ++k)
        out_rgb[k] = unpacked(light, k);
    *out_is_split = light >> 63;
    return light != UINT64_MAX;
}

/* Add what one ray sees to the sum. */
static void gather_ray(gather_job *job, const pl_receiver_frame *frame, vec3 direction, ray_random random,
                       float *io_sum) {
    const pl_solution *solution = job->solution;
    float weight[3] = {1, 1, 1};
    vec3 origin = ray_origin(frame, direction);
    bool skips_lights = true; /* what was sampled as a light must not be seen once more */

    for (int step = 0; step < MOST_STEPS; ++step) {
        const pl_hit hit = first_stop(job->scene, origin, direction, weight);
        ++job->rays;
        if (hit.triangle < 0) {
            add(io_sum, sky_seen(solution->sky, solution->sky_side, direction), weight);
            return;
        }
        const bool is_back = step == 0 ? sees_back(frame, direction, &hit) : hit.is_back;
        const bool is_last = step == MOST_STEPS - 1;
        bool is_split = false;
        float texel[3];
        const bool has_texel = job->texels && !is_back && texel_hit(job->texels, &hit, texel, &is_split);
        const bool takes_texel = has_texel && ((hit.distance >= job->texels->reach && !is_split) || is_last);
        /* most rays end here, before the patches are touched: what they cost is cache misses */
        if (takes_texel && !(skips_lights && job->has_bright_sides)) {
            add(io_sum, texel, weight);
            return;
        }
        const size_t side = 2 * (size_t)patch_at(job->patches, hit.triangle, hit.u, hit.v) + is_back;
        if (skips_lights && solution->kinds[side] == PL_SIDE_LIGHT)
            return;
        /* patches let a little light through walls that part them: backs, which no texel has, are not to pass it on */
        const bool goes_on = step == 0 && is_back && job->texels && solution->reaches[side] >= 0;
        const bool is_mixed = solution->kinds[side] == PL_SIDE_MIXED;
        /* a mean has what bright sides give: where these are lights, what is mixed cannot be put together of both */
        const bool is_far =
            !has_texel && !goes_on && !(is_mixed && job->has_bright_sides) && hit.distance >= solution->reaches[side];
        if (has_texel ? takes_texel : is_last || (is_far && !is_mixed)) {
            add(io_sum, has_texel ? texel : solution->radiosity + 3 * side, weight);
            return;
        }
        skips_lights = is_mixed || ((has_texel || goes_on) && job->lights->count < PL_MANY_LIGHTS);
        if (skips_lights)
            sample_direct(job, &hit, side, &random, weight, io_sum);
        else
            add(io_sum, solution->direct + 3 * side, weight);
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
            weight[k] *= solution->reflectance[3 * side + (size_t)k];
        /* Russian roulette: what carries little ends early, and what is left stands for it */
        const float survival = lesser(greater(weight[0], greater(weight[1], weight[2])), 1);
        if (draw(&random) >= survival)
            return;
        for (int k = 0; k < 3; ++k)
            weight[k] /= survival;
    }
}

static pl_status begin(gather_job *job, const pl_gather_scene *in, const pl_receivers *receivers,
                       const uint32_t *selected, size_t count) {
    for (size_t i = 0; i < count; ++i)
        if (!receiver_is_valid(in->scene, receivers, selected[i]))
            return PL_ERR_ARGUMENT;
    if (in->texels && in->texels->triangle_count != in->scene->triangle_count)
        return PL_ERR_ARGUMENT;
    if (!lights_are_valid(in->lights) || !pl_patches_fit(in->patches, in->scene) || in->solution->sky_side < 1)
        return PL_ERR_ARGUMENT;
    *job = (gather_job){.scene = in->scene,
                        .patches = in->patches,
                        .solution = in->solution,
                        .texels = in->texels,
                        .lights = in->lights};
    job->has_bright_sides = memchr(in->solution->kinds, PL_SIDE_LIGHT, 2 * pl_patches_count(in->patches)) != NULL;
    job->importances = malloc(sizeof(float) * (in->lights->count + 1));
    if (!job->importances || !light_balls_create(in->lights, &job->balls)) {
        free(job->importances);
        return PL_ERR_MEMORY;
    }
    return PL_OK;
}

static void end(gather_job *job) {
    light_balls_destroy(&job->balls);
    free(job->importances);
}

static bool guides_fit(const pl_guides *guides, const uint32_t *selected, size_t count) {
    for (size_t i = 0; i < count; ++i)
        if (guides->groups[selected[i]] >= 0 && (size_t)guides->groups[selected[i]] >= guides->group_count)
            return false;
    return true;
}

pl_status pl_gather(const pl_gather_scene *in, const pl_receivers *receivers, const pl_guides *guides,
                    const uint32_t *selected, size_t count, pl_gather_rays rays, float *io_light, float *io_luminances,
                    uint64_t *out_rays) {
    gather_job job;
    const pl_status status = begin(&job, in, receivers, selected, count);
    if (status != PL_OK)
        return status;
    if (!guides_fit(guides, selected, count)) {
        end(&job);
        return PL_ERR_ARGUMENT;
    }
    for (size_t i = 0; i < count; ++i) {
        const pl_receiver_frame frame = receiver_frame(in->scene, receivers, selected[i]);
        const guide by = guide_of(guides, selected[i]);
        vec3 u, v;
        vec3_basis(frame.shading, &u, &v);
        for (uint32_t replicate = 0; replicate < rays.replicates; ++replicate) {
            const uint32_t seed = hash_pair(hash_pair(rays.seed, replicate), hash_pair(rays.first, rays.count));
            float *replicate_sum = io_luminances + (size_t)selected[i] * rays.replicates + replicate;
            for (uint32_t j = 0; j < rays.count; ++j) {
                const uint32_t k = selected[i] * rays.count + j;
                float x = sobol(k, 0, seed), y = sobol(k, 1, seed), seen[3] = {0, 0, 0};
                const float share = guide_warp(&by, &x, &y), weight[3] = {share, share, share};
                gather_ray(&job, &frame, cosine_direction(x, y, u, v, frame.shading),
                           (ray_random){hash_pair(seed, k), 0}, seen);
                add(io_light + 3 * (size_t)selected[i], seen, weight);
                *replicate_sum += share * luminance(seen);
            }
        }
    }
    *out_rays = job.rays;
    end(&job);
    return PL_OK;
}

/* What one receiver's rays see, squared, added to the cells that they leave through. */
static void learn(gather_job *job, const pl_receivers *receivers, uint32_t receiver, uint32_t rays, uint32_t seed,
                  float *io_moments, uint32_t *io_counts) {
    const pl_receiver_frame frame = receiver_frame(job->scene, receivers, receiver);
    const uint32_t own_seed = hash_pair(seed, receiver);
    vec3 u, v;
    vec3_basis(frame.shading, &u, &v);
    for (uint32_t k = 0; k < rays; ++k) {
        const float x = sobol(k, 0, own_seed), y = sobol(k, 1, own_seed);
        float seen[3] = {0, 0, 0};
        gather_ray(job, &frame, cosine_direction(x, y, u, v, frame.shading), (ray_random){hash_pair(own_seed, k), 0},
                   seen);
        const float light = luminance(seen);
        io_moments[guide_cell(x, y)] += light * light;
        ++io_counts[guide_cell(x, y)];
    }
}

pl_status pl_learn_guides(const pl_gather_scene *in, const pl_receivers *receivers, const uint32_t *members,
                          const uint32_t *first_members, size_t first, size_t count, uint32_t rays, uint32_t seed,
                          float *out_moments, uint64_t *out_rays) {
    gather_job job;
    const uint32_t begin_member = first_members[first], end_member = first_members[first + count];
    const pl_status status = begin(&job, in, receivers, members + begin_member, end_member - begin_member);
    if (status != PL_OK)
        return status;
    for (size_t group = first; group < first + count; ++group) {
        float *moments = out_moments + PL_GUIDE_CELLS * group;
        uint32_t counts[PL_GUIDE_CELLS] = {0};
        for (int cell = 0; cell < PL_GUIDE_CELLS; ++cell)
            moments[cell] = 0;
        for (uint32_t m = first_members[group]; m < first_members[group + 1]; ++m)
            learn(&job, receivers, members[m], rays, seed, moments, counts);
        for (int cell = 0; cell < PL_GUIDE_CELLS; ++cell)
            moments[cell] /= (float)(counts[cell] ? counts[cell] : 1);
    }
    *out_rays = job.rays;
    end(&job);
    return PL_OK;
}
