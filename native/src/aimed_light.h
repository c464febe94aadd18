/* A light as one receiver samples it. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_AIMED_LIGHT_H
#define PATCHLIGHT_AIMED_LIGHT_H

#include "light_kinds.h"

/* A rectangle leaves 3 triangles above the horizon, a triangle 2. */
enum { MOST_RISEN = 2 * EXACT_TRIANGLES };

/* A piece of a lamp's face above the horizon. */
typedef struct risen_triangle {
    vec3 a, ab, ac, normal; /* unit, towards the receiver */
    float area, radiance[3];
} risen_triangle;

/*
 * Where a light has a closed form, samples only say which share of it is seen. Then all have to fall on what is above
 * the horizon and shines this way: where little has risen, samples of the whole light would all be lost.
 */
typedef struct aimed_light {
    const pl_lights *lights;
    size_t light;
    vec3 point, normal;
    bool is_exact; /* has a closed form */
    bool is_cut;   /* has, and only a part of it can shine: the triangles */
    float exact[3];
    float power; /* the triangles' areas times luminance of their radiance */
    size_t count;
    risen_triangle triangles[MOST_RISEN];
} aimed_light;

/* False where the light gives the receiver nothing. */
bool aim(const pl_lights *lights, size_t light, vec3 point, vec3 normal, aimed_light *out);

/* The k-th sample of a sequence; false where it falls on what cannot shine. */
bool sample_aimed(const aimed_light *aimed, uint32_t seed, uint32_t k, pl_light_sample *out_sample);

#endif
