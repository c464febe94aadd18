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
#include "sampling.h"

#include <stdlib.h>

enum { REPLICATES = 2 };
enum { FEW = 8 }; /* samples of a replicate: as many tell whether a lamp is all seen or all hidden */

typedef struct direct_job {
    const pl_scene *scene;
    const pl_lights *lights;
    uint32_t samples, seed;
    bool is_first;
    pl_light_balls balls;
    float *importances; /* one per light, of the receiver at hand */
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
    const float total = light_importances(lights, balls, origin, normal, false, importances);
    if (total <= 0)
        return false;
    const size_t chosen = choose_light(importances, lights->count, total, sobol(0, 2, seed));
    aimed_light aimed;
    if (!aim(lights, chosen, origin, normal, true, &aimed) ||
        !sample_aimed(&aimed, sobol(0, 0, seed), sobol(0, 1, seed), &sample))
        return false;
    if (!is_occluded(scene, origin, sample.direction, sample.far)) {
        transmit(scene, origin, sample.direction, sample.far, sample.irradiance);
        for (int c = 0; c < 3; ++c)
            out_rgb[c] = bounded(sample.irradiance[c] * (total / importances[chosen]));
    }
    return true;
}

/* A ray of a smooth receiver may have to leave through its own triangle, which the smooth surface is not. */
static bool is_hidden_from_smooth(const pl_scene *scene, const pl_receiver_frame *frame, vec3 direction, float far) {
    const pl_hit hit = closest_hit(scene, frame->origin, direction, 0);
    if (hit.triangle < 0 || hit.distance >= far)
        return false;
    if (hit.triangle != frame->triangle)
        return true;
    const vec3 through = vec3_mul_add(direction, hit.distance, frame->origin);
    return is_occluded(scene, point_off_triangle(scene, frame->triangle, through, vec3_scale(frame->geometric, -1)),
                       direction, far - hit.distance);
}

/* Multiply a sample by what reaches the receiver; returns whether anything does. */
static bool shine(direct_job *job, const pl_receiver_frame *frame, pl_light_sample *io_sample) {
    const bool below = vec3_dot(frame->geometric, io_sample->direction) <= 0;
    ++job->rays;
    if (below ? !frame->is_smooth || is_hidden_from_smooth(job->scene, frame, io_sample->direction, io_sample->far)
              : is_occluded(job->scene, frame->origin, io_sample->direction, io_sample->far))
        return false;
    transmit(job->scene, frame->origin, io_sample->direction, io_sample->far, io_sample->irradiance);
    return true;
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
static void add_weak_lights(direct_job *job, const pl_receiver_frame *frame, float threshold, float total,
                            uint32_t samples, uint32_t seed, float out_rgb[3]) {
    const float step = total / (float)samples;
    float next = step * sobol(0, 0, seed), passed = 0;
    uint32_t k = 0;
    for (size_t light = 0; light < job->lights->count && k < samples; ++light) {
        const float importance = job->importances[light];
        if (importance <= 0 || importance >= threshold)
            continue;
        passed += importance;
        for (; next < passed && k < samples; next += step, ++k) {
            pl_light_sample sample;
            if (!light_sample(job->lights, light, frame->origin, frame->shading, sobol(k, 1, seed), sobol(k, 2, seed),
                              &sample) ||
                !shine(job, frame, &sample))
                continue;
            for (int c = 0; c < 3; ++c)
                out_rgb[c] += bounded(sample.irradiance[c] * (step / importance));
        }
    }
}

static uint32_t share_of(uint32_t samples, float part, float total) {
    const float share = ceilf((float)samples * part / total);
    return share<1 ? 1 : share>(float) samples ? samples : (uint32_t)share;
}

static void light_receiver(direct_job *job, const pl_receiver_frame *frame, uint32_t seed, float out_rgb[3],
                           float *out_variance) {
    float totals[REPLICATES][3] = {{0}};
    const float total =
        light_importances(job->lights, &job->balls, frame->origin, frame->shading, true, job->importances);
    const float threshold = total / (2 * (float)job->samples);
    float weak = 0;

    if (total > 0) {
        for (size_t light = 0; light < job->lights->count; ++light) {
            const float importance = job->importances[light];
            if (importance >= threshold)
                add_strong_light(job, frame, light, share_of(job->samples, importance, total),
                                 hash_pair(seed, (uint32_t)light), totals);
            else
                weak += importance;
        }
        const uint32_t each = share_of(job->samples, weak, total) / REPLICATES + 1;
        for (uint32_t r = 0; weak > 0 && r < REPLICATES; ++r)
            add_weak_lights(job, frame, threshold, weak, each, hash_pair(seed, 0x80000000u + r), totals[r]);
    }
    for (int c = 0; c < 3; ++c)
        out_rgb[c] = bounded(0.5f * (totals[0][c] + totals[1][c]));
    /* of a mean of two */
    const float difference = luminance(totals[0]) - luminance(totals[1]);
    *out_variance = lesser(0.25f * difference * difference, most_light * most_light);
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
    job.importances = malloc(sizeof(float) * (lights->count + 1));
    if (!job.importances || !light_balls_create(lights, &job.balls)) {
        free(job.importances);
        return PL_ERR_MEMORY;
    }
    for (size_t i = first; i < first + count; ++i) {
        const pl_receiver_frame frame = receiver_frame(scene, receivers, i);
        light_receiver(&job, &frame, hash_pair(seed, (uint32_t)i), out_irradiance + 3 * i, out_variance + i);
    }
    *out_rays = job.rays;
    light_balls_destroy(&job.balls);
    free(job.importances);
    return PL_OK;
}
