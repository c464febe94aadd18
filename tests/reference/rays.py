"""Slow float64 twin of the kernel's rays: every ray against every triangle, by the definition."""

from __future__ import annotations

import numpy as np


def plane_hits(corners, origins, directions):
    """Where rays (N, 3) meet the planes of triangles (T, 3, 3): distances and weights of corners 1, 2, each (N, T).

    Solves origin + t direction = a + u (b - a) + v (c - a) by Cramer's rule; NaN where the ray is parallel.
    """
    a = corners[:, 0]
    ab, ac = corners[:, 1] - a, corners[:, 2] - a
    normal = np.cross(ab, ac)
    from_a = origins[:, None] - a
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = -1 / (directions @ normal.T)
        t = scale * (from_a * normal).sum(axis=2)
        across = np.cross(from_a, directions[:, None])
        u, v = scale * (ac * across).sum(axis=2), scale * -(ab * across).sum(axis=2)
    return t, u, v


def closest_hit(corners, origins, directions):
    """Index of the first triangle along each ray, -1 where none, and (u, v, distance): as KernelScene.closest_hits."""
    t, u, v = plane_hits(np.asarray(corners, np.float64), origins, directions)
    with np.errstate(invalid="ignore"):
        is_hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    t = np.where(is_hit, t, np.inf)
    nearest = t.argmin(axis=1)
    rows = np.arange(len(t))
    hits = np.stack([u[rows, nearest], v[rows, nearest], t[rows, nearest]], axis=1)
    return np.where(np.isfinite(t[rows, nearest]), nearest, -1), hits


def occluded(corners, points_from, points_to):
    """Whether a triangle lies strictly between points (N, 3)."""
    triangles, hits = closest_hit(corners, points_from, points_to - points_from)
    return (triangles >= 0) & (hits[:, 2] < 1)


def distance_to_borders(corners, origins, directions):
    """How far each ray is from a change of its answer: least |u|, |v|, |1 - u - v| over triangles in front, (N,)."""
    t, u, v = plane_hits(np.asarray(corners, np.float64), origins, directions)
    with np.errstate(invalid="ignore"):
        margin = np.minimum(np.minimum(np.abs(u), np.abs(v)), np.abs(1 - u - v))
        margin = np.where(np.isfinite(margin) & (t > 0), margin, np.inf)
    return margin.min(axis=1)
