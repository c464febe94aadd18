"""Slow float64 twin of the patch layout: the patches as polygons, found by looking into each."""

from __future__ import annotations

import numpy as np


def patch_polygons(apex, columns_of_rows):
    """Corners, as barycentrics (4, 3), of the patches of one triangle in their order.

    Rows have equal heights, row 0 along the edge opposite to the apex; a row's columns all run towards the apex and
    share the row evenly.
    """
    polygons, rows = [], len(columns_of_rows)
    b, c = (apex + 1) % 3, (apex + 2) % 3

    def point(width, across):
        weights = np.zeros(3)
        weights[apex], weights[b], weights[c] = 1 - width, width * (1 - across), width * across
        return weights

    for row, columns in enumerate(columns_of_rows):
        wide, narrow = 1 - row / rows, 1 - (row + 1) / rows
        for column in range(columns):
            left, right = column / columns, (column + 1) / columns
            polygons.append([point(wide, left), point(wide, right), point(narrow, right), point(narrow, left)])
    return np.array(polygons)


def area_share(polygon):
    """Share of the triangle's area: the shoelace formula on two of the barycentrics, twice over."""
    x, y = polygon[:, 0], polygon[:, 1]
    return abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def depth_in(polygon, points):
    """How deep points (N, 3) lie in a convex polygon, in barycentrics; negative outside."""
    flat, inside = polygon[:, :2], np.full(len(points), np.inf)
    orientation = 0.0
    edges = [(a, b) for a, b in zip(flat, np.roll(flat, -1, axis=0)) if np.linalg.norm(b - a) > 1e-12]
    centre = flat.mean(axis=0)
    for a, b in edges:
        across = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
        orientation = np.sign((centre - a) @ across)
        inside = np.minimum(inside, orientation * ((points[:, :2] - a) @ across))
    return inside
