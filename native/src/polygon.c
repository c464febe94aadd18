/*
 * Lambert's formula for the form factor from a point to a polygon (Lambert 1760; Arvo 1995, eqs. 3.1-3.3).
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "polygon.h"

/* Sutherland-Hodgman against the one plane of the horizon. */
int clip_to_horizon(const dvec3 *corners, int count, dvec3 normal, dvec3 *out_clipped) {
    int clipped = 0;
    for (int i = 0; i < count; ++i) {
        const dvec3 a = corners[i], b = corners[(i + 1) % count];
        const double height_a = dvec3_dot(a, normal), height_b = dvec3_dot(b, normal);
        if (height_a >= 0)
            out_clipped[clipped++] = a;
        if ((height_a < 0) != (height_b < 0)) {
            const double t = height_a / (height_a - height_b);
            out_clipped[clipped++] = (dvec3){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), a.z + t * (b.z - a.z)};
        }
    }
    return clipped;
}

/* The angle an edge subtends, seen along the normal [Arvo 3.2]. */
static double edge_contribution(dvec3 a, dvec3 b, dvec3 normal) {
    const dvec3 across = dvec3_cross(a, b);
    const double sine = sqrt(dvec3_dot(across, across));
    if (sine <= 0)
        return 0;
    /* atan2 stays accurate for tiny and near-straight angles, acos does not */
    return atan2(sine, dvec3_dot(a, b)) * dvec3_dot(across, normal) / sine;
}

double point_to_polygon(vec3 point, vec3 normal, const vec3 *corners, int count) {
    const dvec3 n = {(double)normal.x, (double)normal.y, (double)normal.z};
    dvec3 seen[MAX_CORNERS], clipped[MAX_CLIPPED];
    for (int i = 0; i < count; ++i)
        seen[i] = dvec3_between(point, corners[i]);
    const int left = clip_to_horizon(seen, count, n, clipped);
    double sum = 0;
    for (int i = 0; i < left; ++i)
        sum += edge_contribution(clipped[i], clipped[(i + 1) % left], n);
    return fmin(fabs(sum) / (2 * (double)PL_PI), 1);
}
