/* Which of the triangles that meet at an edge a ray hits. SPDX-License-Identifier: GPL-3.0-or-later */
#include "scene.h"

/* Distance to a triangle by double arithmetic (Moeller & Trumbore 1997, eq. 6); infinite where it is not met. */
static double exact_distance(const pl_scene *scene, int32_t triangle, vec3 origin, vec3 direction) {
    const vec3 a = scene_vertex(scene, triangle, 0);
    const dvec3 ab = dvec3_between(a, scene_vertex(scene, triangle, 1)),
                ac = dvec3_between(a, scene_vertex(scene, triangle, 2));
    const dvec3 from_a = dvec3_between(a, origin);
    /* turned by some 1e-12, or a ray through the edge itself would meet all that meet there */
    const double turn = 1e-12 * (double)vec3_length(direction);
    const dvec3 along = {direction.x + 0.41 * turn, direction.y + 0.73 * turn, direction.z + 0.59 * turn};
    const dvec3 p = dvec3_cross(along, ac), q = dvec3_cross(from_a, ab);
    const double volume = dvec3_dot(p, ab);
    const double u = dvec3_dot(p, from_a) / volume, v = dvec3_dot(q, along) / volume,
                 distance = dvec3_dot(q, ac) / volume;
    return u >= 0 && v >= 0 && u + v <= 1 ? distance : INFINITY;
}

pl_hit hit_at_edge(const pl_scene *scene, vec3 origin, vec3 direction, float near, pl_hit hit) {
    double nearest = exact_distance(scene, hit.triangle, origin, direction);
    /* rays beside it find the others that meet there: as far off as rounding cannot bridge, 2^-20 of all coordinates */
    const float length = vec3_length(direction);
    const float off = eight_ulps * greater(length, scene->reach / greater(hit.distance, 1e-30f));
    vec3 u, v;
    vec3_basis(vec3_unit(direction), &u, &v);
    for (int side = 0; side < 4; ++side) {
        const vec3 beside = vec3_mul_add(side & 1 ? v : u, side & 2 ? off : -off, direction);
        pl_hit other = opaque_hit(scene, origin, beside, near);
        if (other.triangle < 0)
            continue;
        const double distance = exact_distance(scene, other.triangle, origin, direction);
        if (distance < (double)near || distance >= nearest)
            continue;
        nearest = distance;
        other.distance = (float)distance;
        hit = other;
    }
    return hit;
}
