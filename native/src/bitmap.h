/*
 * Rows of bits, 64 columns a word, and the searches that packing needs: all columns of a row at once.
 *
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#ifndef PL_BITMAP_H
#define PL_BITMAP_H

#include <stdbool.h>
#include <stdint.h>

enum { PL_WORD_BITS = 64 };

typedef struct pl_bitmap {
    int32_t rows;
    int32_t words; /* per row */
    int32_t capacity;
    uint64_t *bits;
    int32_t *longest_runs; /* per row, kept by the owner: of free bits in an atlas, of set ones in a mask */
    int32_t *run_starts;
} pl_bitmap;

uint64_t *pl_bitmap_row(const pl_bitmap *map, int32_t row);
void pl_bitmap_free(pl_bitmap *map);

/* Room for that many rows, contents kept, new ones not initialised; false where memory is short. */
bool pl_bitmap_reserve(pl_bitmap *map, int32_t rows);

/* Set bits first .. last. */
void pl_bits_set_run(uint64_t *words, int32_t first, int32_t last);

/* The first bit at or after `from` that is `value`, or `end`. */
int32_t pl_bits_next(const uint64_t *words, int32_t from, int32_t end, bool value);

/* Length of the longest run of `value` among the first `count` bits; out_start is left alone where there is none. */
int32_t pl_bits_longest_run(const uint64_t *words, int32_t count, bool value, int32_t *out_start);

/*
 * io_conflicts |= the columns where a run of `length` bits, `start` after the column, meets a taken one; what
 * lies beyond the row counts as taken. `scratch` holds one row.
 */
void pl_bits_add_conflicts(const uint64_t *taken, int32_t words, int32_t start, int32_t length, uint64_t *scratch,
                           uint64_t *io_conflicts);

bool pl_bits_is_full(const uint64_t *words, int32_t count);

/*
 * A row of the mask that meets a taken bit when its first bit stands at that place of the atlas, -1 if none. Rows are
 * tried from `first` on, around: where the mask did not fit last time it will likely not fit a column further.
 */
int32_t pl_bitmap_collision(const pl_bitmap *atlas, const pl_bitmap *mask, int32_t column, int32_t row, int32_t first);

#endif
