"""Form factors in float64 by their definition: pairs of random points, cos cos' V / (pi r^2)."""

from __future__ import annotations

import numpy as np

from .form_factors import points_on
from .rays import occluded


def fan(corners):
    """Triangles (K - 2, 3, 3) of a convex polygon."""
    corners = np.asarray(corners, np.float64)
    return np.stack([np.broadcast_to(corners[0], (len(corners) - 2, 3)), corners[1:-1], corners[2:]], axis=1)


def exchange(first, second, occluders, pairs, rng):
    """A_1 F_12 of two convex polygons among others: mean and standard error over random pairs of points.

    Fronts only; the variance is finite where the polygons do not touch.
    """
    (x, n, a), (y, m, b) = (_samples(corners, pairs, rng) for corners in (first, second))
    to = y - x
    squared = (to**2).sum(axis=1)
    kernel = np.maximum(to @ n, 0) * np.maximum(-(to @ m), 0) / (np.pi * squared**2)
    if occluders:
        kernel[occluded(np.concatenate([fan(o) for o in occluders]), x, y)] = 0.0
    values = a * b * kernel
    return values.mean(), values.std(ddof=1) / np.sqrt(pairs)


def _samples(corners, pairs, rng):
    triangles = fan(corners)
    vectors = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(vectors, axis=1).sum()
    return points_on(triangles, pairs, rng)[0], vectors.sum(axis=0) / area, area
