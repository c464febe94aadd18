"""A copy of a mesh with its long edges cut: vertex colours need vertices where the light changes."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.scene import SceneError
from .cut_faces import ROUNDING, Faces, cut_faces, edge_keys
from .read_mesh import are_finite, corner_vertices, read_positions
from .rebuild_mesh import Origins, rebuild_mesh

MOST_FACES = 20_000_000


def cut_mesh(mesh, name: str, matrix: np.ndarray, longest: float) -> bpy.types.Mesh | None:
    """A copy of the mesh of the object ``name`` with every edge at most ``longest`` [m, world space] long.

    Returns a new Mesh without users, or None where no edge is longer (or the mesh is not finite: reading it says so).
    Materials, UVs, attributes, sharp edges and flat faces are kept; custom normals and vertex groups are not.
    """
    positions = read_positions(mesh) @ matrix[:3, :3].T + matrix[:3, 3]
    if not len(mesh.polygons) or not are_finite(positions):
        return None
    polygons = _Polygons(mesh, positions, longest)
    if not polygons.is_cut.any():
        return None
    quads, triangles = polygons.cut_quads(), polygons.cut_triangles()
    surface = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], triangles])
    _require_possible(positions[polygons.vertices[surface]], longest, name)
    sources = np.concatenate([quads, triangles[:, [0, 1, 2, 2]]])
    faces = cut_faces(_first_faces(mesh, positions, polygons.vertices, quads, triangles), longest)
    return rebuild_mesh(mesh, _origins(polygons, faces, sources))


class _Polygons:
    """A mesh's polygons, and which of them have to be cut."""

    def __init__(self, mesh, positions, longest):
        self.vertices = corner_vertices(mesh).astype(np.int64)
        self.starts, self.sizes = (np.empty(len(mesh.polygons), np.int32) for _ in range(2))
        mesh.polygons.foreach_get("loop_start", self.starts)
        mesh.polygons.foreach_get("loop_total", self.sizes)
        self.of_corner = np.repeat(np.arange(len(self.sizes)), self.sizes)
        self._corners = positions[self.vertices]
        # A polygon of many short edges may still be wide: it has inner edges as soon as it is triangulated.
        self.is_cut = self._longest_edges() > longest * (1 + ROUNDING)
        self.is_cut |= (self.sizes > 4) & (self._widths() > longest)
        self._read_triangles(mesh)

    def _longest_edges(self):
        following = np.arange(1, len(self._corners) + 1)
        following[self.starts + self.sizes - 1] = self.starts
        lengths = np.linalg.norm(self._corners[following] - self._corners, axis=1)
        return np.maximum.reduceat(lengths, self.starts)

    def _widths(self):
        extents = [reduce.reduceat(self._corners, self.starts) for reduce in (np.maximum, np.minimum)]
        return np.linalg.norm(extents[0] - extents[1], axis=1)

    def _read_triangles(self, mesh):
        mesh.calc_loop_triangles()
        self._triangles = np.empty(len(mesh.loop_triangles) * 3, np.int32)
        mesh.loop_triangles.foreach_get("loops", self._triangles)
        self._triangles = self._triangles.reshape(-1, 3).astype(np.int64)
        self._of_triangle = self.of_corner[self._triangles[:, 0]]

    def cut_quads(self):
        """Corners of the convex quads to be cut, int64 (Q, 4)."""
        return self.starts[self._is_cut_quad()].astype(np.int64)[:, None] + np.arange(4)

    def cut_triangles(self):
        """Corners of the triangles of all other polygons to be cut, int64 (T, 3)."""
        return self._triangles[(self.is_cut & ~self._is_cut_quad())[self._of_triangle]]

    def kept(self):
        """Corners of the polygons that stay, and those polygons."""
        return np.flatnonzero(~self.is_cut[self.of_corner]), np.flatnonzero(~self.is_cut)

    def _is_cut_quad(self):
        is_quad = self.is_cut & (self.sizes == 4)
        corners = self._corners[self.starts[is_quad].astype(np.int64)[:, None] + np.arange(4)]
        sides = np.roll(corners, -1, axis=1) - corners
        turns = np.cross(np.roll(sides, 1, axis=1), sides)
        # Convex: at every corner the outline turns the way that the whole polygon does. A straight corner does not.
        is_quad[is_quad] = (np.einsum("qkx,qx->qk", turns, turns.sum(axis=1)) > 0).all(axis=1)
        return is_quad


def _first_faces(mesh, positions, vertices, quads, triangles):
    """The polygons to be cut, each corner made of itself alone."""
    ends = np.empty(len(mesh.edges) * 2, np.int32)
    mesh.edges.foreach_get("vertices", ends)
    keys = edge_keys(*ends.reshape(-1, 2).astype(np.int64).T)
    order = np.argsort(keys)
    quad_corners, triangle_corners = quads.size, triangles.size
    return Faces(
        positions=positions,
        vertices=np.concatenate([vertices[quads.ravel()], vertices[triangles.ravel()]]),
        sources=np.concatenate(
            [np.repeat(np.arange(len(quads)), 4), len(quads) + np.repeat(np.arange(len(triangles)), 3)]
        ),
        weights=np.concatenate([np.tile(np.eye(4), (len(quads), 1)), np.tile(np.eye(3, 4), (len(triangles), 1))]),
        quads=np.arange(quad_corners).reshape(-1, 4),
        triangles=np.arange(quad_corners, quad_corners + triangle_corners).reshape(-1, 3),
        edge_keys=keys[order],
        edge_origins=order,
    )


def _origins(polygons, faces: Faces, sources) -> Origins:
    """Where all of the cut mesh comes from; its polygons are the kept ones, the quads, the triangles."""
    kept, kept_polygons = polygons.kept()
    corners = np.concatenate([faces.quads.ravel(), faces.triangles.ravel()])
    first_corners = np.concatenate([faces.quads[:, 0], faces.triangles[:, 0]])
    own_weight = np.tile([1.0, 0.0, 0.0, 0.0], (len(kept), 1))
    sizes = [polygons.sizes[kept_polygons], np.full(len(faces.quads), 4), np.full(len(faces.triangles), 3)]
    return Origins(
        vertices=np.concatenate([polygons.vertices[kept], faces.vertices[corners]]),
        corners=np.concatenate([np.repeat(kept[:, None], 4, axis=1), sources[faces.sources[corners]]]),
        weights=np.concatenate([own_weight, faces.weights[corners]]),
        sizes=np.concatenate(sizes),
        polygons=np.concatenate([kept_polygons, polygons.of_corner[sources[faces.sources[first_corners], 0]]]),
        edge_keys=faces.edge_keys,
        edges=faces.edge_origins,
    )


def _require_possible(triangles, longest, name):
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1).sum()
    count = area / longest**2
    if count > MOST_FACES:
        raise SceneError(
            f"subdivide is {longest:g} m: '{name}' would get about {count:.1e} faces, allowed is {MOST_FACES:.0e}"
        )
