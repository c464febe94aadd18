"""Lay charts out flat, in metres, without tearing a polygon.

A Blender face corner has one UV, so a polygon's triangles stay in one chart. A polygon that was torn (xatlas sees
triangles only), that folds over in its chart, or that is squeezed there beyond use, becomes a chart of its own:
projected along its Newell normal. Where such a polygon is so bent that its projection overlaps itself, its triangles
share texels; nothing better is tried. Nor for specks too small to see: each chart costs a gutter of several texels.
"""

from __future__ import annotations

import numpy as np

from .charts import FlatCharts, TargetSurface, weld
from .cut import CutSurface

LEAST_FACING = 0.2  # cosine between a triangle and the plane that its chart is projected to
LEAST_SCALE = 0.2  # of lengths, geometric mean in a triangle; a fold counts as negative
LARGEST_SCALE = 5.0
SPECK = 1e-6  # of the whole surface: a texel in a lightmap of a million
SAME_UV = 1e-6  # of the extent of all charts: two corners of one loop so close together have one UV
TURNS = 24  # angles that a chart is tried at, within a quarter turn
EDGES = ((0, 1), (1, 2), (2, 0))


def flatten(surface: TargetSurface, cut: CutSurface) -> FlatCharts:
    """Charts of whole polygons, true to scale as far as a curved piece can be, long edges along the axes."""
    charts, is_projected = _keep_polygons_whole(surface, cut)
    uvs = _unstretched(surface, charts, cut.uvs, len(is_projected))
    is_facing = _is_facing(surface, charts, is_projected, len(cut.is_projected))
    uvs = _projected(surface, charts, is_facing, uvs)
    broken = _broken_polygons(surface, charts, is_projected, uvs)
    charts, is_projected = _take_out(surface, charts, is_projected, broken)
    is_new = np.zeros(len(is_projected), bool)
    is_new[len(is_projected) - len(broken) :] = True
    uvs = _projected(surface, charts, is_new, uvs)
    return _sorted_by_chart(surface, charts, _aligned(surface, charts, uvs, len(is_projected)))


def _keep_polygons_whole(surface, cut):
    """Charts per triangle after torn polygons are taken out, and triangles without an area have joined theirs."""
    polygons, charts = surface.polygons, cut.charts
    lowest = np.full(polygons.max() + 1, np.iinfo(np.int64).max)
    highest = np.full(polygons.max() + 1, -1)
    has_chart = charts >= 0
    np.minimum.at(lowest, polygons[has_chart], charts[has_chart])
    np.maximum.at(highest, polygons[has_chart], charts[has_chart])
    has_area = np.bincount(polygons, surface.areas) > 0
    is_partial = np.bincount(polygons, ~has_chart) > 0
    is_curved = np.append(~cut.is_projected, False)[highest]
    # xatlas gives a triangle without an area no UV; a projection does, a conformal map does not
    is_torn = has_area & ((lowest != highest) | (is_partial & is_curved))
    return _take_out(surface, highest[polygons], cut.is_projected, np.flatnonzero(is_torn))


def _take_out(surface, charts, is_projected, out):
    """Each of the polygons ``out`` becomes a projected chart of its own, behind the others."""
    own_chart = np.full(surface.polygons.max() + 1, -1)
    own_chart[out] = len(is_projected) + np.arange(len(out))
    own_chart = own_chart[surface.polygons]
    return np.where(own_chart >= 0, own_chart, charts), np.append(is_projected, np.ones(len(out), bool))


def _unstretched(surface, charts, uvs, count):
    """Undo each chart's own stretch: factors per axis by least squares on edge lengths, u right-handed."""
    rows = np.flatnonzero((charts >= 0) & (charts < count))
    sums = np.zeros((5, count))
    for i, j in EDGES:
        du, dv = ((uvs[rows, i] - uvs[rows, j]) ** 2).T
        length = ((surface.corners[rows, i] - surface.corners[rows, j]) ** 2).sum(axis=1)
        # (a du^2 + b dv^2 - length^2)^2 / length^2: relative errors of long edges count more
        weight = 1 / np.maximum(length, np.finfo(float).tiny)
        terms = (weight * du * du, weight * du * dv, weight * dv * dv, weight * du * length, weight * dv * length)
        sums += [np.bincount(charts[rows], term, count) for term in terms]
    uu, uv, vv, ul, vl = sums
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = uu * vv - uv * uv
        factors = np.stack([ul * vv - vl * uv, vl * uu - ul * uv]) / determinant
        even = (ul + vl) / (uu + 2 * uv + vv)
        is_sure = (determinant > 1e-9 * uu * vv) & (factors > 0).all(axis=0)
        factors = np.where(is_sure, factors, even).T
    factors = np.sqrt(np.where(np.isfinite(factors), factors, 0.0))
    signed_areas = np.bincount(charts[rows], _cross(uvs[rows]), count)
    factors[signed_areas < 0, 0] *= -1
    out = uvs.copy()
    out[rows] *= factors[charts[rows], None]
    return out


def _is_facing(surface, charts, is_projected, cut_count):
    """Which charts to project: of one polygon always; of xatlas where no triangle stands edge on to the plane."""
    cosines = (_normals(surface, charts, is_projected)[charts] * surface.area_vectors).sum(axis=1)
    is_steep = (cosines < LEAST_FACING * surface.areas) & (charts >= 0)
    is_steep = np.bincount(charts[is_steep], minlength=len(is_projected)) > 0
    is_steep[cut_count:] = False
    return is_projected & ~is_steep


def _normals(surface, charts, is_projected):
    """The Newell normal of each projected chart (C, 3); of one that closes on itself, its largest triangle's."""
    count = len(is_projected)
    rows = np.flatnonzero(np.append(is_projected, False)[charts])
    rows = rows[np.argsort(surface.areas[rows], kind="stable")]
    sums = _sums(charts[rows], surface.area_vectors[rows], count)
    largest = np.zeros((count, 3))
    largest[charts[rows]] = surface.area_vectors[rows]
    areas = np.bincount(charts[rows], surface.areas[rows], count)
    is_open = np.linalg.norm(sums, axis=1) > 1e-6 * areas
    return _unit(np.where(is_open[:, None], sums, largest))


def _projected(surface, charts, is_projected, uvs):
    """UVs in metres of the projected charts' triangles, in double: xatlas computes in float."""
    rows = np.flatnonzero(np.append(is_projected, False)[charts])
    normals = _normals(surface, charts, is_projected)
    across = _unit(np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)]))
    axes = np.stack([across, np.cross(normals, across)], axis=1)
    origins = np.zeros((len(is_projected), 3))
    origins[charts[rows]] = surface.corners[rows, 0]
    out = uvs.copy()
    offsets = surface.corners[rows] - origins[charts[rows], None]
    out[rows] = np.einsum("nkx,nax->nka", offsets, axes[charts[rows]])
    return out


def _broken_polygons(surface, charts, is_projected, uvs):
    """Polygons that fold over or are squeezed or blown up in their chart, or whose loop got two UVs."""
    has_area = (charts >= 0) & (surface.areas > 0)
    areas, flat_areas = surface.areas[has_area], _cross(uvs[has_area]) / 2
    is_broken = np.zeros(len(charts), bool)
    is_broken[has_area] = (flat_areas < LEAST_SCALE**2 * areas) | (flat_areas > LARGEST_SCALE**2 * areas)
    is_broken[has_area] &= np.maximum(areas, flat_areas) > SPECK * areas.sum()
    is_broken |= _has_two_uvs(surface.loops, uvs).any(axis=1) & (charts >= 0)
    # a chart of one polygon is as good as it gets
    polygon_count = surface.polygons.max() + 1
    pairs = np.unique((charts * polygon_count + surface.polygons)[charts >= 0])
    polygons_of_chart = np.bincount(pairs // polygon_count, minlength=len(is_projected))
    is_alone = np.append(is_projected & (polygons_of_chart == 1), False)[charts]
    return np.unique(surface.polygons[is_broken & ~is_alone])


def _has_two_uvs(loops, uvs):
    """Whether another corner of the same loop lies elsewhere, bool (N, 3)."""
    loops, which = np.unique(loops, return_inverse=True)
    which = which.reshape(-1)
    flat = uvs.reshape(-1, 2)
    low, high = np.full((len(loops), 2), np.inf), np.full((len(loops), 2), -np.inf)
    np.minimum.at(low, which, flat)
    np.maximum.at(high, which, flat)
    size = np.ptp(flat, axis=0).max() if len(flat) else 0.0
    return ((high - low).max(axis=1) > SAME_UV * size)[which].reshape(-1, 3)


def _aligned(surface, charts, uvs, count):
    """Turn each chart so that it fills its bounding rectangle best, and its straight borders run along the axes."""
    rows, ends = _border(surface, charts)
    owners = charts[rows]
    start, end = uvs[rows, ends], uvs[rows, (ends + 1) % 3]
    turns = _best_turns(owners, start, count)
    # then exactly: the direction of the edges close by, modulo a quarter turn, as a unit vector to the fourth power
    edge = end - start
    angle = 4 * (np.arctan2(edge[:, 1], edge[:, 0]) - turns[owners])
    is_near = np.cos(angle) > np.cos(4 * np.pi / TURNS)
    # the power makes few long edges outvote many short ones
    weight = np.where(is_near, (edge**2).sum(axis=1) ** 1.5, 0.0)
    sums = _sums(owners, np.stack([np.cos(angle), np.sin(angle)], axis=1) * weight[:, None], count)
    turns += np.arctan2(sums[:, 1], sums[:, 0]) / 4

    placed = np.flatnonzero(charts >= 0)
    out = uvs.copy()
    out[placed] = _turned(uvs[placed], turns[charts[placed], None])
    return out


def _border(surface, charts):
    """Edges that only one triangle of a chart has, sorted by chart: row, and corner that the edge starts from."""
    points = weld(surface.corners.reshape(-1, 3))[1].reshape(-1, 3)
    following = np.roll(points, -1, axis=1)
    first, second = np.minimum(points, following).reshape(-1), np.maximum(points, following).reshape(-1)
    owners = np.repeat(charts, 3)
    order = np.lexsort((second, first, owners))
    order = order[owners[order] >= 0]
    differs = (np.diff(owners[order]) != 0) | (np.diff(first[order]) != 0) | (np.diff(second[order]) != 0)
    edges = order[np.append(True, differs) & np.append(differs, True)]
    closed = np.setdiff1d(owners[order], owners[edges])  # a folded polygon may have no border
    edges = np.append(edges, np.flatnonzero(np.isin(owners, closed)))
    edges = edges[np.argsort(owners[edges], kind="stable")]
    return edges // 3, edges % 3


def _best_turns(owners, points, count):
    """The angle of each chart (C,), of a few, at which its points (sorted by chart) fill the smallest rectangle."""
    present, first = np.unique(owners, return_index=True)
    best, smallest = np.zeros(count), np.full(len(present), np.inf)
    for angle in np.arange(TURNS) * (np.pi / 2 / TURNS):
        turned = _turned(points, angle)
        extents = np.maximum.reduceat(turned, first) - np.minimum.reduceat(turned, first)
        # plus a border, or else all thin charts are alike
        areas = extents.prod(axis=1) + 1e-3 * (extents**2).sum(axis=1)
        best[present[areas < smallest]] = angle
        smallest = np.minimum(areas, smallest)
    return best


def _turned(uvs, angles):
    """Coordinates (..., 2) along axes that are turned by the angles."""
    u, v = uvs[..., 0], uvs[..., 1]
    cos, sin = np.cos(angles), np.sin(angles)
    return np.stack([u * cos + v * sin, v * cos - u * sin], axis=-1)


def _sorted_by_chart(surface, charts, uvs):
    """Rows in the order of charts, numbers of empty charts closed up, each chart's frame starting at (0, 0)."""
    order = np.argsort(charts, kind="stable")
    order = order[charts[order] >= 0]
    _, first = np.unique(charts[order], return_index=True)
    first = np.append(first, len(order)).astype(np.int32)
    uvs = uvs[order]
    lowest = np.minimum.reduceat(uvs.min(axis=1), first[:-1])
    uvs = uvs - np.repeat(lowest, np.diff(first), axis=0)[:, None]
    return FlatCharts(surface.triangles[order], uvs, first)


def _sums(which, rows, count):
    """Sums of rows (N, k) by which of the ``count`` they belong to."""
    return np.stack([np.bincount(which, column, count) for column in rows.T], axis=1)


def _unit(vectors):
    """Unit vectors; z where there is no direction."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(lengths > 0, vectors / lengths, (0.0, 0.0, 1.0))


def _cross(uvs):
    """Twice the signed areas of triangles (N, 3, 2)."""
    a, b = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
