/*
 * Smoothing gathered light over a lightmap's texels, no further than its noise and the geometry allow.
 *
 * One level of an a-trous wavelet filter with edge stops (Dammertz, Sewtz, Hanika & Lensch 2010), its stop on
 * value driven by the estimated variance (Schied et al. 2017).
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "lights.h"

#include <math.h>

enum { CHANNELS = 3, RADIUS = 2 };
static const float spline[RADIUS + 1] = {0.375f, 0.25f, 0.0625f}; /* B3 spline, from the middle out */

typedef struct smooth_job {
    const pl_texel_grid *grid;
    const pl_receivers *receivers;
    const float *values, *variances;
    int32_t step;
    bool stops_on_value;
} smooth_job;

/* (1 - x / 8)^8, about exp(-x), of which an expf would take most of the time here. */
static float falling(float x) {
    const float t = x < 8 ? 1 - 0.125f * x : 0, square = t * t, fourth = square * square;
    return fourth * fourth;
}

/* The texel that is smoothed, as its neighbours are held against it. */
typedef struct middle {
    const double *position;
    vec3 normal;
    float luminance, variance;
} middle;

/* How far two receivers are samples of one smooth surface: 0 across creases, steps and charts. */
static float geometric_weight(const smooth_job *job, const middle *at, size_t other, float reach_squared) {
    const double *p = at->position, *q = job->receivers->positions + 3 * other;
    const vec3 apart = {(float)(q[0] - p[0]), (float)(q[1] - p[1]), (float)(q[2] - p[2])};
    const float cosine = vec3_dot(at->normal, vec3_from(job->receivers->normals + 3 * other));
    /* a neighbour in the atlas that is further away in space than its texels are belongs to another chart */
    if (cosine < 0.9f || vec3_dot(apart, apart) > 4 * reach_squared)
        return 0;
    const float height = vec3_dot(apart, at->normal);
    const float square = cosine * cosine, fourth = square * square;
    return fourth * fourth * falling(8 * height * height / reach_squared);
}

/*
 * How far two values are the same but for their noise. Each counts for a few times the other's at the most, or what is
 * bright and noisy (under a lamp that hangs off the ceiling) would spread over the calm texels beside it.
 */
static const float noisier = 4;
/* Less leaves mottles, more washes out what light does at contacts. */
static const float tolerance = 7;

static float value_weight(const smooth_job *job, const middle *at, size_t other) {
    const float difference = at->luminance - luminance(job->values + CHANNELS * other);
    const float va = at->variance, vb = job->variances[other];
    const float noise = lesser(va, noisier * vb) + lesser(vb, noisier * va);
    return noise > 0 ? falling(difference * difference / (tolerance * noise)) : (difference == 0 ? 1.0f : 0.0f);
}

/* Of a tap that is not the middle itself. */
static float tap_weight(const smooth_job *job, const middle *at, size_t other, int32_t dx, int32_t dy) {
    const float reach = job->grid->spacing * (float)job->step;
    const float reach_squared = reach * reach * (float)(dx * dx + dy * dy);
    if (!(reach_squared > 0))
        return 0;
    const float weight = geometric_weight(job, at, other, reach_squared);
    return weight > 0 && job->stops_on_value ? weight * value_weight(job, at, other) : weight;
}

static void smooth_texel(const smooth_job *job, int32_t row, int32_t column, size_t receiver, float *out_values,
                         float *out_variances) {
    const pl_texel_grid *grid = job->grid;
    const middle at = {job->receivers->positions + 3 * receiver, vec3_from(job->receivers->normals + 3 * receiver),
                       luminance(job->values + CHANNELS * receiver), job->variances[receiver]};
    float sums[CHANNELS] = {0}, weights = 0, variance = 0;
    for (int32_t dy = -RADIUS; dy <= RADIUS; ++dy) {
        const int32_t y = row + dy * job->step;
        if (y < 0 || y >= grid->height)
            continue;
        for (int32_t dx = -RADIUS; dx <= RADIUS; ++dx) {
            const int32_t x = column + dx * job->step;
            if (x < 0 || x >= grid->width)
                continue;
            const int32_t other = grid->receivers[(size_t)y * (size_t)grid->width + (size_t)x];
            if (other < 0)
                continue;
            const float tap = spline[dx < 0 ? -dx : dx] * spline[dy < 0 ? -dy : dy];
            const float weight = dx || dy ? tap * tap_weight(job, &at, (size_t)other, dx, dy) : tap;
            for (int k = 0; k < CHANNELS; ++k)
                sums[k] += weight * job->values[CHANNELS * (size_t)other + (size_t)k];
            variance += weight * weight * job->variances[other];
            weights += weight;
        }
    }
    for (int k = 0; k < CHANNELS; ++k)
        out_values[CHANNELS * receiver + (size_t)k] = sums[k] / weights;
    out_variances[receiver] = variance / (weights * weights);
}

void pl_smooth(const pl_texel_grid *grid, const pl_receivers *receivers, const float *values, const float *variances,
               int32_t step, int32_t stops_on_value, int32_t first_row, int32_t row_count, float *out_values,
               float *out_variances) {
    const smooth_job job = {grid, receivers, values, variances, step, stops_on_value != 0};
    for (int32_t row = first_row; row < first_row + row_count; ++row) {
        for (int32_t column = 0; column < grid->width; ++column) {
            const int32_t receiver = grid->receivers[(size_t)row * (size_t)grid->width + (size_t)column];
            if (receiver >= 0)
                smooth_texel(&job, row, column, (size_t)receiver, out_values, out_variances);
        }
    }
}

enum { LEAST_NEIGHBOURS = 3 };          /* fewer do not tell what is usual */
static const float most_deviations = 2; /* that noise explains */

/* What a texel's value is to be multiplied with to lie among those of its neighbours. */
static float clamping(const smooth_job *job, int32_t row, int32_t column, size_t receiver) {
    const pl_texel_grid *grid = job->grid;
    const middle at = {job->receivers->positions + 3 * receiver, vec3_from(job->receivers->normals + 3 * receiver),
                       luminance(job->values + CHANNELS * receiver), job->variances[receiver]};
    float darkest = INFINITY, brightest = 0;
    int neighbours = 0;
    for (int32_t dy = -1; dy <= 1; ++dy) {
        for (int32_t dx = -1; dx <= 1; ++dx) {
            const int32_t y = row + dy, x = column + dx;
            if ((!dx && !dy) || y < 0 || y >= grid->height || x < 0 || x >= grid->width)
                continue;
            const int32_t other = grid->receivers[(size_t)y * (size_t)grid->width + (size_t)x];
            if (other < 0 || !(tap_weight(job, &at, (size_t)other, dx, dy) > 0))
                continue;
            const float there = luminance(job->values + CHANNELS * (size_t)other);
            darkest = lesser(darkest, there);
            brightest = greater(brightest, there);
            ++neighbours;
        }
    }
    if (neighbours < LEAST_NEIGHBOURS || !(at.luminance > 0))
        return 1;
    const float most = most_deviations * sqrtf(at.variance);
    const float wanted = lesser(greater(at.luminance, darkest), brightest);
    const float factor = lesser(greater(wanted, at.luminance - most), at.luminance + most) / at.luminance;
    return factor < INFINITY ? factor : 1;
}

void pl_clamp_outliers(const pl_texel_grid *grid, const pl_receivers *receivers, const float *values,
                       const float *variances, int32_t first_row, int32_t row_count, float *out_values) {
    const smooth_job job = {grid, receivers, values, variances, 1, false};
    for (int32_t row = first_row; row < first_row + row_count; ++row) {
        for (int32_t column = 0; column < grid->width; ++column) {
            const int32_t receiver = grid->receivers[(size_t)row * (size_t)grid->width + (size_t)column];
            if (receiver < 0)
                continue;
            const float factor = clamping(&job, row, column, (size_t)receiver);
            for (size_t k = CHANNELS * (size_t)receiver; k < CHANNELS * ((size_t)receiver + 1); ++k)
                out_values[k] = factor * values[k];
        }
    }
}
