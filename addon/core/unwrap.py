"""Unwrap the target objects into one lightmap, or keep the UVs that they have."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .charts import Charts, target_surface
from .copies import copies_of, layouts
from .cut import cut
from .flatten import flatten
from .packing import MOST_TEXELS, Surface, pack, too_dense
from .scene import Scene, SceneError
from .settings import BakeSettings
from .triangles import triangle_areas


def unwrap(scene: Scene, settings: BakeSettings, on_step: Callable[[float], None] | None = None) -> Charts:
    """Where each triangle of the target objects lies in the lightmap.

    All objects share one atlas of at most ``settings.texels`` texels, or of ``settings.density`` texels/m. No texel is
    within bilinear reach of two charts, and one free texel lies between them for mipmaps. Polygons stay whole: a loop
    has one UV, and where objects share a mesh, one place within each object's rectangle. Same input, same bytes.

    With ``settings.keep_uvs`` the objects' own UVs decide, over a square of ``settings.texels``, or of a density that
    is ``settings.density`` over all surfaces; they may overlap.

    ``on_step(done)`` hears after each stage how much (0..1) is done; what it raises ends the work.
    """
    if settings.keep_uvs:
        return _kept(scene, settings)
    groups = copies_of(scene)
    surface = target_surface(scene, groups)
    on_step = on_step or (lambda done: None)
    pieces = cut(surface)
    on_step(0.6)
    flat = flatten(surface, pieces)
    on_step(0.7)
    charts = pack(Surface(*layouts(scene, flat, groups)), len(scene.triangles), settings)
    on_step(1.0)
    return charts


def _kept(scene, settings):
    target_surface(scene)  # says where there is nothing to bake
    targets = [obj for obj in scene.objects if obj.is_target and obj.count]
    kept_uvs = [_checked_uvs(obj) for obj in targets]
    side = math.isqrt(settings.texels) if settings.density is None else _side(scene, targets, kept_uvs, settings)
    uvs = np.full((len(scene.triangles), 3, 2), np.nan, np.float32)
    charts = np.full(len(scene.triangles), -1, np.int32)
    chart_count = 0
    for obj, kept in zip(targets, kept_uvs):
        uvs[obj.span] = kept * np.float32(side)
        charts[obj.span] = _connected(kept) + chart_count
        chart_count = int(charts[obj.span].max()) + 1
    return Charts(uvs, charts, side, side)


def _side(scene, targets, uvs, settings):
    """Texels along a square in which the targets' UVs (N, 3, 2) have all of their surface's texels at a density."""
    areas = triangle_areas(scene.corners)
    area = sum(float(areas[obj.span].sum()) for obj in targets)
    share = sum(float(triangle_areas(np.pad(kept, ((0, 0), (0, 0), (0, 1)))).sum()) for kept in uvs)
    if not share > 0:
        raise SceneError('the UV layers "Lightmap" have no area: a density gives no size')
    texels = settings.density * (area / share) * settings.density
    if texels > MOST_TEXELS:
        raise too_dense(settings.density, texels)
    return max(round(math.sqrt(texels)), 1)


def _checked_uvs(obj):
    if obj.lightmap_uvs is None:
        raise SceneError(f'object {obj.name} has no UV layer "Lightmap" to keep')
    uvs = np.asarray(obj.lightmap_uvs, np.float32)
    outside = ~((uvs >= 0) & (uvs <= 1)).all(axis=(1, 2))
    if outside.any():
        raise SceneError(
            f'object {obj.name}: the UV layer "Lightmap" leaves the square from 0 to 1 on {int(outside.sum())} of '
            f"{obj.count} triangles"
        )
    return uvs


def _connected(uvs):
    """Number the pieces that hang together at corners of one UV, int32 (N,), in order of their first triangle."""
    _, corners = np.unique(uvs.reshape(-1, 2), axis=0, return_inverse=True)
    corners = corners.reshape(-1, 3)
    labels = np.arange(len(corners))
    while True:
        # the lowest label around each corner, then the lowest of a triangle's corners, then of its label's label
        lowest = np.full(corners.max() + 1, len(corners))
        np.minimum.at(lowest, corners.reshape(-1), np.repeat(labels, 3))
        found = lowest[corners].min(axis=1)
        found = found[found]
        if (found == labels).all():
            return np.unique(labels, return_inverse=True)[1].astype(np.int32)
        labels = found
