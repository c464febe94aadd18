/* How triangles are cut into patches. SPDX-License-Identifier: GPL-3.0-or-later */
#include "patches.h"

#include <stdlib.h>
#include <string.h>

static bool is_rising(const int32_t *offsets, size_t count) {
    for (size_t i = 0; i < count; ++i)
        if (offsets[i + 1] <= offsets[i])
            return false;
    return offsets[0] == 0;
}

static bool are_squares(const int32_t *offsets, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        const int32_t root = (int32_t)(sqrtf((float)(offsets[i + 1] - offsets[i])) + 0.5f);
        if (root > PL_MOST_ALONG || root * root != offsets[i + 1] - offsets[i])
            return false;
    }
    return true;
}

static bool layout_is_valid(const pl_patch_layout *layout) {
    for (size_t t = 0; t < layout->triangle_count; ++t)
        if (layout->apexes[t] > 2)
            return false;
    return is_rising(layout->first_rows, layout->triangle_count) &&
           (size_t)layout->first_rows[layout->triangle_count] == layout->row_count &&
           is_rising(layout->first_cells, layout->row_count) &&
           (size_t)layout->first_cells[layout->row_count] == layout->cell_count &&
           is_rising(layout->first_patches, layout->cell_count) &&
           are_squares(layout->first_patches, layout->cell_count);
}

static int32_t *copy_of(const int32_t *numbers, size_t count) {
    int32_t *copy = malloc(sizeof *copy * count);
    if (copy)
        memcpy(copy, numbers, sizeof *copy * count);
    return copy;
}

/* Which run each number belongs to: the inverse of offsets. */
static int32_t *owners(const int32_t *offsets, size_t count) {
    int32_t *owner = malloc(sizeof *owner * ((size_t)offsets[count] + 1));
    for (size_t i = 0; owner && i < count; ++i)
        for (int32_t k = offsets[i]; k < offsets[i + 1]; ++k)
            owner[k] = (int32_t)i;
    return owner;
}

pl_status pl_patches_create(const pl_patch_layout *layout, pl_patches **out_patches) {
    if (!layout_is_valid(layout))
        return PL_ERR_ARGUMENT;
    pl_patches *patches = calloc(1, sizeof *patches);
    if (!patches)
        return PL_ERR_MEMORY;
    patches->triangle_count = layout->triangle_count;
    patches->row_count = layout->row_count;
    patches->cell_count = layout->cell_count;
    patches->patch_count = (size_t)layout->first_patches[layout->cell_count];
    patches->apexes = malloc(layout->triangle_count + 1);
    patches->first_rows = copy_of(layout->first_rows, layout->triangle_count + 1);
    patches->first_cells = copy_of(layout->first_cells, layout->row_count + 1);
    patches->first_patches = copy_of(layout->first_patches, layout->cell_count + 1);
    patches->patch_cells = owners(layout->first_patches, layout->cell_count);
    patches->cell_rows = owners(layout->first_cells, layout->row_count);
    patches->row_triangles = owners(layout->first_rows, layout->triangle_count);
    if (!patches->apexes || !patches->first_rows || !patches->first_cells || !patches->first_patches ||
        !patches->patch_cells || !patches->cell_rows || !patches->row_triangles) {
        pl_patches_destroy(patches);
        return PL_ERR_MEMORY;
    }
    memcpy(patches->apexes, layout->apexes, layout->triangle_count);
    *out_patches = patches;
    return PL_OK;
}

void pl_patches_destroy(pl_patches *patches) {
    if (!patches)
        return;
    free(patches->apexes);
    free(patches->first_rows);
    free(patches->first_cells);
    free(patches->first_patches);
    free(patches->patch_cells);
    free(patches->cell_rows);
    free(patches->row_triangles);
    free(patches);
}

size_t pl_patches_count(const pl_patches *patches) { return patches->patch_count; }

bool pl_patches_fit(const pl_patches *patches, const pl_scene *scene) {
    return patches->triangle_count == scene->triangle_count;
}

/*
 * Rays start no nearer than this to the edges of a triangle. Rounded to float32, what is nearer may lie beyond the wall
 * that stands on the edge, and its light would leak: of some rays in ten million, but dark would not be exactly dark.
 */
static const float least_weight = 0x1p-18f;

static pl_barycentric off_the_edges(float weight_1, float weight_2) {
    weight_1 = greater(weight_1, least_weight);
    weight_2 = greater(weight_2, least_weight);
    const float scale = lesser((1 - least_weight) / (weight_1 + weight_2), 1);
    return (pl_barycentric){weight_1 * scale, weight_2 * scale};
}

pl_barycentric point_in_patch(const pl_patches *patches, size_t patch, float x, float y) {
    const int32_t cell = patches->patch_cells[patch], row = patches->cell_rows[cell];
    const int32_t triangle = patches->row_triangles[row];
    const int32_t first_row = patches->first_rows[triangle];
    const float along = (float)patches_along(patches, cell);
    const float rows = along * (float)(patches->first_rows[triangle + 1] - first_row);
    const float columns = along * (float)(patches->first_cells[row + 1] - patches->first_cells[row]);
    const int32_t part = (int32_t)patch - patches->first_patches[cell];
    const float i = along * (float)(row - first_row) + (float)(part / (int32_t)along);
    const float j = along * (float)(cell - patches->first_cells[row]) + (float)(part % (int32_t)along);

    /* the width of the triangle falls linearly towards the apex: area goes with the width's square */
    const float wide = 1 - i / rows;
    const float narrow = greater(1 - (i + 1) / rows, 0);
    const float width = sqrtf(wide * wide + x * (narrow * narrow - wide * wide));
    const float across = (j + y) / columns;

    float weights[3];
    const int apex = patches->apexes[triangle];
    weights[apex] = 1 - width;
    weights[(apex + 1) % 3] = width * (1 - across);
    weights[(apex + 2) % 3] = width * across;
    return off_the_edges(weights[1], weights[2]);
}

pl_status pl_patch_points(const pl_patches *patches, const int32_t *selected, size_t count, uint32_t samples,
                          uint32_t seed, int32_t *out_triangles, float *out_barycentrics) {
    for (size_t i = 0; i < count; ++i)
        if (selected[i] < 0 || (size_t)selected[i] >= patches->patch_count)
            return PL_ERR_ARGUMENT;
    for (size_t i = 0; i < count; ++i) {
        const size_t patch = (size_t)selected[i];
        const uint32_t patch_seed = hash_pair(seed, (uint32_t)patch);
        for (uint32_t k = 0; k < samples; ++k) {
            const pl_barycentric b = point_in_patch(patches, patch, sobol(k, 0, patch_seed), sobol(k, 1, patch_seed));
            const size_t at = i * samples + k;
            out_triangles[at] = patch_triangle(patches, patch);
            out_barycentrics[3 * at] = 1 - b.weight_1 - b.weight_2;
            out_barycentrics[3 * at + 1] = b.weight_1;
            out_barycentrics[3 * at + 2] = b.weight_2;
        }
    }
    return PL_OK;
}
