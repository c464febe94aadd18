"""Slow float64 twin of the kernel's texels, from the definition: all texels against each triangle, no scanlines."""

from __future__ import annotations

import numpy as np


def nearest_points(corners):
    """The point of a triangle nearest to the origin: barycentrics (..., 3) and distances, for corners (..., 3, 2)."""
    best = np.zeros((*corners.shape[:-2], 3))
    distances = np.full(corners.shape[:-2], np.inf)
    for k in range(3):
        a, b = corners[..., k, :], corners[..., (k + 1) % 3, :]
        edge = b - a
        squared = (edge**2).sum(axis=-1)
        along = np.clip(-(a * edge).sum(axis=-1) / np.where(squared > 0, squared, 1), 0, 1)
        distance = np.hypot(*np.moveaxis(a + along[..., None] * edge, -1, 0))
        found = np.zeros_like(best)
        found[..., k], found[..., (k + 1) % 3] = 1 - along, along
        is_nearer = distance < distances
        best = np.where(is_nearer[..., None], found, best)
        distances = np.where(is_nearer, distance, distances)
    areas = np.stack([_cross(corners[..., (k + 1) % 3, :], corners[..., (k + 2) % 3, :]) for k in range(3)], axis=-1)
    is_inside = (areas > 0).all(axis=-1) | (areas < 0).all(axis=-1)
    total = np.where(is_inside, areas.sum(axis=-1), 1.0)
    return np.where(is_inside[..., None], areas / total[..., None], best), np.where(is_inside, 0.0, distances)


def square_meets_triangle(centres, triangle, reach=1.0):
    """Whether the open square centre +- reach (..., 2) meets the triangle (3, 2): separating axes."""
    axes = [np.array([1.0, 0.0]), np.array([0.0, 1.0])]
    for k in range(3):
        edge = triangle[(k + 1) % 3] - triangle[k]
        axes.append(np.array([-edge[1], edge[0]]))
    meets = np.ones(centres.shape[:-1], bool)
    for axis in axes:
        radius = reach * np.abs(axis).sum()
        along, centre = triangle @ axis, centres @ axis
        # an axis of no length separates nothing
        meets &= (radius == 0) | ((along.min() < centre + radius) & (along.max() > centre - radius))
    return meets


def rasterise_texels(uvs, width, height, reach=1.0):
    """Triangles (height, width), distances, barycentrics: as pl_rasterise_texels, ties by the lower triangle."""
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    centres = np.stack([columns, rows], axis=-1)
    triangles = np.full((height, width), -1)
    distances = np.full((height, width), np.inf)
    barycentrics = np.zeros((height, width, 3))
    for index, triangle in enumerate(np.asarray(uvs, np.float64)):
        if not np.isfinite(triangle).all():
            continue
        found, distance = nearest_points(triangle - centres[..., None, :])
        distance = np.where(distance < 1e-6, 0.0, distance)
        wins = square_meets_triangle(centres, triangle, reach) & (distance + 1e-6 < distances)
        triangles = np.where(wins, index, triangles)
        distances = np.where(wins, distance, distances)
        barycentrics = np.where(wins[..., None], found, barycentrics)
    return triangles, distances, barycentrics


def _cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
