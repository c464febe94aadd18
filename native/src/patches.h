/* Point -> patch and patch -> point. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_PATCHES_H
#define PATCHLIGHT_PATCHES_H

#include "sampling.h"
#include "scene.h"

struct pl_patches {
    uint8_t *apexes;
    int32_t *first_rows;
    int32_t *first_patches;
    int32_t *patch_rows; /* which row each patch is in */
    int32_t *row_triangles;
    size_t triangle_count, row_count, patch_count;
};

/* Weights of a triangle's corners 1 and 2. */
typedef struct pl_barycentric {
    float weight_1, weight_2;
} pl_barycentric;

/* Corner weights as seen from the apex: b and c follow it in order, s = 1 - weight of the apex. */
static inline int32_t patch_at(const pl_patches *patches, int32_t triangle, float u, float v) {
    const int32_t first_row = patches->first_rows[triangle];
    const int32_t rows = patches->first_rows[triangle + 1] - first_row;
    const float weights[3] = {1 - u - v, u, v};
    const int apex = patches->apexes[triangle];
    const float apex_weight = fminf(fmaxf(weights[apex], 0), 1);
    int32_t row = (int32_t)(apex_weight * (float)rows);
    row = first_row + (row < rows ? row : rows - 1);
    const int32_t first = patches->first_patches[row];
    const int32_t columns = patches->first_patches[row + 1] - first;
    if (columns == 1)
        return first;
    const float across = weights[apex == 0 ? 2 : apex == 1 ? 0 : 1] / fmaxf(1 - apex_weight, 1e-30f);
    const int32_t column = (int32_t)(fminf(fmaxf(across, 0), 1) * (float)columns);
    return first + (column < columns ? column : columns - 1);
}

static inline size_t hit_side(const pl_patches *patches, const pl_hit *hit) {
    return 2 * (size_t)patch_at(patches, hit->triangle, hit->u, hit->v) + hit->is_back;
}

static inline int32_t patch_triangle(const pl_patches *patches, size_t patch) {
    return patches->row_triangles[patches->patch_rows[patch]];
}

/* The point of a patch that (x, y) of the unit square maps to, evenly by area. */
pl_barycentric point_in_patch(const pl_patches *patches, size_t patch, float x, float y);

/* A patch side as rays leave it. */
typedef struct pl_side_frame {
    int32_t triangle;
    vec3 normal, u, v;
} pl_side_frame;

static inline pl_side_frame side_frame(const pl_scene *scene, const pl_patches *patches, size_t side) {
    pl_side_frame frame = {.triangle = patch_triangle(patches, side / 2)};
    frame.normal = vec3_scale(scene_normal(scene, frame.triangle), side & 1 ? -1.0f : 1.0f);
    vec3_basis(frame.normal, &frame.u, &frame.v);
    return frame;
}

static inline vec3 side_origin(const pl_scene *scene, const pl_patches *patches, size_t side,
                               const pl_side_frame *frame, float x, float y) {
    const pl_barycentric b = point_in_patch(patches, side / 2, x, y);
    return point_off_triangle(scene, frame->triangle, scene_point(scene, frame->triangle, b.weight_1, b.weight_2),
                              frame->normal);
}

#endif
