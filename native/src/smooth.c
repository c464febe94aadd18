/*
 * Smoothing gathered light over a lightmap's texels, no further than its noise and the geometry allow.
 *
 * One level of an a-trous wavelet filter with edge stops (Dammertz, Sewtz, Hanika & Lensch 2010), its stop on
 * value driven by the estimated variance (Schied et al. 2017).
 *
 * The loops over a block vectorise, for which they choose between values and not what to compute.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "edge_stops.h"
#include "texel_rows.h"

#include <math.h>

enum { CHANNELS = 3 };
static const float spline[TEXEL_RADIUS + 1] = {0.375f, 0.25f, 0.0625f}; /* B3 spline, from the middle out */

/* How far texels and their neighbours are samples of one smooth surface: 0 across creases, steps and charts. */
static void weigh_surface(size_t stride, const float *restrict at, const float *restrict other, float reach_squared,
                          float *restrict out_weights) {
    const float sharpness = 8 / reach_squared, farthest = 4 * reach_squared;
    for (size_t i = 0; i < TEXEL_BLOCK; ++i) {
        float apart[3], squared = 0, cosine = 0, height = 0;
        for (size_t axis = 0; axis < 3; ++axis) {
            const size_t k = axis * stride + i, rest = X_REST * stride, normal = NX * stride;
            apart[axis] = (other[k] - at[k]) + (other[k + rest] - at[k + rest]);
            squared += apart[axis] * apart[axis];
            cosine += at[k + normal] * other[k + normal];
            height += apart[axis] * at[k + normal];
        }
        const float square = cosine * cosine, fourth = square * square;
        const float weight = fourth * fourth * falling(height * height * sharpness);
        /* a neighbour in the atlas that is further away in space than its texels are belongs to another chart */
        const bool is_same_surface = (cosine >= 0.9f) & (squared <= farthest);
        out_weights[i] = is_same_surface ? weight : 0;
    }
}

static void weigh_values(size_t stride, const float *restrict at, const float *restrict other,
                         float *restrict io_weights) {
    for (size_t i = 0; i < TEXEL_BLOCK; ++i) {
        const float difference = at[LUMINANCE * stride + i] - other[LUMINANCE * stride + i];
        io_weights[i] *= alike(difference, at[VARIANCE * stride + i], other[VARIANCE * stride + i]);
    }
}

/* Squared distance of a neighbour so many steps away, were the surface flat. */
static float flat_distance(const texel_rows *rows, int32_t dx, int32_t dy) {
    const float reach = rows->grid->spacing * (float)rows->step;
    return reach * reach * (float)(dx * dx + dy * dy);
}

typedef struct mean {
    float sums[CHANNELS][TEXEL_BLOCK], variances[TEXEL_BLOCK], weights[TEXEL_BLOCK];
} mean;

static void add(size_t stride, const float *restrict other, float tap, const float *restrict weights,
                mean *restrict io_mean) {
    for (size_t i = 0; i < TEXEL_BLOCK; ++i) {
        const float weight = tap * weights[i];
        for (size_t k = 0; k < CHANNELS; ++k)
            io_mean->sums[k][i] += weight * other[(RED + k) * stride + i];
        io_mean->variances[i] += weight * weight * other[VARIANCE * stride + i];
        io_mean->weights[i] += weight;
    }
}

/* Weighted means over the taps of a block of texels, the first of which is `at` in row `row`. */
static void smooth_block(texel_rows *rows, bool stops_on_value, int32_t row, int32_t column, mean *out_mean) {
    const float *at = texel_row(rows, row) + column;
    *out_mean = (mean){0};
    for (int32_t dy = -TEXEL_RADIUS; dy <= TEXEL_RADIUS; ++dy) {
        const float *texels = texel_row(rows, row + dy * rows->step);
        for (int32_t dx = -TEXEL_RADIUS; texels && dx <= TEXEL_RADIUS; ++dx) {
            const float *other = texels + column + dx * rows->step, distance = flat_distance(rows, dx, dy);
            float weights[TEXEL_BLOCK];
            if (!dx && !dy) {
                for (size_t i = 0; i < TEXEL_BLOCK; ++i)
                    weights[i] = 1;
            } else {
                if (!(distance > 0))
                    continue;
                weigh_surface(rows->stride, at, other, distance, weights);
                if (stops_on_value)
                    weigh_values(rows->stride, at, other, weights);
            }
            add(rows->stride, other, spline[abs(dx)] * spline[abs(dy)], weights, out_mean);
        }
    }
}

/* Texels of the block that starts at a column, within the row. */
static int32_t block_width(const pl_texel_grid *grid, int32_t column) {
    const int32_t left = grid->width - column;
    return left < TEXEL_BLOCK ? left : TEXEL_BLOCK;
}

static bool has_receiver(const int32_t *receivers, int32_t count) {
    for (int32_t i = 0; i < count; ++i)
        if (receivers[i] >= 0)
            return true;
    return false;
}

static void store_mean(const mean *found, size_t i, size_t receiver, float *out_values, float *out_variances) {
    const float weight = found->weights[i];
    for (size_t k = 0; k < CHANNELS; ++k)
        out_values[CHANNELS * receiver + k] = found->sums[k][i] / weight;
    out_variances[receiver] = found->variances[i] / (weight * weight);
}

static void smooth_row(texel_rows *rows, bool stops_on_value, int32_t row, float *out_values, float *out_variances) {
    const pl_texel_grid *grid = rows->grid;
    for (int32_t column = 0; column < grid->width; column += TEXEL_BLOCK) {
        const int32_t *receivers = grid->receivers + (size_t)row * (size_t)grid->width + column;
        const int32_t count = block_width(grid, column);
        mean found;
        if (!has_receiver(receivers, count))
            continue;
        smooth_block(rows, stops_on_value, row, column, &found);
        for (int32_t i = 0; i < count; ++i)
            if (receivers[i] >= 0)
                store_mean(&found, (size_t)i, (size_t)receivers[i], out_values, out_variances);
    }
}

pl_status pl_smooth(const pl_texel_grid *grid, const pl_receivers *receivers, const float *values,
                    const float *variances, int32_t step, int32_t stops_on_value, int32_t first_row, int32_t row_count,
                    float *out_values, float *out_variances) {
    texel_rows rows = {.grid = grid, .receivers = receivers, .values = values, .variances = variances, .step = step};
    if (step < 1 || step > PL_WIDEST_STEP)
        return PL_ERR_ARGUMENT;
    if (!texel_rows_create(&rows))
        return PL_ERR_MEMORY;
    /* rows a step apart share what is held */
    for (int32_t first = first_row; first < first_row + row_count && first < first_row + step; ++first)
        for (int32_t row = first; row < first_row + row_count; row += step)
            smooth_row(&rows, stops_on_value != 0, row, out_values, out_variances);
    texel_rows_destroy(&rows);
    return PL_OK;
}

static const float least_neighbours = 3; /* fewer do not tell what is usual */
static const float most_deviations = 2;  /* that noise explains */

/* The luminances around texels of the same surface. */
typedef struct neighbours {
    float darkest[TEXEL_BLOCK], brightest[TEXEL_BLOCK], count[TEXEL_BLOCK];
} neighbours;

static void add_neighbours(size_t stride, const float *restrict other, const float *restrict weights,
                           neighbours *restrict io_around) {
    for (size_t i = 0; i < TEXEL_BLOCK; ++i) {
        const float there = other[LUMINANCE * stride + i];
        const float darker = lesser(there, io_around->darkest[i]), brighter = greater(there, io_around->brightest[i]);
        io_around->darkest[i] = weights[i] > 0 ? darker : io_around->darkest[i];
        io_around->brightest[i] = weights[i] > 0 ? brighter : io_around->brightest[i];
        io_around->count[i] += weights[i] > 0 ? 1.0f : 0.0f;
    }
}

static void look_around(texel_rows *rows, int32_t row, int32_t column, neighbours *out_around) {
    const float *at = texel_row(rows, row) + column;
    for (size_t i = 0; i < TEXEL_BLOCK; ++i) {
        out_around->darkest[i] = INFINITY;
        out_around->brightest[i] = out_around->count[i] = 0;
    }
    for (int32_t dy = -1; dy <= 1; ++dy) {
        const float *texels = texel_row(rows, row + dy);
        for (int32_t dx = -1; texels && dx <= 1; ++dx) {
            const float distance = flat_distance(rows, dx, dy);
            float weights[TEXEL_BLOCK];
            if (!(distance > 0))
                continue;
            weigh_surface(rows->stride, at, texels + column + dx, distance, weights);
            add_neighbours(rows->stride, texels + column + dx, weights, out_around);
        }
    }
}

/* What the i-th texel's light is to be multiplied with to lie among those around it. */
static float clamping(const neighbours *around, size_t i, float light, float variance) {
    if (around->count[i] < least_neighbours || !(light > 0))
        return 1;
    const float most = most_deviations * sqrtf(variance);
    const float wanted = lesser(greater(light, around->darkest[i]), around->brightest[i]);
    const float factor = lesser(greater(wanted, light - most), light + most) / light;
    return factor < INFINITY ? factor : 1;
}

static void store_clamped(const texel_rows *rows, const neighbours *around, size_t i, size_t receiver,
                          float *out_values) {
    const float *value = rows->values + CHANNELS * receiver;
    const float factor = clamping(around, i, luminance(value), rows->variances[receiver]);
    for (size_t k = 0; k < CHANNELS; ++k)
        out_values[CHANNELS * receiver + k] = factor * value[k];
}

static void clamp_row(texel_rows *rows, int32_t row, float *out_values) {
    const pl_texel_grid *grid = rows->grid;
    const int32_t *receivers = grid->receivers + (size_t)row * (size_t)grid->width;
    neighbours around;
    for (int32_t column = 0; column < grid->width; ++column) {
        const int32_t i = column % TEXEL_BLOCK;
        if (i == 0 && has_receiver(receivers + column, block_width(grid, column)))
            look_around(rows, row, column, &around);
        if (receivers[column] >= 0)
            store_clamped(rows, &around, (size_t)i, (size_t)receivers[column], out_values);
    }
}

pl_status pl_clamp_outliers(const pl_texel_grid *grid, const pl_receivers *receivers, const float *values,
                            const float *variances, int32_t first_row, int32_t row_count, float *out_values) {
    texel_rows rows = {.grid = grid, .receivers = receivers, .values = values, .variances = variances, .step = 1};
    if (!texel_rows_create(&rows))
        return PL_ERR_MEMORY;
    for (int32_t row = first_row; row < first_row + row_count; ++row)
        clamp_row(&rows, row, out_values);
    texel_rows_destroy(&rows);
    return PL_OK;
}
