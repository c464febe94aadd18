"""What vertex colours are made of: receivers beside the corners of faces, and which of them share a colour."""

from __future__ import annotations

import numpy as np

from .kernel import KernelScene
from .receivers import Receivers, surface_receivers
from .scene import Scene
from .triangles import triangle_areas, unit_normals
from .vertex_graph import VertexGraph, vertex_graph

INSET = 1 / 12  # of a triangle: a vertex is where surfaces touch, so its receivers stand a little inside their faces
BESIDE_CORNERS = np.where(np.eye(3, dtype=bool), 1 - 2 * INSET, INSET).astype(np.float32)  # barycentrics
LIFT = 0.1  # of their distance above their faces do two receivers look for each other, and over the edge between them


def vertex_receivers(scene: Scene, kernel: KernelScene, smooth_angle_deg: float) -> tuple[Receivers, VertexGraph]:
    """A receiver inside every target face near each of its corners, and how they come together at vertices.

    A vertex's value is the mean over the adjoining faces, by area and by nearness (Cohen & Greenberg 1985, sec. 5), of
    what is gathered there; faces come together across edges that are not sharp where their corner normals differ by
    less than the smooth angle, and no wall stands between.
    """
    spans = [np.arange(o.first, o.first + o.count) for o in scene.objects if o.is_target]
    triangles = np.concatenate(spans).astype(np.int32) if spans else np.zeros(0, np.int32)
    receivers = surface_receivers(scene, np.repeat(triangles, 3), np.tile(BESIDE_CORNERS, (len(triangles), 1)))

    corners = scene.corners[triangles]
    areas, normals = triangle_areas(corners), unit_normals(corners)
    distances = np.linalg.norm(receivers.positions - corners.reshape(-1, 3), axis=1)
    # a face without area must not make a mean without weight
    areas = np.repeat(areas, 3) + 1e-12 * max(areas.max(initial=0.0), 1e-30)
    owners, twins = _shared_corners(scene, kernel, triangles, receivers, normals, smooth_angle_deg)
    corners = np.arange(3 * len(triangles))
    sides = np.stack([corners, _next_corner(corners)], axis=1)
    pairs = np.concatenate([sides[_see_each_other(kernel, receivers, normals, sides)], twins])
    return receivers, vertex_graph(triangles, owners, areas / np.maximum(distances, 1e-12), areas, receivers, pairs)


def _shared_corners(scene, kernel, triangles, receivers, face_normals, smooth_angle_deg):
    """Number of the value that each corner of the triangles takes, int64 (3 K,); which see each other across edges
    (M, 2)."""
    vertices = scene.triangles[triangles]
    normals = scene.corner_normals[triangles].reshape(-1, 3)
    sharp = np.zeros((len(triangles), 3), bool)
    for obj in scene.objects:
        if obj.is_target and obj.sharp_edges is not None:
            sharp[np.searchsorted(triangles, obj.first) :][: obj.count] = obj.sharp_edges
    first, second = _adjoining_edges(vertices)
    is_sharp = sharp.ravel()[first] | sharp.ravel()[second]
    ends = [np.stack(pair, axis=1) for pair in ((first, _next_corner(second)), (_next_corner(first), second))]
    twins, is_sharp = np.concatenate(ends), np.tile(is_sharp, 2)
    seen = _see_each_other(kernel, receivers, face_normals, twins)
    twins, is_sharp = twins[seen], is_sharp[seen]
    cosines = np.einsum("nc,nc->n", normals[twins[:, 0]], normals[twins[:, 1]])
    is_shared = ~is_sharp & (cosines > np.cos(np.radians(smooth_angle_deg)))
    return _components(3 * len(triangles), twins[is_shared]), twins


def _see_each_other(kernel, receivers, face_normals, pairs):
    """Whether nothing but their own faces, of normals (K, 3), stands between receivers (M, 2): bool (M,)."""
    start, end = (receivers.positions[column] for column in pairs.T)
    first, second = (face_normals[column // 3] for column in pairs.T)
    apart = end - start
    # where faces bend away from each other, the edge between them rises no more than one lies below the other's plane
    below = np.maximum(np.einsum("nc,nc->n", apart, second), -np.einsum("nc,nc->n", apart, first))
    lift = (LIFT * np.linalg.norm(apart, axis=1) + np.maximum(below, 0.0))[:, None]
    return ~kernel.occluded(start + lift * first, end + lift * second)


def _next_corner(corner):
    return corner - corner % 3 + (corner + 1) % 3


def _adjoining_edges(vertices):
    """Pairs of half edges (corner numbers 3 k + c) that run the same edge in opposite directions."""
    start, end = vertices.ravel().astype(np.int64), np.roll(vertices, -1, axis=1).ravel().astype(np.int64)
    count = int(vertices.max(initial=0)) + 1
    keys, opposite = start * count + end, end * count + start
    order = np.argsort(keys, kind="stable")
    place = np.searchsorted(keys[order], opposite)
    found = place < len(keys)
    found[found] = keys[order][place[found]] == opposite[found]
    first, second = np.flatnonzero(found), order[place[found]]
    # each is found from both sides
    once = first < second
    return first[once], second[once]


def _components(count, links):
    """Connected components, int64 (count,), numbered from 0 in order of their first member."""
    labels = np.arange(count)
    while True:
        before = labels.copy()
        low = np.minimum(labels[links[:, 0]], labels[links[:, 1]])
        np.minimum.at(labels, links[:, 0], low)
        np.minimum.at(labels, links[:, 1], low)
        labels = labels[labels]
        if (labels == before).all():
            return np.unique(labels, return_inverse=True)[1]
