/* Point -> patch and patch -> point. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_PATCHES_H
#define PATCHLIGHT_PATCHES_H

#include "sampling.h"
#include "scene.h"

struct pl_patches {
    uint8_t *apexes;
    int32_t *first_rows;
    int32_t *first_cells;
    int32_t *first_patches;
    int32_t *patch_cells; /* which cell each patch is part of, which row that is in */
    int32_t *cell_rows;
    int32_t *row_triangles;
    size_t triangle_count, row_count, cell_count, patch_count;
};

/* Weights of a triangle's corners 1 and 2. */
typedef struct pl_barycentric {
    float weight_1, weight_2;
} pl_barycentric;

/* Along each side of a cell lie so many patches. */
static inline int32_t patches_along(const pl_patches *patches, int32_t cell) {
    return (int32_t)(sqrtf((float)(patches->first_patches[cell + 1] - patches->first_patches[cell])) + 0.5f);
}

static inline int32_t part_at(float share, int32_t parts) {
    const int32_t part = (int32_t)(share * (float)parts);
    return part < parts ? part : parts - 1;
}

/* Seen from the apex: `down` from its opposite edge to it, `across` from the next corner to the one after. */
static inline int32_t patch_at(const pl_patches *patches, int32_t triangle, float u, float v) {
    const int32_t first_row = patches->first_rows[triangle];
    const int32_t rows = patches->first_rows[triangle + 1] - first_row;
    const float weights[3] = {1 - u - v, u, v};
    const int apex = patches->apexes[triangle];
    const float down = lesser(greater(weights[apex], 0), 1);
    const int32_t row = part_at(down, rows);
    const int32_t first_cell = patches->first_cells[first_row + row];
    const int32_t columns = patches->first_cells[first_row + row + 1] - first_cell;
    const int32_t first = patches->first_patches[first_cell];
    if (columns == 1 && patches->first_patches[first_cell + 1] == first + 1)
        return first;
    const float weight_after = weights[apex == 0 ? 2 : apex == 1 ? 0 : 1];
    const float across = lesser(greater(weight_after / greater(1 - down, 1e-30f), 0), 1);
    const int32_t column = part_at(across, columns);
    const int32_t along = patches_along(patches, first_cell + column);
    if (along == 1)
        return patches->first_patches[first_cell + column];
    const int32_t i = part_at(down * (float)rows - (float)row, along);
    const int32_t j = part_at(across * (float)columns - (float)column, along);
    return patches->first_patches[first_cell + column] + i * along + j;
}

static inline size_t hit_side(const pl_patches *patches, const pl_hit *hit) {
    return 2 * (size_t)patch_at(patches, hit->triangle, hit->u, hit->v) + hit->is_back;
}

static inline int32_t patch_triangle(const pl_patches *patches, size_t patch) {
    return patches->row_triangles[patches->cell_rows[patches->patch_cells[patch]]];
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
