/* Glowing meshes. SPDX-License-Identifier: GPL-3.0-or-later */
#include "light_kinds.h"

/* Radiance of a glowing triangle towards the side that a point is on. */
static const float *radiance_towards(const pl_lights *lights, size_t triangle, vec3 corner, vec3 twice_area,
                                     vec3 point) {
    const bool is_front = vec3_dot(vec3_sub(point, corner), twice_area) >= 0;
    return lights->triangle_radiances + 6 * triangle + (is_front ? 0 : 3);
}

light_face mesh_face(const pl_lights *lights, size_t triangle, vec3 point) {
    const float *c = lights->triangle_corners + 9 * triangle;
    light_face face = {.corners = {vec3_from(c), vec3_from(c + 3), vec3_from(c + 6)}, .count = 3};
    const vec3 *corners = face.corners;
    const vec3 twice_area = vec3_cross(vec3_sub(corners[1], corners[0]), vec3_sub(corners[2], corners[0]));
    scaled(radiance_towards(lights, triangle, corners[0], twice_area, point), 1, face.radiance);
    return face;
}

/*
 * The luminance that arrives of a face, as if all of it came from its middle: near enough to choose by, in a tenth
 * of the time that Lambert's formula takes. Below 0 where the face is so near or so low that it is not.
 */
static float from_middle(const light_face *face, vec3 point, vec3 normal) {
    const vec3 a = face->corners[0], ab = vec3_sub(face->corners[1], a), ac = vec3_sub(face->corners[2], a);
    const vec3 across = vec3_cross(ab, ac);
    const vec3 to = vec3_sub(vec3_mul_add(vec3_add(ab, ac), 1.0f / 3, a), point);
    const float square = vec3_dot(to, to), reach = greater(vec3_dot(ab, ab), vec3_dot(ac, ac));
    const float height = vec3_dot(to, normal);
    if (square < 4 * reach || height * height < reach)
        return -1;
    return height < 0 ? 0
                      : luminance(face->radiance) * height * (0.5f * fabsf(vec3_dot(to, across))) / (square * square);
}

float mesh_importance(const pl_lights *lights, const float *p, vec3 point, vec3 normal, float ball) {
    const mesh_light light = mesh_of(p);
    const vec3 to = vec3_sub(light.centre, point);
    if (light.count > PL_EXACT_TRIANGLES || vec3_dot(to, to) > 16 * light.radius * light.radius)
        return ball;
    float guessed = 0, rgb[3] = {0, 0, 0};
    for (size_t t = light.first; t < light.first + light.count; ++t) {
        const light_face face = mesh_face(lights, t, point);
        const float guess = from_middle(&face, point, normal);
        if (guess >= 0)
            guessed += guess;
        else
            add_face(&face, point, normal, rgb);
    }
    return guessed + luminance(rgb);
}

/* The triangle whose share of the cumulative sums x falls into; x becomes its place in that share. */
static size_t choose_triangle(const pl_lights *lights, const mesh_light *light, float *io_x, float *out_chance) {
    size_t low = light->first;
    for (size_t left = light->count, half; left > 1; left -= half) {
        half = left / 2;
        /* no branch: it would be taken by chance, and guessed wrongly half of the time */
        low += half * (size_t)(lights->cumulative[low + half] <= *io_x);
    }
    const float start = lights->cumulative[low];
    const float end = low + 1 < light->first + light->count ? lights->cumulative[low + 1] : 1;
    *out_chance = greater(end - start, 1e-12f);
    *io_x = lesser(greater((*io_x - start) / *out_chance, 0), 1);
    return low;
}

bool sample_mesh(const pl_lights *lights, const float *p, vec3 point, vec3 normal, float x, float y,
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
    const float twice = vec3_length(twice_area);
    vec3 lamp_normal = vec3_scale(twice_area, 1 / greater(twice, 1e-30f));
    if (vec3_dot(vec3_sub(point, target), lamp_normal) < 0)
        lamp_normal = vec3_scale(lamp_normal, -1);
    target = vec3_mul_add(lamp_normal, greater(rounding_of(target), eight_ulps * light.radius), target);

    out->direction = vec3_sub(target, point);
    out->far = far_of_face;
    const float lamp_height = -vec3_dot(out->direction, lamp_normal), height = vec3_dot(out->direction, normal);
    if (height <= 0 || lamp_height <= 0)
        return false;
    const float *radiance = radiance_towards(lights, t, a, twice_area, point);
    /* cosines are heights by the distance, of which each takes one off the square law */
    const float inverse_square = 1 / vec3_dot(out->direction, out->direction);
    scaled(radiance, height * inverse_square * (lamp_height * inverse_square) * (0.5f * twice / chance),
           out->irradiance);
    return luminance(radiance) > 0;
}
