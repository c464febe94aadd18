/* Point -> patch and patch -> point. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_PATCHES_H
#define PATCHLIGHT_PATCHES_H

#include "sampling.h"
#include "scene.h"

struct pl_patches {
    uint8_t *apexes;
    int32_t *first_rows;
    int32_t *first_cells;
    int32_t *first_pieces;
    int32_t *piece_cells; /* which cell each piece is part of, which row that is in */
    int32_t *cell_rows;
    int32_t *row_triangles;
    int32_t *owners;        /* of the pieces; NULL, as the next three, where every piece is a patch */
    int32_t *first_members; /* patch_count + 1: patch p has members[first_members[p]] ... */
    int32_t *members;
    float *before; /* for each of the members, what share of the patch's area lies in those before it */
    size_t triangle_count, row_count, cell_count, piece_count, patch_count;
};

/* A point of a patch: its triangle, and weights of that one's corners 1 and 2. */
typedef struct pl_patch_point {
    int32_t triangle;
    float weight_1, weight_2;
} pl_patch_point;

/* Along each side of a cell lie so many pieces. */
static inline int32_t pieces_along(const pl_patches *patches, int32_t cell) {
    return (int32_t)(sqrtf((float)(patches->first_pieces[cell + 1] - patches->first_pieces[cell])) + 0.5f);
}

static inline int32_t part_at(float share, int32_t parts) {
    const int32_t part = (int32_t)(share * (float)parts);
    return part < parts ? part : parts - 1;
}

/* Seen from the apex: `down` from its opposite edge to it, `across` from the next corner to the one after. */
static inline int32_t piece_at(const pl_patches *patches, int32_t triangle, float u, float v) {
    const int32_t first_row = patches->first_rows[triangle];
    const int32_t rows = patches->first_rows[triangle + 1] - first_row;
    const float weights[3] = {1 - u - v, u, v};
    const int apex = patches->apexes[triangle];
    const float down = lesser(greater(weights[apex], 0), 1);
    const int32_t row = part_at(down, rows);
    const int32_t first_cell = patches->first_cells[first_row + row];
    const int32_t columns = patches->first_cells[first_row + row + 1] - first_cell;
    const int32_t first = patches->first_pieces[first_cell];
    if (columns == 1 && patches->first_pieces[first_cell + 1] == first + 1)
        return first;
    const float weight_after = weights[apex == 0 ? 2 : apex == 1 ? 0 : 1];
    const float across = lesser(greater(weight_after / greater(1 - down, 1e-30f), 0), 1);
    const int32_t column = part_at(across, columns);
    const int32_t along = pieces_along(patches, first_cell + column);
    if (along == 1)
        return patches->first_pieces[first_cell + column];
    const int32_t i = part_at(down * (float)rows - (float)row, along);
    const int32_t j = part_at(across * (float)columns - (float)column, along);
    return patches->first_pieces[first_cell + column] + i * along + j;
}

static inline int32_t patch_at(const pl_patches *patches, int32_t triangle, float u, float v) {
    const int32_t piece = piece_at(patches, triangle, u, v);
    return patches->owners ? patches->owners[piece] : piece;
}

static inline size_t hit_side(const pl_patches *patches, const pl_hit *hit) {
    return 2 * (size_t)patch_at(patches, hit->triangle, hit->u, hit->v) + hit->is_back;
}

/* The point of a patch that (x, y) of the unit square maps to, evenly by area. */
pl_patch_point point_in_patch(const pl_patches *patches, size_t patch, float x, float y);

/* A point of a patch side as rays leave it: off its plane, with a basis about the normal. */
typedef struct pl_side_point {
    vec3 origin, normal, u, v;
} pl_side_point;

static inline pl_side_point side_point(const pl_scene *scene, const pl_patches *patches, size_t side, float x,
                                       float y) {
    const pl_patch_point p = point_in_patch(patches, side / 2, x, y);
    pl_side_point from = {.normal = vec3_scale(scene_normal(scene, p.triangle), side & 1 ? -1.0f : 1.0f)};
    from.origin =
        point_off_triangle(scene, p.triangle, scene_point(scene, p.triangle, p.weight_1, p.weight_2), from.normal);
    vec3_basis(from.normal, &from.u, &from.v);
    return from;
}

#endif
