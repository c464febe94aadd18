/* The table of lights: which kind each is decides what answers for it. SPDX-License-Identifier: GPL-3.0-or-later */
#include "light_kinds.h"
#include "polygon.h"

bool lights_are_valid(const pl_lights *lights) {
    for (size_t light = 0; light < lights->count; ++light) {
        const float *p = parameters_of(lights, light);
        if (lights->kinds[light] < PL_LIGHT_POINT || lights->kinds[light] > PL_LIGHT_MESH)
            return false;
        const float most = (float)lights->triangle_count;
        if (lights->kinds[light] == PL_LIGHT_MESH && !(p[5] >= 0 && p[6] >= 1 && p[5] + p[6] <= most))
            return false;
        if (lights->kinds[light] == PL_LIGHT_POINT && !(p[13] >= 0 && p[13] <= (float)lights->profile_count))
            return false;
    }
    return true;
}

bool light_is_sharp(const pl_lights *lights, size_t light) {
    const float *p = parameters_of(lights, light);
    return (lights->kinds[light] == PL_LIGHT_POINT || lights->kinds[light] == PL_LIGHT_SUN) && p[6] <= 0;
}

size_t light_faces(const pl_lights *lights, size_t light, vec3 point, light_face out_faces[PL_EXACT_TRIANGLES]) {
    const float *p = parameters_of(lights, light);
    if (lights->kinds[light] == PL_LIGHT_AREA) {
        const area_light lamp = area_of(p);
        if (!area_is_exact(&lamp))
            return 0;
        out_faces[0] = area_face(&lamp, point);
        return 1;
    }
    if (lights->kinds[light] != PL_LIGHT_MESH)
        return 0;
    const mesh_light lamp = mesh_of(p);
    if (lamp.count > PL_EXACT_TRIANGLES)
        return 0;
    for (size_t k = 0; k < lamp.count; ++k)
        out_faces[k] = mesh_face(lights, lamp.first + k, point);
    return lamp.count;
}

void add_face(const light_face *face, vec3 point, vec3 normal, float io_rgb[3]) {
    if (luminance(face->radiance) <= 0)
        return;
    const float factor = PL_PI * (float)point_to_polygon(point, normal, face->corners, face->count);
    for (int k = 0; k < 3; ++k)
        io_rgb[k] += factor * face->radiance[k];
}

static bool sample(const pl_lights *lights, size_t light, vec3 point, vec3 normal, float x, float y,
                   pl_light_sample *out_sample) {
    const float *p = parameters_of(lights, light);
    switch (lights->kinds[light]) {
    case PL_LIGHT_POINT: {
        const point_light lamp = point_of(lights, light);
        return sample_point_light(&lamp, point, normal, x, y, out_sample);
    }
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
    if (light_is_shadowless(lights, light))
        out_sample->far = 0;
    return true;
}
