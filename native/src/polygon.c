/*
 * Lambert's formula for the form factor from a point to a polygon (Lambert 1760; Arvo 1995, eqs. 3.1-3.3).
 * SPDX-License-Identifier: GPL-3.0-or-later
 */
#include "polygon.h"

typedef struct dvec3 {
    double x, y, z;
} dvec3;

enum { MAX_CORNERS = 4, MAX_CLIPPED = MAX_CORNERS + 1 };

static double dot(dvec3 a, dvec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static dvec3 cross(dvec3 a, dvec3 b) {
    return (dvec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* Sutherland-Hodgman against the one plane of the horizon. */
static int clip_to_horizon(const dvec3 *corners, int count, dvec3 normal, dvec3 *out_clipped) {
    int clipped = 0;
    for (int i = 0; i < count; ++i) {
        const dvec3 a = corners[i], b = corners[(i + 1) % count];
        const double height_a = dot(a, normal), height_b = dot(b, normal);
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
    const dvec3 across = cross(a, b);
    const double sine = sqrt(dot(across, across));
    if (sine <= 0)
        return 0;
    /* atan2 stays accurate for tiny and near-straight angles, acos does not */
    return atan2(sine, dot(a, b)) * dot(across, normal) / sine;
}

double point_to_polygon(vec3 point, vec3 normal, const vec3 *corners, int count) {
    const dvec3 n = {(double)normal.x, (double)normal.y, (double)normal.z};
    dvec3 seen[MAX_CORNERS], clipped[MAX_CLIPPED];
    for (int i = 0; i < count; ++i)
        seen[i] = (dvec3){(double)corners[i].x - (double)point.x, (double)corners[i].y - (double)point.y,
                          (double)corners[i].z - (double)point.z};
    const int left = clip_to_horizon(seen, count, n, clipped);
    double sum = 0;
    for (int i = 0; i < left; ++i)
        sum += edge_contribution(clipped[i], clipped[(i + 1) % left], n);
    return fmin(fabs(sum) / (2 * (double)PL_PI), 1);
}
