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
           is_rising(layout->first_pieces, layout->cell_count) && are_squares(layout->first_pieces, layout->cell_count);
}

/* Whether all pieces have a patch, and the patches a piece. */
static bool owners_are_valid(const int32_t *owners, size_t piece_count, const int32_t *first_members,
                             size_t patch_count) {
    for (size_t i = 0; i < piece_count; ++i)
        if (!(owners[i] >= 0 && (size_t)owners[i] < patch_count))
            return false;
    return is_rising(first_members, patch_count);
}

/* Which run each number belongs to: the inverse of offsets. */
static int32_t *run_of_each(const int32_t *offsets, size_t count) {
    int32_t *owner = malloc(sizeof *owner * ((size_t)offsets[count] + 1));
    for (size_t i = 0; owner && i < count; ++i)
        for (int32_t k = offsets[i]; k < offsets[i + 1]; ++k)
            owner[k] = (int32_t)i;
    return owner;
}

/* first_members: how many pieces the patches before each have; those of patches that there are not count for none. */
static void count_members(const int32_t *owners, size_t piece_count, int32_t *io_first_members, size_t patch_count) {
    for (size_t i = 0; i < piece_count; ++i)
        if (owners[i] >= 0 && (size_t)owners[i] < patch_count)
            ++io_first_members[owners[i] + 1];
    for (size_t p = 0; p < patch_count; ++p)
        io_first_members[p + 1] += io_first_members[p];
}

/* Which pieces each patch has, in their order, and what of its area lies before each; without area all count alike. */
static void sort_members(pl_patches *patches, const float *areas, int32_t *next) {
    memcpy(next, patches->first_members, sizeof *next * patches->patch_count);
    for (size_t i = 0; i < patches->piece_count; ++i)
        patches->members[next[patches->owners[i]]++] = (int32_t)i;
    for (size_t p = 0; p < patches->patch_count; ++p) {
        const int32_t first = patches->first_members[p], end = patches->first_members[p + 1];
        double total = 0, passed = 0;
        for (int32_t k = first; k < end; ++k)
            total += (double)areas[patches->members[k]];
        for (int32_t k = first; k < end; ++k) {
            patches->before[k] = total > 0 ? (float)(passed / total) : (float)(k - first) / (float)(end - first);
            passed += (double)areas[patches->members[k]];
        }
    }
}

static pl_status join(pl_patches *patches, const pl_patch_layout *layout) {
    if (layout->patch_count > patches->piece_count)
        return PL_ERR_ARGUMENT;
    patches->patch_count = layout->patch_count;
    patches->owners = malloc(sizeof *patches->owners * (patches->piece_count + 1));
    patches->first_members = calloc(patches->patch_count + 1, sizeof *patches->first_members);
    patches->members = malloc(sizeof *patches->members * (patches->piece_count + 1));
    patches->before = malloc(sizeof *patches->before * (patches->piece_count + 1));
    int32_t *next = malloc(sizeof *next * (patches->patch_count + 1));
    pl_status status = PL_ERR_MEMORY;
    if (patches->owners && patches->first_members && patches->members && patches->before && next) {
        memcpy(patches->owners, layout->owners, sizeof *patches->owners * patches->piece_count);
        count_members(patches->owners, patches->piece_count, patches->first_members, patches->patch_count);
        status = PL_ERR_ARGUMENT;
        if (owners_are_valid(patches->owners, patches->piece_count, patches->first_members, patches->patch_count)) {
            sort_members(patches, layout->areas, next);
            status = PL_OK;
        }
    }
    free(next);
    return status;
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
    patches->piece_count = patches->patch_count = (size_t)layout->first_pieces[layout->cell_count];
    patches->apexes = malloc(layout->triangle_count + 1);
    patches->first_rows = copy_of(layout->first_rows, sizeof(int32_t) * (layout->triangle_count + 1));
    patches->first_cells = copy_of(layout->first_cells, sizeof(int32_t) * (layout->row_count + 1));
    patches->first_pieces = copy_of(layout->first_pieces, sizeof(int32_t) * (layout->cell_count + 1));
    patches->piece_cells = run_of_each(layout->first_pieces, layout->cell_count);
    patches->cell_rows = run_of_each(layout->first_cells, layout->row_count);
    patches->row_triangles = run_of_each(layout->first_rows, layout->triangle_count);
    if (!patches->apexes || !patches->first_rows || !patches->first_cells || !patches->first_pieces ||
        !patches->piece_cells || !patches->cell_rows || !patches->row_triangles) {
        pl_patches_destroy(patches);
        return PL_ERR_MEMORY;
    }
    memcpy(patches->apexes, layout->apexes, layout->triangle_count);
    const pl_status status = layout->owners ? join(patches, layout) : PL_OK;
    if (status != PL_OK) {
        pl_patches_destroy(patches);
        return status;
    }
    *out_patches = patches;
    return PL_OK;
}

void pl_patches_destroy(pl_patches *patches) {
    if (!patches)
        return;
    free(patches->apexes);
    free(patches->first_rows);
    free(patches->first_cells);
    free(patches->first_pieces);
    free(patches->piece_cells);
    free(patches->cell_rows);
    free(patches->row_triangles);
    free(patches->owners);
    free(patches->first_members);
    free(patches->members);
    free(patches->before);
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

static pl_patch_point off_the_edges(int32_t triangle, float weight_1, float weight_2) {
    weight_1 = greater(weight_1, least_weight);
    weight_2 = greater(weight_2, least_weight);
    const float scale = lesser((1 - least_weight) / (weight_1 + weight_2), 1);
    return (pl_patch_point){triangle, weight_1 * scale, weight_2 * scale};
}

/* The piece of a patch that x falls into by area; x becomes its place in that. */
static int32_t choose_piece(const pl_patches *patches, size_t patch, float *io_x) {
    if (!patches->owners)
        return (int32_t)patch;
    const int32_t end = patches->first_members[patch + 1];
    int32_t low = patches->first_members[patch], high = end;
    while (high - low > 1) {
        const int32_t middle = low + (high - low) / 2;
        if (patches->before[middle] <= *io_x)
            low = middle;
        else
            high = middle;
    }
    const float start = patches->before[low], stop = low + 1 < end ? patches->before[low + 1] : 1;
    *io_x = lesser(greater((*io_x - start) / greater(stop - start, 1e-12f), 0), 1);
    return patches->members[low];
}

pl_patch_point point_in_patch(const pl_patches *patches, size_t patch, float x, float y) {
    const int32_t piece = choose_piece(patches, patch, &x);
    const int32_t cell = patches->piece_cells[piece], row = patches->cell_rows[cell];
    const int32_t triangle = patches->row_triangles[row];
    const int32_t first_row = patches->first_rows[triangle];
    const float along = (float)pieces_along(patches, cell);
    const float rows = along * (float)(patches->first_rows[triangle + 1] - first_row);
    const float columns = along * (float)(patches->first_cells[row + 1] - patches->first_cells[row]);
    const int32_t part = piece - patches->first_pieces[cell];
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
    return off_the_edges(triangle, weights[1], weights[2]);
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
            const pl_patch_point p = point_in_patch(patches, patch, sobol(k, 0, patch_seed), sobol(k, 1, patch_seed));
            const size_t at = i * samples + k;
            out_triangles[at] = p.triangle;
            out_barycentrics[3 * at] = 1 - p.weight_1 - p.weight_2;
            out_barycentrics[3 * at + 1] = p.weight_1;
            out_barycentrics[3 * at + 2] = p.weight_2;
        }
    }
    return PL_OK;
}
