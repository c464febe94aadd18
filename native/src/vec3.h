/* Vectors of three: float for rays, double where digits cancel. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_VEC3_H
#define PATCHLIGHT_VEC3_H

#include <math.h>

static const float PL_PI = 3.14159265358979f;

/* fminf and fmaxf are calls. Of a value that is not a number these take the bound, which has to be one. */
static inline float lesser(float value, float bound) { return value < bound ? value : bound; }
static inline float greater(float value, float bound) { return value > bound ? value : bound; }

/* Eight units in the last place of a number of size 1: what keeps a point off a plane that it was computed in. */
static const float eight_ulps = 9.5367431640625e-7f;

typedef struct vec3 {
    float x, y, z;
} vec3;

static inline vec3 vec3_from(const float *p) { return (vec3){p[0], p[1], p[2]}; }
static inline vec3 vec3_add(vec3 a, vec3 b) { return (vec3){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline vec3 vec3_sub(vec3 a, vec3 b) { return (vec3){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline vec3 vec3_scale(vec3 a, float s) { return (vec3){a.x * s, a.y * s, a.z * s}; }
static inline vec3 vec3_mul_add(vec3 a, float s, vec3 b) { return (vec3){a.x * s + b.x, a.y * s + b.y, a.z * s + b.z}; }
static inline float vec3_dot(vec3 a, vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline vec3 vec3_cross(vec3 a, vec3 b) {
    return (vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline float vec3_length(vec3 a) { return sqrtf(vec3_dot(a, a)); }
static inline vec3 vec3_unit(vec3 a) {
    const float length = vec3_length(a);
    return length > 0 ? vec3_scale(a, 1 / length) : a;
}

typedef struct dvec3 {
    double x, y, z;
} dvec3;

static inline dvec3 dvec3_between(vec3 from, vec3 to) {
    return (dvec3){(double)to.x - (double)from.x, (double)to.y - (double)from.y, (double)to.z - (double)from.z};
}
static inline double dvec3_dot(dvec3 a, dvec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline dvec3 dvec3_cross(dvec3 a, dvec3 b) {
    return (dvec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* Two unit vectors that complete n, without a branch at the pole (Duff et al. 2017). */
static inline void vec3_basis(vec3 n, vec3 *out_u, vec3 *out_v) {
    const float sign = copysignf(1.0f, n.z);
    const float a = -1.0f / (sign + n.z);
    const float b = n.x * n.y * a;
    *out_u = (vec3){1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x};
    *out_v = (vec3){b, sign + n.y * n.y * a, -n.y};
}

#endif
