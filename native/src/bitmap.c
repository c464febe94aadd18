/* Rows of bits. SPDX-License-Identifier: GPL-3.0-or-later */
#include "bitmap.h"

#include <stdlib.h>

uint64_t *pl_bitmap_row(const pl_bitmap *map, int32_t row) { return map->bits + (size_t)row * (size_t)map->words; }

void pl_bitmap_free(pl_bitmap *map) {
    free(map->bits);
    free(map->longest_runs);
    free(map->run_starts);
}

bool pl_bitmap_reserve(pl_bitmap *map, int32_t rows) {
    if (rows <= map->capacity)
        return true;
    const int32_t capacity = rows + rows / 2;
    const size_t row_bytes = sizeof *map->bits * (size_t)map->words;
    uint64_t *bits = realloc(map->bits, row_bytes * (size_t)capacity);
    if (bits)
        map->bits = bits;
    int32_t *runs = realloc(map->longest_runs, sizeof *runs * (size_t)capacity);
    if (runs)
        map->longest_runs = runs;
    int32_t *starts = realloc(map->run_starts, sizeof *starts * (size_t)capacity);
    if (starts)
        map->run_starts = starts;
    if (!bits || !runs || !starts)
        return false;
    map->capacity = capacity;
    return true;
}

void pl_bits_set_run(uint64_t *words, int32_t first, int32_t last) {
    for (int32_t bit = first; bit <= last;) {
        const int32_t shift = bit % PL_WORD_BITS;
        const int32_t count = last - bit + 1 < PL_WORD_BITS - shift ? last - bit + 1 : PL_WORD_BITS - shift;
        const uint64_t ones = count == PL_WORD_BITS ? ~UINT64_C(0) : (UINT64_C(1) << count) - 1;
        words[bit / PL_WORD_BITS] |= ones << shift;
        bit += count;
    }
}

int32_t pl_bits_next(const uint64_t *words, int32_t from, int32_t end, bool value) {
    while (from < end) {
        const uint64_t word =
            (value ? words[from / PL_WORD_BITS] : ~words[from / PL_WORD_BITS]) >> (from % PL_WORD_BITS);
        if (word) {
            const int32_t found = from + __builtin_ctzll(word);
            return found < end ? found : end;
        }
        from += PL_WORD_BITS - from % PL_WORD_BITS;
    }
    return end;
}

int32_t pl_bits_longest_run(const uint64_t *words, int32_t count, bool value, int32_t *out_start) {
    int32_t longest = 0;

    for (int32_t start = pl_bits_next(words, 0, count, value); start < count;) {
        const int32_t end = pl_bits_next(words, start, count, !value);
        if (end - start > longest) {
            longest = end - start;
            *out_start = start;
        }
        start = pl_bits_next(words, end, count, value);
    }
    return longest;
}

void pl_bits_add_conflicts(const uint64_t *taken, int32_t words, int32_t start, int32_t length, uint64_t *scratch,
                           uint64_t *io_conflicts) {
    const int32_t skip = start / PL_WORD_BITS, shift = start % PL_WORD_BITS;

    for (int32_t w = 0; w < words; ++w) {
        const uint64_t low = w + skip < words ? taken[w + skip] : ~UINT64_C(0);
        const uint64_t high = w + skip + 1 < words ? taken[w + skip + 1] : ~UINT64_C(0);
        scratch[w] = shift ? low >> shift | high << (PL_WORD_BITS - shift) : low;
    }
    /* an OR over `length` neighbours in log2(length) steps; ascending, so that it works in place */
    for (int32_t done = 1; done < length;) {
        const int32_t step = done < length - done ? done : length - done;
        const int32_t jump = step / PL_WORD_BITS, bits = step % PL_WORD_BITS;
        for (int32_t w = 0; w < words; ++w) {
            const uint64_t low = w + jump < words ? scratch[w + jump] : ~UINT64_C(0);
            const uint64_t high = w + jump + 1 < words ? scratch[w + jump + 1] : ~UINT64_C(0);
            scratch[w] |= bits ? low >> bits | high << (PL_WORD_BITS - bits) : low;
        }
        done += step;
    }
    for (int32_t w = 0; w < words; ++w)
        io_conflicts[w] |= scratch[w];
}

static bool row_collides(const uint64_t *bits, int32_t count, int32_t shift, const uint64_t *taken,
                         int32_t taken_count) {
    for (int32_t w = 0; w < count; ++w) {
        if (bits[w] << shift & taken[w])
            return true;
        if (shift && w + 1 < taken_count && bits[w] >> (PL_WORD_BITS - shift) & taken[w + 1])
            return true;
    }
    return false;
}

int32_t pl_bitmap_collision(const pl_bitmap *atlas, const pl_bitmap *mask, int32_t column, int32_t row, int32_t first) {
    const int32_t skip = column / PL_WORD_BITS, shift = column % PL_WORD_BITS;

    for (int32_t i = 0; i < mask->rows; ++i) {
        const int32_t r = first + i < mask->rows ? first + i : first + i - mask->rows;
        if (row_collides(pl_bitmap_row(mask, r), mask->words, shift, pl_bitmap_row(atlas, row + r) + skip,
                         atlas->words - skip))
            return r;
    }
    return -1;
}

bool pl_bits_is_full(const uint64_t *words, int32_t count) {
    for (int32_t w = 0; w < count; ++w)
        if (~words[w])
            return false;
    return true;
}
