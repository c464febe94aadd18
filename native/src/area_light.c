/* Area lamps: rectangles and ellipses, one-sided. Radiometry as Cycles has it. SPDX-License-Identifier:
 * GPL-3.0-or-later */
#include "light_kinds.h"

/* Half of the beam's angle [rad]; light that is parallel by its number is nearly so. */
static float half_angle(const area_light *light) { return greater(0.5f * light->spread, 0.005f); }

static bool is_wide(const area_light *light) { return half_angle(light) >= 0.5f * PL_PI - 1e-3f; }

/* What a narrowed beam keeps of the radiance at an angle of this tangent from the lamp's axis. */
float spread_share(const area_light *light, float tangent) {
    if (is_wide(light))
        return 1;
    const float half = half_angle(light), square = half * half;
    /* where the difference would be rounding, its series */
    const float excess = half < 0.1f ? half * square * (1 / 3.0f + 2 / 15.0f * square) : tanf(half) - half;
    return greater(tanf(half) - tangent, 0) / excess;
}

/* The part of the lamp, in half sides from its centre, that a point may be in the beam of. */
typedef struct lamp_part {
    float low_u, high_u, low_v, high_v;
} lamp_part;

/* Of a narrow beam what shines at the point is a disc about its foot on the lamp: here, a box about that disc. */
static bool part_in_reach(const area_light *light, vec3 point, lamp_part *out) {
    *out = (lamp_part){-1, 1, -1, 1};
    if (is_wide(light))
        return true;
    const vec3 normal = vec3_unit(vec3_cross(light->axis_u, light->axis_v));
    const vec3 to = vec3_sub(point, light->centre);
    const float radius = vec3_dot(to, normal) * tanf(half_angle(light));
    /* the axes need not be at right angles: coordinates are taken along their dual ones */
    vec3 dual_u = vec3_cross(light->axis_v, normal), dual_v = vec3_cross(normal, light->axis_u);
    dual_u = vec3_scale(dual_u, 1 / vec3_dot(dual_u, light->axis_u));
    dual_v = vec3_scale(dual_v, 1 / vec3_dot(dual_v, light->axis_v));
    const float u = vec3_dot(to, dual_u), v = vec3_dot(to, dual_v);
    const float reach_u = radius * vec3_length(dual_u), reach_v = radius * vec3_length(dual_v);
    out->low_u = greater(u - reach_u, -1);
    out->high_u = lesser(u + reach_u, 1);
    out->low_v = greater(v - reach_v, -1);
    out->high_v = lesser(v + reach_v, 1);
    return radius > 0 && out->low_u < out->high_u && out->low_v < out->high_v;
}

/* How much of the lamp's rectangle that is. */
static float share_of_part(const lamp_part *part) {
    return 0.25f * (part->high_u - part->low_u) * (part->high_v - part->low_v);
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

bool area_is_exact(const area_light *light) { return light->is_ellipse <= 0 && is_wide(light); }

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
    lamp_part part;
    if (!part_in_reach(light, point, &part))
        return 0;
    if (!is_wide(light)) { /* the more of it, the more light, and in the midst of the beam pi L */
        const float radiance[3] = {light->radiance.x, light->radiance.y, light->radiance.z};
        return lesser(ball * share_of_part(&part), PL_PI * luminance(radiance));
    }
    if (!area_is_exact(light) || vec3_dot(to, to) > reach * reach)
        return ball;
    const light_face face = area_face(light, point);
    float rgb[3] = {0, 0, 0};
    add_face(&face, point, normal, rgb);
    return luminance(rgb);
}

bool sample_area(const float *p, vec3 point, vec3 normal, float x, float y, pl_light_sample *out) {
    const area_light light = area_of(p);
    lamp_part part;
    if (!part_in_reach(&light, point, &part))
        return false;
    const float share = share_of_part(&part);
    float a = part.low_u + x * (part.high_u - part.low_u), b = part.low_v + y * (part.high_v - part.low_v);
    float area = share * 4 * vec3_length(vec3_cross(light.axis_u, light.axis_v));
    if (light.is_ellipse > 0 && share >= 1) {
        const float radius = sqrtf(x), angle = 2 * PL_PI * y;
        a = radius * cosf(angle);
        b = radius * sinf(angle);
        area = area_of_lamp(&light);
    } else if (light.is_ellipse > 0 && a * a + b * b > 1)
        return false;
    /* off the lamp's plane, in which a ceiling may lie that must not be in the way */
    const vec3 lamp_normal = vec3_unit(vec3_cross(light.axis_u, light.axis_v));
    const vec3 target = vec3_mul_add(light.axis_u, a, vec3_mul_add(light.axis_v, b, light.centre));
    out->direction = vec3_sub(vec3_mul_add(lamp_normal, rounding_of(target), target), point);
    out->far = far_of_face;
    const float inverse = 1 / greater(vec3_length(out->direction), 1e-30f);
    const float height = -vec3_dot(out->direction, lamp_normal), lamp_cosine = height * inverse;
    const float cosine = vec3_dot(out->direction, normal) * inverse;
    if (cosine <= 0 || lamp_cosine <= 0)
        return false;
    /* not by the cosine, which is 1 to rounding where a beam is narrow */
    const float tangent = vec3_length(vec3_cross(out->direction, lamp_normal)) / height;
    scaled(p + 3, cosine * inverse * (lamp_cosine * inverse) * area * spread_share(&light, tangent), out->irradiance);
    return true;
}
