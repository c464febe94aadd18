"""Objects that share a mesh share one layout of UVs: it is made for all of them, and each has a place of its own.

A mesh's UV layer is one, whatever number of objects show it: what tells them apart is a rectangle of the lightmap each
(``patchlight_rect``), into which the whole layout goes, scaled and moved but not turned.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .charts import FlatCharts
from .scene import Scene, SceneError, SceneObject
from .triangles import triangle_areas


@dataclass(frozen=True, slots=True)
class Layout:
    """The charts of a mesh that several objects share, and who they are.

    Attributes
    ----------
    objects : the K objects; the first is the one whose triangles were laid out
    flat : FlatCharts of its triangles, each as large as the object needs it where it is largest [m]
    factors : float64 (K, 2) what part of that an object needs along u and v, at most 1, about
    """

    objects: tuple[SceneObject, ...]
    flat: FlatCharts
    factors: np.ndarray

    @property
    def loops(self) -> np.ndarray:
        """The face corners of ``flat``'s rows, int32 (N, 3)."""
        return self.objects[0].corners[self.flat.triangles - self.objects[0].first]

    def spread(self, uvs: np.ndarray, obj: SceneObject):
        """UVs of ``flat``'s rows (N, 3, 2) as an object's own triangles have them, and the chart of each of these."""
        model = self.objects[0]  # whose corners and polygons are all that the others have
        of_loop = np.full((int(model.corners.max()) + 1, 2), np.nan)
        of_loop[self.loops] = uvs
        of_polygon = np.full(int(model.polygons.max()) + 1, -1, np.int32)
        of_polygon[model.polygons[self.flat.triangles - model.first]] = self.flat.chart_of_row
        return of_loop[obj.corners], of_polygon[obj.polygons]


def copies_of(scene: Scene) -> tuple[tuple[SceneObject, ...], ...]:
    """The target objects that share meshes, by mesh; first the one to lay out: it has most faces, and is large.

    SceneError where its faces are not all that the others have.
    """
    by_mesh = {}
    for obj in scene.objects:
        if obj.is_target and obj.count and obj.mesh is not None:
            by_mesh.setdefault(obj.mesh, []).append(obj)
    groups = [group for group in by_mesh.values() if len(group) > 1]
    areas = triangle_areas(scene.corners) if groups else None
    return tuple(_model_first(areas, group) for group in groups)


def layouts(scene: Scene, flat: FlatCharts, groups) -> tuple[FlatCharts, tuple[Layout, ...]]:
    """Charts of meshes of one object, and those that are shared: ``flat`` has every mesh once."""
    group_of_triangle = np.full(len(scene.triangles), -1)
    for number, group in enumerate(groups):
        group_of_triangle[group[0].span] = number
    # a chart never spans two objects
    group_of_chart = group_of_triangle[flat.triangles[flat.first_triangles[:-1]]]
    own = _chosen(flat, group_of_chart == -1) if groups else flat
    return own, tuple(
        _layout(scene, _chosen(flat, group_of_chart == number), group) for number, group in enumerate(groups)
    )


def _model_first(areas, group):
    model = max(range(len(group)), key=lambda k: (group[k].count, areas[group[k].span].sum(), -k))
    is_known = np.zeros(max(int(obj.corners.max()) for obj in group) + 1, bool)
    is_known[group[model].corners] = True
    for obj in group:
        if not is_known[obj.corners].all():
            raise SceneError(
                f"'{obj.name}' and '{group[model].name}' share a mesh, but not the faces that have an area: "
                "make one a single user to bake it"
            )
    return (group[model], *group[:model], *group[model + 1 :])


def _chosen(flat, is_chosen):
    rows = is_chosen[flat.chart_of_row]
    counts = np.diff(flat.first_triangles)[is_chosen]
    return FlatCharts(flat.triangles[rows], flat.uvs[rows], np.append(0, np.cumsum(counts)).astype(np.int32))


def _layout(scene, flat, group):
    layout = Layout(group, flat, np.ones((len(group), 2)))
    stretches = np.stack([_stretch(scene, layout, obj) for obj in group])
    stretches /= stretches[0]  # what the flat chart itself has squeezed is none of the others' need
    largest = stretches.max(axis=0)
    # a mean over the object's surface: a speck that is stretched does not make all of it large
    areas = stretches.prod(axis=2, keepdims=True) * flat.areas[:, None]
    factors = np.sqrt((areas * (stretches / largest) ** 2).sum(axis=1) / np.maximum(areas.sum(axis=1), 1e-300))
    return Layout(group, replace(flat, uvs=flat.uvs * largest[flat.chart_of_row][:, None]), factors)


def _stretch(scene, layout, obj):
    """How long an object's surface is along u and v of each chart, of the layout's: RMS by area, above 0 (C, 2)."""
    flat = layout.flat
    positions = np.full((int(layout.objects[0].corners.max()) + 1, 3), np.nan)
    positions[obj.corners] = scene.vertices[scene.triangles[obj.span]]
    corners = positions[layout.loops]
    edges, along = corners[:, 1:] - corners[:, :1], flat.uvs[:, 1:] - flat.uvs[:, :1]
    twice_area = along[:, 0, 0] * along[:, 1, 1] - along[:, 0, 1] * along[:, 1, 0]
    charts = flat.chart_of_row
    is_sure = (np.abs(twice_area) > 0) & np.isfinite(corners).all(axis=(1, 2))
    out = np.empty((flat.chart_count, 2))
    for axis, other in ((0, 1), (1, 0)):
        # what the position changes by along the axis, times the area
        change = edges[:, 0] * along[:, 1, other, None] - edges[:, 1] * along[:, 0, other, None]
        squares = (change**2).sum(axis=1)[is_sure] / np.abs(twice_area[is_sure])
        sums = np.bincount(charts[is_sure], squares, flat.chart_count)
        out[:, axis] = sums / np.maximum(np.bincount(charts, np.abs(twice_area), flat.chart_count), 1e-300)
    return np.maximum(np.sqrt(out), 1e-9)
