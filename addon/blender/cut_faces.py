"""Halving the long edges of quads and triangles, in all their faces at once: no T-junction ever appears.

A quad with all edges long becomes a grid of four, one with two opposite long edges two halves; any other quad is two
triangles first. A triangle with one, two or three long edges becomes two, three or four. Every new edge is shorter than
the longest that it comes from, so this ends whatever the shape, triangles without area included.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

ROUNDING = 1e-6  # an edge of just the longest length is not cut
KEY_STEP = np.int64(1) << 32  # above any vertex index: one integer names an edge


@dataclass(frozen=True, slots=True)
class Faces:
    """Quads and triangles over C corners, each corner a weighted mean of the corners of the face that it was cut from.

    Attributes
    ----------
    positions : float64 (V, 3), the vertices
    vertices : int64 (C,) vertex of each corner
    sources : int64 (C,) row of the first face that each corner lies in
    weights : float64 (C, 4) of that face's corners
    quads : int64 (Q, 4) corners
    triangles : int64 (T, 3) corners
    edge_keys : int64 (K,) sorted; an original edge or part of one
    edge_origins : int64 (K,) the original edge
    """

    positions: np.ndarray
    vertices: np.ndarray
    sources: np.ndarray
    weights: np.ndarray
    quads: np.ndarray
    triangles: np.ndarray
    edge_keys: np.ndarray
    edge_origins: np.ndarray


def cut_faces(faces: Faces, longest: float) -> Faces:
    """Cut until no edge is longer than ``longest``."""
    limit = longest * (1 + ROUNDING)
    while True:
        faces = _without_mixed_quads(faces, limit)
        edges = _Edges(faces, limit)
        if not edges.is_long.any():
            return faces
        faces = _halved(faces, edges)


def edge_keys(first, second):
    """One integer per pair of vertices, either way round."""
    return np.minimum(first, second) * KEY_STEP + np.maximum(first, second)


class _Edges:
    """The edges of some faces: which are long, and the number of each face's edges."""

    def __init__(self, faces, limit):
        quad_keys, triangle_keys = (_face_keys(faces, corners) for corners in (faces.quads, faces.triangles))
        self.keys, numbers = np.unique(np.concatenate([quad_keys.ravel(), triangle_keys.ravel()]), return_inverse=True)
        self.of_quads = numbers[: quad_keys.size].reshape(-1, 4)
        self.of_triangles = numbers[quad_keys.size :].reshape(-1, 3)
        self.ends = np.stack([self.keys // KEY_STEP, self.keys % KEY_STEP])
        first, second = faces.positions[self.ends]
        self.is_long = np.linalg.norm(first - second, axis=1) > limit


def _face_keys(faces, corners):
    vertices = faces.vertices[corners]
    return edge_keys(vertices, np.roll(vertices, -1, axis=1))


def _without_mixed_quads(faces, limit):
    """Triangles in place of the quads whose long edges are neither all four nor two opposite."""
    long = _Edges(faces, limit)
    quad_long = long.is_long[long.of_quads]
    is_mixed = (quad_long != np.roll(quad_long, 2, axis=1)).any(axis=1)
    if not is_mixed.any():
        return faces
    pieces = _two_triangles(faces, faces.quads[is_mixed])
    return replace(faces, quads=faces.quads[~is_mixed], triangles=np.concatenate([faces.triangles, pieces]))


def _two_triangles(faces, quads):
    """Split along the shorter diagonal."""
    corners = faces.positions[faces.vertices[quads]]
    first, second = (np.linalg.norm(corners[:, k] - corners[:, k + 2], axis=1) for k in (0, 1))
    turned = np.where((first <= second)[:, None], quads, np.roll(quads, -1, axis=1))
    return np.concatenate([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]])


def _halved(faces, edges):
    """Every long edge cut in the middle, and the faces with it."""
    new = _NewCorners(faces)
    first, second = edges.ends[:, edges.is_long]
    vertex_of_edge = np.full(len(edges.keys), -1, np.int64)
    vertex_of_edge[edges.is_long] = new.add_vertices((faces.positions[first] + faces.positions[second]) / 2)
    quad_middles = new.add_middles(faces.quads, vertex_of_edge[edges.of_quads])
    triangle_middles = new.add_middles(faces.triangles, vertex_of_edge[edges.of_triangles])
    quads = _halved_quads(faces.quads, quad_middles, new)
    keys, origins = _halved_origins(faces, edges, vertex_of_edge)
    cut = replace(new.faces(), quads=quads, edge_keys=keys, edge_origins=origins)
    return replace(cut, triangles=_halved_triangles(cut, faces.triangles, triangle_middles))


class _NewCorners:
    """Vertices and corners added to some faces."""

    def __init__(self, faces):
        self._faces = faces
        self._positions = [faces.positions]
        self._vertices, self._sources, self._weights = [faces.vertices], [faces.sources], [faces.weights]
        self._vertex_count, self._corner_count = len(faces.positions), len(faces.vertices)

    def add_vertices(self, positions):
        numbers = np.arange(self._vertex_count, self._vertex_count + len(positions))
        self._positions.append(positions)
        self._vertex_count += len(positions)
        return numbers

    def add_middles(self, corners, vertices):
        """Corners in the middle of face edges, where ``vertices`` (F, k) is not -1; int64 (F, k), -1 elsewhere."""
        is_cut = vertices >= 0
        pairs = np.stack([corners[is_cut], np.roll(corners, -1, axis=1)[is_cut]], axis=1)
        middles = np.full(corners.shape, -1, np.int64)
        middles[is_cut] = self.add_means(pairs, vertices[is_cut])
        return middles

    def add_means(self, corners, vertices):
        """One corner per row of ``corners``, in their mean."""
        self._vertices.append(vertices)
        self._sources.append(self._faces.sources[corners[:, 0]])
        self._weights.append(self._faces.weights[corners].mean(axis=1))
        numbers = np.arange(self._corner_count, self._corner_count + len(corners))
        self._corner_count += len(corners)
        return numbers

    def add_centres(self, quads):
        """A vertex and a corner in the middle of each quad."""
        centres = self._faces.positions[self._faces.vertices[quads]].mean(axis=1)
        return self.add_means(quads, self.add_vertices(centres))

    def faces(self):
        """The old faces over all corners."""
        parts = (self._positions, self._vertices, self._sources, self._weights)
        positions, vertices, sources, weights = (np.concatenate(part) for part in parts)
        return replace(self._faces, positions=positions, vertices=vertices, sources=sources, weights=weights)


def _halved_quads(quads, middles, new):
    is_cut = middles >= 0
    both, even, odd = is_cut.all(axis=1), is_cut[:, 0] & ~is_cut[:, 1], is_cut[:, 1] & ~is_cut[:, 0]
    a, b, c, d = quads[both].T
    ab, bc, cd, da = middles[both].T
    centre = new.add_centres(quads[both])
    pieces = [quads[~is_cut.any(axis=1)]]
    pieces += [_rows(a, ab, centre, da), _rows(ab, b, bc, centre), _rows(centre, bc, c, cd), _rows(da, centre, cd, d)]
    for corners, middle in ((quads[even], middles[even]), (np.roll(quads[odd], -1, 1), np.roll(middles[odd], -1, 1))):
        a, b, c, d = corners.T
        pieces += [_rows(a, middle[:, 0], middle[:, 2], d), _rows(middle[:, 0], b, c, middle[:, 2])]
    return np.concatenate(pieces)


def _halved_triangles(faces, triangles, middles):
    is_cut = middles >= 0
    count = is_cut.sum(axis=1)
    pieces = [triangles[count == 0]]

    a, b, c = triangles[count == 3].T
    ab, bc, ca = middles[count == 3].T
    pieces += [_rows(a, ab, ca), _rows(ab, b, bc), _rows(ca, bc, c), _rows(ab, bc, ca)]

    # turned so that the one cut edge is the first
    (a, b, c), (ab, _, _) = _turned(triangles, middles, count == 1, np.argmax(is_cut, axis=1))
    pieces += [_rows(a, ab, c), _rows(ab, b, c)]

    # turned so that the edge that is not cut is opposite the first corner
    (a, b, c), (ab, _, ca) = _turned(triangles, middles, count == 2, np.argmin(is_cut, axis=1) - 1)
    pieces += [_rows(a, ab, ca), _two_triangles(faces, _rows(ab, b, c, ca))]
    return np.concatenate(pieces)


def _turned(triangles, middles, chosen, first):
    order = (first[chosen][:, None] + np.arange(3)) % 3
    return (np.take_along_axis(array[chosen], order, axis=1).T for array in (triangles, middles))


def _halved_origins(faces, edges, vertex_of_edge):
    """The parts of original edges, with those that were cut replaced by their halves."""
    rows = np.searchsorted(edges.keys, faces.edge_keys)
    found = edges.keys[np.minimum(rows, len(edges.keys) - 1)] == faces.edge_keys
    middle = np.where(found, vertex_of_edge[np.minimum(rows, len(edges.keys) - 1)], -1)
    is_cut = middle >= 0
    first, second = faces.edge_keys[is_cut] // KEY_STEP, faces.edge_keys[is_cut] % KEY_STEP
    halves = [edge_keys(end, middle[is_cut]) for end in (first, second)]
    keys = np.concatenate([faces.edge_keys[~is_cut], *halves])
    origins = np.concatenate([faces.edge_origins[~is_cut], faces.edge_origins[is_cut], faces.edge_origins[is_cut]])
    order = np.argsort(keys)
    return keys[order], origins[order]


def _rows(*columns):
    return np.stack(columns, axis=1)
