/*
 * Charts into an atlas: bottom-left first fit of the charts' real outlines, largest first, on a bitmap
 * of blocks. Outlines and not bounding boxes, so that small charts fill window openings and the notches
 * of L-shaped floors; the same footprint as the rasteriser's, so that no texel can serve two charts.
 *
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "patchlight.h"

#include "bitmap.h"
#include "footprint.h"

#include <stdlib.h>
#include <string.h>

enum { PROBES = 8 };

/* How far a texel reaches beyond 1: UVs are stored as float, and a chart must not touch a texel more
   when its last digit is rounded. Charts start so far into their first texel that the one before stays out. */
static const double reach_margin = 0.003;
static const double chart_start = PL_CHART_START;

typedef struct place {
    int32_t column, row;
} place;

typedef struct rectangle {
    int32_t columns, rows;
    int32_t row; /* no row below has room for it */
} rectangle;

typedef struct atlas_job {
    const double *uvs;
    const int32_t *first_triangles;
    size_t turnable; /* so many charts, the first ones, may be turned */
    double density;  /* blocks per unit */
    int32_t block;
    int32_t columns;    /* of the atlas, in blocks */
    pl_bitmap atlas;    /* with a rim of one block, so that a gutter never leaves it */
    pl_bitmap masks[2]; /* of one chart: as it is, and turned (axes swapped) */
    int32_t mask_columns[2];
    rectangle last[2]; /* where the last chart without notches was found a place */
} atlas_job;

/* Atlas rows up to `rows` exist; a new row is free inside, its rim taken. */
static bool grow_atlas(atlas_job *job, int32_t rows) {
    pl_bitmap *atlas = &job->atlas;

    if (!pl_bitmap_reserve(atlas, rows))
        return false;
    for (; atlas->rows < rows; ++atlas->rows) {
        memset(pl_bitmap_row(atlas, atlas->rows), 0, sizeof *atlas->bits * (size_t)atlas->words);
        pl_bits_set_run(pl_bitmap_row(atlas, atlas->rows), 0, 0);
        pl_bits_set_run(pl_bitmap_row(atlas, atlas->rows), job->columns + 1, atlas->words * PL_WORD_BITS - 1);
        atlas->longest_runs[atlas->rows] = job->columns;
    }
    return true;
}

/* The blocks that a chart touches, as bits. */
static bool draw_mask(atlas_job *job, size_t chart, bool is_turned, const int32_t size[2]) {
    pl_bitmap *mask = &job->masks[is_turned];
    const int32_t columns = size[is_turned], rows = size[!is_turned];
    const double reach = 0.5 + (0.5 + reach_margin) / (double)job->block; /* of a block's centre, in blocks */
    const double start = chart_start / (double)job->block;

    mask->words = (columns + PL_WORD_BITS - 1) / PL_WORD_BITS;
    mask->capacity = 0; /* rows have another length now */
    if (!pl_bitmap_reserve(mask, rows))
        return false;
    mask->rows = rows;
    job->mask_columns[is_turned] = columns;
    memset(mask->bits, 0, sizeof *mask->bits * (size_t)mask->words * (size_t)rows);

    for (int32_t t = job->first_triangles[chart]; t < job->first_triangles[chart + 1]; ++t) {
        double corners[3][2], bottom = INFINITY, top = -INFINITY;
        for (int k = 0; k < 3; ++k) {
            corners[k][is_turned] = job->uvs[6 * (size_t)t + 2 * (size_t)k] * job->density + start;
            corners[k][!is_turned] = job->uvs[6 * (size_t)t + 2 * (size_t)k + 1] * job->density + start;
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
            pl_bits_set_run(pl_bitmap_row(mask, row), first, last);
        }
    }
    for (int32_t row = 0; row < rows; ++row) {
        mask->run_starts[row] = 0;
        mask->longest_runs[row] = pl_bits_longest_run(pl_bitmap_row(mask, row), columns, true, &mask->run_starts[row]);
    }
    return true;
}

/* Rows of the mask that are asked for all columns at once, before columns are tried one by one: spread
   evenly, the one with the longest run first. */
static int32_t choose_probes(const pl_bitmap *mask, int32_t probes[PROBES + 1]) {
    const int32_t count = mask->rows < PROBES ? mask->rows : PROBES;
    int32_t widest = 0;

    for (int32_t row = 1; row < mask->rows; ++row)
        if (mask->longest_runs[row] > mask->longest_runs[widest])
            widest = row;
    probes[0] = widest;
    for (int32_t p = 0; p < count; ++p)
        probes[p + 1] = count > 1 ? (int32_t)((int64_t)p * (mask->rows - 1) / (count - 1)) : 0;
    return count + 1;
}

/* The leftmost place in one row of the atlas, or -1; scratch holds two rows. */
static int32_t fit_in_row(const atlas_job *job, bool is_turned, const int32_t *probes, int32_t probe_count, int32_t row,
                          uint64_t *scratch) {
    const pl_bitmap *atlas = &job->atlas, *mask = &job->masks[is_turned];
    const int32_t words = atlas->words;
    uint64_t *conflicts = scratch + words;

    for (int32_t p = 0; p < probe_count; ++p)
        if (atlas->longest_runs[row + probes[p]] < mask->longest_runs[probes[p]])
            return -1;
    memset(conflicts, 0, sizeof *conflicts * (size_t)words);
    pl_bits_set_run(conflicts, 0, 0);
    pl_bits_set_run(conflicts, job->columns + 2 - job->mask_columns[is_turned], words * PL_WORD_BITS - 1);
    for (int32_t p = 0; p < probe_count; ++p) {
        const int32_t probe = probes[p];
        if (mask->longest_runs[probe] == 0)
            continue;
        pl_bits_add_conflicts(pl_bitmap_row(atlas, row + probe), words, mask->run_starts[probe],
                              mask->longest_runs[probe], scratch, conflicts);
        if (pl_bits_is_full(conflicts, words))
            return -1;
    }
    const int32_t end = words * PL_WORD_BITS;
    int32_t collision = 0;
    for (int32_t column = pl_bits_next(conflicts, 0, end, false); column < end;
         column = pl_bits_next(conflicts, column + 1, end, false)) {
        collision = pl_bitmap_collision(atlas, mask, column, row, collision);
        if (collision < 0)
            return column;
    }
    return -1;
}

static bool is_rectangle(const pl_bitmap *mask, int32_t columns) {
    for (int32_t row = 0; row < mask->rows; ++row)
        if (mask->longest_runs[row] != columns)
            return false;
    return true;
}

/* The lowest row, then the leftmost column, that takes the mask without reaching above `ceiling`. */
static bool find_place(atlas_job *job, bool is_turned, int32_t ceiling, uint64_t *scratch, place *out_place) {
    const pl_bitmap *mask = &job->masks[is_turned];
    rectangle *last = &job->last[is_turned];
    const int32_t columns = job->mask_columns[is_turned];
    const bool is_repeated = last->columns == columns && last->rows == mask->rows && is_rectangle(mask, columns);
    int32_t probes[PROBES + 1];
    const int32_t probe_count = choose_probes(mask, probes);

    if (columns > job->columns)
        return false;
    /* the atlas only fills up: where there was no room for this rectangle, there is none now */
    int32_t row = is_repeated ? last->row : 1;
    int32_t column = -1;
    for (; row + mask->rows <= ceiling; ++row) {
        column = fit_in_row(job, is_turned, probes, probe_count, row, scratch);
        if (column >= 0)
            break;
    }
    if (is_repeated || is_rectangle(mask, columns))
        *last = (rectangle){columns, mask->rows, row};
    *out_place = (place){column, row};
    return column >= 0;
}

/* Mark the mask and a gutter of one block around it as taken. */
static void take(atlas_job *job, bool is_turned, place at) {
    pl_bitmap *atlas = &job->atlas;
    const pl_bitmap *mask = &job->masks[is_turned];
    const int32_t columns = job->mask_columns[is_turned];
    int32_t unused;

    for (int32_t r = 0; r < mask->rows; ++r) {
        const uint64_t *bits = pl_bitmap_row(mask, r);
        for (int32_t start = pl_bits_next(bits, 0, columns, true); start < columns;) {
            const int32_t end = pl_bits_next(bits, start, columns, false);
            for (int32_t side = -1; side <= 1; ++side)
                pl_bits_set_run(pl_bitmap_row(atlas, at.row + r + side), at.column + start - 1, at.column + end);
            start = pl_bits_next(bits, end, columns, true);
        }
    }
    for (int32_t row = at.row - 1; row <= at.row + mask->rows; ++row)
        atlas->longest_runs[row] = pl_bits_longest_run(pl_bitmap_row(atlas, row), job->columns + 2, false, &unused);
}

static pl_status place_chart(atlas_job *job, size_t chart, const int32_t size[2], uint64_t *scratch, int32_t *out_place,
                             int32_t *io_height) {
    const bool can_turn = chart < job->turnable && (size[0] != size[1] || size[0] > 2);
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

/* The side counts twice: a long frame leaves more holes for others than a compact chart of its area. */
static int32_t weight(const chart_size *chart) {
    const int32_t u = chart->size[0], v = chart->size[1];
    return u + v + (u > v ? u : v);
}

/* Long charts first, equal ones one after the other, then by index: one order on every machine. */
static int by_weight(const void *left, const void *right) {
    const chart_size *a = left, *b = right;
    const int32_t weight_a = weight(a), weight_b = weight(b);

    if (weight_a != weight_b)
        return weight_a > weight_b ? -1 : 1;
    if (a->size[0] != b->size[0])
        return a->size[0] > b->size[0] ? -1 : 1;
    return a->chart < b->chart ? -1 : 1;
}

/* False where a corner is negative or no number, or a chart so large that its size is no index. */
static bool measure(const atlas_job *job, size_t chart, chart_size *out_size) {
    double extent[2] = {0.0, 0.0};

    for (size_t c = 3 * (size_t)job->first_triangles[chart]; c < 3 * (size_t)job->first_triangles[chart + 1]; ++c)
        for (int axis = 0; axis < 2; ++axis) {
            if (!(job->uvs[2 * c + (size_t)axis] >= 0.0))
                return false;
            extent[axis] = fmax(extent[axis], job->uvs[2 * c + (size_t)axis]);
        }
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

static bool are_runs(const int32_t *first, size_t count, size_t end) {
    for (size_t i = 0; i < count; ++i)
        if (first[i + 1] < first[i])
            return false;
    return first[0] == 0 && (size_t)first[count] == end;
}

pl_status pl_pack_charts(const double *uvs, size_t triangle_count, const int32_t *first_triangles, size_t chart_count,
                         size_t upright, double density, int32_t width, int32_t block, int32_t *out_places,
                         int32_t *out_height) {
    if (!(density > 0.0) || upright > chart_count || block < 1 || width < block || width > PL_WIDEST_ATLAS ||
        !are_runs(first_triangles, chart_count, triangle_count))
        return PL_ERR_ARGUMENT;

    atlas_job job = {.uvs = uvs, .first_triangles = first_triangles, .density = density / (double)block};
    pl_status status = PL_ERR_MEMORY;
    int32_t height = 0;
    job.turnable = chart_count - upright;
    job.block = block;
    job.columns = width / block;
    job.atlas.words = (job.columns + 2 + PL_WORD_BITS - 1) / PL_WORD_BITS;
    chart_size *order = malloc(sizeof *order * (chart_count + 1));
    uint64_t *scratch = malloc(sizeof *scratch * 2 * (size_t)job.atlas.words);
    if (!order || !scratch || !grow_atlas(&job, 2))
        goto done;
    pl_bits_set_run(pl_bitmap_row(&job.atlas, 0), 0, job.columns + 1);
    job.atlas.longest_runs[0] = 0;

    status = PL_ERR_ARGUMENT;
    for (size_t chart = 0; chart < chart_count; ++chart)
        if (!measure(&job, chart, &order[chart]))
            goto done;
    qsort(order, chart_count, sizeof *order, by_weight);
    status = PL_OK;
    for (size_t i = 0; i < chart_count && status == PL_OK; ++i)
        status = place_chart(&job, order[i].chart, order[i].size, scratch, out_places + 3 * order[i].chart, &height);
    *out_height = height * block;

done:
    free(order);
    free(scratch);
    pl_bitmap_free(&job.atlas);
    pl_bitmap_free(&job.masks[0]);
    pl_bitmap_free(&job.masks[1]);
    return status;
}
