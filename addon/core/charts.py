"""Charts: pieces of surface laid out flat. First each in a frame of its own, then all in one atlas."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from .scene import Scene, SceneError
from .triangles import area_vectors


@dataclass(frozen=True, slots=True)
class Charts:
    """Where each target triangle lies in the lightmap.

    Attributes
    ----------
    uvs : float32 (T, 3, 2) of the scene's triangles' corners, in texels: the centre of column i is at i + 0.5. NaN on
        triangles without a place: those of other objects, and polygons without an area
    charts : int32 (T,) which chart a triangle is part of; -1 without a place
    width, height : of the lightmap [texels]
    rects : of objects that share a mesh, by name, (scale_u, scale_v, offset_u, offset_v) [texels]: where the square
        from 0 to 1, in which the mesh's one layout lies, is for them
    """

    uvs: np.ndarray
    charts: np.ndarray
    width: int
    height: int
    rects: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class FlatCharts:
    """Charts before they are packed.

    Attributes
    ----------
    triangles : int64 (N,) indices of the scene's triangles, sorted by chart
    uvs : float64 (N, 3, 2) corners in their chart's frame, which starts at (0, 0) [m]
    first_triangles : int32 (C + 1,) chart c has rows ``first_triangles[c] : first_triangles[c + 1]``
    """

    triangles: np.ndarray
    uvs: np.ndarray
    first_triangles: np.ndarray

    @property
    def chart_count(self) -> int:
        return len(self.first_triangles) - 1

    @property
    def chart_of_row(self) -> np.ndarray:
        """Which chart each row is part of, int32 (N,)."""
        return np.repeat(np.arange(self.chart_count, dtype=np.int32), np.diff(self.first_triangles))

    @cached_property
    def sizes(self) -> np.ndarray:
        """Extents of the charts along u and v, float64 (C, 2) [m]."""
        if not self.chart_count:
            return np.zeros((0, 2))
        return np.maximum.reduceat(self.uvs.max(axis=1), self.first_triangles[:-1])

    @property
    def areas(self) -> np.ndarray:
        """Of the charts, float64 (C,) [m^2]."""
        a, b = self.uvs[:, 1] - self.uvs[:, 0], self.uvs[:, 2] - self.uvs[:, 0]
        return np.bincount(self.chart_of_row, np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2, self.chart_count)


@dataclass(frozen=True, slots=True)
class TargetSurface:
    """The triangles that get a place, with what binds them together.

    Attributes
    ----------
    triangles : int64 (N,) indices of the scene's triangles
    objects : tuple of (name, slice into the rows)
    corners : float64 (N, 3, 3) [m]
    area_vectors : float64 (N, 3) normals as long as the triangle's area [m^2]
    areas : float64 (N,) [m^2]
    polygons : int64 (N,) 0.. without gaps, of all objects
    loops : int64 (N, 3) face corners, of all objects: one loop has one UV
    """

    triangles: np.ndarray
    objects: tuple[tuple[str, slice], ...]
    corners: np.ndarray
    area_vectors: np.ndarray
    areas: np.ndarray
    polygons: np.ndarray
    loops: np.ndarray


def target_surface(scene: Scene, groups=()) -> TargetSurface:
    """The triangles of the scene's target objects, of ``groups`` that share a mesh only the first's; SceneError where
    there are none with an area."""
    copies = {obj.first for _, *others in groups for obj in others}
    targets = [obj for obj in scene.objects if obj.is_target and obj.count and obj.first not in copies]
    triangles, objects, polygons, loops = [], [], [], []
    row = polygon_count = loop_count = 0
    for obj in targets:
        triangles.append(np.arange(obj.first, obj.first + obj.count))
        objects.append((obj.name, slice(row, row + obj.count)))
        own = np.arange(obj.count) if obj.polygons is None else obj.polygons
        polygons.append(own.astype(np.int64) + polygon_count)
        own = np.arange(3 * obj.count).reshape(-1, 3) if obj.corners is None else obj.corners
        loops.append(own.astype(np.int64) + loop_count)
        row, polygon_count, loop_count = row + obj.count, polygons[-1].max() + 1, loops[-1].max() + 1
    if not targets:
        raise SceneError("nothing to bake: the scene has no target object with faces")
    triangles = np.concatenate(triangles)
    corners = scene.vertices[scene.triangles[triangles]]
    vectors = area_vectors(corners)
    if not vectors.any():
        raise SceneError("nothing to bake: no face of the target objects has an area")
    polygons = np.unique(np.concatenate(polygons), return_inverse=True)[1]
    areas = np.linalg.norm(vectors, axis=1)
    return TargetSurface(triangles, tuple(objects), corners, vectors, areas, polygons, np.concatenate(loops))


def weld(points):
    """Distinct rows of points (N, 3), and which of them each point is."""
    order = np.lexsort(points.T)
    ordered = points[order]
    is_new = np.ones(len(points), bool)
    is_new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    which = np.empty(len(points), np.int64)
    which[order] = np.cumsum(is_new) - 1
    return ordered[is_new], which
