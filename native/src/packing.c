/*
 * Charts into an atlas: bottom-left first fit of the charts' real outlines, largest first, on a bitmap
 * of blocks. Outlines and not bounding boxes, so that small charts fill window openings and the notches
 * of L-shaped floors; the same footprint as the rasteriser's, so that no texel can serve two charts.
 *
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "patchlight.h"

#include "footprint.h"

#include <stdlib.h>
#include <string.h>

enum { WORD_BITS = 64, PROBES = 8 };

/* How far a texel reaches beyond 1: UVs are stored as float, and a chart must not touch a texel more
   when its last digit is rounded. Also where a chart starts within its first texel. */
static const double reach_margin = 0.003;
static const double chart_start = 0.504;

typedef struct bitmap {
    int32_t rows;
    int32_t words; /* per row */
    int32_t capacity;
    uint64_t *bits;
    int32_t *free_runs; /* atlas: longest run of free blocks; mask: longest run of set ones, per row */
    int32_t *run_starts;
} bitmap;

typedef struct place {
    int32_t column, row;
} place;

typedef struct atlas_job {
    const double *uvs;
    const int64_t *first_triangles;
    double density; /* blocks per unit */
    int32_t block;
    int32_t columns; /* of the atlas, in blocks */
    bitmap atlas;    /* with a rim of one block, so that a gutter never leaves it */
    bitmap masks[2]; /* of one chart: as it is, and turned (axes swapped) */
    int32_t mask_columns[2];
} atlas_job;

static uint64_t *row_of(const bitmap *map, int32_t row) {
    return map->bits + (size_t)row * (size_t)map->words;
}

static void free_bitmap(bitmap *map) {
    free(map->bits);
    free(map->free_runs);
    free(map->run_starts);
}

/* Room for that many rows; new ones are empty. */
static bool reserve(bitmap *map, int32_t rows) {
    if (rows <= map->capacity)
        return true;
    const int32_t capacity = rows + rows / 2;
    const size_t row_bytes = sizeof *map->bits * (size_t)map->words;
    uint64_t *bits = realloc(map->bits, row_bytes * (size_t)capacity);
    if (bits)
        map->bits = bits;
    int32_t *runs = realloc(map->free_runs, sizeof *runs * (size_t)capacity);
    if (runs)
        map->free_runs = runs;
    int32_t *starts = realloc(map->run_starts, sizeof *starts * (size_t)capacity);
    if (starts)
        map->run_starts = starts;
    if (!bits || !runs || !starts)
        return false;
    map->capacity = capacity;
    return true;
}

static void set_run(uint64_t *words, int32_t first, int32_t last) {
    for (int32_t bit = first; bit <= last;) {
        const int32_t shift = bit % WORD_BITS;
        const int32_t count = last - bit + 1 < WORD_BITS - shift ? last - bit + 1 : WORD_BITS - shift;
        const uint64_t ones = count == WORD_BITS ? ~UINT64_C(0) : (UINT64_C(1) << count) - 1;
        words[bit / WORD_BITS] |= ones << shift;
        bit += count;
    }
}

/* The first bit at or after `from` that is `value`, or `end`. */
static int32_t next_bit(const uint64_t *words, int32_t from, int32_t end, bool value) {
    while (from < end) {
        const uint64_t word = (value ? words[from / WORD_BITS] : ~words[from / WORD_BITS]) >> (from % WORD_BITS);
        if (word) {
            const int32_t found = from + __builtin_ctzll(word);
            return found < end ? found : end;
        }
        from += WORD_BITS - from % WORD_BITS;
    }
    return end;
}

static int32_t longest_run(const uint64_t *words, int32_t count, bool value, int32_t *out_start) {
    int32_t longest = 0;

    for (int32_t start = next_bit(words, 0, count, value); start < count;) {
        const int32_t end = next_bit(words, start, count, !value);
        if (end - start > longest) {
            longest = end - start;
            *out_start = start;
        }
        start = next_bit(words, end, count, value);
    }
    return longest;
}

/* Atlas rows up to `rows` exist; a new row is free inside, its rim taken. */
static bool grow_atlas(atlas_job *job, int32_t rows) {
    bitmap *atlas = &job->atlas;

    if (!reserve(atlas, rows))
        return false;
    for (; atlas->rows < rows; ++atlas->rows) {
        memset(row_of(atlas, atlas->rows), 0, sizeof *atlas->bits * (size_t)atlas->words);
        set_run(row_of(atlas, atlas->rows), 0, 0);
        set_run(row_of(atlas, atlas->rows), job->columns + 1, atlas->words * WORD_BITS - 1);
        atlas->free_runs[atlas->rows] = job->columns;
    }
    return true;
}

/* The blocks that a chart touches, as bits. */
static bool draw_mask(atlas_job *job, size_t chart, bool is_turned, const int32_t size[2]) {
    bitmap *mask = &job->masks[is_turned];
    const int32_t columns = size[is_turned], rows = size[!is_turned];
    const double reach = 0.5 + (0.5 + reach_margin) / (double)job->block; /* of a block's centre, in blocks */
    const double start = chart_start / (double)job->block;

    mask->words = (columns + WORD_BITS - 1) / WORD_BITS;
    mask->capacity = 0; /* rows have another length now */
    if (!reserve(mask, rows))
        return false;
    mask->rows = rows;
    job->mask_columns[is_turned] = columns;
    memset(mask->bits, 0, sizeof *mask->bits * (size_t)mask->words * (size_t)rows);

    for (int64_t t = job->first_triangles[chart]; t < job->first_triangles[chart + 1]; ++t) {
        double corners[3][2], bottom = INFINITY, top = -INFINITY;
        for (int k = 0; k < 3; ++k) {
            corners[k][is_turned] = job->uvs[6 * t + 2 * k] * job->density + start;
            corners[k][!is_turned] = job->uvs[6 * t + 2 * k + 1] * job->density + start;
            bottom = fmin(bottom, corners[k][1]);
            top = fmax(top, corners[k][1]);
        }
        const int32_t last_row = (int32_t)fmin(floor(top + reach), (double)(rows - 1));
        for (int32_t row = (int32_t)fmax(floor(bottom - reach - 0.5), 0.0); row <= last_row; ++row) {
            const double centre = (double)row + 0.5;
            double left, right;
            if (!pl_span_between((const double (*)[2])corners, centre - reach, centre + reach, &left, &right))
                continue;
            const int32_t first = (int32_t)fmax(ceil(left - reach - 0.5), 0.0);
            const int32_t last = (int32_t)fmin(floor(right + reach - 0.5), (double)(columns - 1));
            set_run(row_of(mask, row), first, last);
        }
    }
    for (int32_t row = 0; row < rows; ++row) {
        mask->run_starts[row] = 0;
        mask->free_runs[row] = longest_run(row_of(mask, row), columns, true, &mask->run_starts[row]);
    }
    return true;
}

/* io_conflicts |= the columns where a run of blocks, `start` after the mask's edge, meets a taken one. */
static void add_conflicts(const uint64_t *taken, int32_t words, int32_t start, int32_t length, uint64_t *scratch,
                          uint64_t *io_conflicts) {
    const int32_t skip = start / WORD_BITS, shift = start % WORD_BITS;

    for (int32_t w = 0; w < words; ++w) {
        const uint64_t low = w + skip < words ? taken[w + skip] : ~UINT64_C(0);
        const uint64_t high = w + skip + 1 < words ? taken[w + skip + 1] : ~UINT64_C(0);
        scratch[w] = shift ? low >> shift | high << (WORD_BITS - shift) : low;
    }
    /* an OR over `length` neighbours in log2(length) steps; ascending, so that it works in place */
    for (int32_t done = 1; done < length;) {
        const int32_t step = done < length - done ? done : length - done;
        const int32_t jump = step / WORD_BITS, bits = step % WORD_BITS;
        for (int32_t w = 0; w < words; ++w) {
            const uint64_t low = w + jump < words ? scratch[w + jump] : ~UINT64_C(0);
            const uint64_t high = w + jump + 1 < words ? scratch[w + jump + 1] : ~UINT64_C(0);
            scratch[w] |= bits ? low >> bits | high << (WORD_BITS - bits) : low;
        }
        done += step;
    }
    for (int32_t w = 0; w < words; ++w)
        io_conflicts[w] |= scratch[w];
}

/* Whether the mask, with its corner at that place of the rimmed atlas, meets a taken block. */
static bool collides(const bitmap *atlas, const bitmap *mask, int32_t column, int32_t row) {
    const int32_t skip = column / WORD_BITS, shift = column % WORD_BITS;

    for (int32_t r = 0; r < mask->rows; ++r) {
        const uint64_t *bits = row_of(mask, r), *taken = row_of(atlas, row + r) + skip;
        for (int32_t w = 0; w < mask->words; ++w) {
            if (bits[w] << shift & taken[w])
                return true;
            if (shift && bits[w] >> (WORD_BITS - shift) & (skip + w + 1 < atlas->words ? taken[w + 1] : 0))
                return true;
        }
    }
    return false;
}

/* Rows of the mask that are asked for all columns at once, before columns are tried one by one: spread
   evenly, the one with the longest run first. */
static int32_t choose_probes(const bitmap *mask, int32_t probes[PROBES + 1]) {
    const int32_t count = mask->rows < PROBES ? mask->rows : PROBES;
    int32_t widest = 0;

    for (int32_t row = 1; row < mask->rows; ++row)
        if (mask->free_runs[row] > mask->free_runs[widest])
            widest = row;
    probes[0] = widest;
    for (int32_t p = 0; p < count; ++p)
        probes[p + 1] = count > 1 ? (int32_t)((int64_t)p * (mask->rows - 1) / (count - 1)) : 0;
    return count + 1;
}

static bool is_full(const uint64_t *words, int32_t count) {
    for (int32_t w = 0; w < count; ++w)
        if (~words[w])
            return false;
    return true;
}

/* The leftmost place in one row of the atlas, or -1; scratch holds two rows. */
static int32_t fit_in_row(const atlas_job *job, bool is_turned, const int32_t *probes, int32_t probe_count, int32_t row,
                          uint64_t *scratch) {
    const bitmap *atlas = &job->atlas, *mask = &job->masks[is_turned];
    const int32_t words = atlas->words;
    uint64_t *conflicts = scratch + words;

    for (int32_t p = 0; p < probe_count; ++p)
        if (atlas->free_runs[row + probes[p]] < mask->free_runs[probes[p]])
            return -1;
    memset(conflicts, 0, sizeof *conflicts * (size_t)words);
    set_run(conflicts, 0, 0);
    set_run(conflicts, job->columns + 2 - job->mask_columns[is_turned], words * WORD_BITS - 1);
    for (int32_t p = 0; p < probe_count; ++p) {
        const int32_t probe = probes[p];
        if (mask->free_runs[probe] == 0)
            continue;
        add_conflicts(row_of(atlas, row + probe), words, mask->run_starts[probe], mask->free_runs[probe], scratch,
                      conflicts);
        if (is_full(conflicts, words))
            return -1;
    }
    const int32_t end = words * WORD_BITS;
    for (int32_t column = next_bit(conflicts, 0, end, false); column < end;
         column = next_bit(conflicts, column + 1, end, false))
        if (!collides(atlas, mask, column, row))
            return column;
    return -1;
}

/* The lowest row, then the leftmost column, that takes the mask without reaching above `ceiling`. */
static bool find_place(atlas_job *job, bool is_turned, int32_t ceiling, uint64_t *scratch, place *out_place) {
    const bitmap *mask = &job->masks[is_turned];
    int32_t probes[PROBES + 1];
    const int32_t probe_count = choose_probes(mask, probes);

    if (job->mask_columns[is_turned] > job->columns)
        return false;
    for (int32_t row = 1; row + mask->rows <= ceiling; ++row) {
        const int32_t column = fit_in_row(job, is_turned, probes, probe_count, row, scratch);
        if (column >= 0) {
            *out_place = (place){column, row};
            return true;
        }
    }
    return false;
}

/* Mark the mask and a gutter of one block around it as taken. */
static void take(atlas_job *job, bool is_turned, place at) {
    bitmap *atlas = &job->atlas;
    const bitmap *mask = &job->masks[is_turned];
    const int32_t columns = job->mask_columns[is_turned];
    int32_t unused;

    for (int32_t r = 0; r < mask->rows; ++r) {
        const uint64_t *bits = row_of(mask, r);
        for (int32_t start = next_bit(bits, 0, columns, true); start < columns;) {
            const int32_t end = next_bit(bits, start, columns, false);
            for (int32_t side = -1; side <= 1; ++side)
                set_run(row_of(atlas, at.row + r + side), at.column + start - 1, at.column + end);
            start = next_bit(bits, end, columns, true);
        }
    }
    for (int32_t row = at.row - 1; row <= at.row + mask->rows; ++row)
        atlas->free_runs[row] = longest_run(row_of(atlas, row), job->columns + 2, false, &unused);
}

static pl_status place_chart(atlas_job *job, size_t chart, const int32_t size[2], uint64_t *scratch, int32_t *out_place,
                             int32_t *io_height) {
    const bool can_turn = size[0] != size[1] || size[0] > 2;
    /* above everything there is always room */
    const int32_t roof = *io_height + 2 + (size[0] > size[1] ? size[0] : size[1]);
    int32_t ceiling = roof + 1;
    place best = {0, 0};
    int chosen = -1;

    if (!grow_atlas(job, roof + 2))
        return PL_ERR_MEMORY;
    for (int turned = 0; turned <= can_turn; ++turned) {
        place found;
        if (!draw_mask(job, chart, turned, size))
            return PL_ERR_MEMORY;
        if (!find_place(job, turned, ceiling, scratch, &found))
            continue;
        best = found;
        chosen = turned;
        ceiling = found.row + job->masks[turned].rows - 1; /* the other way must end lower to be better */
    }
    if (chosen < 0)
        return PL_ERR_ARGUMENT;

    take(job, chosen, best);
    out_place[0] = best.column - 1;
    out_place[1] = best.row - 1;
    out_place[2] = chosen;
    if (out_place[1] + job->masks[chosen].rows > *io_height)
        *io_height = out_place[1] + job->masks[chosen].rows;
    return PL_OK;
}

typedef struct chart_size {
    int32_t size[2]; /* blocks along u and v */
    size_t chart;
} chart_size;

static int32_t longer(const chart_size *chart) {
    return chart->size[0] > chart->size[1] ? chart->size[0] : chart->size[1];
}

/* Long charts first, among these the wide ones, then by index: one order on every machine. */
static int by_size(const void *left, const void *right) {
    const chart_size *a = left, *b = right;
    const int32_t long_a = longer(a), long_b = longer(b);

    if (long_a != long_b)
        return long_a > long_b ? -1 : 1;
    const int32_t sum_a = a->size[0] + a->size[1], sum_b = b->size[0] + b->size[1];
    if (sum_a != sum_b)
        return sum_a > sum_b ? -1 : 1;
    return a->chart < b->chart ? -1 : 1;
}

/* False where a chart is so large that its size is no index. */
static bool measure(const atlas_job *job, size_t chart, chart_size *out_size) {
    double extent[2] = {0.0, 0.0};

    for (int64_t c = 3 * job->first_triangles[chart]; c < 3 * job->first_triangles[chart + 1]; ++c)
        for (int axis = 0; axis < 2; ++axis)
            extent[axis] = fmax(extent[axis], job->uvs[2 * c + axis]);
    out_size->chart = chart;
    for (int axis = 0; axis < 2; ++axis) {
        /* the last block within reach of the chart's far end */
        const double end = extent[axis] * job->density + (chart_start + 0.5 + reach_margin) / (double)job->block;
        if (!(end < 1e6))
            return false;
        out_size->size[axis] = (int32_t)floor(end) + 1;
    }
    return true;
}

pl_status pl_pack_charts(const double *uvs, const int64_t *first_triangles, size_t chart_count, double density,
                         int32_t width, int32_t block, int32_t *out_places, int32_t *out_height) {
    if (!(density > 0.0) || width < 1 || block < 1 || width < block)
        return PL_ERR_ARGUMENT;

    atlas_job job = {.uvs = uvs, .first_triangles = first_triangles, .density = density / (double)block};
    pl_status status = PL_ERR_MEMORY;
    int32_t height = 0;
    job.block = block;
    job.columns = width / block;
    job.atlas.words = (job.columns + 2 + WORD_BITS - 1) / WORD_BITS;
    chart_size *order = malloc(sizeof *order * (chart_count + 1));
    uint64_t *scratch = malloc(sizeof *scratch * 2 * (size_t)job.atlas.words);
    if (!order || !scratch || !grow_atlas(&job, 2))
        goto done;
    set_run(row_of(&job.atlas, 0), 0, job.columns + 1);
    job.atlas.free_runs[0] = 0;

    status = PL_ERR_ARGUMENT;
    for (size_t chart = 0; chart < chart_count; ++chart)
        if (!measure(&job, chart, &order[chart]))
            goto done;
    qsort(order, chart_count, sizeof *order, by_size);
    status = PL_OK;
    for (size_t i = 0; i < chart_count && status == PL_OK; ++i)
        status = place_chart(&job, order[i].chart, order[i].size, scratch, out_places + 3 * order[i].chart, &height);
    *out_height = height * block;

done:
    free(order);
    free(scratch);
    free_bitmap(&job.atlas);
    free_bitmap(&job.masks[0]);
    free_bitmap(&job.masks[1]);
    return status;
}
