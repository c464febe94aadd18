"""Cut the surface into charts by xatlas: which triangles go together, and how xatlas lays them out."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from .charts import TargetSurface, weld
from .settings import SettingsError

# Triangles below 1.2e-7 square units have no place for xatlas, whatever the scene's size; meshes are handed over scaled
# so that nearly all triangles are far above, and not larger than float32 holds.
SMALL_AREA_SHARE = 0.01  # of the triangles may be smaller than 1 square unit
LEAST_AREA = 1e-6  # [square units]
LARGEST_EXTENT = 1e6  # [units]


@dataclass(frozen=True, slots=True)
class CutSurface:
    """What xatlas makes of the surface.

    Attributes
    ----------
    charts : int64 (N,) chart of each triangle, -1 where it has none
    uvs : float64 (N, 3, 2) layout by xatlas: each chart is stretched along u and v by factors of its own
    is_projected : bool (C,) the chart is a projection to a plane; the others are conformal maps of curved pieces
    """

    charts: np.ndarray
    uvs: np.ndarray
    is_projected: np.ndarray


def cut(surface: TargetSurface) -> CutSurface:
    """One xatlas atlas over all objects; triangles that meet at a position grow into one chart."""
    xatlas = _xatlas()
    atlas = xatlas.Atlas()
    meshes = [_add_object(atlas, surface, rows) for _, rows in surface.objects]
    packing = xatlas.PackOptions()
    packing.texels_per_unit = 1e-6  # its packing is not used: the smallest is the quickest
    meshes = [rows for rows in meshes if len(rows)]
    atlas.generate(xatlas.ChartOptions(), packing, False)

    charts, uvs = np.full(len(surface.triangles), -1), np.zeros((len(surface.triangles), 3, 2))
    is_projected = []
    for mesh, rows in enumerate(meshes):
        _, indices, layout = atlas.get_mesh(mesh)
        uvs[rows] = layout[indices]
        for number in range(atlas.get_mesh_chart_count(mesh)):
            chart = atlas.get_mesh_chart(mesh, number)
            charts[rows[np.asarray(chart.faces)]] = len(is_projected)
            is_projected.append(chart.type in (xatlas.ChartType.Planar, xatlas.ChartType.Ortho))
    return CutSurface(charts, uvs * (atlas.width, atlas.height), np.array(is_projected, bool))


def _xatlas():
    try:
        import xatlas
    except ImportError as error:
        python = ".".join(map(str, sys.version_info[:2]))
        raise SettingsError(
            f"unwrapping needs the package xatlas==0.0.11, which cannot be loaded ({error}; it has wheels for Python "
            f"3.8 to 3.13, this is {python}): keep the UVs that the objects have, or bake vertex colours"
        ) from error
    return xatlas


def _add_object(atlas, surface, rows):
    """Hand an object's triangles that have an area to xatlas; their rows."""
    areas = surface.areas[rows]
    rows = np.arange(rows.start, rows.stop)[areas > 0]
    if not len(rows):
        return rows
    corners = surface.corners[rows].reshape(-1, 3)
    positions, indices = weld(corners)
    low, high = positions.min(axis=0), positions.max(axis=0)
    areas = areas[areas > 0]
    scale = max(np.quantile(areas, SMALL_AREA_SHARE) ** -0.5, (LEAST_AREA / areas.min()) ** 0.5)
    scale = min(scale, LARGEST_EXTENT / (high - low).max())
    positions = ((positions - (low + high) / 2) * scale).astype(np.float32)
    atlas.add_mesh(positions, indices.reshape(-1, 3).astype(np.uint32))
    return rows
