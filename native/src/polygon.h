/* Lambert's formula. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_POLYGON_H
#define PATCHLIGHT_POLYGON_H

#include "vec3.h"

/* A flat polygon leaves one corner more than it has. One that lies in the horizon is flat no longer once its corners
   are rounded: its heights may alternate, and every edge that crosses leaves one, beside every other corner. */
enum { MAX_CORNERS = 4, MAX_CLIPPED = 3 * MAX_CORNERS / 2 };

/* What of a polygon is above the horizon of the origin; how many corners that has. */
int clip_to_horizon(const dvec3 *corners, int count, dvec3 normal, dvec3 *out_clipped);

/*
 * Form factor from a point with a normal to a polygon of 3 or 4 corners, unoccluded, whichever way the
 * polygon faces: what lies below the horizon is clipped away.
 */
double point_to_polygon(vec3 point, vec3 normal, const vec3 *corners, int count);

#endif
