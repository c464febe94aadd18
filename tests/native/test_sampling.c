/* Scrambled Sobol points, and what is made of them. SPDX-License-Identifier: GPL-3.0-or-later */
#include "check.h"
#include "patches.h"
#include "sampling.h"

#include <math.h>

/*
 * Direction numbers from their definition: of a primitive polynomial over GF(2) of degree s with inner
 * coefficients a, and the first s odd numbers m (Joe & Kuo 2008, new-joe-kuo-6.21201, dimensions 2..4).
 */
typedef struct polynomial {
    uint32_t degree, inner, first[3];
} polynomial;

static uint32_t sobol_by_definition(uint32_t index, polynomial p) {
    uint32_t m[32], point = 0;
    for (uint32_t k = 0; k < 32; ++k) {
        if (k < p.degree) {
            m[k] = p.first[k];
            continue;
        }
        m[k] = m[k - p.degree] ^ (m[k - p.degree] << p.degree);
        for (uint32_t i = 1; i < p.degree; ++i)
            if ((p.inner >> (p.degree - 1 - i)) & 1u)
                m[k] ^= m[k - i] << i;
    }
    for (uint32_t k = 0; k < 32; ++k)
        if ((index >> k) & 1u)
            point ^= m[k] << (31 - k);
    return point;
}

static void directions_are_those_of_the_polynomials(void) {
    const polynomial polynomials[] = {{1, 0, {1, 0, 0}}, {2, 1, {1, 3, 0}}, {3, 1, {1, 3, 1}}};
    for (int dimension = 1; dimension < 4; ++dimension)
        for (uint32_t bit = 0; bit < 32; ++bit) {
            const uint32_t index = (1u << bit) | (bit > 3 ? 5u : 0u);
            CHECK(reverse_bits(sobol_reversed(index, dimension)) ==
                  sobol_by_definition(index, polynomials[dimension - 1]));
        }
    /* dimension 0 is van der Corput's radical inverse */
    for (uint32_t index = 0; index < 100; ++index)
        CHECK(sobol_reversed(index, 0) == index);
}

/* One point in each elementary interval, for every aligned block of 2^bits and every shape of interval. */
static void blocks_are_nets(uint32_t first, uint32_t bits, uint32_t seed) {
    const uint32_t count = 1u << bits;
    for (uint32_t across = 0; across <= bits; ++across) {
        unsigned char taken[1024] = {0};
        for (uint32_t k = first; k < first + count; ++k) {
            const uint32_t x = (uint32_t)(sobol(k, 0, seed) * (float)(1u << across));
            const uint32_t y = (uint32_t)(sobol(k, 1, seed) * (float)(1u << (bits - across)));
            const uint32_t cell = (y << across) | x;
            CHECK(cell < count);
            CHECK(!taken[cell]);
            taken[cell] = 1;
        }
    }
}

/* Every dimension alone: one point in each of 2^bits intervals. */
static void blocks_are_stratified(uint32_t first, uint32_t bits, uint32_t seed) {
    for (int dimension = 0; dimension < 4; ++dimension) {
        unsigned char taken[1024] = {0};
        for (uint32_t k = first; k < first + (1u << bits); ++k) {
            const float x = sobol(k, dimension, seed);
            CHECK(x >= 0 && x < 1);
            const uint32_t cell = (uint32_t)(x * (float)(1u << bits));
            CHECK(!taken[cell]);
            taken[cell] = 1;
        }
    }
}

static void scrambling_keeps_the_net_and_changes_the_points(void) {
    uint32_t same = 0;
    for (uint32_t seed = 0; seed < 20; ++seed)
        for (uint32_t bits = 0; bits <= 10; bits += 2)
            for (uint32_t block = 0; block < 3; ++block) {
                blocks_are_nets(block << bits, bits, hash(seed));
                blocks_are_stratified(block << bits, bits, hash(seed));
            }
    for (uint32_t k = 0; k < 1000; ++k)
        for (int dimension = 0; dimension < 4; ++dimension)
            same += sobol(k, dimension, hash(1)) <= sobol(k, dimension, hash(2)) &&
                    sobol(k, dimension, hash(1)) >= sobol(k, dimension, hash(2));
    CHECK(same < 3); /* 4000 pairs of 24 bits: one in four thousand runs would meet one */
}

/* Over seeds, a scrambled point is anywhere with equal chance: the estimate is unbiased. */
static void a_point_is_uniform_over_seeds(void) {
    enum { CELLS = 16, SEEDS = 16000 };
    for (int dimension = 0; dimension < 4; ++dimension) {
        uint32_t counts[CELLS] = {0};
        double chi_square = 0;
        for (uint32_t seed = 0; seed < SEEDS; ++seed)
            ++counts[(uint32_t)(sobol(7, dimension, hash(seed)) * CELLS)];
        for (int i = 0; i < CELLS; ++i)
            chi_square += pow((double)counts[i] - SEEDS / CELLS, 2) / (SEEDS / CELLS);
        CHECK(chi_square < 37.7); /* 15 degrees of freedom, one false alarm in a thousand */
    }
}

/* Independent numbers in, so that chi-square's assumptions hold: cells of equal chance under cos / pi. */
static void directions_follow_the_cosine(void) {
    enum { RINGS = 8, SECTORS = 12, CELLS = RINGS * SECTORS, SAMPLES = 96000 };
    const vec3 normals[] = {{0, 0, 1}, {0, 0, -1}, {0.6f, -0.8f, 0}, {0.48f, 0.6f, -0.64f}};
    for (uint32_t n = 0; n < 4; ++n) {
        uint32_t counts[CELLS] = {0};
        double chi_square = 0;
        vec3 u, v;
        vec3_basis(normals[n], &u, &v);
        for (uint32_t k = 0; k < SAMPLES; ++k) {
            const vec3 d =
                cosine_direction(unit_float(hash(2 * k + 1)), unit_float(hash(0x80000000u + 2 * k)), u, v, normals[n]);
            const float cosine = vec3_dot(d, normals[n]);
            CHECK(cosine >= 0 && fabsf(vec3_length(d) - 1) < 1e-5f);
            /* sin^2 of the polar angle is uniform under a cosine density */
            const int ring = (int)fminf((1 - cosine * cosine) * RINGS, RINGS - 1);
            const float turn = atan2f(vec3_dot(d, v), vec3_dot(d, u)) / (2 * PL_PI) + 0.5f;
            ++counts[ring * SECTORS + (int)fminf(turn * SECTORS, SECTORS - 1)];
        }
        for (int i = 0; i < CELLS; ++i)
            chi_square += pow((double)counts[i] - SAMPLES / CELLS, 2) / (SAMPLES / CELLS);
        CHECK(chi_square < 143.3); /* 95 degrees of freedom, one false alarm in a thousand */
    }
}

static void bases_are_orthonormal(void) {
    for (uint32_t k = 0; k < 1000; ++k) {
        vec3 n = {unit_float(hash(k)) - 0.5f, unit_float(hash(k + 1000)) - 0.5f, unit_float(hash(k + 2000)) - 0.5f};
        vec3 u, v;
        n = vec3_unit(n);
        vec3_basis(n, &u, &v);
        CHECK(fabsf(vec3_dot(u, v)) < 1e-6f && fabsf(vec3_dot(u, n)) < 1e-6f && fabsf(vec3_dot(v, n)) < 1e-6f);
        CHECK(fabsf(vec3_length(u) - 1) < 1e-6f && fabsf(vec3_length(v) - 1) < 1e-6f);
        CHECK(vec3_dot(vec3_cross(u, v), n) > 0.999f);
    }
}

enum { CELLS = 35, MOST_PIECES = 9 * CELLS };

/* Four triangles in rows of cells, every third of them of 2 x 2 pieces, every fifth of 3 x 3; patches of as many
 * pieces as `joined`, from all over, but for the last ones. */
static pl_patches *cut_up(int32_t joined) {
    const uint8_t apexes[] = {0, 1, 2, 1};
    const int32_t rows[] = {0, 1, 4, 9, 10}, cells[] = {0, 1, 6, 9, 10, 17, 23, 28, 31, 32, CELLS};
    int32_t first_pieces[CELLS + 1] = {0}, owners[MOST_PIECES];
    float areas[MOST_PIECES];
    for (int cell = 0; cell < CELLS; ++cell)
        first_pieces[cell + 1] = first_pieces[cell] + (cell % 5 == 0 ? 9 : cell % 3 == 0 ? 4 : 1);
    const int32_t count = (first_pieces[CELLS] + joined - 1) / joined;
    for (int32_t piece = 0; piece < first_pieces[CELLS]; ++piece) {
        owners[piece] = piece % count;
        areas[piece] = (float)(1 + piece % 7);
    }
    const pl_patch_layout layout = {apexes, rows,         cells, first_pieces, 4, 10, CELLS, joined > 1 ? owners : NULL,
                                    areas,  (size_t)count};
    pl_patches *patches = NULL;
    CHECK(pl_patches_create(&layout, &patches) == PL_OK);
    return patches;
}

/* Round trip: a point of a patch is found in that patch. */
static void points_come_back_to_their_patch(int32_t joined) {
    pl_patches *patches = cut_up(joined);
    uint32_t strayed = 0, tried = 0;
    for (size_t patch = 0; patch < patches->patch_count; ++patch)
        for (uint32_t k = 0; k < 4096 * (uint32_t)joined; ++k) {
            const pl_patch_point p = point_in_patch(patches, patch, sobol(k, 0, hash(3)), sobol(k, 1, hash(3)));
            CHECK(p.weight_1 >= 0 && p.weight_2 >= 0 && p.weight_1 + p.weight_2 <= 1.000001f);
            ++tried;
            if (patch_at(patches, p.triangle, p.weight_1, p.weight_2) != (int32_t)patch)
                ++strayed;
        }
    /* only points within rounding of a border may: borders are some 10 ulp wide, 1e-6 of the points, and off the
       triangle's edges points keep 4e-6 */
    CHECK(tried > 300000 && strayed < 60);
    pl_patches_destroy(patches);
}

/* A wall may stand on any edge: no point rounds to beyond it, whatever the numbers drawn. */
static void points_keep_off_the_edges_of_their_triangle(int32_t joined) {
    const float drawn[] = {0, 0x1p-32f, 0x1p-24f, 0.5f, 1 - 0x1p-24f};
    pl_patches *patches = cut_up(joined);
    for (size_t patch = 0; patch < patches->patch_count; ++patch)
        for (int i = 0; i < 5; ++i)
            for (int j = 0; j < 5; ++j) {
                const pl_patch_point p = point_in_patch(patches, patch, drawn[i], drawn[j]);
                const float least = fminf(fminf(p.weight_1, p.weight_2), 1 - p.weight_1 - p.weight_2);
                CHECK(least > 0x1p-19f); /* positions about as large as the triangle round by 2^-24 of it */
            }
    pl_patches_destroy(patches);
}

/* Of a patch of several pieces each gets points by its area. */
static void pieces_of_a_patch_are_met_by_their_areas(void) {
    enum { POINTS = 1 << 14 };
    pl_patches *patches = cut_up(5);
    for (size_t patch = 0; patch < patches->patch_count; ++patch) {
        const int32_t first = patches->first_members[patch], end = patches->first_members[patch + 1];
        int32_t met[MOST_PIECES] = {0};
        double area = 0;
        for (uint32_t k = 0; k < POINTS; ++k) {
            const pl_patch_point p = point_in_patch(patches, patch, sobol(k, 0, hash(5)), sobol(k, 1, hash(5)));
            ++met[piece_at(patches, p.triangle, p.weight_1, p.weight_2)];
        }
        CHECK(end - first == 4 || end - first == 5);
        for (int32_t k = first; k < end; ++k)
            area += 1 + patches->members[k] % 7;
        for (int32_t k = first; k < end; ++k) {
            const double expected = POINTS * (1 + patches->members[k] % 7) / area;
            /* stratified: a point or two at either border; and few that rounding moves over the border of a piece */
            CHECK(fabs(met[patches->members[k]] - expected) < 6);
        }
    }
    pl_patches_destroy(patches);
}

static void owners_that_do_not_fit_are_refused(void) {
    const uint8_t apexes[] = {0, 0};
    const int32_t one_each[] = {0, 1, 2}, owners[][2] = {{0, 0}, {0, -1}, {0, 2}, {1, 0}};
    const float areas[] = {1, 1};
    for (int i = 0; i < 4; ++i)
        for (size_t count = 0; count < 4; ++count) {
            const pl_patch_layout layout = {apexes, one_each, one_each, one_each, 2, 2, 2, owners[i], areas, count};
            const bool fits = (i == 0 && count == 1) || (i == 3 && count == 2);
            pl_patches *patches = NULL;
            CHECK(pl_patches_create(&layout, &patches) == (fits ? PL_OK : PL_ERR_ARGUMENT));
            if (fits)
                pl_patches_destroy(patches);
        }
}

int main(void) {
    directions_are_those_of_the_polynomials();
    scrambling_keeps_the_net_and_changes_the_points();
    a_point_is_uniform_over_seeds();
    directions_follow_the_cosine();
    bases_are_orthonormal();
    points_come_back_to_their_patch(1);
    points_come_back_to_their_patch(5);
    points_keep_off_the_edges_of_their_triangle(1);
    points_keep_off_the_edges_of_their_triangle(5);
    pieces_of_a_patch_are_met_by_their_areas();
    owners_that_do_not_fit_are_refused();
    return 0;
}
