"""Analytic form factors between planar polygons: each pair by the formula that holds for it.

Far apart: Gauss on both polygons, all terms positive. Near or touching: the double contour integral. Where that would
lose digits (slivers, small things, angles near 180 degrees): parts, each far or near. Partly hidden: what others hide
is integrated over positions and taken off. The exchange A_i F_ij of a pair is computed once, so reciprocity is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .contour import contour_exchange, contour_exchanges
from .polygon import (
    above,
    are_coplanar,
    area_vector,
    bisect,
    clip,
    convex_pieces,
    fault_of,
    heights_above,
    polygon_area,
    subtract,
    unit_normal,
)
from .quadrature import fan, polygon_rule, triangle_rule
from .triangles import triangle_areas
from .visibility import blocking_part, blocks_all, clip_all, integrate_partly_hidden, visible_factors

FAR = 3.0  # distance of centres in radii of both: Gauss converges like (2 FAR)^(-2 n) or faster
ROUNDING_ALLOWED = 1e-9  # relative, of the contour integral; above it the pair is cut into parts
PART_ROUNDING = 1e-10  # of the whole, allowed to each part
PARTS_LIMIT = 4000


@dataclass(frozen=True, slots=True)
class Surface:
    """A planar polygon, or several that act as one, with one radiosity.

    Attributes
    ----------
    name : str
    pieces : convex polygons, float64 (K, 3) each, counter-clockwise seen from the front [m]
    """

    name: str
    pieces: tuple[np.ndarray, ...]

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return sum(polygon_area(piece) for piece in self.pieces)


def surface(name: str, corners) -> Surface:
    """A surface from a polygon's corners (K, 3) [m]; raises ValueError, with the reason, where it has no area."""
    corners = np.asarray(corners, np.float64)
    fault = fault_of(corners)
    if fault:
        raise ValueError(f"{name}: {fault}")
    return Surface(name, tuple(convex_pieces(corners)))


def without(whole: Surface, hole: Surface) -> Surface:
    """A surface less what a coplanar one covers of it."""
    pieces = list(whole.pieces)
    for cover in hole.pieces:
        pieces = [part for piece in pieces for part in subtract(piece, cover)]
    return Surface(whole.name, tuple(pieces))


def cut_overlaps(surfaces):
    """Surfaces of which none covers another: of coplanar ones that face one way, the smaller keeps what both cover.

    A lamp in a ceiling is smaller than the ceiling; of duplicates the first keeps all, the others have no pieces left.
    """
    kept: dict[int, Surface] = {}
    areas = [one.area for one in surfaces]
    for k in sorted(range(len(surfaces)), key=areas.__getitem__):
        new = surfaces[k]
        for old in kept.values():
            if new.pieces and old.pieces and _share_a_plane(new.pieces[0], old.pieces[0]):
                new = without(new, old)
        kept[k] = new
    return [kept[k] for k in range(len(surfaces))]


def _share_a_plane(first, second):
    return are_coplanar(first, second) and unit_normal(first) @ unit_normal(second) > 0


# ---- unobstructed pairs ----


def exchange(first, second) -> float:
    """A_1 F_12 [m^2] of two convex polygons (K, 3), (M, 3), nothing between them; each sees from its front only."""
    # about a point nearby: the digits of a place far from the origin are for the shape
    first, second = first - first[0], second - first[0]
    a, b = above(first, second), above(second, first)
    if not (len(a) and len(b)) or fault_of(a) or fault_of(b):
        return 0.0
    if _is_far(a, b):
        value = _gauss_exchange(a, b)
    else:
        value, rounding = contour_exchange(a, b)
        if rounding > ROUNDING_ALLOWED * abs(value):
            value = _exchange_by_parts(a, b, abs(value))
    return min(max(value, 0.0), polygon_area(a), polygon_area(b))


def _radius(corners):
    centre = corners.mean(axis=0)
    return centre, float(np.sqrt(((corners - centre) ** 2).sum(axis=1).max()))


def _is_far(first, second):
    (p, r), (q, s) = _radius(first), _radius(second)
    return np.linalg.norm(p - q) > FAR * (r + s)


def _gauss_exchange(first, second):
    """Integral of cos cos' / (pi r^2) over both, by product Gauss of an order that the distance asks for."""
    (p, r), (q, s) = _radius(first), _radius(second)
    distance = np.linalg.norm(p - q)
    nodes = []
    for own, other in ((r, s), (s, r)):
        z = (distance - other) / own
        nodes.append(int(np.ceil(18 / np.log(z + np.sqrt(z * z - 1)))) + 1)  # e^(-2 * 18) = 2e-16
    (x, a), (y, b) = polygon_rule(first, nodes[0]), polygon_rule(second, nodes[1])
    to = y[None] - x[:, None]
    squared = (to**2).sum(axis=2)
    # towards both, each term is positive; squares of 1e-30 m would vanish, ratios do not
    cosines = np.maximum(to @ unit_normal(first), 0) * np.maximum(-(to @ unit_normal(second)), 0)
    return float(a @ (cosines / squared**2) @ b) / np.pi


def _exchange_by_parts(first, second, guess):
    """The larger of two is halved until the pair is far, or its contour integral rounds to nothing of the whole."""
    waiting, total, count = [(first, second)], 0.0, 0
    while waiting:
        a, b = waiting.pop()
        count += 1
        if _is_far(a, b):
            total += _gauss_exchange(a, b)
            continue
        value, rounding = contour_exchange(a, b)
        if rounding <= max(PART_ROUNDING * guess, ROUNDING_ALLOWED * abs(value)) or count > PARTS_LIMIT:
            total += value
        elif _radius(a)[1] >= _radius(b)[1]:
            waiting += [(part, b) for part in bisect(a)]
        else:
            waiting += [(a, part) for part in bisect(b)]
    return total


def exchanges(first, others):
    """A_1 F_1j [m^2] of one convex polygon (K, 3) and many (N, M, 3) that have it wholly in front: float64 (N,).

    For tessellations: as ``exchange``, all at once, far pairs to 1e-6.
    """
    origin, normal = first[0], unit_normal(first)
    heights = (others - origin) @ normal
    heights[np.abs(heights) < 1e-12 * np.abs(others - origin).max()] = 0.0
    parts, is_seen = clip_all(others, heights)
    if not len(parts):
        return np.zeros(len(others))
    out, values = np.zeros(len(others)), np.zeros(len(parts))
    (centre, radius), centres = _radius(first), parts.mean(axis=1)
    radii = np.sqrt(((parts - centres[:, None]) ** 2).sum(axis=2).max(axis=1))
    is_far = np.linalg.norm(centres - centre, axis=1) > 2 * (radius + radii)
    values[is_far] = _gauss_exchanges(first, parts[is_far], 4)
    near = parts[~is_far]
    if len(near):
        values[~is_far] = contour_exchanges(np.broadcast_to(first, (len(near), *first.shape)), near)[0]
    out[is_seen] = np.maximum(values, 0.0)
    return out


def _gauss_exchanges(first, others, count):
    if not len(others):
        return np.zeros(0)
    points, weights = polygon_rule(first, count)
    barycentrics, shares = triangle_rule(count)
    out = []
    for part in np.array_split(others, -(-len(others) // 256)):
        triangles = np.stack([fan(corners) for corners in part])
        there = np.einsum("qc,ntcx->ntqx", barycentrics, triangles).reshape(len(part), 1, -1, 3)
        areas = (triangle_areas(triangles)[..., None] * shares).reshape(len(part), -1)
        to = there - points[:, None]
        squared = (to**2).sum(axis=3)
        vectors = area_vector(part)
        normals = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        cosines = np.maximum(to @ unit_normal(first), 0) * np.maximum(-np.einsum("npqx,nx->npq", to, normals), 0)
        out.append(np.einsum("p,npq,nq->n", weights, cosines / squared**2, areas) / np.pi)
    return np.concatenate(out)


# ---- pairs with others between ----


def exchange_among(first, second, blockers) -> float:
    """A_1 F_12 [m^2] of two convex polygons, less what convex blockers hide: 0 <= A F_obs <= A F <= min(A_1, A_2)."""
    clear = exchange(first, second)
    if clear == 0 or not len(blockers):
        return clear
    origin = first[0]
    a, b = first - origin, second - origin
    a, b = above(a, b), above(b, a)
    parts = [part for part in (blocking_part(blocker - origin, a, b) for blocker in blockers) if part is not None]
    if not parts:
        return clear
    if any(blocks_all(part, a, b) for part in parts):
        return 0.0
    # the smaller one changes less of what it sees
    if polygon_area(b) < polygon_area(a):
        a, b = b, a
    hidden = integrate_partly_hidden(a, b, parts)
    if hidden.visible < hidden.hidden:
        return min(hidden.visible, clear)
    return max(clear - hidden.hidden, 0.0)


def surface_exchange(first: Surface, second: Surface, blockers=()) -> float:
    """A_1 F_12 [m^2] of two surfaces among blockers, which are surfaces too."""
    pieces = [piece for blocker in blockers for piece in blocker.pieces]
    total = sum(exchange_among(p, q, pieces) for p in first.pieces for q in second.pieces)
    return min(total, first.area, second.area)


def exchange_matrix(surfaces, blockers=()):
    """A_i F_ij of all pairs, symmetric, float64 (N, N) [m^2]; surfaces block each other, ``blockers`` block, too."""
    exchanges = np.zeros((len(surfaces), len(surfaces)))
    for i, first in enumerate(surfaces):
        for j in range(i):
            others = [s for k, s in enumerate(surfaces) if k not in (i, j)]
            exchanges[i, j] = exchanges[j, i] = surface_exchange(first, surfaces[j], [*others, *blockers])
    return exchanges


def element_form_factor(point, normal, target: Surface, blockers=()) -> float:
    """Form factor from an element at ``point`` (3,) with unit ``normal`` (3,) to the part of a surface it sees."""
    total = 0.0
    for piece in target.pieces:
        seen = _above_element(piece - point, normal)
        if seen is None or unit_normal(seen) @ seen[0] >= 0:
            continue
        hiding = [
            above(part, seen)
            for part in (_above_element(o - point, normal) for s in blockers for o in s.pieces)
            if part is not None
        ]
        hiding = [part for part in hiding if len(part) and fault_of(part) is None]
        total += float(visible_factors(np.zeros((1, 3)), normal, seen, hiding)[0])
    return max(total, 0.0)


def _above_element(corners, normal):
    part = clip(corners, heights_above(corners, np.zeros(3), normal))
    return part if len(part) and fault_of(part) is None else None
