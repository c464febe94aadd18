/* A light as one receiver samples it. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_AIMED_LIGHT_H
#define PATCHLIGHT_AIMED_LIGHT_H

#include "light_kinds.h"
#include "polygon.h"

/* Above the horizon a triangle leaves 2, and a rectangle, which is a lamp by itself, MAX_CLIPPED - 2 of them. */
enum { MOST_RISEN = 2 * PL_EXACT_TRIANGLES };
_Static_assert(MAX_CLIPPED - 2 <= MOST_RISEN, "a rectangle has room");

/* A piece of a lamp's face above the horizon. */
typedef struct risen_triangle {
    vec3 a, ab, ac, normal; /* unit, towards the receiver */
    float area, radiance[3];
    float share, sampled[3]; /* of the lamp's weight, and the radiance over it: what one sample stands for */
    vec3 seen[3];            /* unit directions to its corners */
    float angle;             /* [sr] */
} risen_triangle;

/*
 * Of a lamp with a closed form only what is above the horizon and shines this way is sampled: where little has risen,
 * samples of the whole would all be lost. What is large from here is sampled by solid angle: of a lamp's area only
 * the little that is nearest counts, which few samples find.
 */
typedef struct aimed_light {
    const pl_lights *lights;
    size_t light;
    vec3 point, normal;
    light_face faces[PL_EXACT_TRIANGLES];
    size_t face_count; /* 0: it has no closed form */
    enum { BY_LIGHT, BY_AREA, BY_ANGLE } way;
    size_t count;
    risen_triangle triangles[MOST_RISEN];
} aimed_light;

/* For one sample or many; false where the light gives the receiver nothing. */
bool aim(const pl_lights *lights, size_t light, vec3 point, vec3 normal, bool once, aimed_light *out);

/* What arrives unoccluded, in closed form. */
void aimed_exact(const aimed_light *aimed, float out_rgb[3]);

/* A sample for (x, y) of the unit square, without bias by itself; false where it falls on what cannot shine. */
bool sample_aimed(const aimed_light *aimed, float x, float y, pl_light_sample *out_sample);

#endif
