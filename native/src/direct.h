/* Direct light at one point. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_DIRECT_H
#define PATCHLIGHT_DIRECT_H

#include "lights.h"
#include "receivers.h"

/*
 * One-sample estimate of the direct irradiance at a point off a surface: one light in proportion to what it
 * would give, one shadow ray; `importances` is room for one number a light.
 * Returns whether a ray was traced.
 */
bool direct_at_point(const pl_scene *scene, const pl_lights *lights, const pl_light_balls *balls, float *importances,
                     vec3 origin, vec3 normal, uint32_t seed, float out_rgb[3]);

#endif
