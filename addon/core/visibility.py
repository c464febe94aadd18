"""The part of the light between two convex polygons that others hide: exact at a point, adaptive over points.

At a point, an occluder hides what lies in the cone through its corners; what is left of the target is cut out exactly,
as convex pieces (Nishita & Nakamae 1985). Over positions the result is smooth but along lines, where a corner of an
occluder seen from there crosses an edge of the target or the other way round: cells of positions are cut along them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .kinks import kinks_of
from .lambert import element_factors
from .polygon import above, bisect, clip, extent, fault_of, heights_above, unit_normal
from .quadrature import fan, triangle_rule
from .triangles import triangle_areas

COARSE, FINE = 3, 5  # nodes along a triangle's side; the difference is the error of a cell
KINKS_AT_ONCE, CELLS_AT_ONCE = 200, 400  # with no more kinks than this, cells are cut along all of them at the start
GENERATIONS = 14
CELL_LIMIT = 1500
HIDDEN_ERROR = 1e-6  # of the unobstructed exchange, to which the hidden part is integrated
VISIBLE_ERROR = 1e-5  # of a small visible part
NOTHING = 1e-12  # of the unobstructed exchange: a visible part below this is rounding


@dataclass(frozen=True, slots=True)
class PartlyHidden:
    """Integrals over one polygon of the factor to the visible and to the hidden part of the other [m^2]."""

    visible: float
    hidden: float
    error: float  # of the smaller one, estimated [m^2]


# ---- which polygons can block ----


def blocking_part(occluder, first, second):
    """The part of an occluder that may lie between two polygons; None where it surely does not.

    Light between them stays in front of both, and inside their convex hull; an occluder on a face of the hull hides
    nothing.
    """
    part = above(occluder, first)
    part = above(part, second) if len(part) else part
    if not len(part) or fault_of(part):
        return None
    both = np.concatenate([first, second])
    heights = heights_above(both, part[0], unit_normal(part))
    if (heights >= 0).all() or (heights <= 0).all():
        return None
    return None if _is_outside_hull(part, first, second) else part


def _is_outside_hull(part, first, second):
    """Whether a plane through an edge of one polygon and a corner of the other has all of both on its other side."""
    both = np.concatenate([first, second])
    for edges, corners in ((first, second), (second, first)):
        origins = np.repeat(edges, len(corners), axis=0)
        along = np.repeat(np.roll(edges, -1, axis=0) - edges, len(corners), axis=0)
        normals = np.cross(along, np.tile(corners, (len(edges), 1)) - origins)
        lengths = np.linalg.norm(normals, axis=1)
        kept = lengths > 0
        origins, normals = origins[kept], normals[kept] / lengths[kept, None]
        offsets = (origins * normals).sum(axis=1)
        rounding = 1e-12 * np.abs(np.concatenate([both, part])).max()
        inside, outside = both @ normals.T - offsets, part @ normals.T - offsets
        for sign in (1, -1):
            if ((sign * inside >= -rounding).all(axis=0) & (sign * outside <= rounding).all(axis=0)).any():
                return True
    return False


def blocks_all(occluder, first, second) -> bool:
    """Whether a convex occluder alone hides two polygons from each other altogether.

    The point where a line from one to the other crosses the occluder's plane is a weighted mean of those of the lines
    between corners: where these lie in the occluder, all do.
    """
    normal = unit_normal(occluder)
    high, low = heights_above(first, occluder[0], normal), heights_above(second, occluder[0], normal)
    if (high <= 0).all() and (low >= 0).all():
        high, low = -high, -low
    if not ((high >= 0).all() and (low <= 0).all() and high.any() and low.any()):
        return False
    fall = high[:, None] - low[None, :]
    i, j = np.nonzero(fall > 0)
    crossings = (high[i, None] * second[j] - low[j, None] * first[i]) / fall[i, j, None]
    inward = np.cross(normal, np.roll(occluder, -1, axis=0) - occluder)
    depth = ((crossings[:, None] - occluder) * inward).sum(axis=2)
    return bool((depth >= -1e-12 * extent(occluder) ** 2).all())


# ---- at a point ----


def visible_factors(points, normal, target, occluders):
    """Form factors from elements (N,) to the part of a convex polygon in front of them that occluders leave visible.

    Parameters
    ----------
    points : float64 (N, 3) [m]; normal : (3,); target : (K, 3); occluders : convex, in front of the target's plane
    """
    owners = np.arange(len(points))
    pieces = np.broadcast_to(target, (len(points), *target.shape))
    for occluder in occluders:
        pieces, owners = _without_shadow(points, pieces, owners, occluder)
    return np.bincount(owners, element_factors(points[owners], normal, pieces), minlength=len(points))


def _without_shadow(points, pieces, owners, occluder):
    """Take the cone of an occluder out of pieces (M, V, 3) that are seen from points[owners]."""
    heights = heights_above(points, occluder[0], unit_normal(occluder))[owners]
    # the cone's planes look inwards where the occluder shows its back
    side = -np.sign(heights)
    to = occluder[None] - points[owners][:, None]
    planes = side[:, None, None] * np.cross(to, np.roll(to, -1, axis=1))
    shadowed, rest, shadow_planes, index = [], pieces, planes, np.arange(len(pieces))
    # an occluder seen edge-on hides nothing
    rest, shadow_planes, index = rest[side != 0], shadow_planes[side != 0], index[side != 0]
    for k in range(len(occluder)):
        over = ((rest - points[owners[index]][:, None]) * shadow_planes[:, None, k]).sum(axis=2)
        outside, is_outside = clip_all(rest, -over)
        shadowed.append((outside, index[is_outside]))
        rest, is_inside = clip_all(rest, over)
        shadow_planes, index = shadow_planes[is_inside], index[is_inside]
    is_hit = np.zeros(len(pieces), bool)
    is_hit[index] = True
    # pieces that no shadow falls on stay whole
    parts = [(pieces[~is_hit], np.flatnonzero(~is_hit)), *((p[is_hit[i]], i[is_hit[i]]) for p, i in shadowed)]
    width = max(part.shape[1] for part, _ in parts)
    padded = [np.concatenate([p, np.repeat(p[:, -1:], width - p.shape[1], axis=1)], axis=1) for p, _ in parts]
    return np.concatenate(padded), owners[np.concatenate([i for _, i in parts])]


def clip_all(polygons, heights):
    """Parts of convex polygons (M, V, 3) where heights (M, V) are positive, and which of them are left, bool (M,).

    As polygon.clip; a polygon of fewer corners repeats its last one.
    """
    is_left = (heights > 0).any(axis=1)
    polygons, heights = polygons[is_left], heights[is_left]
    after, height_after = np.roll(polygons, -1, axis=1), np.roll(heights, -1, axis=1)
    crosses = heights * height_after < 0
    share = np.where(crosses, heights / np.where(crosses, heights - height_after, 1.0), 0.0)
    both = np.stack([polygons, polygons + share[..., None] * (after - polygons)], axis=2)
    kept = np.stack([heights >= 0, crosses], axis=2).reshape(len(polygons), 2 * polygons.shape[1])
    both = both.reshape(len(polygons), 2 * polygons.shape[1], 3)
    counts = kept.sum(axis=1)
    order = np.argsort(~kept, axis=1, kind="stable")[:, : max(counts.max(initial=3), 3)]
    order = np.where(
        np.arange(order.shape[1]) < counts[:, None], order, order[np.arange(len(order)), counts - 1][:, None]
    )
    return np.take_along_axis(both, order[..., None], axis=1), is_left


# ---- over positions ----


def integrate_partly_hidden(first, second, occluders) -> PartlyHidden:
    """Integrate the visible and the hidden factor over the first polygon, cells halved until the smaller is good."""
    kinks = kinks_of(first, second, occluders)
    cells = _cut_along_all(first, kinks) if 0 < len(kinks) <= KINKS_AT_ONCE else [first]
    done = np.zeros(3)
    normal = unit_normal(first)
    for generation in range(GENERATIONS):
        visible, total, errors = _cell_integrals(cells, normal, second, occluders)
        sums = done[:2] + np.array([visible.sum(), total.sum()])
        seen, hidden = sums[0], sums[1] - sums[0]
        allowed = HIDDEN_ERROR * sums[1] if hidden < seen else max(VISIBLE_ERROR * seen, 1e-3 * HIDDEN_ERROR * sums[1])
        error = errors[:, int(hidden < seen)]
        refined = error > 0.5 * allowed / max(len(cells), 1)
        left = done[2] + error.sum()
        if left <= allowed or generation == GENERATIONS - 1 or len(cells) > CELL_LIMIT:
            break
        done += (visible[~refined].sum(), total[~refined].sum(), error[~refined].sum())
        cells = [part for k in np.flatnonzero(refined) for part in _halves(cells[k], kinks)]
    if seen <= NOTHING * sums[1]:
        return PartlyHidden(0.0, float(sums[1]), float(left))
    return PartlyHidden(float(seen), float(max(hidden, 0.0)), float(left))


def _cell_integrals(cells, normal, target, occluders):
    """Visible and total integrals of cells (C,), and the errors (C, 2) of the visible and of the hidden one."""
    triangles = np.concatenate([fan(cell) for cell in cells])
    owners = np.repeat(np.arange(len(cells)), [len(cell) - 2 for cell in cells])
    areas, values = triangle_areas(triangles), []
    for count in (COARSE, FINE):
        barycentrics, weights = triangle_rule(count)
        points = np.einsum("qc,tcx->tqx", barycentrics, triangles).reshape(-1, 3)
        visible = np.concatenate([visible_factors(p, normal, target, occluders) for p in _chunks(points)])
        total = np.concatenate([element_factors(p, normal, target) for p in _chunks(points)])
        for part in (visible, total):
            sums = areas * (part.reshape(len(triangles), -1) @ weights)
            values.append(np.bincount(owners, sums, minlength=len(cells)))
    coarse_visible, coarse_total, visible, total = values
    hidden_error = np.abs((total - visible) - (coarse_total - coarse_visible))
    return visible, total, np.stack([np.abs(visible - coarse_visible), hidden_error], axis=1)


def _chunks(points, size=20000):
    return np.array_split(points, -(-len(points) // size))


def _cut(cell, origin, normal):
    heights = heights_above(cell, origin, normal)
    parts = [clip(cell, heights), clip(cell, -heights)]
    return [part for part in parts if len(part) and fault_of(part) is None] or [cell]


def _halves(cell, kinks):
    """Cut a cell along the kink that divides it most evenly, else across its longest edge."""
    if len(kinks):
        evenness = kinks.evenness(cell)
        best = int(np.argmax(evenness))
        if evenness[best] > 1e-3:
            return _cut(cell, kinks.origins[best], kinks.normals[best])
    return [part for part in bisect(cell) if len(part) and fault_of(part) is None]


def _cut_along_all(cell, kinks):
    """Cells that no kink crosses."""
    waiting, done = [cell], []
    while waiting and len(waiting) + len(done) < CELLS_AT_ONCE:
        cell = waiting.pop()
        evenness = kinks.evenness(cell)
        best = int(np.argmax(evenness))
        parts = _cut(cell, kinks.origins[best], kinks.normals[best]) if evenness[best] > 1e-6 else [cell]
        if len(parts) > 1:
            waiting += parts
        else:
            done.append(cell)
    return done + waiting
