/* The table of lights: which kind each is decides what answers for it. SPDX-License-Identifier: GPL-3.0-or-later */
#include "light_kinds.h"

bool lights_are_valid(const pl_lights *lights) {
    for (size_t light = 0; light < lights->count; ++light) {
        const float *p = parameters_of(lights, light);
        if (lights->kinds[light] < PL_LIGHT_POINT || lights->kinds[light] > PL_LIGHT_MESH)
            return false;
        const float most = (float)lights->triangle_count;
        if (lights->kinds[light] == PL_LIGHT_MESH && !(p[5] >= 0 && p[6] >= 1 && p[5] + p[6] <= most))
            return false;
    }
    return true;
}

bool light_is_sharp(const pl_lights *lights, size_t light) {
    const float *p = parameters_of(lights, light);
    return (lights->kinds[light] == PL_LIGHT_POINT || lights->kinds[light] == PL_LIGHT_SUN) && p[6] <= 0;
}

static bool exact(const pl_lights *lights, size_t light, vec3 point, vec3 normal, float out_rgb[3]) {
    const float *p = parameters_of(lights, light);
    if (lights->kinds[light] == PL_LIGHT_AREA) {
        const area_light lamp = area_of(p);
        if (!area_is_exact(&lamp))
            return false;
        scaled(p + 3, area_faces(&lamp, point) ? area_exact(&lamp, point, normal) : 0, out_rgb);
        return true;
    }
    if (lights->kinds[light] == PL_LIGHT_MESH) {
        const mesh_light lamp = mesh_of(p);
        if (lamp.count > EXACT_TRIANGLES)
            return false;
        mesh_exact(lights, &lamp, point, normal, out_rgb);
        return true;
    }
    return false;
}

bool light_exact(const pl_lights *lights, size_t light, vec3 point, vec3 normal, float out_rgb[3]) {
    if (!exact(lights, light, point, normal, out_rgb))
        return false;
    for (int k = 0; k < 3; ++k)
        out_rgb[k] = bounded(out_rgb[k]);
    return true;
}

static bool sample(const pl_lights *lights, size_t light, vec3 point, vec3 normal, float x, float y,
                   pl_light_sample *out_sample) {
    const float *p = parameters_of(lights, light);
    switch (lights->kinds[light]) {
    case PL_LIGHT_POINT:
        return sample_point_light(p, point, normal, x, y, out_sample);
    case PL_LIGHT_AREA:
        return sample_area(p, point, normal, x, y, out_sample);
    case PL_LIGHT_SUN:
        return sample_sun(p, normal, x, y, out_sample);
    default:
        return sample_mesh(lights, p, point, normal, x, y, out_sample);
    }
}

bool light_sample(const pl_lights *lights, size_t light, vec3 point, vec3 normal, float x, float y,
                  pl_light_sample *out_sample) {
    if (!sample(lights, light, point, normal, x, y, out_sample))
        return false;
    for (int k = 0; k < 3; ++k)
        out_sample->irradiance[k] = bounded(out_sample->irradiance[k]);
    return true;
}
