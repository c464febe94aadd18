/* Rays through the scene. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_SCENE_H
#define PATCHLIGHT_SCENE_H

#include "embree.h"
#include "vec3.h"

#include <stdbool.h>

/* Triangles that share a BVH, and which of the scene's triangles each is. */
typedef struct pl_layer {
    RTCScene bvh;
    int32_t *triangles;
} pl_layer;

struct pl_scene {
    const pl_embree *embree;
    double centre[3];
    float reach;     /* largest coordinate of a vertex */
    float *vertices; /* re-centred */
    int32_t *indices;
    size_t vertex_count, triangle_count;
    pl_clear clear; /* copies; all NULL where all is opaque */
    pl_layer opaque;
    pl_layer clear_layer; /* bvh NULL where all is opaque */
};

typedef struct pl_hit {
    int32_t triangle; /* -1: nothing */
    float u, v, distance;
    bool is_back;
} pl_hit;

static inline vec3 scene_vertex(const pl_scene *scene, int32_t triangle, int corner) {
    return vec3_from(scene->vertices + 3 * (size_t)scene->indices[3 * (size_t)triangle + (size_t)corner]);
}

static inline vec3 scene_normal(const pl_scene *scene, int32_t triangle) {
    const vec3 a = scene_vertex(scene, triangle, 0);
    return vec3_unit(
        vec3_cross(vec3_sub(scene_vertex(scene, triangle, 1), a), vec3_sub(scene_vertex(scene, triangle, 2), a)));
}

static inline vec3 scene_point(const pl_scene *scene, int32_t triangle, float weight_1, float weight_2) {
    const vec3 a = scene_vertex(scene, triangle, 0);
    const vec3 b = vec3_sub(scene_vertex(scene, triangle, 1), a);
    const vec3 c = vec3_sub(scene_vertex(scene, triangle, 2), a);
    return vec3_mul_add(b, weight_1, vec3_mul_add(c, weight_2, a));
}

static const float half_ulp = 2.98023223876953e-8f; /* half a unit in the last place of a number of size 1 */

/*
 * How far a ray may find a triangle off its plane, as it does along slivers: of the normal, a product of two edges, a
 * rounding of theirs is left, which a height much less than the length makes much of. No more than twice that height.
 */
static inline float sliver_rounding(vec3 a, vec3 b, vec3 c) {
    const vec3 ab = vec3_sub(b, a), ac = vec3_sub(c, a), bc = vec3_sub(c, b);
    const float longest = sqrtf(greater(vec3_dot(ab, ab), greater(vec3_dot(ac, ac), vec3_dot(bc, bc))));
    const float twice_area = vec3_length(vec3_cross(ab, ac));
    if (!(twice_area > 0))
        return 0;
    return lesser(half_ulp * longest * longest * longest / twice_area, 2 * twice_area / longest);
}

/*
 * A point of a triangle moved off its plane by more than the rounding error of its corners, never by a
 * fixed distance: eight units in the last place of their largest coordinate, more on slivers. Rays that leave from
 * here do not meet the face that they leave.
 */
static inline vec3 point_off_triangle(const pl_scene *scene, int32_t triangle, vec3 point, vec3 normal) {
    float largest = 0;
    vec3 corners[3];
    for (int corner = 0; corner < 3; ++corner) {
        const vec3 p = corners[corner] = scene_vertex(scene, triangle, corner);
        largest = greater(largest, greater(fabsf(p.x), greater(fabsf(p.y), fabsf(p.z))));
    }
    const float off = greater(sliver_rounding(corners[0], corners[1], corners[2]), eight_ulps * largest);
    return vec3_mul_add(normal, off, point);
}

/* The first opaque triangle from `near` on. */
pl_hit closest_hit(const pl_scene *scene, vec3 origin, vec3 direction, float near);

/* The same by float alone: at an edge where several triangles meet, any of them. */
pl_hit opaque_hit(const pl_scene *scene, vec3 origin, vec3 direction, float near);

/* edge_hits.c: of a hit that opaque_hit found at an edge, the one that double finds: else, once in 10^8 rays, a wall as
 * thin as nothing leaks into the room behind it, where the floors of both rooms end at its foot. */
pl_hit hit_at_edge(const pl_scene *scene, vec3 origin, vec3 direction, float near, pl_hit hit);

/* Opaque triangles strictly between origin and origin + direction. */
bool is_occluded(const pl_scene *scene, vec3 origin, vec3 direction, float far);

/* The first clear triangle between `near` and `far`; clear.h has what it does to light. */
pl_hit clear_hit(const pl_scene *scene, vec3 origin, vec3 direction, float near, float far);

/* `size` bytes that free() takes back, NULL where there is no memory. */
void *copy_of(const void *bytes, size_t size);

#endif
