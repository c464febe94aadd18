/*
 * Rows of a lightmap's texels in columns of numbers, for loops over neighbours that vectorise: as receivers, each
 * neighbour's place, normal and light lie on five lines of memory, and reading them took most of the time.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#ifndef PATCHLIGHT_TEXEL_ROWS_H
#define PATCHLIGHT_TEXEL_ROWS_H

#include "lights.h"

#include <stdlib.h>

/* A place is the sum of two floats: one has not enough digits for neighbours far from the origin. */
enum texel_column { X, Y, Z, X_REST, Y_REST, Z_REST, NX, NY, NZ, RED, GREEN, BLUE, LUMINANCE, VARIANCE, TEXEL_COLUMNS };
enum {
    TEXEL_RADIUS = 2,                  /* steps to the farthest neighbour that is looked at */
    TEXEL_ROWS = 2 * TEXEL_RADIUS + 1, /* that are held: all that a row's neighbours lie in */
    TEXEL_BLOCK = 64                   /* texels that a loop runs over */
};

/*
 * What is no receiver has all numbers 0, as has what lies beyond the sides: no normal, by which it is known. Numbers
 * of column c stand at c * stride from the row's texel.
 */
typedef struct texel_rows {
    const pl_texel_grid *grid;
    const pl_receivers *receivers;
    const float *values, *variances; /* 3 and 1 per receiver */
    int32_t step;                    /* from neighbour to neighbour */
    size_t stride;
    float *room;
    int32_t held[TEXEL_ROWS];
} texel_rows;

static inline size_t texel_margin(const texel_rows *rows) { return TEXEL_RADIUS * (size_t)rows->step; }

/* False where there is no memory. `rows` has all but the last three set. */
static inline bool texel_rows_create(texel_rows *rows) {
    const size_t blocks = ((size_t)rows->grid->width + TEXEL_BLOCK - 1) / TEXEL_BLOCK;
    rows->stride = TEXEL_BLOCK * blocks + 2 * texel_margin(rows);
    rows->room = calloc(TEXEL_ROWS * TEXEL_COLUMNS * rows->stride, sizeof(float));
    for (int k = 0; k < TEXEL_ROWS; ++k)
        rows->held[k] = -1;
    return rows->room != NULL;
}

static inline void texel_rows_destroy(texel_rows *rows) { free(rows->room); }

static inline void texel_fill(const texel_rows *rows, int32_t receiver, float *texel) {
    const size_t k = (size_t)receiver;
    for (size_t axis = 0; axis < 3; ++axis) {
        const double place = rows->receivers->positions[3 * k + axis];
        const float most = (float)place;
        texel[(X + axis) * rows->stride] = most;
        texel[(X_REST + axis) * rows->stride] = (float)(place - (double)most);
        texel[(NX + axis) * rows->stride] = rows->receivers->normals[3 * k + axis];
        texel[(RED + axis) * rows->stride] = rows->values[3 * k + axis];
    }
    texel[LUMINANCE * rows->stride] = luminance(rows->values + 3 * k);
    texel[VARIANCE * rows->stride] = rows->variances[k];
}

static inline void texel_clear(const texel_rows *rows, float *texel) {
    for (size_t column = 0; column < TEXEL_COLUMNS; ++column)
        texel[column * rows->stride] = 0;
}

/* The first texel of a row of the grid, NULL outside it. It is held until other rows take its place. */
static inline const float *texel_row(texel_rows *rows, int32_t row) {
    const pl_texel_grid *grid = rows->grid;
    if (row < 0 || row >= grid->height)
        return NULL;
    const size_t slot = (size_t)(row / rows->step) % TEXEL_ROWS;
    float *texels = rows->room + slot * TEXEL_COLUMNS * rows->stride + texel_margin(rows);
    if (rows->held[slot] == row)
        return texels;
    rows->held[slot] = row;
    const int32_t *receivers = grid->receivers + (size_t)row * (size_t)grid->width;
    for (int32_t x = 0; x < grid->width; ++x) {
        if (receivers[x] >= 0)
            texel_fill(rows, receivers[x], texels + x);
        else
            texel_clear(rows, texels + x);
    }
    return texels;
}

#endif
