"""Gauss-Legendre nodes on intervals and, collapsed, on triangles."""

from __future__ import annotations

import functools

import numpy as np

from .triangles import triangle_areas


@functools.cache
def gauss(count: int):
    """Nodes and weights (count,) on [0, 1]; weights sum to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (nodes + 1), 0.5 * weights


@functools.cache
def triangle_rule(count: int):
    """Barycentrics (count^2, 3) and weights (count^2,), sum 1: a product of Gauss rules, collapsed (Stroud 1971)."""
    nodes, weights = gauss(count)
    u, v = (grid.ravel() for grid in np.meshgrid(nodes, nodes, indexing="ij"))
    area = 2 * np.outer(weights * (1 - nodes), weights).ravel()
    return np.stack([u, (1 - u) * (1 - v), (1 - u) * v], axis=1), area


def fan(corners):
    """Triangles (K - 2, 3, 3) of a convex polygon (K, 3), all from its first corner."""
    return np.stack([np.broadcast_to(corners[0], (len(corners) - 2, 3)), corners[1:-1], corners[2:]], axis=1)


def polygon_rule(corners, count: int):
    """Positions (N, 3) on a convex polygon (K, 3), and weights (N,) that sum to its area [m^2]."""
    triangles = fan(corners)
    barycentrics, weights = triangle_rule(count)
    positions = np.einsum("qc,tcx->tqx", barycentrics, triangles)
    return positions.reshape(-1, 3), (triangle_areas(triangles)[:, None] * weights).ravel()
