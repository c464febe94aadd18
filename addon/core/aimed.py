"""Form factors between surfaces that stand apart, by rays aimed from points of one at points of the other.

F_ij = 1 / A_i of the integral over both areas of V cos_i cos_j / (pi r^2) [Cohen & Wallace 1993, eq. 4.13], sampled
where it is: a small, far or half hidden target gets every ray, and what is not hidden is smooth over the samples, so
that an even sequence is right to 1e-6 where rays that hit or miss are right to 1e-4. Near by, 1 / r^2 would be noise.
"""

from __future__ import annotations

import numpy as np

from .kernel import KernelScene, sobol_points
from .polygon import above, bisect, extent, fault_of, polygon_area, unit_normal
from .quadrature import fan
from .triangles import triangle_areas

APART = 1.2  # distance of two parts' centres, in the sum of their radii, from which rays may be aimed at one
PAIRS_LIMIT = 256  # of parts
DEEPEST = 12  # how often a pair is cut in two: surfaces that touch never come to an end
RAYS_AT_ONCE = 1 << 16
PUSH = 2.0**-20  # of the largest coordinate: how far off their surface rays start (as in native/src/scene.h)
END = 2.0**-19  # of a ray: what is hit so near to its end is what it was aimed at


def pairs_apart(emitter_pieces, target_pieces):
    """Pairs of convex parts of two surfaces, (K, 3) each, that see each other and stand apart; None where some never
    do."""
    found = []
    waiting = [(a, b) for a in emitter_pieces for b in target_pieces]
    for _ in range(DEEPEST):
        seen = [(above(a, b), above(b, a)) for a, b in waiting]
        seen = [(a, b) for a, b in seen if len(a) and len(b) and not fault_of(a) and not fault_of(b)]
        found += [(a, b) for a, b in seen if _stand_apart(a, b)]
        waiting = [pair for a, b in seen if not _stand_apart(a, b) for pair in _cut_the_larger(a, b)]
        if not waiting:
            return found
        if len(found) + len(waiting) > PAIRS_LIMIT:
            return None
    return None


def _stand_apart(a, b):
    return np.linalg.norm(a.mean(axis=0) - b.mean(axis=0)) > APART * (_radius(a) + _radius(b))


def _cut_the_larger(a, b):
    if _radius(a) > _radius(b):
        return [(half, b) for half in bisect(a) if len(half)]
    return [(a, half) for half in bisect(b) if len(half)]


def _radius(corners):
    return np.linalg.norm(corners - corners.mean(axis=0), axis=1).max()


def aimed_exchanges(kernel: KernelScene, is_target, pairs, rays, first, seeds):
    """A_i F_ij [m^2] of all pairs of parts together, one estimate for each seed: float64 (len(seeds), 2), as it is and
    as it would be if nothing stood between; and the rays traced.

    ``rays`` from each pair, after the ``first`` ones; ``is_target`` bool (T,) of the kernel scene's triangles.
    """

    def exchanges(start, stop):
        return sum(_exchange(kernel, is_target, *pairs[k], rays, first, [len(pairs) * s + k for s in seeds])
                   for k in range(start, stop))  # fmt: skip

    return sum(kernel.workers.each_range(len(pairs), 1, exchanges)), len(seeds) * len(pairs) * rays


def _exchange(kernel, is_target, emitter, target, rays, first, seeds):
    together = max(1, RAYS_AT_ONCE // rays)
    found = []
    for k in range(0, len(seeds), together):
        points = np.concatenate([sobol_points(first, rays, seed) for seed in seeds[k : k + together]])
        # the middle of what was cut off behind the last bit
        points = points.astype(np.float64) + 2.0**-25
        values = _integrand(kernel, is_target, emitter, target, points)
        found.append(values.reshape(-1, rays, 2).mean(axis=1))
    return polygon_area(emitter) * polygon_area(target) * np.concatenate(found)


def _integrand(kernel, is_target, emitter, target, points):
    origins, ends = points_on(emitter, points[:, :2]), points_on(target, points[:, 2:])
    normals = unit_normal(emitter), unit_normal(target)
    along = ends - origins
    squared = (along**2).sum(axis=1)
    kernels = (along @ normals[0]) * -(along @ normals[1]) / (np.pi * squared**2)  # eq. 4.13
    return np.stack([kernels * are_visible(kernel, is_target, origins, normals[0], along), kernels], axis=1)


def are_visible(kernel: KernelScene, is_target, origins, normal, along):
    """Whether nothing but the target stops rays before their ends, bool (N,): origins + along (N, 3) [m]."""
    origins = origins + PUSH * np.abs(origins - kernel.centre).max(initial=0.0) * normal
    triangles, hits = kernel.closest_hits(origins, along)
    # past an edge by rounding is no miss: it was aimed at the target
    return (triangles < 0) | is_target[triangles] | (hits[:, 2] > 1 - END)


def points_on(corners, places):
    """Points on a convex polygon (K, 3), evenly by area, of places (N, 2) in the unit square."""
    if len(corners) == 4 and np.abs(corners[0] - corners[1] + corners[2] - corners[3]).max() <= 1e-12 * extent(corners):
        return corners[0] + places[:, :1] * (corners[1] - corners[0]) + places[:, 1:] * (corners[3] - corners[0])
    triangles = fan(corners)
    areas = triangle_areas(triangles)
    ends = np.cumsum(areas) / areas.sum()
    chosen = np.minimum(np.searchsorted(ends, places[:, 0], side="right"), len(ends) - 1)
    share = areas[chosen] / areas.sum()
    width = np.sqrt(np.clip((places[:, 0] - ends[chosen]) / share + 1, 0, 1))
    weights = np.stack([1 - width, width * (1 - places[:, 1]), width * places[:, 1]], axis=1)
    return np.einsum("nk,nkc->nc", weights, triangles[chosen])
