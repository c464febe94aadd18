/* A light as one receiver samples it. SPDX-License-Identifier: GPL-3.0-or-later */
#include "aimed_light.h"

/* Lamps that are larger from here are sampled by solid angle [sr]. One sample alone has to stay below what a hemisphere
   of the lamp's radiance would give; many are spread better over the area, until only what is nearest counts. */
static const float large_for_one = 0.01f, large_for_many = 2.5f;

/* Whether some of a face is below the horizon or dark. */
static bool is_cut(const light_face *face, vec3 point, vec3 normal) {
    if (luminance(face->radiance) <= 0)
        return true;
    for (int corner = 0; corner < face->count; ++corner)
        if (vec3_dot(vec3_sub(face->corners[corner], point), normal) <= 0)
            return true;
    return false;
}

/* The corners of what of a face is above the horizon, and how many these are. */
static int clip_face(const light_face *face, vec3 point, vec3 normal, vec3 out_corners[MAX_CLIPPED]) {
    const dvec3 n = {(double)normal.x, (double)normal.y, (double)normal.z};
    dvec3 seen[MAX_CORNERS], clipped[MAX_CLIPPED];
    for (int i = 0; i < face->count; ++i)
        seen[i] = dvec3_between(point, face->corners[i]);
    const int count = clip_to_horizon(seen, face->count, n, clipped);
    for (int i = 0; i < count; ++i)
        out_corners[i] = vec3_add(point, (vec3){(float)clipped[i].x, (float)clipped[i].y, (float)clipped[i].z});
    return count;
}

/* Of the triangle between three unit directions (Van Oosterom & Strackee 1983, eq. 8) [sr]. */
static float solid_angle(const vec3 seen[3]) {
    const float volume = fabsf(vec3_dot(seen[0], vec3_cross(seen[1], seen[2])));
    return 2 * atan2f(volume, 1 + vec3_dot(seen[0], seen[1]) + vec3_dot(seen[1], seen[2]) + vec3_dot(seen[2], seen[0]));
}

static void add_risen(const light_face *face, aimed_light *io_aimed) {
    vec3 corners[MAX_CLIPPED];
    const int count = clip_face(face, io_aimed->point, io_aimed->normal, corners);
    for (int i = 2; i < count; ++i) {
        const vec3 a = corners[0], b = corners[i - 1], c = corners[i], point = io_aimed->point;
        const vec3 across = vec3_cross(vec3_sub(b, a), vec3_sub(c, a));
        const float twice = vec3_length(across);
        if (!(twice > 0))
            continue;
        const bool is_front = vec3_dot(across, vec3_sub(point, a)) >= 0;
        risen_triangle *risen = io_aimed->triangles + io_aimed->count++;
        risen->a = a;
        risen->ab = vec3_sub(b, a);
        risen->ac = vec3_sub(c, a);
        risen->normal = vec3_scale(across, (is_front ? 1 : -1) / twice);
        risen->area = 0.5f * twice;
        scaled(face->radiance, 1, risen->radiance);
        risen->seen[0] = vec3_unit(vec3_sub(a, point));
        risen->seen[1] = vec3_unit(vec3_sub(b, point));
        risen->seen[2] = vec3_unit(vec3_sub(c, point));
        risen->angle = solid_angle(risen->seen);
    }
}

/* Samples fall on triangles by the luminance of their radiance and their area or angle; false where none has any. */
static bool share_out(aimed_light *io_aimed) {
    float weight = 0;
    for (size_t k = 0; k < io_aimed->count; ++k) {
        risen_triangle *risen = io_aimed->triangles + k;
        risen->share = luminance(risen->radiance) * (io_aimed->way == BY_ANGLE ? risen->angle : risen->area);
        weight += risen->share;
    }
    if (!(weight > 0))
        return false;
    for (size_t k = 0; k < io_aimed->count; ++k) {
        risen_triangle *risen = io_aimed->triangles + k;
        risen->share /= weight;
        scaled(risen->radiance, weight / luminance(risen->radiance), risen->sampled);
    }
    return true;
}

bool aim(const pl_lights *lights, size_t light, vec3 point, vec3 normal, bool once, aimed_light *out) {
    bool cut = false;
    float angle = 0;
    out->lights = lights;
    out->light = light;
    out->point = point;
    out->normal = normal;
    out->face_count = light_faces(lights, light, point, out->faces);
    out->way = BY_LIGHT;
    if (!out->face_count)
        return true;

    out->count = 0;
    for (size_t k = 0; k < out->face_count; ++k) {
        cut = cut || is_cut(out->faces + k, point, normal);
        if (luminance(out->faces[k].radiance) > 0)
            add_risen(out->faces + k, out);
    }
    for (size_t k = 0; k < out->count; ++k)
        angle += out->triangles[k].angle;
    if (angle > (once ? large_for_one : large_for_many))
        out->way = BY_ANGLE;
    else if (cut || lights->kinds[light] == PL_LIGHT_MESH) /* a rectangle as a whole is spread better */
        out->way = BY_AREA;
    return share_out(out);
}

void aimed_exact(const aimed_light *aimed, float out_rgb[3]) {
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 0;
    for (size_t k = 0; k < aimed->face_count; ++k)
        add_face(aimed->faces + k, aimed->point, aimed->normal, out_rgb);
    for (int c = 0; c < 3; ++c)
        out_rgb[c] = bounded(out_rgb[c]);
}

/* The triangle whose share x falls into; x becomes its place in that share. */
static const risen_triangle *choose_risen(const aimed_light *aimed, float *io_x) {
    float passed = *io_x;
    size_t k = 0;
    while (k + 1 < aimed->count && passed >= aimed->triangles[k].share)
        passed -= aimed->triangles[k++].share;
    *io_x = lesser(greater(passed / greater(aimed->triangles[k].share, 1e-30f), 0), 1);
    return aimed->triangles + k;
}

/* To a point of a face, moved off it towards the receiver: the face is an occluder, too. */
static void aim_at(const aimed_light *aimed, const risen_triangle *risen, vec3 target, pl_light_sample *out) {
    target = vec3_mul_add(risen->normal, rounding_of(target), target);
    out->direction = vec3_sub(target, aimed->point);
    out->far = light_is_shadowless(aimed->lights, aimed->light) ? 0 : far_of_face;
}

static bool sample_by_area(const aimed_light *aimed, float x, float y, pl_light_sample *out) {
    const risen_triangle *risen = choose_risen(aimed, &x);
    const float width = sqrtf(x);
    aim_at(aimed, risen, vec3_mul_add(risen->ab, width * (1 - y), vec3_mul_add(risen->ac, width * y, risen->a)), out);
    const float lamp_height = -vec3_dot(out->direction, risen->normal);
    const float height = vec3_dot(out->direction, aimed->normal);
    if (height <= 0 || lamp_height <= 0)
        return false;
    /* cosines are heights by the distance, of which each takes one off the square law */
    const float inverse_square = 1 / vec3_dot(out->direction, out->direction);
    scaled(risen->sampled, height * inverse_square * (lamp_height * inverse_square), out->irradiance);
    for (int c = 0; c < 3; ++c)
        out->irradiance[c] = bounded(out->irradiance[c]);
    return true;
}

/* The unit vector in the plane of two that is at right angles to the first. */
static vec3 across_from(vec3 first, vec3 second) {
    return vec3_unit(vec3_mul_add(first, -vec3_dot(first, second), second));
}

/* A direction, even over a triangle's solid angle (Arvo 1995, "Stratified sampling of spherical triangles"). */
static vec3 direction_within(const risen_triangle *risen, float x, float y) {
    const vec3 a = risen->seen[0], b = risen->seen[1], to_c = across_from(a, risen->seen[2]);
    const float cos_alpha = lesser(greater(vec3_dot(across_from(a, b), to_c), -1), 1);
    const float sin_alpha = sqrtf(greater(1 - cos_alpha * cos_alpha, 1e-12f));
    /* the arc from b to a point of the arc from a to c cuts off x of the angle */
    const float turn = x * risen->angle - acosf(cos_alpha);
    const float s = sinf(turn), t = cosf(turn);
    const float u = t - cos_alpha, v = s + sin_alpha * vec3_dot(a, b);
    const float below = (v * s + u * t) * sin_alpha;
    const float cosine = fabsf(below) > 1e-20f ? ((v * t - u * s) * cos_alpha - v) / below : 1;
    const float q = lesser(greater(cosine, -1), 1);
    const vec3 cut = vec3_mul_add(to_c, sqrtf(1 - q * q), vec3_scale(a, q));
    const float z = 1 - y * (1 - vec3_dot(cut, b));
    return vec3_mul_add(across_from(b, cut), sqrtf(greater(1 - z * z, 0)), vec3_scale(b, z));
}

/* A number in [0, 1] whose density goes from one weight to the other. */
static float between(float x, float low, float high) {
    return x * (low + high) / (low + sqrtf(low * low + x * (high * high - low * low)));
}

/*
 * (x, y) moved to where they lead to directions of large cosines; returns the density there. What direction_within
 * makes of the unit square's corners are b, b, a and c; in between cosines are about bilinear.
 */
static float prefer_cosines(const risen_triangle *risen, vec3 normal, float *io_x, float *io_y) {
    const float a = greater(vec3_dot(risen->seen[0], normal), 0.01f);
    const float b = greater(vec3_dot(risen->seen[1], normal), 0.01f);
    const float c = greater(vec3_dot(risen->seen[2], normal), 0.01f);
    const float y = between(*io_y, 2 * b, a + c);
    const float x = between(*io_x, b + y * (a - b), b + y * (c - b));
    *io_x = x;
    *io_y = y;
    return 4 * ((1 - y) * b + y * ((1 - x) * a + x * c)) / (a + 2 * b + c);
}

static bool sample_by_angle(const aimed_light *aimed, float x, float y, pl_light_sample *out) {
    const risen_triangle *risen = choose_risen(aimed, &x);
    const float density = prefer_cosines(risen, aimed->normal, &x, &y);
    const vec3 direction = direction_within(risen, x, y);
    const float slope = vec3_dot(direction, risen->normal), cosine = vec3_dot(direction, aimed->normal);
    if (slope >= 0 || cosine <= 0)
        return false;
    const float distance = vec3_dot(vec3_sub(risen->a, aimed->point), risen->normal) / slope;
    aim_at(aimed, risen, vec3_mul_add(direction, distance, aimed->point), out);
    scaled(risen->sampled, cosine / density, out->irradiance);
    return true;
}

bool sample_aimed(const aimed_light *aimed, float x, float y, pl_light_sample *out_sample) {
    switch (aimed->way) {
    case BY_ANGLE:
        return sample_by_angle(aimed, x, y, out_sample);
    case BY_AREA:
        return sample_by_area(aimed, x, y, out_sample);
    default:
        return light_sample(aimed->lights, aimed->light, aimed->point, aimed->normal, x, y, out_sample);
    }
}
