/*
 * Which texels a triangle of a chart touches: a texel is touched where the square that bilinear lookup
 * spreads it over, less than 1 texel away along both axes, meets the triangle.
 *
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#ifndef PL_FOOTPRINT_H
#define PL_FOOTPRINT_H

#include <math.h>
#include <stdbool.h>

/* The columns that a triangle covers between two rows; false where it has no point there. */
static inline bool pl_span_between(const double corners[3][2], double bottom, double top, double *out_left,
                                   double *out_right) {
    double left = INFINITY, right = -INFINITY;

    for (int k = 0; k < 3; ++k) {
        const double *a = corners[k], *b = corners[(k + 1) % 3];
        if (a[1] > bottom && a[1] < top) {
            left = fmin(left, a[0]);
            right = fmax(right, a[0]);
        }
        /* a triangle that only meets a limit, without a point between, must not be cut there */
        const bool cuts_bottom = (a[1] <= bottom) != (b[1] <= bottom);
        const bool cuts_top = (a[1] >= top) != (b[1] >= top);
        for (int c = 0; c < 2; ++c) {
            if (!(c == 0 ? cuts_bottom : cuts_top))
                continue;
            const double cut = c == 0 ? bottom : top;
            const double x = a[0] + (b[0] - a[0]) * ((cut - a[1]) / (b[1] - a[1]));
            left = fmin(left, x);
            right = fmax(right, x);
        }
    }
    *out_left = left;
    *out_right = right;
    return left <= right;
}

#endif
