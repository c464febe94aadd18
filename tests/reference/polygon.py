"""Lambert's formula in float64, and the same factor by its definition."""

from __future__ import annotations

import numpy as np


def point_to_polygon(point, normal, corners):
    """Form factor from a surface element to a polygon (K, 3), unoccluded, whichever way the polygon faces.

    Half the sum over edges of the angle each subtends, seen along the normal, over pi; below the horizon is cut away.
    """
    seen = _above_horizon(np.asarray(corners, np.float64) - point, np.asarray(normal, np.float64))
    total = 0.0
    for a, b in zip(seen, seen[1:] + seen[:1]):
        across = np.cross(a, b)
        sine = np.linalg.norm(across)
        if sine > 0:
            total += np.arctan2(sine, a @ b) * (across @ normal) / sine
    return abs(total) / (2 * np.pi)


def _above_horizon(corners, normal):
    kept = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0)):
        high_a, high_b = a @ normal, b @ normal
        if high_a >= 0:
            kept.append(a)
        if (high_a < 0) != (high_b < 0):
            kept.append(a + high_a / (high_a - high_b) * (b - a))
    return kept


def point_to_parallelogram_by_sum(point, normal, corner, u, v, cells=400):
    """The same by its definition: cos cos' / (pi r^2) dA over a parallelogram, midpoints of cells^2 cells."""
    steps = (np.arange(cells) + 0.5) / cells
    a, b = np.meshgrid(steps, steps)
    targets = corner + a.reshape(-1, 1) * u + b.reshape(-1, 1) * v
    return float(disc_sum(point, normal, targets, np.cross(u, v), np.linalg.norm(np.cross(u, v)) / cells**2))


def disc_sum(point, normal, targets, target_normal, area):
    """Sum of cos |cos'| / (pi r^2) over small areas around targets (N, 3)."""
    to = targets - point
    squared = (to**2).sum(axis=1)
    cosine = np.maximum(to @ normal, 0) / np.sqrt(squared)
    target_cosine = np.abs(to @ target_normal) / np.linalg.norm(target_normal) / np.sqrt(squared)
    return (cosine * target_cosine / (np.pi * squared)).sum() * area
