/*
 * Charts in an atlas, under sanitizers: random charts of all sizes are packed and rasterised, and keep apart.
 *
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#undef NDEBUG
#include "patchlight.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

enum { MOST_CHARTS = 60, MOST_TRIANGLES = 5 * MOST_CHARTS, MOST_ROWS = 4000 };

typedef struct atlas {
    double uvs[MOST_TRIANGLES * 6];
    float texel_uvs[MOST_TRIANGLES * 6];
    int32_t first_triangles[MOST_CHARTS + 1];
    int32_t owners[MOST_TRIANGLES];
    int32_t places[3 * MOST_CHARTS];
    int32_t chart_count, triangle_count, width, height, block;
    size_t upright;
    double density;
} atlas;

static uint32_t state;

static uint32_t next_random(void) {
    state = state * 1664525u + 1013904223u;
    return state >> 8;
}

static double uniform(void) { return (double)next_random() / (double)(1 << 24); }

/* Charts of 1 cm to 10 m, in some atlases needles. */
static void make_charts(atlas *made, uint32_t seed) {
    state = seed;
    made->chart_count = 1 + (int32_t)(next_random() % MOST_CHARTS);
    made->triangle_count = 0;
    for (int32_t chart = 0; chart < made->chart_count; ++chart) {
        made->first_triangles[chart] = made->triangle_count;
        const int32_t end = made->triangle_count + 1 + (int32_t)(next_random() % 5);
        const double size = pow(10.0, 3.0 * uniform() - 2.0), aspect = seed % 3 == 0 ? 0.01 : 1.0;
        for (; made->triangle_count < end; ++made->triangle_count) {
            made->owners[made->triangle_count] = chart;
            for (int32_t i = 0; i < 6; ++i)
                made->uvs[6 * made->triangle_count + i] = size * uniform() * (i % 2 ? aspect : 1.0);
        }
    }
    made->first_triangles[made->chart_count] = made->triangle_count;
    made->block = 1 + (int32_t)(next_random() % 3);
    made->upright = next_random() % (uint32_t)(made->chart_count + 1);
    made->width = made->block + (int32_t)(next_random() % 300);
    made->density = pow(10.0, 2.0 * uniform() - 1.0);
}

static pl_status pack(atlas *made) {
    return pl_pack_charts(made->uvs, (size_t)made->triangle_count, made->first_triangles, (size_t)made->chart_count,
                          made->upright, made->density, made->width, made->block, made->places, &made->height);
}

static void place_charts(atlas *made) {
    for (int32_t corner = 0; corner < 3 * made->triangle_count; ++corner) {
        const int32_t *place = made->places + 3 * made->owners[corner / 3];
        for (int32_t axis = 0; axis < 2; ++axis) {
            const double along = made->uvs[2 * corner + (place[2] ? 1 - axis : axis)] * made->density;
            made->texel_uvs[2 * corner + axis] = (float)(along + place[axis] * made->block + PL_CHART_START);
        }
    }
}

static bool may_touch(const atlas *made, int32_t one, int32_t other) {
    return one < 0 || other < 0 || made->owners[one] == made->owners[other];
}

/* No two texels side by side, diagonals included, serve two charts. */
static void check_gutters(const atlas *made) {
    const size_t texels = (size_t)made->width * (size_t)made->height;
    int32_t *triangles = malloc(sizeof *triangles * texels);
    float *distances = malloc(sizeof *distances * texels), *barycentrics = malloc(sizeof *barycentrics * 3 * texels);

    assert(triangles && distances && barycentrics);
    assert(pl_rasterise_texels(made->texel_uvs, (size_t)made->triangle_count, made->width, made->height, triangles,
                               distances, barycentrics) == PL_OK);
    for (int32_t row = 0; row + 1 < made->height; ++row) {
        for (int32_t column = 0; column + 1 < made->width; ++column) {
            const int32_t *here = triangles + row * made->width + column, *above = here + made->width;
            assert(may_touch(made, here[0], here[1]));
            assert(may_touch(made, here[0], above[0]));
            assert(may_touch(made, here[0], above[1]));
            assert(may_touch(made, here[1], above[0]));
        }
    }
    free(triangles);
    free(distances);
    free(barycentrics);
}

static void random_charts_keep_apart(void) {
    static atlas made;
    int packed = 0;

    for (uint32_t seed = 1; seed <= 200; ++seed) {
        make_charts(&made, seed);
        const pl_status status = pack(&made);
        assert(status == PL_OK || status == PL_ERR_ARGUMENT); /* a chart may be wider than the atlas */
        if (status != PL_OK || made.height > MOST_ROWS)
            continue;
        ++packed;
        for (int32_t chart = made.chart_count - (int32_t)made.upright; chart < made.chart_count; ++chart)
            assert(made.places[3 * chart + 2] == 0);
        place_charts(&made);
        check_gutters(&made);
    }
    assert(packed > 100);
}

static void bad_arguments_are_refused(void) {
    static atlas made;

    make_charts(&made, 7);
    made.width = made.block = 4;
    made.density = -1.0;
    assert(pack(&made) == PL_ERR_ARGUMENT);
    made.density = (double)NAN;
    assert(pack(&made) == PL_ERR_ARGUMENT);
    made.density = 1e300;
    assert(pack(&made) == PL_ERR_ARGUMENT);
    made.density = 1.0;
    made.block = 0;
    assert(pack(&made) == PL_ERR_ARGUMENT);
    made.block = 4;
    made.upright = (size_t)made.chart_count + 1;
    assert(pack(&made) == PL_ERR_ARGUMENT);
    made.upright = 0;
    made.first_triangles[made.chart_count] += 1;
    assert(pack(&made) == PL_ERR_ARGUMENT);
}

static void no_charts_need_no_rows(void) {
    static atlas made;

    made.width = made.block = 1;
    made.density = 1.0;
    made.height = 9;
    assert(pack(&made) == PL_OK);
    assert(made.height == 0);
}

int main(void) {
    random_charts_keep_apart();
    bad_arguments_are_refused();
    no_charts_need_no_rows();
    return 0;
}
