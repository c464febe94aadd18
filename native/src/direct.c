/*
 * Direct light: lights chosen by what they would give unoccluded, then shadow rays.
 *
 * A light that gives a good share of a receiver's light gets rays of its own; the many weak ones share a few
 * rays by systematic sampling (Shirley, Wang & Zimmerman 1996 sample direct light so). Where the unoccluded
 * light has a closed form, rays decide only the visible share of it, so that an open sky of lamps has no noise.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "direct.h"

#include "aimed_light.h"
#include "clear.h"
#include "sampling.h"

#include <stdlib.h>

enum { REPLICATES = 2 };
static const float surely_weak = 8; /* times less than a strong light, a guess need not be mended */
enum { FEW = 8 };                   /* samples of a replicate: as many tell whether a lamp is all seen or all hidden */

/* Lights that share rays, and the running sums of their importances. */
typedef struct weak_lights {
    size_t *lights, count;
    float *sums, total;
} weak_lights;

static void add_weak_light(weak_lights *io_weak, size_t light, float importance) {
    io_weak->total += importance;
    io_weak->sums[io_weak->count] = io_weak->total;
    io_weak->lights[io_weak->count++] = light;
}

/* The light at which the running sum passes `choice`; the last one where rounding has it that none does. */
static size_t weak_light_at(const weak_lights *weak, float choice) {
    size_t low = 0;
    for (size_t left = weak->count, half; left > 1; left -= half) {
        half = left / 2;
        low += half * (size_t)(weak->sums[low + half - 1] <= choice);
    }
    return weak->lights[low];
}

typedef struct direct_job {
    const pl_scene *scene;
    const pl_lights *lights;
    uint32_t samples, seed;
    bool is_first;
    pl_light_balls balls;
    float *importances; /* one per light, of the receiver at hand */
    weak_lights weak;   /* of it, too */
    uint64_t rays;
} direct_job;

/* The light at which the running sum of importances passes `choice` of the total. */
static size_t choose_light(const float *importances, size_t count, float total, float choice) {
    float passed = 0;
    size_t chosen = 0;
    for (size_t light = 0; light < count; ++light) {
        if (importances[light] <= 0)
            continue;
        chosen = light;
        passed += importances[light];
        if (passed > choice * total)
            break;
    }
    return chosen;
}

bool direct_at_point(const pl_scene *scene, const pl_lights *lights, const pl_light_balls *balls, float *importances,
                     vec3 origin, vec3 normal, uint32_t seed, float out_rgb[3]) {
    pl_light_sample sample;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 0;
    const float total = light_importances(lights, balls, origin, normal, INFINITY, importances);
    if (total <= 0)
        return false;
    const size_t chosen = choose_light(importances, lights->count, total, sobol(0, 2, seed));
    aimed_light aimed;
    if (!aim(lights, chosen, origin, normal, true, &aimed) ||
        !sample_aimed(&aimed, sobol(0, 0, seed), sobol(0, 1, seed), &sample))
        return false;
    if (!is_occluded(scene, origin, sample.direction, sample.far) &&
        transmit(scene, origin, sample.direction, sample.far, sample.irradiance))
        for (int c = 0; c < 3; ++c)
            out_rgb[c] = bounded(sample.irradiance[c] * (total / importances[chosen]));
    return true;
}

/* A ray of a smooth receiver may have to leave through its own triangle, which the smooth surface is not. */
static bool is_hidden_from_smooth(const pl_scene *scene, const pl_receiver_frame *frame, vec3 origin, vec3 direction,
                                  float far) {
    const pl_hit hit = closest_hit(scene, origin, direction, 0);
    if (hit.triangle < 0 || hit.distance >= far)
        return false;
    if (hit.triangle != frame->triangle)
        return true;
    const vec3 through = vec3_mul_add(direction, hit.distance, origin);
    return is_occluded(scene, point_off_triangle(scene, frame->triangle, through, vec3_scale(frame->geometric, -1)),
                       direction, far - hit.distance);
}

/* Multiply a sample by what reaches the receiver; returns whether anything does. */
static bool shine(direct_job *job, const pl_receiver_frame *frame, pl_light_sample *io_sample) {
    const bool below = vec3_dot(frame->geometric, io_sample->direction) <= 0;
    const vec3 origin = ray_origin(frame, io_sample->direction);
    ++job->rays;
    if (below && frame->is_smooth && io_sample->far > 0 && io_sample->far < INFINITY) {
        /* to the same point of the light */
        io_sample->direction = vec3_mul_add(io_sample->direction, io_sample->far, vec3_scale(frame->lift, -1));
        io_sample->far = 1;
    }
    if (below ? !frame->is_smooth ||
                    is_hidden_from_smooth(job->scene, frame, origin, io_sample->direction, io_sample->far)
              : is_occluded(job->scene, origin, io_sample->direction, io_sample->far))
        return false;
    return transmit(job->scene, origin, io_sample->direction, io_sample->far, io_sample->irradiance);
}

typedef struct light_sums {
    float all[3], seen[3];   /* unoccluded, and what arrives */
    uint32_t taken, visible; /* samples: all, those not hidden */
} light_sums;

static void sample_range(direct_job *job, const pl_receiver_frame *frame, const aimed_light *aimed, uint32_t seed,
                         uint32_t first, uint32_t end, light_sums *io_sums) {
    for (uint32_t k = first; k < end; ++k) {
        pl_light_sample sample;
        ++io_sums->taken;
        if (!sample_aimed(aimed, sobol(k, 0, seed), sobol(k, 1, seed), &sample))
            continue;
        for (int c = 0; c < 3; ++c)
            io_sums->all[c] += sample.irradiance[c];
        if (!shine(job, frame, &sample))
            continue;
        ++io_sums->visible;
        for (int c = 0; c < 3; ++c)
            io_sums->seen[c] += sample.irradiance[c];
    }
}

/* The light that arrives, from one replicate's sums; `exact` is what would arrive if all of the light were seen, or
 * NULL where that is not known. */
static void estimate(const light_sums *sums, const float *exact, float out_rgb[3]) {
    for (int c = 0; c < 3; ++c) {
        out_rgb[c] = 0;
        if (exact && sums->all[c] > 0)
            out_rgb[c] = exact[c] * (sums->seen[c] / sums->all[c]);
        else if (!exact && sums->taken)
            out_rgb[c] = sums->seen[c] / (float)sums->taken;
    }
}

/*
 * The same from few samples, which say too little of the share that is seen. What is hidden is taken off the closed
 * form, or what is seen is all there is: whichever the other replicate's samples find more likely, as a choice by its
 * own would favour what it happens to see.
 */
static void estimate_from_few(const light_sums *sums, const light_sums *other, const float *exact, float out_rgb[3]) {
    const bool most_seen = exact && 2 * other->visible > other->taken;
    for (int c = 0; c < 3; ++c) {
        const float hidden = sums->all[c] - sums->seen[c];
        out_rgb[c] = most_seen ? exact[c] - hidden / (float)sums->taken : sums->seen[c] / (float)sums->taken;
    }
}

/* A light of its own rays: at first few where it is all seen or all hidden, the full number in its penumbra. */
static void add_strong_light(direct_job *job, const pl_receiver_frame *frame, size_t light, uint32_t samples,
                             uint32_t seed, float io_totals[REPLICATES][3]) {
    if (light_is_sharp(job->lights, light)) {
        pl_light_sample sample;
        if (light_sample(job->lights, light, frame->origin, frame->shading, 0, 0, &sample) &&
            shine(job, frame, &sample))
            for (int r = 0; r < REPLICATES; ++r)
                for (int c = 0; c < 3; ++c)
                    io_totals[r][c] += sample.irradiance[c];
        return;
    }
    aimed_light aimed;
    const uint32_t most = samples / REPLICATES < 1 ? 1 : samples / REPLICATES;
    if (!aim(job->lights, light, frame->origin, frame->shading, most < FEW, &aimed))
        return;
    float exact[3];
    aimed_exact(&aimed, exact);
    const uint32_t few = most < FEW || !job->is_first ? most : most * 3 / 8 < FEW ? FEW : most * 3 / 8;
    light_sums sums[REPLICATES] = {{{0}, {0}, 0, 0}};
    uint32_t visible = 0;
    for (uint32_t r = 0; r < REPLICATES; ++r) {
        sample_range(job, frame, &aimed, hash_pair(seed, r), 0, few, &sums[r]);
        visible += sums[r].visible;
    }
    for (uint32_t r = 0; r < REPLICATES; ++r) {
        float rgb[3];
        if (visible > 0 && visible < REPLICATES * few)
            sample_range(job, frame, &aimed, hash_pair(seed, r), few, most, &sums[r]);
        if (most < FEW)
            estimate_from_few(&sums[r], &sums[1 - r], aimed.face_count ? exact : NULL, rgb);
        else
            estimate(&sums[r], aimed.face_count ? exact : NULL, rgb);
        for (int c = 0; c < 3; ++c)
            io_totals[r][c] += rgb[c];
    }
}

/* All lights too weak for rays of their own: `samples` of them, in proportion to what they would give. */
static void add_weak_lights(direct_job *job, const pl_receiver_frame *frame, const weak_lights *weak, uint32_t samples,
                            uint32_t seed, float out_rgb[3]) {
    const float step = weak->total / (float)samples, start = sobol(0, 0, seed);
    for (uint32_t k = 0; k < samples; ++k) {
        const size_t light = weak_light_at(weak, step * ((float)k + start));
        pl_light_sample sample;
        if (!light_sample(job->lights, light, frame->origin, frame->shading, sobol(k, 1, seed), sobol(k, 2, seed),
                          &sample) ||
            !shine(job, frame, &sample))
            continue;
        for (int c = 0; c < 3; ++c)
            out_rgb[c] += bounded(sample.irradiance[c] * (step / job->importances[light]));
    }
}

static uint32_t share_of(uint32_t samples, float part, float total) {
    const float share = ceilf((float)samples * part / total);
    return share<1 ? 1 : share>(float) samples ? samples : (uint32_t)share;
}

static void light_receiver(direct_job *job, const pl_receiver_frame *frame, uint32_t seed, float out_rgb[3],
                           float *out_variance) {
    float totals[REPLICATES][3] = {{0}};
    const float strong = 1 / (2 * (float)job->samples); /* of all that there may be: a light with rays of its own */
    const float total = light_importances(job->lights, &job->balls, frame->origin, frame->shading, strong / surely_weak,
                                          job->importances);
    job->weak.count = 0;
    job->weak.total = 0;
    for (size_t light = 0; light < job->lights->count; ++light) {
        const float importance = job->importances[light];
        if (importance > 0 && importance >= strong * total)
            add_strong_light(job, frame, light, share_of(job->samples, importance, total),
                             hash_pair(seed, (uint32_t)light), totals);
        else if (importance > 0)
            add_weak_light(&job->weak, light, importance);
    }
    if (job->weak.count) {
        const uint32_t each = share_of(job->samples, job->weak.total, total) / REPLICATES + 1;
        for (uint32_t r = 0; r < REPLICATES; ++r)
            add_weak_lights(job, frame, &job->weak, each, hash_pair(seed, 0x80000000u + r), totals[r]);
    }
    for (int c = 0; c < 3; ++c)
        out_rgb[c] = bounded(0.5f * (totals[0][c] + totals[1][c]));
    /* of a mean of two */
    const float difference = luminance(totals[0]) - luminance(totals[1]);
    *out_variance = lesser(0.25f * difference * difference, most_light * most_light);
}

static void end(direct_job *job) {
    light_balls_destroy(&job->balls);
    free(job->importances);
    free(job->weak.lights);
    free(job->weak.sums);
}

/* Room for what is found for a receiver; false where there is no memory. */
static bool begin(direct_job *job) {
    const size_t room = job->lights->count + 1;
    job->importances = malloc(sizeof(float) * room);
    job->weak.lights = malloc(sizeof(size_t) * room);
    job->weak.sums = malloc(sizeof(float) * room);
    if (light_balls_create(job->lights, &job->balls) && job->importances && job->weak.lights && job->weak.sums)
        return true;
    end(job);
    return false;
}

pl_status pl_direct(const pl_scene *scene, const pl_lights *lights, const pl_receivers *receivers, size_t first,
                    size_t count, uint32_t samples, int32_t is_first, uint32_t seed, float *out_irradiance,
                    float *out_variance, uint64_t *out_rays) {
    for (size_t i = first; i < first + count; ++i)
        if (!receiver_is_valid(scene, receivers, i))
            return PL_ERR_ARGUMENT;
    if (!lights_are_valid(lights))
        return PL_ERR_ARGUMENT;
    direct_job job = {
        .scene = scene, .lights = lights, .samples = samples ? samples : 1, .is_first = is_first != 0, .seed = seed};
    if (!begin(&job))
        return PL_ERR_MEMORY;
    for (size_t i = first; i < first + count; ++i) {
        const pl_receiver_frame frame = receiver_frame(scene, receivers, i);
        light_receiver(&job, &frame, hash_pair(seed, (uint32_t)i), out_irradiance + 3 * i, out_variance + i);
    }
    *out_rays = job.rays;
    end(&job);
    return PL_OK;
}
