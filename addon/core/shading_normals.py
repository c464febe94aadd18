"""Shading normals that smooth surfaces could have: where all edges were smoothed, those that are none are found again.

A box or a cylinder that is shaded smooth all over has normals between its sides, of which no smooth surface of that
shape knows: light by these would be that of a ball.
"""

from __future__ import annotations

import numpy as np

from .scene import Scene
from .triangles import unit_normals

STEEPEST = 40.0  # degrees between a corner's normal and its face: an icosahedron's are 37, a cube's 55
BEND = 60.0  # degrees between faces at the most, for an edge that is smooth where a corner was too steep
FLAT = 1.0  # degrees: corners nearer to their face are not shaded smooth, and normals nearer to each other are one
MOST_FACES = 256  # about a vertex; pairs of more take too long
BLOCK, AT_ONCE = 1 << 17, 1 << 16  # triangles, and corners of which all pairs at a vertex are taken, at once
COSINE_OF = {angle: np.cos(np.radians(angle + 0.01)) for angle in (STEEPEST, BEND, FLAT)}


def without_steep_normals(scene: Scene):
    """Corner normals float32 (T, 3, 3), and of which triangles some are others than they were, bool (T,).

    At vertices where a target's corner has a normal that leans too far off its face, the smooth corners get the mean
    of the faces about them that share their normal and bend by less than an edge does, by angle (Thuermer & Wuethrich
    1998), or else their face's own.
    """
    normals, triangles = scene.corner_normals, scene.triangles
    is_steep = _leaning(scene, STEEPEST)
    for obj in scene.objects:
        is_steep[obj.span] &= obj.is_target
    is_changed = np.zeros(len(triangles), bool)
    if not is_steep.any():
        return normals, is_changed
    at_edge = np.zeros(len(scene.vertices), bool)
    at_edge[triangles[is_steep]] = True
    corners = np.argwhere(at_edge[triangles])
    corners = corners[np.argsort(triangles[tuple(corners.T)], kind="stable")]
    is_smooth, normals = _leaning(scene, FLAT), normals.copy()
    for some in _by_vertices(triangles[tuple(corners.T)], corners):
        found = _means_of_gentle_bends(scene, some)
        chosen = is_smooth[tuple(some.T)]
        normals[tuple(some[chosen].T)] = found[chosen]
        is_changed[some[chosen, 0]] = True
    return normals, is_changed


def _by_vertices(vertices, corners):
    """Sorted corners (K, 2) of vertices (K,) in parts of about AT_ONCE that end with all corners of a vertex."""
    ends = np.append(np.flatnonzero(np.diff(vertices)) + 1, len(vertices))
    start = 0
    while start < len(corners):
        stop = int(ends[min(np.searchsorted(ends, start + AT_ONCE), len(ends) - 1)])
        yield corners[start:stop]
        start = stop


def _leaning(scene, degrees):
    """Which corners' normals lean off their face by more: bool (T, 3)."""
    is_leaning = np.zeros((len(scene.triangles), 3), bool)
    for first in range(0, len(is_leaning), BLOCK):
        part = slice(first, first + BLOCK)
        normals = scene.corner_normals[part]
        flat = unit_normals(scene.vertices[scene.triangles[part]])
        is_leaning[part] = np.einsum("tkc,tc->tk", normals, flat) < COSINE_OF[degrees] * np.linalg.norm(normals, axis=2)
    return is_leaning


def _means_of_gentle_bends(scene, corners):
    """Normals (K, 3) of corners (K, 2: triangle, which), sorted by their vertex, that hold all corners of theirs."""
    owners = corners[:, 0]
    places = scene.vertices[scene.triangles[owners]]
    flat = unit_normals(places)
    vertices = scene.triangles[tuple(corners.T)]
    _, first, counts = np.unique(vertices, return_index=True, return_counts=True)
    # each corner beside each of its vertex; of too many, which no smooth surface has, beside itself alone
    is_crowded = np.repeat(counts > MOST_FACES, counts)
    begins, sizes = np.repeat(first, counts), np.repeat(counts, counts)
    begins, sizes = np.where(is_crowded, np.arange(len(corners)), begins), np.where(is_crowded, 1, sizes)
    one = np.repeat(np.arange(len(corners)), sizes)
    other = np.arange(len(one)) - np.repeat(np.cumsum(sizes) - sizes, sizes) + np.repeat(begins, sizes)
    # what was parted already, by sharp edges or as flat, has normals of its own
    normals = scene.corner_normals[tuple(corners.T)].astype(np.float64)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    is_gentle = np.einsum("nc,nc->n", normals[one], normals[other]) >= COSINE_OF[FLAT]
    is_gentle &= np.einsum("nc,nc->n", flat[one], flat[other]) >= COSINE_OF[BEND]
    one, other = one[is_gentle], other[is_gentle]
    weighted = flat * _angles(places, corners[:, 1])[:, None]
    means = np.stack([np.bincount(one, weighted[other, axis], len(corners)) for axis in range(3)], axis=1)
    means /= np.maximum(np.linalg.norm(means, axis=1, keepdims=True), 1e-300)
    is_steep = np.einsum("nc,nc->n", means, flat) < COSINE_OF[STEEPEST]
    return np.where(is_steep[:, None], flat, means)


def _angles(places, which):
    """Angles (K,) of triangles (K, 3, 3) at one of their corners (K,) [rad]."""
    rows = np.arange(len(places))
    at, ahead, behind = (places[rows, (which + k) % 3] for k in range(3))
    first, second = ahead - at, behind - at
    across = np.linalg.norm(np.cross(first, second), axis=1)
    return np.arctan2(across, np.einsum("nc,nc->n", first, second))
