"""Form factors between surfaces by hemicubes whose pixels all lie over the target.

A hemicube's delta form factors are held to 1 all together [Cohen & Greenberg 1985]. Here the pixels of each face are
drawn over the part of it that the target covers, and held to the form factor of the whole target from where the
hemicube stands, by Lambert's formula: pixels tell only what is hidden. What nothing hides is exact at a position, and
smooth over positions, also where surfaces touch.
"""

from __future__ import annotations

import numpy as np

from .aimed import are_visible, points_on
from .kernel import KernelScene, sobol_points
from .lambert import element_factors
from .polygon import above, fault_of, polygon_area, tangents, unit_normal
from .visibility import clip_all

PAIRS_LIMIT = 16  # of convex parts; more are seen at once by the pixels of one whole hemicube
PIXELS_AT_ONCE = 1 << 19
WHOLE_POSITIONS = 64  # positions, for one hemicube, at which the whole target's factor is taken: these cost no rays
# columns: right, up and ahead of each face, in the hemicube's (u, v, normal)
TOP = np.eye(3)
SIDES = tuple(np.array([(-y, x, 0), (0, 0, 1), (x, y, 0)], float).T for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1)))


def pairs_seen(emitter_pieces, target_pieces):
    """Pairs of convex parts of two surfaces, (K, 3) each, wholly in front of each other; None if there are many."""
    found = [(above(a, b), above(b, a)) for a in emitter_pieces for b in target_pieces]
    found = [(a, b) for a, b in found if len(a) and len(b) and not fault_of(a) and not fault_of(b)]
    return found if len(found) <= PAIRS_LIMIT else None


def hemicube_exchanges(kernel: KernelScene, is_target, pairs, resolution, positions, first, seeds):
    """A_i F_ij [m^2] of all pairs of parts together, one estimate for each seed: float64 (len(seeds), 2), as it is and
    as it would be if nothing stood between; and the rays traced.

    ``positions`` on each emitter, after the ``first`` ones, with ``resolution``^2 pixels over what the target covers of
    each of a hemicube's five faces; ``is_target`` bool (T,) of the kernel scene's triangles.
    """

    found = np.empty((len(pairs) * len(seeds), 3))

    def exchanges(start, stop):
        for job in range(start, stop):
            k, s = divmod(job, len(seeds))
            # pairs must not share a sequence: their errors would add up
            seed = len(pairs) * seeds[s] + k
            found[job] = _exchange(kernel, is_target, *pairs[k], resolution, positions, first, seed)

    kernel.workers.each_range(len(found), 1, exchanges)
    return found[:, :2].reshape(len(pairs), len(seeds), 2).sum(axis=0), int(found[:, 2].sum())


def _exchange(kernel, is_target, emitter, target, resolution, positions, first, seed):
    normal, sums = unit_normal(emitter), np.zeros(3)
    for points in _points(first, positions, max(1, PIXELS_AT_ONCE // resolution**2), seed):
        origins = points_on(emitter, points[:, :2])
        sums += _seen_from(kernel, is_target, origins, normal, target, resolution, points[:, 2:])
    whole, count = 0.0, WHOLE_POSITIONS * positions
    for points in _points(WHOLE_POSITIONS * first, count, PIXELS_AT_ONCE // 16, seed):
        whole += element_factors(points_on(emitter, points[:, :2]), normal, target).sum()
    whole *= polygon_area(emitter) / count
    # pixels at the target's edge are in or out, which errs for what is seen as for what is covered
    return (whole if sums[0] == sums[1] else sums[0] / sums[1] * whole), whole, sums[2]


def _points(first, count, together, seed):
    """Points of a sequence in the unit cube, float64 (<= together, 4) at a time, amid what rounding cut off."""
    for start in range(first, first + count, together):
        yield sobol_points(start, min(together, first + count - start), seed).astype(np.float64) + 2.0**-25


def _seen_from(kernel, is_target, origins, normal, target, resolution, places):
    """Sums of the delta form factors of pixels that see the target, and of those that it covers, and how many these
    are, float64 (3,)."""
    frame = np.stack([*tangents(normal), normal], axis=1)
    corners, sums = target - origins[:, None], np.zeros(3)
    for face in (TOP, *SIDES):
        directions, deltas, owners = _covered_pixels(corners @ (frame @ face), face, resolution, places)
        along = directions @ (frame @ face).T
        # as long as to the target's plane
        heights = corners[owners, 0] @ unit_normal(target)
        along *= (heights / (along @ unit_normal(target)))[:, None]
        seen = are_visible(kernel, is_target, origins[owners], normal, along)
        sums += (deltas * seen).sum(), deltas.sum(), len(deltas)
    return sums


def _covered_pixels(corners, face, resolution, places):
    """Pixels of a face of hemicubes that a target covers.

    Parameters
    ----------
    corners : float64 (N, K, 3), of the target, from each hemicube's position: right, up, ahead of the face
    places : float64 (N, 2), where in its pixels each hemicube's rays go through

    Returns
    -------
    directions float64 (M, 3): right, up, 1; delta form factors (M,); the pixels' hemicubes int64 (M,)
    """
    inside, owners = _in_sight(corners, face)
    places, edges = places[owners], np.cross(corners, np.roll(corners, -1, axis=1))[owners]
    at = np.clip(inside[..., :2] / np.maximum(inside[..., 2:], 1e-300), -1, 1)
    low, size = at.min(axis=1), np.ptp(at, axis=1)
    # each pixel's point is its own: a shift of the whole grid would err at once along all of an edge
    shifts = sobol_points(0, resolution**2, 0)[:, :2]
    columns = np.stack(np.divmod(np.arange(resolution**2), resolution), axis=1)
    within = (columns + (places[:, None] + shifts) % 1.0) / resolution
    directions = np.ones((len(owners), resolution**2, 3))
    directions[..., :2] = low[:, None] + within * size[:, None]
    # seen from its front a polygon turns left, seen from here it turns right
    is_covered = (directions @ edges.transpose(0, 2, 1) < 0).all(axis=2)
    chosen, pixels = np.nonzero(is_covered)
    directions = directions[chosen, pixels]
    # eq. 12 and 13 of Cohen & Greenberg: the cosines at the patch and at the face over pi r^2
    deltas = directions @ face[2] / (np.pi * (directions**2).sum(axis=1) ** 2)
    return directions, deltas * (size.prod(axis=1) / resolution**2)[chosen], owners[chosen]


def _in_sight(corners, face):
    """The parts of polygons (N, K, 3) inside a face's pyramid, and whose they are."""
    right, up, ahead = np.eye(3)
    # a side face begins at the horizon
    planes = (ahead + right, ahead - right, ahead - up, ahead + up if face is TOP else up)
    owners = np.arange(len(corners))
    for plane in planes:
        corners, is_left = clip_all(corners, corners @ plane)
        owners = owners[is_left]
    return corners, owners
