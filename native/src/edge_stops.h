/*
 * How far two values of light are the same but for their noise: what smoothing over texels and over vertices share.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#ifndef PATCHLIGHT_EDGE_STOPS_H
#define PATCHLIGHT_EDGE_STOPS_H

#include "vec3.h"

/* (1 - x / 8)^8, about exp(-x), of which an expf would take most of the time here. */
static inline float falling(float x) {
    const float t = greater(1 - 0.125f * x, 0), square = t * t, fourth = square * square;
    return fourth * fourth;
}

/*
 * Each variance counts for a few times the other's at the most, or what is bright and noisy (under a lamp that hangs
 * off the ceiling) would spread over the calm neighbours beside it.
 */
static const float noisier = 4;
/* Less leaves mottles, more washes out what light does at contacts. */
static const float tolerance = 7;

/* The weight of one in the mean of the other. */
static inline float alike(float difference, float variance, float other_variance) {
    const float noise = lesser(variance, noisier * other_variance) + lesser(other_variance, noisier * variance);
    const float by_noise = falling(difference * difference / (tolerance * noise));
    const float without_noise = difference == 0 ? 1.0f : 0.0f;
    return noise > 0 ? by_noise : without_noise;
}

#endif
