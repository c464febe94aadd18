/*
 * Texels of a lightmap: which are receivers, and of which point of the surface.
 *
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "patchlight.h"

#include "footprint.h"

/* Distances closer than this [texels] are one and the same: what is computed of a shared edge from its
   two triangles differs by rounding only, and the lower triangle has to win on every machine. */
static const double same_distance = 1e-6;

typedef struct nearest {
    double barycentrics[3];
    double distance;
} nearest;

/* The point of the edge from corner k to corner k + 1 that is nearest to the origin. */
static nearest nearest_on_edge(const double corners[3][2], int k) {
    const int next = (k + 1) % 3;
    const double *a = corners[k], *b = corners[next];
    const double edge[2] = {b[0] - a[0], b[1] - a[1]};
    const double length_squared = edge[0] * edge[0] + edge[1] * edge[1];
    double along = 0.0;

    if (length_squared > 0.0)
        along = fmin(fmax(-(a[0] * edge[0] + a[1] * edge[1]) / length_squared, 0.0), 1.0);
    nearest found = {{0.0, 0.0, 0.0}, hypot(a[0] + along * edge[0], a[1] + along * edge[1])};
    found.barycentrics[k] = 1.0 - along;
    found.barycentrics[next] = along;
    return found;
}

/* The point of a triangle that is nearest to the origin; the triangle may have no area. */
static nearest nearest_on_triangle(const double corners[3][2]) {
    double areas[3];

    for (int k = 0; k < 3; ++k) {
        const double *a = corners[(k + 1) % 3], *b = corners[(k + 2) % 3];
        areas[k] = a[0] * b[1] - a[1] * b[0];
    }
    const double area = areas[0] + areas[1] + areas[2];
    const bool is_inside =
        (areas[0] > 0.0 && areas[1] > 0.0 && areas[2] > 0.0) || (areas[0] < 0.0 && areas[1] < 0.0 && areas[2] < 0.0);
    if (is_inside) {
        const nearest inside = {{areas[0] / area, areas[1] / area, areas[2] / area}, 0.0};
        return inside;
    }

    nearest best = nearest_on_edge(corners, 0);
    for (int k = 1; k < 3; ++k) {
        const nearest other = nearest_on_edge(corners, k);
        if (other.distance < best.distance)
            best = other;
    }
    if (best.distance < same_distance)
        best.distance = 0.0;
    return best;
}

/* The triangle, seen from the centre of a texel, offers its nearest point as the texel's receiver. */
static void offer(const double corners[3][2], int32_t triangle, int32_t column, int32_t row, int32_t *texel_triangle,
                  float *texel_distance, float *texel_barycentrics) {
    double seen[3][2];

    for (int k = 0; k < 3; ++k) {
        seen[k][0] = corners[k][0] - ((double)column + 0.5);
        seen[k][1] = corners[k][1] - ((double)row + 0.5);
    }
    const nearest found = nearest_on_triangle((const double (*)[2])seen);
    if (*texel_triangle >= 0 && found.distance + same_distance >= (double)*texel_distance)
        return;
    *texel_triangle = triangle;
    *texel_distance = (float)found.distance;
    for (int k = 0; k < 3; ++k)
        texel_barycentrics[k] = (float)found.barycentrics[k];
}

static int32_t clamp_to_index(double value, int32_t count) {
    return (int32_t)fmin(fmax(value, 0.0), (double)(count - 1));
}

/* False where a corner is not a number: the triangle has no place. */
static bool read_corners(const float *uvs, double out_corners[3][2]) {
    for (int k = 0; k < 3; ++k) {
        for (int axis = 0; axis < 2; ++axis) {
            out_corners[k][axis] = (double)uvs[2 * k + axis];
            if (!isfinite(out_corners[k][axis]))
                return false;
        }
    }
    return true;
}

static void rasterise_triangle(const double corners[3][2], int32_t triangle, int32_t width, int32_t height,
                               int32_t *out_triangles, float *out_distances, float *out_barycentrics) {
    const double bottom = fmin(fmin(corners[0][1], corners[1][1]), corners[2][1]);
    const double top = fmax(fmax(corners[0][1], corners[1][1]), corners[2][1]);
    const int32_t first_row = clamp_to_index(floor(bottom - 1.5), height);
    const int32_t last_row = clamp_to_index(ceil(top + 0.5), height);

    for (int32_t row = first_row; row <= last_row; ++row) {
        const double centre = (double)row + 0.5;
        double left, right;
        if (!pl_span_between(corners, centre - 1.0, centre + 1.0, &left, &right))
            continue;

        /* strictly closer than 1: at 1 the bilinear weight is 0 */
        const double first_column = floor(left - 1.5) + 1.0, last_column = ceil(right + 0.5) - 1.0;
        if (last_column < 0.0 || first_column > (double)(width - 1))
            continue;
        const int32_t end = clamp_to_index(last_column, width);
        for (int32_t column = clamp_to_index(first_column, width); column <= end; ++column) {
            const size_t texel = (size_t)row * (size_t)width + (size_t)column;
            offer(corners, triangle, column, row, out_triangles + texel, out_distances + texel,
                  out_barycentrics + 3 * texel);
        }
    }
}

pl_status pl_rasterise_texels(const float *uvs, size_t triangle_count, int32_t width, int32_t height,
                              int32_t *out_triangles, float *out_distances, float *out_barycentrics) {
    if (width < 1 || height < 1 || triangle_count > (size_t)INT32_MAX)
        return PL_ERR_ARGUMENT;

    const size_t texel_count = (size_t)width * (size_t)height;
    for (size_t texel = 0; texel < texel_count; ++texel) {
        out_triangles[texel] = -1;
        out_distances[texel] = INFINITY;
    }
    for (size_t texel = 0; texel < 3 * texel_count; ++texel)
        out_barycentrics[texel] = 0.0f;

    for (size_t triangle = 0; triangle < triangle_count; ++triangle) {
        double corners[3][2];
        if (read_corners(uvs + 6 * triangle, corners))
            rasterise_triangle((const double (*)[2])corners, (int32_t)triangle, width, height, out_triangles,
                               out_distances, out_barycentrics);
    }
    return PL_OK;
}
