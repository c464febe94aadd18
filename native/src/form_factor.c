/*
 * Form factors by rays: Monte Carlo and hemicube.
 *
 * Cohen & Greenberg 1985, "The Hemi-Cube"; Burley 2020, "Practical Hash-based Owen Scrambling".
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "clear.h"
#include "patches.h"

#include <string.h>

/* Add a ray's share to the entry of what it hits, less what clear triangles take of it: in grey, as a row is one. */
static void deposit(const pl_scene *scene, const pl_patches *patches, vec3 origin, vec3 direction, double share,
                    double *row) {
    float through[3] = {1, 1, 1};
    const pl_hit hit = first_stop(scene, origin, direction, through);
    if (hit.triangle >= 0)
        row[hit_side(patches, &hit)] += share * (double)(through[0] + through[1] + through[2]) / 3;
}

static bool sides_are_in_range(const pl_patches *patches, const int32_t *sides, size_t count) {
    for (size_t i = 0; i < count; ++i)
        if (sides[i] < 0 || (size_t)sides[i] >= 2 * patches->patch_count)
            return false;
    return true;
}

pl_status pl_form_factors_monte_carlo(const pl_scene *scene, const pl_patches *patches, const int32_t *sides,
                                      size_t count, uint32_t rays, uint32_t seed, double *out_rows) {
    const size_t side_count = 2 * patches->patch_count;
    if (rays == 0 || !sides_are_in_range(patches, sides, count))
        return PL_ERR_ARGUMENT;
    memset(out_rows, 0, sizeof(double) * side_count * count);
    for (size_t i = 0; i < count; ++i) {
        const size_t side = (size_t)sides[i];
        const uint32_t side_seed = hash_pair(seed, (uint32_t)side);
        for (uint32_t k = 0; k < rays; ++k) {
            const pl_side_point from = side_point(scene, patches, side, sobol(k, 0, side_seed), sobol(k, 1, side_seed));
            const vec3 direction =
                cosine_direction(sobol(k, 2, side_seed), sobol(k, 3, side_seed), from.u, from.v, from.normal);
            deposit(scene, patches, from.origin, direction, 1 / (double)rays, out_rows + i * side_count);
        }
    }
    return PL_OK;
}

/* Delta form factor of a pixel of area 1 at (x, y) of the top face z = 1 [Cohen & Greenberg, eq. 12]. */
static float delta_top(float x, float y) {
    const float square = x * x + y * y + 1;
    return 1 / (PL_PI * square * square);
}

/* The same at height z of a side face, distance 1 from the axis [Cohen & Greenberg, eq. 13]. */
static float delta_side(float y, float z) {
    const float square = y * y + z * z + 1;
    return z / (PL_PI * square * square);
}

/* Where in its pixel each ray of a hemicube goes through, from (0, 0) to (1, 1): the same in all pixels. */
typedef struct pixel_point {
    float x, y;
} pixel_point;

/* Pixel `k` of a half cube of width 2 and height 1: its direction in (u, v, n), returns its delta factor, not yet
 * normalised. */
static float hemicube_pixel(uint32_t k, uint32_t resolution, pixel_point at, vec3 *out_direction) {
    const uint32_t top = resolution * resolution;
    const float step = 2 / (float)resolution;
    if (k < top) {
        const float x = ((float)(k % resolution) + at.x) * step - 1;
        const float y = ((float)(k / resolution) + at.y) * step - 1;
        *out_direction = (vec3){x, y, 1};
        return delta_top(x, y);
    }
    const uint32_t face = (k - top) / (top / 2), pixel = (k - top) % (top / 2);
    const float y = ((float)(pixel % resolution) + at.x) * step - 1;
    const float z = ((float)(pixel / resolution) + at.y) * step;
    const vec3 around[4] = {{1, y, z}, {-1, y, z}, {y, 1, z}, {y, -1, z}};
    *out_direction = around[face];
    return delta_side(y, z);
}

/* Sum of all delta factors before normalising. */
static double hemicube_sum(uint32_t resolution, pixel_point at) {
    double sum = 0;
    vec3 direction;
    for (uint32_t k = 0; k < 3 * resolution * resolution; ++k)
        sum += (double)hemicube_pixel(k, resolution, at, &direction);
    return sum;
}

static void hemicube_at(const pl_scene *scene, const pl_patches *patches, const pl_side_point *from, float turn,
                        pixel_point at, uint32_t resolution, double share, double *row) {
    const float cosine = cosf(turn), sine = sinf(turn);
    const vec3 u = vec3_mul_add(from->u, cosine, vec3_scale(from->v, sine));
    const vec3 v = vec3_mul_add(from->v, cosine, vec3_scale(from->u, -sine));
    const double normalised = share / hemicube_sum(resolution, at);
    for (uint32_t k = 0; k < 3 * resolution * resolution; ++k) {
        vec3 local;
        const float delta = hemicube_pixel(k, resolution, at, &local);
        const vec3 across = vec3_mul_add(u, local.x, vec3_scale(v, local.y));
        deposit(scene, patches, from->origin, vec3_mul_add(from->normal, local.z, across), (double)delta * normalised,
                row);
    }
}

pl_status pl_form_factors_hemicube(const pl_scene *scene, const pl_patches *patches, const int32_t *sides, size_t count,
                                   uint32_t resolution, uint32_t positions, uint32_t seed, double *out_rows) {
    const size_t side_count = 2 * patches->patch_count;
    if (resolution < 2 || resolution % 2 || resolution > 1 << 14 || positions == 0 ||
        !sides_are_in_range(patches, sides, count))
        return PL_ERR_ARGUMENT;
    memset(out_rows, 0, sizeof(double) * side_count * count);
    for (size_t i = 0; i < count; ++i) {
        const size_t side = (size_t)sides[i];
        const uint32_t side_seed = hash_pair(seed, (uint32_t)side);
        /* a fifth coordinate, of a sequence of its own */
        const uint32_t fifth_seed = hash_pair(side_seed, 4);
        for (uint32_t k = 0; k < positions; ++k) {
            const pl_side_point from = side_point(scene, patches, side, sobol(k, 0, side_seed), sobol(k, 1, side_seed));
            const float turn = 2 * PL_PI * sobol(k, 2, side_seed);
            const pixel_point at = {sobol(k, 3, side_seed), sobol(k, 0, fifth_seed)};
            hemicube_at(scene, patches, &from, turn, at, resolution, 1 / (double)positions, out_rows + i * side_count);
        }
    }
    return PL_OK;
}
