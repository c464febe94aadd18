"""Planar polygons in float64: normals, areas, cleaning, clipping, convex pieces.

A polygon is float64 (K, 3), counter-clockwise seen from its front; a convex piece is a convex one.
"""

from __future__ import annotations

import numpy as np

ROUNDING = 1e-12  # of a polygon's size: what is nearer to a plane than this lies in it


def area_vector(corners):
    """Area times unit normal of a polygon (..., K, 3), float64 (..., 3) [m^2]: Newell's sum, exact about any origin."""
    relative = corners - corners[..., :1, :]
    return 0.5 * np.cross(relative, np.roll(relative, -1, axis=-2)).sum(axis=-2)


def distinct_corners(corners):
    """A polygon (K, 3) without corners that repeat the one before."""
    return corners[(corners != np.roll(corners, 1, axis=0)).any(axis=1)]


def polygon_area(corners) -> float:
    """Area of a planar polygon (K, 3) [m^2]."""
    return float(np.linalg.norm(area_vector(corners)))


def unit_normal(corners):
    """Unit normal of a polygon (K, 3) that has an area, float64 (3,)."""
    vector = area_vector(corners)
    return vector / np.linalg.norm(vector)


def extent(corners) -> float:
    """Diagonal of the bounding box of points (K, 3) [m]."""
    return float(np.linalg.norm(np.ptp(corners, axis=0)))


def fault_of(corners) -> str | None:
    """Why a list of corners encloses no area, in words; None where it does."""
    if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) < 3:
        return "fewer than three corners"
    if not np.isfinite(corners).all():
        return "a corner that is not finite"
    # scaled first, as areas of 1e-30 m overflow or vanish when squared
    size = np.abs(corners - corners[0]).max()
    if size == 0 or not np.isfinite(size):
        return "no area"
    shape = (corners - corners[0]) / size
    # a triangle of equal sides 1e-14 high is rounding, not a sliver
    return "no area" if np.linalg.norm(area_vector(shape)) < 1e-14 else None


def is_planar(corners) -> bool:
    """Whether all corners (K, 3) lie in one plane, to 1e-9 of the polygon's size."""
    heights = (corners - corners[0]) @ unit_normal(corners)
    return bool(np.abs(heights).max() <= 1e-9 * extent(corners))


def is_convex(corners) -> bool:
    """Whether a planar polygon (K, 3) turns left, or goes straight, at each corner, once around."""
    normal, edges = unit_normal(corners), np.roll(corners, -1, axis=0) - corners
    turns = np.cross(np.roll(edges, 1, axis=0), edges) @ normal
    lengths = np.linalg.norm(edges, axis=1)
    if not (turns >= -ROUNDING * lengths * np.roll(lengths, 1)).all():
        return False
    kept = edges[lengths > 0]
    angles = np.arctan2(np.cross(np.roll(kept, 1, axis=0), kept) @ normal, (np.roll(kept, 1, axis=0) * kept).sum(1))
    return bool(angles.sum() < 3 * np.pi)  # 2 pi once around, 4 pi for a star


def convex_pieces(corners) -> list[np.ndarray]:
    """Convex pieces that make up a polygon (K, 3): itself where it is convex and planar, else few, or triangles."""
    corners = distinct_corners(corners)
    if not is_planar(corners):
        return triangulate(corners)
    return [corners] if is_convex(corners) else merged(triangulate(corners))


def merged(pieces) -> list[np.ndarray]:
    """Coplanar convex pieces joined along shared edges as long as they stay convex (Hertel & Mehlhorn 1983)."""
    pieces = list(pieces)
    for i in range(len(pieces) - 1, 0, -1):
        for j in range(i):
            union = _joined(pieces[j], pieces[i])
            if union is not None and is_convex(union):
                pieces[j] = union
                del pieces[i]
                break
    return pieces


def _joined(first, second):
    """Two polygons as one, without the edge that they share; None where they share none."""
    for k, a in enumerate(first):
        b = first[(k + 1) % len(first)]
        for m, c in enumerate(second):
            if (c == b).all() and (second[(m + 1) % len(second)] == a).all():
                rest = np.roll(second, -m - 2, axis=0)[: len(second) - 2]
                return np.concatenate([first[: k + 1], rest, first[k + 1 :]])
    return None


def triangulate(corners) -> list[np.ndarray]:
    """Triangles that make up a simple polygon (K, 3), by cutting ears (Meisters 1975)."""
    normal, left = unit_normal(corners), list(range(len(corners)))
    triangles = []
    while len(left) > 3:
        ear = next((k for k in range(len(left)) if _is_ear(corners, left, k, normal)), 0)
        triangle = corners[[left[ear - 1], left[ear], left[(ear + 1) % len(left)]]]
        if fault_of(triangle) is None:
            triangles.append(triangle)
        del left[ear]
    last = corners[left]
    return [*triangles, last] if fault_of(last) is None else triangles


def _is_ear(corners, left, k, normal):
    a, b, c = (corners[left[(k + step) % len(left)]] for step in (-1, 0, 1))
    if np.cross(b - a, c - b) @ normal <= 0:
        return False
    others = corners[[i for i in left if not any((corners[i] == p).all() for p in (a, b, c))]]
    if not len(others):
        return True
    inside = np.ones(len(others), bool)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.cross(q - p, others - p) @ normal >= 0
    return not inside.any()


def tangents(normal):
    """Two unit vectors (3,) that make a right-handed frame with a unit normal after them."""
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(helper, normal)
    u /= np.linalg.norm(u)
    return u, np.cross(normal, u)


def heights_above(corners, origin, normal):
    """Heights of corners (K, 3) over a plane [m]; what is nearer than rounding lies in it and has height 0."""
    heights = (corners - origin) @ normal
    size = max(np.abs(corners - origin).max(), 1e-300)
    return np.where(np.abs(heights) < ROUNDING * size, 0.0, heights)


def clip(corners, heights):
    """The part of a convex polygon (K, 3) where its corners' heights (K,) over a plane are positive; (0, 3) if none.

    Sutherland & Hodgman 1974.
    """
    if (heights >= 0).all() and (heights > 0).any():
        return corners
    if (heights <= 0).all():
        return np.empty((0, 3))
    kept = []
    for k in range(len(corners)):
        after = (k + 1) % len(corners)
        if heights[k] >= 0:
            kept.append(corners[k])
        if heights[k] * heights[after] < 0:
            share = heights[k] / (heights[k] - heights[after])
            kept.append(corners[k] + share * (corners[after] - corners[k]))
    return np.array(kept)


def above(corners, plane_of):
    """The part of a convex polygon in front of the plane of another polygon; (0, 3) where there is none."""
    return clip(corners, heights_above(corners, plane_of[0], unit_normal(plane_of)))


def edge_planes(corners):
    """Planes through the edges of a convex polygon, across it: inward normals float64 (K, 3)."""
    normal = unit_normal(corners)
    inward = np.cross(normal, np.roll(corners, -1, axis=0) - corners)
    return inward / np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-300)


def subtract(corners, hole) -> list[np.ndarray]:
    """Convex pieces of a convex polygon without what a coplanar convex polygon covers."""
    outside, rest = [], corners
    for origin, inward in zip(hole, edge_planes(hole)):
        heights = heights_above(rest, origin, inward)
        piece = clip(rest, -heights)
        if len(piece) and fault_of(piece) is None:
            outside.append(piece)
        rest = clip(rest, heights)
        if not len(rest):
            # the hole lies outside: the polygon stays whole, not cut along the hole's edges
            return [corners]
    return outside


def are_coplanar(first, second) -> bool:
    """Whether two polygons lie in one plane, to rounding."""
    return (
        not heights_above(second, first[0], unit_normal(first)).any()
        and not heights_above(first, second[0], unit_normal(second)).any()
    )


def bisect(corners):
    """Two halves of a convex polygon: cut across its longest edge, through the middle."""
    edges = np.roll(corners, -1, axis=0) - corners
    longest = int(np.argmax((edges**2).sum(axis=1)))
    along = edges[longest] / np.linalg.norm(edges[longest])
    positions = corners @ along
    heights = positions - 0.5 * (positions.min() + positions.max())
    return clip(corners, heights), clip(corners, -heights)


def distance_to(point, corners) -> float:
    """Distance from a point (3,) to a convex polygon (K, 3) [m]."""
    normal = unit_normal(corners)
    inward = np.cross(normal, np.roll(corners, -1, axis=0) - corners)
    if (((point - corners) * inward).sum(axis=1) >= 0).all():
        return abs(float((point - corners[0]) @ normal))
    along = np.roll(corners, -1, axis=0) - corners
    squared = np.maximum((along**2).sum(axis=1), 1e-300)
    share = np.clip(((point - corners) * along).sum(axis=1) / squared, 0, 1)
    return float(np.linalg.norm(corners + share[:, None] * along - point, axis=1).min())
