/*
 * What rays see that leave the scene: a map of all directions, an octahedron laid out flat.
 *
 * Engelhardt & Dachsbacher 2008, "Octahedron environment maps": no poles, and no angles to be found.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#ifndef PATCHLIGHT_SKY_H
#define PATCHLIGHT_SKY_H

#include "vec3.h"

#include <math.h>

static inline size_t sky_texel(float place, size_t side) {
    const float texel = (0.5f * place + 0.5f) * (float)side;
    return texel < 1 ? 0 : texel < (float)(side - 1) ? (size_t)texel : side - 1;
}

/* Where a direction, not 0, lies on the flat octahedron, from -1 to 1. */
static inline void octahedron_place(vec3 direction, float *out_x, float *out_y) {
    const float scale = 1 / (fabsf(direction.x) + fabsf(direction.y) + fabsf(direction.z));
    const float x = direction.x * scale, y = direction.y * scale;
    *out_x = direction.z < 0 ? copysignf(1 - fabsf(y), x) : x;
    *out_y = direction.z < 0 ? copysignf(1 - fabsf(x), y) : y;
}

static inline const float *sky_seen(const float *sky, size_t side, vec3 direction) {
    if (side == 1)
        return sky;
    float x, y;
    octahedron_place(direction, &x, &y);
    return sky + 3 * (side * sky_texel(y, side) + sky_texel(x, side));
}

#endif
