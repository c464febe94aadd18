/* Light through triangles that let some of it pass. SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef PATCHLIGHT_CLEAR_H
#define PATCHLIGHT_CLEAR_H

#include "scene.h"

/* A copy of all arrays, to be destroyed even where it failed; PL_ERR_ARGUMENT for a map that is not there. */
pl_status clear_copy(const pl_clear *from, size_t triangle_count, pl_clear *out_clear);
void clear_destroy(pl_clear *clear);

/* Multiply io_rgb by what the clear triangles up to `far` let through of a shadow ray; returns whether any is left. */
bool transmit(const pl_scene *scene, vec3 origin, vec3 direction, float far, float io_rgb[3]);

/*
 * The first triangle that stops a scattered ray: an opaque one, or a clear one before it, which stops as many rays as
 * it takes light. io_rgb is multiplied by what those that the ray passes let through, by the share of rays that pass.
 * Whether one does hangs on where it hits alone: the same ray ends at the same place in any thread.
 */
pl_hit first_stop(const pl_scene *scene, vec3 origin, vec3 direction, float io_rgb[3]);

/*
 * Where light that is sent along a ray lands next, from *io_near on, which becomes where it goes on from, or INFINITY.
 *
 * As rays look back along it: those from beyond a triangle whose other side is open see through it, although it has got
 * the light; those beyond one that the light meets on its open side do not.
 */
pl_hit next_landing(const pl_scene *scene, vec3 origin, vec3 direction, float *io_near, float io_rgb[3]);

#endif
