/* Points, balls and spots, and suns. Radiometry as Cycles has it. SPDX-License-Identifier: GPL-3.0-or-later */
#include "light_kinds.h"
#include "sky.h"

static float squared_by(const float m[6], vec3 d) {
    return m[0] * d.x * d.x + m[1] * d.y * d.y + m[2] * d.z * d.z +
           2 * (m[3] * d.x * d.y + m[4] * d.x * d.z + m[5] * d.y * d.z);
}

/* Smoothstep from the cone's edge inwards. */
static float cone_share(const point_light *light, vec3 from_light) {
    if (light->cos_inner < -1)
        return 1;
    float cosine = vec3_dot(from_light, light->direction);
    if (light->metric)
        cosine /= sqrtf(greater(squared_by(light->metric, from_light), 1e-30f));
    const float range = greater(light->cos_inner - light->cos_outer, 1e-6f);
    const float t = lesser(greater((cosine - light->cos_outer) / range, 0), 1);
    return t * t * (3 - 2 * t);
}

/* Beyond the square's edge lies the other half of that edge. */
static float profile_texel(const float *profile, int32_t column, int32_t row) {
    const int32_t side = PL_PROFILE_SIDE;
    if (column < 0 || column >= side) {
        column = column < 0 ? 0 : side - 1;
        row = side - 1 - row;
    }
    if (row < 0 || row >= side) {
        row = row < 0 ? 0 : side - 1;
        column = side - 1 - column;
    }
    return profile[side * row + column];
}

static float profile_share(const float *profile, vec3 direction) {
    if (!profile)
        return 1;
    float x, y;
    octahedron_place(direction, &x, &y);
    const float from_left = (0.5f * lesser(greater(x, -1), 1) + 0.5f) * PL_PROFILE_SIDE - 0.5f;
    const float from_low = (0.5f * lesser(greater(y, -1), 1) + 0.5f) * PL_PROFILE_SIDE - 0.5f;
    const int32_t column = (int32_t)floorf(from_left), row = (int32_t)floorf(from_low);
    const float right = from_left - (float)column, up = from_low - (float)row;
    float sum = 0;
    for (int corner = 0; corner < 4; ++corner) {
        const int is_right = corner & 1, is_up = corner >> 1;
        const float weight = (is_right ? right : 1 - right) * (is_up ? up : 1 - up);
        sum += weight * profile_texel(profile, column + is_right, row + is_up);
    }
    return sum;
}

/* What the light sends in a direction, as a share of its intensity, over the square law. */
static float share_of_intensity(const point_light *light, vec3 from_light, float distance) {
    const float far = light->distance_power == 0 ? 1 : powf(distance, light->distance_power);
    return cone_share(light, from_light) * profile_share(light->profile, from_light) * far;
}

/* How much more or less than its ball a light gives that is not plain. */
float point_importance(const point_light *light, vec3 point) {
    const vec3 to = vec3_sub(light->position, point);
    const float distance = vec3_length(to);
    if (distance <= light->radius)
        return 1;
    const float share = share_of_intensity(light, vec3_scale(to, -1 / distance), distance);
    /* a sphere's edge can look into a cone that its centre is out of */
    return greater(share, light->radius > 0 ? 0.01f : 0);
}

/* A direction, even over the solid angle of a cone about an axis; (x, y) of the unit square. */
static vec3 direction_in_cone(vec3 axis, float one_minus_cos_max, float x, float y) {
    vec3 u, v;
    vec3_basis(axis, &u, &v);
    const float one_minus_cos = x * one_minus_cos_max, angle = 2 * PL_PI * y;
    const float side = sqrtf(greater(one_minus_cos * (2 - one_minus_cos), 0));
    const vec3 across = vec3_mul_add(u, side * cosf(angle), vec3_scale(v, side * sinf(angle)));
    return vec3_mul_add(axis, 1 - one_minus_cos, across);
}

/* A uniform direction in the cone that a sphere fills; its solid angle over the area of a disc of its radius. */
static bool sample_sphere(const point_light *light, vec3 to, float distance, float x, float y, vec3 *out_direction,
                          float *out_far, float *out_over_disc) {
    const vec3 axis = vec3_scale(to, 1 / distance);
    const float sine = light->radius / distance;
    if (sine >= 1)
        return false;
    /* 1 - cos without cancellation for small lamps far away */
    const float one_minus_cos_max = sine * sine / (1 + sqrtf(1 - sine * sine));
    const float one_minus_cos = x * one_minus_cos_max;
    const float cosine = 1 - one_minus_cos, side = distance * sqrtf(greater(one_minus_cos * (2 - one_minus_cos), 0));
    *out_direction = direction_in_cone(axis, one_minus_cos_max, x, y);
    *out_far = distance * cosine - sqrtf(greater(light->radius * light->radius - side * side, 0));
    *out_over_disc = 2 / (distance * distance * (1 + sqrtf(1 - sine * sine)));
    return true;
}

bool sample_point_light(const point_light *light, vec3 point, vec3 normal, float x, float y, pl_light_sample *out) {
    const vec3 to = vec3_sub(light->position, point);
    const float distance = vec3_length(to);
    float factor;
    if (distance <= 0)
        return false;

    if (light->radius <= 0) {
        out->direction = to;
        out->far = far_of_face;
        const float cosine = vec3_dot(to, normal) / distance;
        factor = cosine * share_of_intensity(light, vec3_scale(to, -1 / distance), distance) / (distance * distance);
    } else if (light->is_soft > 0) {
        /* a disc of radiance I / (pi r^2) that always faces the receiver */
        vec3 u, v;
        const vec3 axis = vec3_scale(to, 1 / distance);
        vec3_basis(axis, &u, &v);
        const float radius = light->radius * sqrtf(x), angle = 2 * PL_PI * y;
        const vec3 across = vec3_mul_add(u, radius * cosf(angle), vec3_scale(v, radius * sinf(angle)));
        out->direction = vec3_add(to, across);
        out->far = 1;
        const float square = vec3_dot(out->direction, out->direction), reach = sqrtf(square);
        const float cosine = vec3_dot(out->direction, normal) / reach;
        factor = cosine * (distance / reach) / square;
        factor *= share_of_intensity(light, vec3_scale(out->direction, -1 / reach), reach);
    } else {
        /* a sphere of radiance P / (4 pi^2 r^2) = I / (pi r^2), times its solid angle: r^2 cancels, however small */
        float over_disc;
        if (!sample_sphere(light, to, distance, x, y, &out->direction, &out->far, &over_disc))
            return false;
        factor = vec3_dot(out->direction, normal) * over_disc;
        factor *= share_of_intensity(light, vec3_scale(out->direction, -1), out->far);
    }
    out->irradiance[0] = light->intensity.x * factor;
    out->irradiance[1] = light->intensity.y * factor;
    out->irradiance[2] = light->intensity.z * factor;
    return factor > 0;
}

float sun_importance(const float *p, vec3 normal) {
    return luminance(p + 3) * greater(vec3_dot(vec3_from(p), normal) + sinf(lesser(p[6], 1.5f)), 0);
}

bool sample_sun(const float *p, vec3 normal, float x, float y, pl_light_sample *out) {
    /* a disc of radiance E / (pi sin^2), whose solid angle is 2 pi (1 - cos) */
    const float half = sinf(0.5f * lesser(p[6], 0.5f * PL_PI)), one_minus_cos_max = 2 * half * half;
    out->direction = direction_in_cone(vec3_from(p), one_minus_cos_max, x, y);
    out->far = INFINITY;
    const float cosine = vec3_dot(out->direction, normal);
    scaled(p + 3, 2 * cosine / (2 - one_minus_cos_max), out->irradiance);
    return cosine > 0;
}
