/* What each light would give, guessed by the balls that the lights lie in. SPDX-License-Identifier: GPL-3.0-or-later */
#include "light_kinds.h"

#include <stdlib.h>

static void describe_ball(const pl_lights *lights, size_t light, pl_light_balls *io_balls) {
    const float *p = parameters_of(lights, light);
    io_balls->x[light] = p[0];
    io_balls->y[light] = p[1];
    io_balls->z[light] = p[2];
    io_balls->radius[light] = 0;
    switch (lights->kinds[light]) {
    case PL_LIGHT_POINT:
        io_balls->radius[light] = p[6];
        io_balls->strength[light] = luminance(p + 3);
        break;
    case PL_LIGHT_AREA: {
        const area_light lamp = area_of(p);
        io_balls->radius[light] = vec3_length(vec3_add(lamp.axis_u, lamp.axis_v));
        /* a narrow beam is concentrated on its axis */
        io_balls->strength[light] = luminance(p + 3) * area_of_lamp(&lamp) * greater(spread_share(&lamp, 0), 1);
        break;
    }
    case PL_LIGHT_MESH:
        io_balls->radius[light] = p[3];
        io_balls->strength[light] = p[4];
        break;
    default:
        io_balls->strength[light] = 0;
    }
    io_balls->strength[light] = lesser(io_balls->strength[light], 1e30f);
    const bool is_plain = lights->kinds[light] == PL_LIGHT_POINT && point_is_plain(p);
    if (!is_plain)
        io_balls->special[io_balls->special_count++] = light;
}

bool light_balls_create(const pl_lights *lights, pl_light_balls *out_balls) {
    const size_t count = lights->count, room = count + 1;
    float *columns = malloc(5 * sizeof(float) * room);
    size_t *special = malloc(sizeof(size_t) * room);
    *out_balls = (pl_light_balls){.count = count, .x = columns, .special = special};
    if (!columns || !special) {
        light_balls_destroy(out_balls);
        return false;
    }
    out_balls->y = columns + room;
    out_balls->z = columns + 2 * room;
    out_balls->radius = columns + 3 * room;
    out_balls->strength = columns + 4 * room;
    for (size_t light = 0; light < count; ++light)
        describe_ball(lights, light, out_balls);
    return true;
}

void light_balls_destroy(pl_light_balls *balls) {
    free(balls->x);
    free(balls->special);
    *balls = (pl_light_balls){0};
}

/* Strength by the square law, with the best cosine that any part of the ball can have. */
static void ball_importances(const pl_light_balls *balls, vec3 point, vec3 normal, float *restrict out) {
    const float *restrict xs = balls->x, *restrict ys = balls->y, *restrict zs = balls->z;
    const float *restrict radii = balls->radius, *restrict strengths = balls->strength;
    for (size_t i = 0; i < balls->count; ++i) {
        const float x = xs[i] - point.x, y = ys[i] - point.y, z = zs[i] - point.z;
        const float square = x * x + y * y + z * z + 1e-30f;
        const float distance = sqrtf(square);
        const float height = x * normal.x + y * normal.y + z * normal.z + radii[i];
        const float best = height < distance ? height : distance;
        const float nearest = square > radii[i] * radii[i] ? square : radii[i] * radii[i];
        const float light = best > 0 ? strengths[i] * (best / (distance * nearest)) : 0;
        out[i] = light < most_light ? light : most_light;
    }
}

static float special_importance(const pl_lights *lights, size_t light, vec3 point, vec3 normal, float ball,
                                bool closely) {
    const float *p = parameters_of(lights, light);
    switch (lights->kinds[light]) {
    case PL_LIGHT_SUN:
        return sun_importance(p, normal);
    case PL_LIGHT_AREA: {
        const area_light lamp = area_of(p);
        if (!closely)
            return ball > 0 && area_faces(&lamp, point) ? ball : 0;
        return ball > 0 ? area_importance(&lamp, point, normal, ball) : 0;
    }
    case PL_LIGHT_MESH:
        return !closely ? ball : ball > 0 ? mesh_importance(lights, p, point, normal, ball) : 0;
    default: {
        const point_light lamp = point_of(lights, light);
        return ball > 0 ? ball * point_importance(&lamp, point) : 0;
    }
    }
}

/* The sum of all, in four parts at a time: each addition waits for the one before it. */
static float sum_of(const float *numbers, size_t count) {
    float parts[4] = {0, 0, 0, 0};
    for (size_t k = 0; k + 4 <= count; k += 4)
        for (size_t part = 0; part < 4; ++part)
            parts[part] += numbers[k + part];
    for (size_t k = count & ~(size_t)3; k < count; ++k)
        parts[0] += numbers[k];
    return (parts[0] + parts[1]) + (parts[2] + parts[3]);
}

float light_importances(const pl_lights *lights, const pl_light_balls *balls, vec3 point, vec3 normal,
                        float worth_a_look, float *out_importances) {
    ball_importances(balls, point, normal, out_importances);
    const float least = worth_a_look * sum_of(out_importances, balls->count);
    for (size_t k = 0; k < balls->special_count; ++k) {
        const size_t light = balls->special[k];
        const float ball = out_importances[light];
        out_importances[light] = bounded(special_importance(lights, light, point, normal, ball, ball >= least));
    }
    return sum_of(out_importances, balls->count);
}
