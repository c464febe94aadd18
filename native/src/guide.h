/*
 * Guided directions: cosine rays drawn more often from where a group of neighbouring receivers has found light.
 *
 * The unit square that cosine rays are drawn from is cut into PL_GUIDE_SIDE^2 cells; a group's shares say how
 * often each is drawn. Inverting their sums row by row keeps a Sobol sequence stratified.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#ifndef PATCHLIGHT_GUIDE_H
#define PATCHLIGHT_GUIDE_H

#include "patchlight.h"

typedef struct guide {
    const float *shares; /* NULL: evenly */
    float rows[PL_GUIDE_SIDE];
} guide;

static inline guide guide_of(const pl_guides *guides, size_t receiver) {
    guide result = {.shares = NULL};
    if (!guides || guides->groups[receiver] < 0)
        return result;
    result.shares = guides->shares + (size_t)PL_GUIDE_CELLS * (size_t)guides->groups[receiver];
    for (int row = 0; row < PL_GUIDE_SIDE; ++row) {
        result.rows[row] = 0;
        for (int column = 0; column < PL_GUIDE_SIDE; ++column)
            result.rows[row] += result.shares[PL_GUIDE_SIDE * row + column];
    }
    return result;
}

/* Which of the shares x in [0, 1) falls into; x becomes its place in [0, 1) along all of them. */
static inline int guide_step(const float *shares, float total, float *io_x) {
    float left = *io_x * total;
    int k = 0;
    for (; k < PL_GUIDE_SIDE - 1 && left >= shares[k]; ++k)
        left -= shares[k];
    const float inside = shares[k] > 0 ? left / shares[k] : 0.5f;
    *io_x = ((float)k + (inside < 0.999999f ? inside : 0.999999f)) * (1.0f / (float)PL_GUIDE_SIDE);
    return k;
}

/* Move (x, y) to where the guide wants it; returns what a ray from there counts for: 1 / density. */
static inline float guide_warp(const guide *by, float *io_x, float *io_y) {
    if (!by->shares)
        return 1;
    const int row = guide_step(by->rows, 1, io_x);
    const int column = guide_step(by->shares + PL_GUIDE_SIDE * row, by->rows[row], io_y);
    return 1 / ((float)PL_GUIDE_CELLS * by->shares[PL_GUIDE_SIDE * row + column]);
}

/* The cell that (x, y) lies in. */
static inline int guide_cell(float x, float y) {
    const float side = PL_GUIDE_SIDE;
    return PL_GUIDE_SIDE * (int)(x * side) + (int)(y * side);
}

#endif
