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

static inline float luminance(const float rgb[3]) { return 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2]; }

/*
 * No light is brighter than this, in any unit: the square law has no bound near a lamp, and the square of an estimate
 * must still be a float. What is no number is no light.
 */
static const float most_light = 1e17f;
static inline float bounded(float light) { return light > 0 ? lesser(light, most_light) : 0; }

/* Whether kinds are known and glowing triangles in range. */
bool lights_are_valid(const pl_lights *lights);

/* A light that one ray decides: a point or a parallel sun. */
bool light_is_sharp(const pl_lights *lights, size_t light);

/*
 * The lights as balls, in columns: a loop over them is what every receiver pays for every light, so it is
 * the one loop here that must vectorise.
 */
typedef struct pl_light_balls {
    size_t count;
    float *x, *y, *z, *radius, *strength;
    size_t *special; /* lights that a ball does not describe: cones, one-sided lamps, suns, near meshes */
    size_t special_count;
} pl_light_balls;

bool light_balls_create(const pl_lights *lights, pl_light_balls *out_balls);
void light_balls_destroy(pl_light_balls *balls);

/*
 * What each light gives unoccluded, as luminance of irradiance: a guess that is above 0 wherever a sample can be; of
 * those that seem to give `worth_a_look` of it all, or more, exact where near and in closed form. What seems so is a
 * guess, too, which hangs on lamps that face away. Returns their sum.
 */
float light_importances(const pl_lights *lights, const pl_light_balls *balls, vec3 point, vec3 normal,
                        float worth_a_look, float *out_importances);

/* A point of the light for (x, y) of the unit square; false where it cannot light the receiver. Of a light that casts
 * no shadows `far` is 0. */
bool light_sample(const pl_lights *lights, size_t light, vec3 point, vec3 normal, float x, float y,
                  pl_light_sample *out_sample);

#endif
