/*
 * Quasi-random points that hang on nothing but their index and a seed.
 *
 * Sobol's first four dimensions (Joe & Kuo 2008), scrambled by a hash that acts as Owen's nested uniform
 * scrambling (Laine & Karras 2011; Burley 2020; constants of Vegdahl 2021).
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#ifndef PATCHLIGHT_SAMPLING_H
#define PATCHLIGHT_SAMPLING_H

#include "vec3.h"

#include <stddef.h>
#include <stdint.h>

static inline uint32_t hash(uint32_t x) {
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    x ^= x >> 16;
    return x;
}

static inline uint32_t hash_pair(uint32_t a, uint32_t b) { return hash(a ^ (hash(b) + 0x9e3779b9u)); }

static inline uint32_t reverse_bits(uint32_t x) {
    x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
    return __builtin_bswap32(x);
}

/* Owen scrambling of a number given with its bits reversed; each bit depends on the more significant ones. */
static inline uint32_t scramble_reversed(uint32_t x, uint32_t seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return reverse_bits(x);
}

static inline float unit_float(uint32_t x) { return (float)(x >> 8) * 5.9604644775390625e-8f; }

/* Point `index` of Sobol's sequence in dimension 2 or 3, its 32 bits reversed. */
uint32_t sobol_by_columns(uint32_t index, int dimension);

/*
 * The same in any dimension. Dimension 0 is the radical inverse. Column k of dimension 1 is (1 + x)^k over GF(2), so
 * the point is the index as a polynomial at x + 1: each coefficient takes those whose place has all of its bits.
 */
static inline uint32_t sobol_reversed(uint32_t index, int dimension) {
    if (dimension > 1)
        return sobol_by_columns(index, dimension);
    if (dimension == 1) {
        index ^= (index & 0xaaaaaaaau) >> 1;
        index ^= (index & 0xccccccccu) >> 2;
        index ^= (index & 0xf0f0f0f0u) >> 4;
        index ^= (index & 0xff00ff00u) >> 8;
        index ^= index >> 16;
    }
    return index;
}

/* Coordinate of a scrambled point in [0, 1). Each dimension needs a seed of its own. */
static inline float sobol(uint32_t index, int dimension, uint32_t seed) {
    return unit_float(scramble_reversed(sobol_reversed(index, dimension), hash_pair(seed, (uint32_t)dimension)));
}

/* Cosine-weighted direction about the normal, in the basis (u, v, n). */
static inline vec3 cosine_direction(float x, float y, vec3 u, vec3 v, vec3 n) {
    const float radius = sqrtf(x), angle = 2 * PL_PI * y;
    const vec3 across = vec3_mul_add(u, radius * cosf(angle), vec3_scale(v, radius * sinf(angle)));
    return vec3_mul_add(n, sqrtf(greater(1 - x, 0)), across);
}

#endif
