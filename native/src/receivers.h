/* A receiver as rays leave it. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_RECEIVERS_H
#define PATCHLIGHT_RECEIVERS_H

#include "scene.h"

typedef struct pl_receiver_frame {
    int32_t triangle;
    int side;
    vec3 origin;    /* off the triangle's plane */
    vec3 lift;      /* from there to where the smooth surface is that the triangle stands for */
    vec3 geometric; /* the plane's normal on the receiver's side */
    vec3 shading;   /* where the cosine is measured from */
    bool is_smooth;
} pl_receiver_frame;

static inline pl_receiver_frame receiver_frame(const pl_scene *scene, const pl_receivers *receivers, size_t index) {
    const double *p = receivers->positions + 3 * index;
    pl_receiver_frame frame = {.triangle = receivers->triangle_sides[index] / 2,
                               .side = receivers->triangle_sides[index] & 1};
    vec3 point = {(float)(p[0] - scene->centre[0]), (float)(p[1] - scene->centre[1]), (float)(p[2] - scene->centre[2])};
    frame.geometric = vec3_scale(scene_normal(scene, frame.triangle), frame.side ? -1.0f : 1.0f);
    frame.shading = vec3_from(receivers->normals + 3 * index);
    frame.is_smooth = vec3_dot(frame.geometric, frame.shading) < 0.99999f;
    if (!frame.is_smooth)
        frame.shading = frame.geometric;
    frame.lift = (vec3){0, 0, 0};
    if (frame.is_smooth) {
        const vec3 corner = scene_vertex(scene, frame.triangle, 0);
        frame.lift = vec3_scale(frame.geometric, vec3_dot(vec3_sub(point, corner), frame.geometric));
        point = vec3_sub(point, frame.lift);
    }
    frame.origin = point_off_triangle(scene, frame.triangle, point, frame.geometric);
    return frame;
}

/*
 * Where a ray starts. Above the triangle's plane the triangle is what there is. Below it is the rest of what bulges,
 * which would shade what lies on it (the terminator): there rays start on the smooth surface.
 */
static inline vec3 ray_origin(const pl_receiver_frame *frame, vec3 direction) {
    const bool is_below = frame->is_smooth && vec3_dot(frame->geometric, direction) <= 0;
    return is_below ? vec3_add(frame->origin, frame->lift) : frame->origin;
}

static inline bool receiver_is_valid(const pl_scene *scene, const pl_receivers *receivers, size_t index) {
    return index < receivers->count && receivers->triangle_sides[index] >= 0 &&
           (size_t)receivers->triangle_sides[index] < 2 * scene->triangle_count;
}

#endif
