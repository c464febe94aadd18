/* Each kind of light by itself, for lights.c and light_balls.c. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_LIGHT_KINDS_H
#define PATCHLIGHT_LIGHT_KINDS_H

#include "lights.h"

/* A flat piece of a lamp, of 3 or 4 corners, as a point sees it: of no radiance where that is its dark side. */
typedef struct light_face {
    vec3 corners[4];
    int count;
    float radiance[3];
} light_face;

typedef struct point_light {
    vec3 position, intensity;
    float radius, is_soft;
    vec3 direction;
    float cos_outer, cos_inner;
    const float *profile; /* NULL: the same in all directions */
    float distance_power;
    const float *metric; /* of a cone that is not round, else NULL */
} point_light;

typedef struct area_light {
    vec3 centre, radiance, axis_u, axis_v;
    float is_ellipse, spread;
} area_light;

typedef struct mesh_light {
    vec3 centre;
    float radius, weight;
    size_t first, count;
} mesh_light;

static inline area_light area_of(const float *p) {
    return (area_light){vec3_from(p), vec3_from(p + 3), vec3_from(p + 6), vec3_from(p + 9), p[12], p[13]};
}

static inline mesh_light mesh_of(const float *p) {
    return (mesh_light){vec3_from(p), p[3], p[4], (size_t)p[5], (size_t)p[6]};
}

static inline const float *parameters_of(const pl_lights *lights, size_t light) {
    return lights->parameters + PL_LIGHT_FLOATS * light;
}

static inline point_light point_of(const pl_lights *lights, size_t light) {
    const float *p = parameters_of(lights, light);
    const float *profile =
        p[13] >= 1 ? lights->profiles + (size_t)PL_PROFILE_SIDE * PL_PROFILE_SIDE * ((size_t)p[13] - 1) : NULL;
    const float *metric = p[15] > 0 ? p + 15 : NULL;
    return (point_light){vec3_from(p), vec3_from(p + 3), p[6],  p[7],  vec3_from(p + 8), p[11],
                         p[12],        profile,          p[14], metric};
}

/* Whether a point light gives the same all round, by the square law. */
static inline bool point_is_plain(const float *p) { return p[12] < -1 && !(p[13] >= 1) && p[14] == 0; }

static inline bool light_is_shadowless(const pl_lights *lights, size_t light) {
    return parameters_of(lights, light)[PL_LIGHT_FLOATS - 1] > 0;
}

/* The flat pieces of a lamp whose light has a closed form: how many, 0 of one that has none. */
size_t light_faces(const pl_lights *lights, size_t light, vec3 point, light_face out_faces[PL_EXACT_TRIANGLES]);

/* Add what arrives of a face, unoccluded. */
void add_face(const light_face *face, vec3 point, vec3 normal, float io_rgb[3]);

static inline void scaled(const float rgb[3], float factor, float out_rgb[3]) {
    for (int k = 0; k < 3; ++k)
        out_rgb[k] = rgb[k] * factor;
}

/* How far along itself a shadow ray goes to a lamp that may lie in a face. */
static const float far_of_face = 0.999999f;

/* Eight units in the last place of a point's largest coordinate, as in point_off_triangle. */
static inline float rounding_of(vec3 p) { return eight_ulps * greater(fabsf(p.x), greater(fabsf(p.y), fabsf(p.z))); }

/* point_light.c: `p` are the light's parameters in the table. */
float point_importance(const point_light *light, vec3 point);
bool sample_point_light(const point_light *light, vec3 point, vec3 normal, float x, float y, pl_light_sample *out);
float sun_importance(const float *p, vec3 normal);
bool sample_sun(const float *p, vec3 normal, float x, float y, pl_light_sample *out);

/* area_light.c */
float spread_share(const area_light *light, float tangent);
bool area_faces(const area_light *light, vec3 point);
bool area_is_exact(const area_light *light);
float area_of_lamp(const area_light *light);
light_face area_face(const area_light *light, vec3 point);
float area_importance(const area_light *light, vec3 point, vec3 normal, float ball);
bool sample_area(const float *p, vec3 point, vec3 normal, float x, float y, pl_light_sample *out);

/* mesh_light.c */
light_face mesh_face(const pl_lights *lights, size_t triangle, vec3 point);
float mesh_importance(const pl_lights *lights, const float *p, vec3 point, vec3 normal, float ball);
bool sample_mesh(const pl_lights *lights, const float *p, vec3 point, vec3 normal, float x, float y,
                 pl_light_sample *out);

#endif
