/*
 * The lights: points, spots, area lamps, suns, glowing meshes. Radiometry as Cycles has it.
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "lights.h"

#include "polygon.h"

#include <stdlib.h>

enum { EXACT_TRIANGLES = 8 }; /* a mesh light of no more is summed exactly: Lambert's formula is 0.2 us */

typedef struct point_light {
    vec3 position, intensity;
    float radius, is_soft;
    vec3 direction;
    float cos_outer, cos_inner;
} point_light;

typedef struct area_light {
    vec3 centre, radiance, axis_u, axis_v;
    float is_ellipse, spread;
} area_light;

typedef struct mesh_light {
    vec3 centre;
    float radius, weight;
    size_t first, count;
} mesh_light;

static point_light point_of(const float *p) {
    return (point_light){vec3_from(p), vec3_from(p + 3), p[6], p[7], vec3_from(p + 8), p[11], p[12]};
}

static area_light area_of(const float *p) {
    return (area_light){vec3_from(p), vec3_from(p + 3), vec3_from(p + 6), vec3_from(p + 9), p[12], p[13]};
}

static mesh_light mesh_of(const float *p) { return (mesh_light){vec3_from(p), p[3], p[4], (size_t)p[5], (size_t)p[6]}; }

/* How far along itself a shadow ray goes to a lamp that may lie in a face. */
static const float far_of_face = 0.999999f;

/* Eight units in the last place of a point's largest coordinate, as in point_off_triangle. */
static float rounding_of(vec3 p) { return 9.5367431640625e-7f * fmaxf(fabsf(p.x), fmaxf(fabsf(p.y), fabsf(p.z))); }

static const float *parameters_of(const pl_lights *lights, size_t light) {
    return lights->parameters + PL_LIGHT_FLOATS * light;
}

static void scaled(const float rgb[3], float factor, float out_rgb[3]) {
    for (int k = 0; k < 3; ++k)
        out_rgb[k] = rgb[k] * factor;
}

/* Smoothstep from the cone's edge inwards. */
static float cone_share(const point_light *light, vec3 from_light) {
    if (light->cos_inner < -1)
        return 1;
    const float cosine = vec3_dot(from_light, light->direction);
    const float range = fmaxf(light->cos_inner - light->cos_outer, 1e-6f);
    const float t = fminf(fmaxf((cosine - light->cos_outer) / range, 0), 1);
    return t * t * (3 - 2 * t);
}

/* What a spot's cone lets through of its ball's importance. */
static float cone_importance(const point_light *light, vec3 point) {
    const vec3 to = vec3_sub(light->position, point);
    const float distance = vec3_length(to);
    if (distance <= light->radius)
        return 1;
    const float share = cone_share(light, vec3_scale(to, -1 / distance));
    /* a sphere's edge can look into a cone that its centre is out of */
    return fmaxf(share, light->radius > 0 ? 0.01f : 0);
}

/* A uniform direction in the cone that a sphere fills; its solid angle over the area of a disc of its radius. */
static bool sample_sphere(const point_light *light, vec3 to, float distance, float x, float y, vec3 *out_direction,
                          float *out_far, float *out_over_disc) {
    vec3 u, v;
    const vec3 axis = vec3_scale(to, 1 / distance);
    const float sine = light->radius / distance;
    const float angle = 2 * PL_PI * y;
    if (sine >= 1)
        return false;
    vec3_basis(axis, &u, &v);
    /* 1 - cos without cancellation for small lamps far away */
    const float one_minus_cos_max = sine * sine / (1 + sqrtf(1 - sine * sine));
    const float one_minus_cos = x * one_minus_cos_max;
    const float cosine = 1 - one_minus_cos;
    const float side = sqrtf(fmaxf(0, one_minus_cos * (2 - one_minus_cos)));
    const vec3 across = vec3_mul_add(u, side * cosf(angle), vec3_scale(v, side * sinf(angle)));
    *out_direction = vec3_mul_add(axis, cosine, across);
    *out_far = distance * cosine - sqrtf(fmaxf(0, light->radius * light->radius - distance * distance * side * side));
    *out_over_disc = 2 / (distance * distance * (1 + sqrtf(1 - sine * sine)));
    return true;
}

static bool sample_point_light(const float *p, vec3 point, vec3 normal, float x, float y, pl_light_sample *out) {
    const point_light light = point_of(p);
    const vec3 to = vec3_sub(light.position, point);
    const float distance = vec3_length(to);
    float factor;
    if (distance <= 0)
        return false;

    if (light.radius <= 0) {
        out->direction = to;
        out->far = far_of_face;
        const float cosine = vec3_dot(to, normal) / distance;
        factor = cosine * cone_share(&light, vec3_scale(to, -1 / distance)) / (distance * distance);
    } else if (light.is_soft > 0) {
        /* a disc of radiance I / (pi r^2) that always faces the receiver */
        vec3 u, v;
        const vec3 axis = vec3_scale(to, 1 / distance);
        vec3_basis(axis, &u, &v);
        const float radius = light.radius * sqrtf(x), angle = 2 * PL_PI * y;
        const vec3 across = vec3_mul_add(u, radius * cosf(angle), vec3_scale(v, radius * sinf(angle)));
        out->direction = vec3_add(to, across);
        out->far = 1;
        const float square = vec3_dot(out->direction, out->direction), reach = sqrtf(square);
        const float cosine = vec3_dot(out->direction, normal) / reach;
        factor = cosine * (distance / reach) / square;
        factor *= cone_share(&light, vec3_scale(out->direction, -1 / reach));
    } else {
        /* a sphere of radiance P / (4 pi^2 r^2) = I / (pi r^2), times its solid angle: r^2 cancels, however small */
        float over_disc;
        if (!sample_sphere(&light, to, distance, x, y, &out->direction, &out->far, &over_disc))
            return false;
        factor = vec3_dot(out->direction, normal) * over_disc;
        factor *= cone_share(&light, vec3_scale(out->direction, -1));
    }
    scaled(p + 3, factor, out->irradiance);
    return factor > 0;
}

static float sun_importance(const float *p, vec3 normal) {
    return luminance(p + 3) * fmaxf(0, vec3_dot(vec3_from(p), normal) + sinf(fminf(p[6], 1.5f)));
}

static bool sample_sun(const float *p, vec3 normal, float x, float y, pl_light_sample *out) {
    vec3 u, v;
    const vec3 axis = vec3_from(p);
    vec3_basis(axis, &u, &v);
    /* a disc on the sky, narrow enough for its projection to stand for it */
    const float radius = tanf(p[6]) * sqrtf(x), angle = 2 * PL_PI * y;
    const vec3 across = vec3_mul_add(u, radius * cosf(angle), vec3_scale(v, radius * sinf(angle)));
    out->direction = vec3_unit(vec3_add(axis, across));
    out->far = INFINITY;
    const float cosine = vec3_dot(out->direction, normal);
    scaled(p + 3, cosine, out->irradiance);
    return cosine > 0;
}

/* What a narrowed beam keeps of the radiance at an angle from the lamp's axis. */
static float spread_share(const area_light *light, float cosine) {
    const float half = 0.5f * light->spread;
    if (half >= 0.5f * PL_PI - 1e-3f)
        return 1;
    const float tangent = sqrtf(fmaxf(0, 1 - cosine * cosine)) / fmaxf(cosine, 1e-6f);
    return fmaxf(0, tanf(half) - tangent) / fmaxf(tanf(half) - half, 1e-9f);
}

static void area_corners(const area_light *light, vec3 out_corners[4]) {
    static const float signs[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (int k = 0; k < 4; ++k)
        out_corners[k] =
            vec3_mul_add(light->axis_u, signs[k][0], vec3_mul_add(light->axis_v, signs[k][1], light->centre));
}

static bool area_faces(const area_light *light, vec3 point) {
    const vec3 normal = vec3_cross(light->axis_u, light->axis_v);
    return vec3_dot(vec3_sub(point, light->centre), normal) > 0;
}

static bool area_is_exact(const area_light *light) {
    return light->is_ellipse <= 0 && 0.5f * light->spread >= 0.5f * PL_PI - 1e-3f;
}

static float area_of_lamp(const area_light *light) {
    const float rectangle = 4 * vec3_length(vec3_cross(light->axis_u, light->axis_v));
    return light->is_ellipse > 0 ? 0.25f * PL_PI * rectangle : rectangle;
}

/* Near an area lamp the closed form; from far away, it says no more than the square law at fifty times the cost. */
static float area_importance(const area_light *light, const float *radiance, vec3 point, vec3 normal, float ball) {
    if (!area_faces(light, point))
        return 0;
    const float reach = 4 * vec3_length(vec3_add(light->axis_u, light->axis_v));
    const vec3 to = vec3_sub(light->centre, point);
    if (!area_is_exact(light) || vec3_dot(to, to) > reach * reach)
        return ball;
    vec3 corners[4];
    area_corners(light, corners);
    return PL_PI * luminance(radiance) * (float)point_to_polygon(point, normal, corners, 4);
}

static bool sample_area(const float *p, vec3 point, vec3 normal, float x, float y, pl_light_sample *out) {
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
    const float square = vec3_dot(out->direction, out->direction);
    const float reach = sqrtf(square);
    const float lamp_cosine = -vec3_dot(out->direction, lamp_normal) / fmaxf(reach, 1e-30f);
    const float cosine = vec3_dot(out->direction, normal) / fmaxf(reach, 1e-30f);
    if (cosine <= 0 || lamp_cosine <= 0)
        return false;
    scaled(p + 3, cosine * lamp_cosine * area_of_lamp(&light) * spread_share(&light, lamp_cosine) / square,
           out->irradiance);
    return true;
}

/* Radiance of a glowing triangle towards the side that a point is on. */
static const float *radiance_towards(const pl_lights *lights, size_t triangle, vec3 corner, vec3 twice_area,
                                     vec3 point) {
    const bool is_front = vec3_dot(vec3_sub(point, corner), twice_area) >= 0;
    return lights->triangle_radiances + 6 * triangle + (is_front ? 0 : 3);
}

static void mesh_exact(const pl_lights *lights, const mesh_light *light, vec3 point, vec3 normal, float out_rgb[3]) {
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 0;
    for (size_t t = light->first; t < light->first + light->count; ++t) {
        const float *c = lights->triangle_corners + 9 * t;
        const vec3 corners[3] = {vec3_from(c), vec3_from(c + 3), vec3_from(c + 6)};
        const vec3 twice_area = vec3_cross(vec3_sub(corners[1], corners[0]), vec3_sub(corners[2], corners[0]));
        const float *radiance = radiance_towards(lights, t, corners[0], twice_area, point);
        if (luminance(radiance) <= 0)
            continue;
        const float factor = PL_PI * (float)point_to_polygon(point, normal, corners, 3);
        for (int k = 0; k < 3; ++k)
            out_rgb[k] += factor * radiance[k];
    }
}

static float mesh_importance(const pl_lights *lights, const float *p, vec3 point, vec3 normal, float ball) {
    const mesh_light light = mesh_of(p);
    const vec3 to = vec3_sub(light.centre, point);
    if (light.count > EXACT_TRIANGLES || vec3_dot(to, to) > 16 * light.radius * light.radius)
        return ball;
    float rgb[3];
    mesh_exact(lights, &light, point, normal, rgb);
    return luminance(rgb);
}

/* The triangle whose share of the cumulative sums x falls into; x becomes its place in that share. */
static size_t choose_triangle(const pl_lights *lights, const mesh_light *light, float *io_x, float *out_chance) {
    size_t low = light->first, high = light->first + light->count;
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        if (lights->cumulative[middle] <= *io_x)
            low = middle;
        else
            high = middle;
    }
    const float start = lights->cumulative[low];
    const float end = low + 1 < light->first + light->count ? lights->cumulative[low + 1] : 1;
    *out_chance = fmaxf(end - start, 1e-12f);
    *io_x = fminf(fmaxf((*io_x - start) / *out_chance, 0), 1);
    return low;
}

static bool sample_mesh(const pl_lights *lights, const float *p, vec3 point, vec3 normal, float x, float y,
                        pl_light_sample *out) {
    const mesh_light light = mesh_of(p);
    float chance;
    const size_t t = choose_triangle(lights, &light, &x, &chance);
    const float *c = lights->triangle_corners + 9 * t;
    const vec3 a = vec3_from(c);
    const vec3 ab = vec3_sub(vec3_from(c + 3), a), ac = vec3_sub(vec3_from(c + 6), a);
    const vec3 twice_area = vec3_cross(ab, ac);
    const float width = sqrtf(x);
    vec3 target = vec3_mul_add(ab, width * (1 - y), vec3_mul_add(ac, width * y, a));

    /* the target is moved off the face towards the receiver, so that the face itself,
       which is an occluder too, is not in the way */
    vec3 lamp_normal = vec3_unit(twice_area);
    if (vec3_dot(vec3_sub(point, target), lamp_normal) < 0)
        lamp_normal = vec3_scale(lamp_normal, -1);
    target = vec3_mul_add(lamp_normal, fmaxf(rounding_of(target), 9.5367431640625e-7f * light.radius), target);

    out->direction = vec3_sub(target, point);
    out->far = far_of_face;
    const float square = vec3_dot(out->direction, out->direction);
    const float reach = fmaxf(sqrtf(square), 1e-30f);
    const float lamp_cosine = -vec3_dot(out->direction, lamp_normal) / reach;
    const float cosine = vec3_dot(out->direction, normal) / reach;
    if (cosine <= 0 || lamp_cosine <= 0)
        return false;
    const float area = 0.5f * vec3_length(twice_area);
    const float *radiance = radiance_towards(lights, t, a, twice_area, point);
    scaled(radiance, cosine * lamp_cosine * area / (square * chance), out->irradiance);
    return luminance(radiance) > 0;
}

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
        io_balls->strength[light] = luminance(p + 3) * area_of_lamp(&lamp) * fmaxf(spread_share(&lamp, 1), 1);
        break;
    }
    case PL_LIGHT_MESH:
        io_balls->radius[light] = p[3];
        io_balls->strength[light] = p[4];
        break;
    default:
        io_balls->strength[light] = 0;
    }
    io_balls->strength[light] = fminf(io_balls->strength[light], 1e30f);
    const bool is_plain = lights->kinds[light] == PL_LIGHT_POINT && p[12] < -1;
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
        const float light = best > 0 ? strengths[i] * (best / distance / nearest) : 0;
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
        return ball > 0 ? area_importance(&lamp, p + 3, point, normal, ball) : 0;
    }
    case PL_LIGHT_MESH:
        return !closely ? ball : ball > 0 ? mesh_importance(lights, p, point, normal, ball) : 0;
    default: {
        const point_light lamp = point_of(p);
        return ball > 0 ? ball * cone_importance(&lamp, point) : 0;
    }
    }
}

float light_importances(const pl_lights *lights, const pl_light_balls *balls, vec3 point, vec3 normal, bool closely,
                        float *out_importances) {
    float total = 0;
    ball_importances(balls, point, normal, out_importances);
    for (size_t k = 0; k < balls->special_count; ++k) {
        const size_t light = balls->special[k];
        out_importances[light] =
            bounded(special_importance(lights, light, point, normal, out_importances[light], closely));
    }
    for (size_t light = 0; light < balls->count; ++light)
        total += out_importances[light];
    return total;
}

bool light_has_closed_form(const pl_lights *lights, size_t light) {
    const float *p = parameters_of(lights, light);
    if (lights->kinds[light] == PL_LIGHT_AREA) {
        const area_light lamp = area_of(p);
        return area_is_exact(&lamp);
    }
    return lights->kinds[light] == PL_LIGHT_MESH && mesh_of(p).count <= EXACT_TRIANGLES;
}

static bool exact(const pl_lights *lights, size_t light, vec3 point, vec3 normal, float out_rgb[3]) {
    const float *p = parameters_of(lights, light);
    if (lights->kinds[light] == PL_LIGHT_AREA) {
        const area_light lamp = area_of(p);
        if (!area_is_exact(&lamp))
            return false;
        vec3 corners[4];
        area_corners(&lamp, corners);
        const bool faces = area_faces(&lamp, point);
        scaled(p + 3, faces ? PL_PI * (float)point_to_polygon(point, normal, corners, 4) : 0, out_rgb);
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
