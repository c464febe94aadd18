/* Area lamps: rectangles and ellipses, one-sided. Radiometry as Cycles has it. SPDX-License-Identifier:
 * GPL-3.0-or-later */
#include "light_kinds.h"

/* What a narrowed beam keeps of the radiance at an angle from the lamp's axis. */
float spread_share(const area_light *light, float cosine) {
    const float half = 0.5f * light->spread;
    if (half >= 0.5f * PL_PI - 1e-3f)
        return 1;
    const float tangent = sqrtf(greater(1 - cosine * cosine, 0)) / greater(cosine, 1e-6f);
    return greater(tanf(half) - tangent, 0) / greater(tanf(half) - half, 1e-9f);
}

static void area_corners(const area_light *light, vec3 out_corners[4]) {
    static const float signs[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (int k = 0; k < 4; ++k)
        out_corners[k] =
            vec3_mul_add(light->axis_u, signs[k][0], vec3_mul_add(light->axis_v, signs[k][1], light->centre));
}

bool area_faces(const area_light *light, vec3 point) {
    const vec3 normal = vec3_cross(light->axis_u, light->axis_v);
    return vec3_dot(vec3_sub(point, light->centre), normal) > 0;
}

bool area_is_exact(const area_light *light) {
    return light->is_ellipse <= 0 && 0.5f * light->spread >= 0.5f * PL_PI - 1e-3f;
}

float area_of_lamp(const area_light *light) {
    const float rectangle = 4 * vec3_length(vec3_cross(light->axis_u, light->axis_v));
    return light->is_ellipse > 0 ? 0.25f * PL_PI * rectangle : rectangle;
}

light_face area_face(const area_light *light, vec3 point) {
    light_face face = {.count = 4};
    area_corners(light, face.corners);
    if (area_faces(light, point)) {
        face.radiance[0] = light->radiance.x;
        face.radiance[1] = light->radiance.y;
        face.radiance[2] = light->radiance.z;
    }
    return face;
}

/* Near an area lamp the closed form; from far away, it says no more than the square law at fifty times the cost. */
float area_importance(const area_light *light, vec3 point, vec3 normal, float ball) {
    if (!area_faces(light, point))
        return 0;
    const float reach = 4 * vec3_length(vec3_add(light->axis_u, light->axis_v));
    const vec3 to = vec3_sub(light->centre, point);
    if (!area_is_exact(light) || vec3_dot(to, to) > reach * reach)
        return ball;
    const light_face face = area_face(light, point);
    float rgb[3] = {0, 0, 0};
    add_face(&face, point, normal, rgb);
    return luminance(rgb);
}

bool sample_area(const float *p, vec3 point, vec3 normal, float x, float y, pl_light_sample *out) {
    const area_light light = area_of(p);
    float a = 2 * x - 1, b = 2 * y - 1;
    if (light.is_ellipse > 0) {
        const float radius = sqrtf(x), angle = 2 * PL_PI * y;
        a = radius * cosf(angle);
        b = radius * sinf(angle);
    }
    /* off the lamp's plane, in which a ceiling may lie that must not be in the way */
    const vec3 lamp_normal = vec3_unit(vec3_cross(light.axis_u, light.axis_v));
    const vec3 target = vec3_mul_add(light.axis_u, a, vec3_mul_add(light.axis_v, b, light.centre));
    out->direction = vec3_sub(vec3_mul_add(lamp_normal, rounding_of(target), target), point);
    out->far = far_of_face;
    const float inverse = 1 / greater(vec3_length(out->direction), 1e-30f);
    const float lamp_cosine = -vec3_dot(out->direction, lamp_normal) * inverse;
    const float cosine = vec3_dot(out->direction, normal) * inverse;
    if (cosine <= 0 || lamp_cosine <= 0)
        return false;
    scaled(p + 3, cosine * inverse * (lamp_cosine * inverse) * area_of_lamp(&light) * spread_share(&light, lamp_cosine),
           out->irradiance);
    return true;
}
