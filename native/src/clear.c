/* Light through triangles that let some of it pass: glass, thin cloth, what an image cuts out, what some rays miss.
 * SPDX-License-Identifier: GPL-3.0-or-later */
#include "clear.h"

#include "sampling.h"

#include <stdlib.h>

enum { MOST_FACES = 256 }; /* a guard against a stack of faces so close that the distance no longer grows */

static bool maps_are_valid(const pl_clear *clear, size_t triangle_count) {
    for (size_t map = 0; map < clear->map_count; ++map) {
        const int32_t *shape = clear->map_shapes + 3 * map;
        if (shape[0] < 0 || shape[1] < 1 || shape[2] < 1 ||
            (uint64_t)shape[0] + (uint64_t)shape[1] * (uint64_t)shape[2] > clear->pixel_count)
            return false;
    }
    for (size_t t = 0; t < triangle_count; ++t)
        if (clear->maps[t] < -1 || (clear->maps[t] >= 0 && (size_t)clear->maps[t] >= clear->map_count))
            return false;
    return true;
}

pl_status clear_copy(const pl_clear *from, size_t triangle_count, pl_clear *out_clear) {
    if (!maps_are_valid(from, triangle_count))
        return PL_ERR_ARGUMENT;
    *out_clear = (pl_clear){.transmittance = copy_of(from->transmittance, 3 * sizeof(float) * triangle_count),
                            .flags = copy_of(from->flags, triangle_count),
                            .maps = copy_of(from->maps, sizeof(int32_t) * triangle_count),
                            /* without a map nothing is looked up, and three million triangles have 72 MB of these */
                            .uvs = copy_of(from->uvs, from->map_count ? 6 * sizeof(float) * triangle_count : 0),
                            .map_shapes = copy_of(from->map_shapes, 3 * sizeof(int32_t) * from->map_count),
                            .map_count = from->map_count,
                            .pixels = copy_of(from->pixels, 3 * sizeof(float) * from->pixel_count),
                            .pixel_count = from->pixel_count};
    const bool is_complete = out_clear->transmittance && out_clear->flags && out_clear->maps && out_clear->uvs &&
                             out_clear->map_shapes && out_clear->pixels;
    return is_complete ? PL_OK : PL_ERR_MEMORY;
}

void clear_destroy(pl_clear *clear) {
    const void *const copies[] = {clear->transmittance, clear->flags,      clear->maps,
                                  clear->uvs,           clear->map_shapes, clear->pixels};
    for (size_t k = 0; k < sizeof copies / sizeof *copies; ++k)
        free((void *)copies[k]);
}

/* A place along a side of a map, from -0.5 at its begin to size - 0.5; 0 of what is not a number. */
static float place_along(float coordinate, int32_t size, bool extends) {
    const float within = extends ? lesser(greater(coordinate, 0), 1) : coordinate - floorf(coordinate);
    return (within >= 0 && within <= 1 ? within : 0) * (float)size - 0.5f;
}

/* The texel of a row's or a column's number, which may be one beyond the map. */
static size_t texel_along(int32_t number, int32_t size, bool extends) {
    if (extends)
        return (size_t)(number < 0 ? 0 : number < size ? number : size - 1);
    return (size_t)((number + size) % size);
}

/* Multiply io_rgb by a map, bilinearly. */
static void multiply_by_map(const pl_clear *clear, int32_t map, bool extends, float u, float v, float io_rgb[3]) {
    const int32_t height = clear->map_shapes[3 * map + 1], width = clear->map_shapes[3 * map + 2];
    const float *pixels = clear->pixels + 3 * (size_t)clear->map_shapes[3 * map];
    const float x = place_along(u, width, extends), y = place_along(v, height, extends);
    const float right = x - floorf(x), up = y - floorf(y);
    const int32_t column = (int32_t)floorf(x), row = (int32_t)floorf(y);
    float sum[3] = {0, 0, 0};
    for (int corner = 0; corner < 4; ++corner) {
        const int is_right = corner & 1, is_up = corner >> 1;
        const size_t c = texel_along(column + is_right, width, extends), r = texel_along(row + is_up, height, extends);
        const float weight = (is_right ? right : 1 - right) * (is_up ? up : 1 - up);
        for (size_t k = 0; k < 3; ++k)
            sum[k] += weight * pixels[3 * (r * (size_t)width + c) + k];
    }
    for (int k = 0; k < 3; ++k)
        io_rgb[k] *= sum[k];
}

/* What a clear triangle lets through at the point hit. */
static void transmittance_at(const pl_clear *clear, const pl_hit *hit, float out_rgb[3]) {
    const size_t triangle = (size_t)hit->triangle;
    for (size_t k = 0; k < 3; ++k)
        out_rgb[k] = clear->transmittance[3 * triangle + k];
    if (clear->maps[triangle] < 0)
        return;
    const float *uv = clear->uvs + 6 * triangle;
    const float u = uv[0] + hit->u * (uv[2] - uv[0]) + hit->v * (uv[4] - uv[0]);
    const float v = uv[1] + hit->u * (uv[3] - uv[1]) + hit->v * (uv[5] - uv[1]);
    multiply_by_map(clear, clear->maps[triangle], clear->flags[triangle] & PL_MAP_EXTENDS, u, v, out_rgb);
}

/* A number of [0, 1) that hangs on nothing but where a ray hits. */
static float number_of(const pl_hit *hit) {
    const union {
        float number;
        uint32_t bits;
    } u = {hit->u}, v = {hit->v}, distance = {hit->distance};
    return unit_float(hash_pair(hash_pair(u.bits, v.bits), hash_pair(distance.bits, (uint32_t)hit->triangle)));
}

/* Whether a ray passes a clear triangle as if it were not there: of one kind of rays, or on an open side. */
static bool misses(const pl_clear *clear, const pl_hit *hit, pl_clear_flags kind) {
    return clear->flags[hit->triangle] & (kind | (hit->is_back ? PL_BACK_OPEN : PL_FRONT_OPEN));
}

bool transmit(const pl_scene *scene, vec3 origin, vec3 direction, float far, float io_rgb[3]) {
    float near = 0;
    if (!scene->clear_layer.bvh)
        return true;
    for (int faces = 0; faces < MOST_FACES; ++faces) {
        const pl_hit hit = clear_hit(scene, origin, direction, near, far);
        if (hit.triangle < 0)
            break;
        near = nextafterf(hit.distance, INFINITY);
        if (misses(&scene->clear, &hit, PL_SHADOWS_MISS))
            continue;
        float through[3];
        transmittance_at(&scene->clear, &hit, through);
        for (int k = 0; k < 3; ++k)
            io_rgb[k] *= through[k];
    }
    return io_rgb[0] > 0 || io_rgb[1] > 0 || io_rgb[2] > 0;
}

/* The first triangle from `near` on that stops a scattered ray; of one with an open side, where `minds_open`, its other
 * side alone. */
static pl_hit stop_from(const pl_scene *scene, vec3 origin, vec3 direction, float near, bool minds_open,
                        float io_rgb[3]) {
    const pl_hit end = closest_hit(scene, origin, direction, near);
    if (!scene->clear_layer.bvh)
        return end;
    for (int faces = 0; faces < MOST_FACES; ++faces) {
        const pl_hit hit = clear_hit(scene, origin, direction, near, end.distance);
        if (hit.triangle < 0)
            break;
        near = nextafterf(hit.distance, INFINITY);
        const uint8_t flags = scene->clear.flags[hit.triangle];
        if (minds_open ? misses(&scene->clear, &hit, PL_RAYS_MISS) : (bool)(flags & PL_RAYS_MISS))
            continue;
        float through[3], passing = 1;
        transmittance_at(&scene->clear, &hit, through);
        if (flags & PL_RAYS_STOP) {
            /* exact for grey: nothing is lost then */
            passing = through[1] + ((through[0] - through[1]) + (through[2] - through[1])) / 3;
            if (number_of(&hit) >= passing)
                return hit;
        }
        for (int k = 0; k < 3; ++k)
            io_rgb[k] *= through[k] / passing;
    }
    return end;
}

pl_hit first_stop(const pl_scene *scene, vec3 origin, vec3 direction, float io_rgb[3]) {
    return stop_from(scene, origin, direction, 0, true, io_rgb);
}

pl_hit next_landing(const pl_scene *scene, vec3 origin, vec3 direction, float *io_near, float io_rgb[3]) {
    const pl_hit hit = stop_from(scene, origin, direction, *io_near, false, io_rgb);
    *io_near = INFINITY;
    if (hit.triangle < 0 || !scene->clear_layer.bvh)
        return hit;
    const uint8_t flags = scene->clear.flags[hit.triangle];
    if (flags & (hit.is_back ? PL_BACK_OPEN : PL_FRONT_OPEN))
        return (pl_hit){.triangle = -1, .distance = hit.distance};
    if (flags & (PL_BACK_OPEN | PL_FRONT_OPEN))
        *io_near = nextafterf(hit.distance, INFINITY);
    return hit;
}
