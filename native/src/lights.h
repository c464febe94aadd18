/* What a light gives where nothing hides it. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_LIGHTS_H
#define PATCHLIGHT_LIGHTS_H

#include "patchlight.h"
#include "vec3.h"

#include <stdbool.h>

typedef struct pl_light_sample {
    vec3 direction; /* to the light; `far` of it reaches the light */
    float far;
    float irradiance[3]; /* one-sample estimate of what arrives, unoccluded */
} pl_light_sample;

static inline float luminance(const float rgb[3]) {
    return 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
}

/* A light that one ray decides: a point or a parallel sun. */
bool light_is_sharp(const pl_lights *lights, size_t light);

/*
 * What a light gives unoccluded, as luminance of irradiance: exact where a closed form is at hand, else a
 * guess that is above 0 wherever a sample can be.
 */
float light_importance(const pl_lights *lights, size_t light, vec3 point, vec3 normal);

/* The same in three channels where it is exact; false where it is only a guess. */
bool light_exact(const pl_lights *lights, size_t light, vec3 point, vec3 normal, float out_rgb[3]);

/* A point of the light for (x, y) of the unit square; false where it cannot light the receiver. */
bool light_sample(const pl_lights *lights, size_t light, vec3 point, vec3 normal, float x, float y,
                  pl_light_sample *out_sample);

#endif
