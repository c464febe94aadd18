/* A light as one receiver samples it. SPDX-License-Identifier: GPL-3.0-or-later */
#include "aimed_light.h"

#include "sampling.h"

/* Whether some of the faces are below the horizon or dark. */
static bool are_cut(const light_face *faces, size_t count, vec3 point, vec3 normal) {
    for (size_t k = 0; k < count; ++k) {
        if (luminance(faces[k].radiance) <= 0)
            return true;
        for (int corner = 0; corner < faces[k].count; ++corner)
            if (vec3_dot(vec3_sub(faces[k].corners[corner], point), normal) <= 0)
                return true;
    }
    return false;
}

/* Sutherland-Hodgman against the horizon. */
static int clip_face(const light_face *face, vec3 point, vec3 normal, vec3 out_corners[5]) {
    int clipped = 0;
    for (int i = 0; i < face->count; ++i) {
        const vec3 a = face->corners[i], b = face->corners[(i + 1) % face->count];
        const float height_a = vec3_dot(vec3_sub(a, point), normal), height_b = vec3_dot(vec3_sub(b, point), normal);
        if (height_a > 0)
            out_corners[clipped++] = a;
        if ((height_a > 0) != (height_b > 0))
            out_corners[clipped++] = vec3_mul_add(vec3_sub(b, a), height_a / (height_a - height_b), a);
    }
    return clipped;
}

static void add_risen(const light_face *face, aimed_light *io_aimed) {
    vec3 corners[5];
    const int count = clip_face(face, io_aimed->point, io_aimed->normal, corners);
    for (int i = 2; i < count; ++i) {
        risen_triangle risen = {
            .a = corners[0], .ab = vec3_sub(corners[i - 1], corners[0]), .ac = vec3_sub(corners[i], corners[0])};
        const vec3 across = vec3_cross(risen.ab, risen.ac);
        const float twice = vec3_length(across);
        if (twice <= 0)
            continue;
        const bool is_front = vec3_dot(across, vec3_sub(io_aimed->point, corners[0])) >= 0;
        risen.normal = vec3_scale(across, (is_front ? 1 : -1) / twice);
        risen.area = 0.5f * twice;
        scaled(face->radiance, 1, risen.radiance);
        io_aimed->power += risen.area * luminance(risen.radiance);
        io_aimed->triangles[io_aimed->count++] = risen;
    }
}

bool aim(const pl_lights *lights, size_t light, vec3 point, vec3 normal, aimed_light *out) {
    light_face faces[EXACT_TRIANGLES];
    const size_t count = light_faces(lights, light, point, faces);
    out->lights = lights;
    out->light = light;
    out->point = point;
    out->normal = normal;
    out->is_exact = count > 0;
    out->is_cut = are_cut(faces, count, point, normal);
    for (int c = 0; c < 3; ++c)
        out->exact[c] = 0;
    for (size_t k = 0; k < count; ++k)
        add_face(faces + k, point, normal, out->exact);
    for (int c = 0; c < 3; ++c)
        out->exact[c] = bounded(out->exact[c]);
    out->power = 0;
    out->count = 0;
    for (size_t k = 0; out->is_cut && k < count; ++k)
        if (luminance(faces[k].radiance) > 0)
            add_risen(faces + k, out);
    return !out->is_exact || (luminance(out->exact) > 0 && (!out->is_cut || out->power > 0));
}

/* A point of the triangles for (x, y) of the unit square, by what they emit. */
static bool sample_risen(const aimed_light *aimed, float x, float y, pl_light_sample *out) {
    float passed = x * aimed->power, emitted = 0;
    const risen_triangle *risen = aimed->triangles;
    for (size_t k = 0; k < aimed->count; ++k, passed -= emitted) {
        risen = aimed->triangles + k;
        emitted = risen->area * luminance(risen->radiance);
        if (passed < emitted)
            break;
    }
    const float width = sqrtf(lesser(greater(passed / emitted, 0), 1));
    vec3 target = vec3_mul_add(risen->ab, width * (1 - y), vec3_mul_add(risen->ac, width * y, risen->a));
    /* off the face, which is an occluder too, towards the receiver */
    target = vec3_mul_add(risen->normal, rounding_of(target), target);
    out->direction = vec3_sub(target, aimed->point);
    out->far = far_of_face;
    const float lamp_height = -vec3_dot(out->direction, risen->normal);
    const float height = vec3_dot(out->direction, aimed->normal);
    if (height <= 0 || lamp_height <= 0)
        return false;
    /* cosines are heights by the distance, of which each takes one off the square law */
    const float inverse_square = 1 / vec3_dot(out->direction, out->direction);
    const float factor = height * inverse_square * (lamp_height * inverse_square);
    scaled(risen->radiance, factor * (aimed->power / luminance(risen->radiance)), out->irradiance);
    for (int c = 0; c < 3; ++c)
        out->irradiance[c] = bounded(out->irradiance[c]);
    return true;
}

bool sample_aimed(const aimed_light *aimed, uint32_t seed, uint32_t k, pl_light_sample *out_sample) {
    const float x = sobol(k, 0, seed), y = sobol(k, 1, seed);
    if (aimed->is_cut)
        return sample_risen(aimed, x, y, out_sample);
    return light_sample(aimed->lights, aimed->light, aimed->point, aimed->normal, x, y, out_sample);
}
