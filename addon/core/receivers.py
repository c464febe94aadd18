"""Receivers: the points and normals where irradiance is wanted, on texels, at vertices, on patches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .kernel import KernelScene
from .scene import Scene

BLOCK = 1 << 16  # receivers that are placed at once: with all corners of all they would take ten times their memory
EDGE_INSET = 1e-3  # of a triangle: receivers keep so far off its edges
INSET = 1 / 12  # of a triangle: a vertex is where surfaces touch, so its receivers stand a little inside their faces


@dataclass(frozen=True, slots=True)
class Receivers:
    """Points on triangles' sides.

    Attributes
    ----------
    positions : float64 (N, 3) [m]; lifted off the triangle where it stands for a smooth surface that bulges
    normals : float32 (N, 3) unit shading normals
    triangle_sides : int32 (N,) 2 * triangle + side, side 1 = back
    """

    positions: np.ndarray
    normals: np.ndarray
    triangle_sides: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)

    def arrays(self) -> tuple:
        """In the kernel's order."""
        return self.positions, self.normals, self.triangle_sides

    def part(self, chosen) -> Receivers:
        """Some of them."""
        return Receivers(*(array[chosen] for array in self.arrays()))


def surface_receivers(scene: Scene, triangles, barycentrics) -> Receivers:
    """Receivers on the fronts of triangles (N,) at barycentrics (N, 3)."""
    count, corners = len(triangles), scene.corners
    positions, normals = np.empty((count, 3)), np.empty((count, 3), np.float32)
    for first in range(0, count, BLOCK):
        block = slice(first, first + BLOCK)
        chosen = triangles[block]
        placed = _placed(barycentrics[block], corners[chosen], scene.corner_normals[chosen].astype(np.float64))
        positions[block], normals[block] = placed
    return Receivers(positions, normals, (2 * triangles).astype(np.int32))


def _placed(barycentrics, corners, corner_normals):
    """Positions and normals (N, 3) at barycentrics (N, 3) of corners and their normals (N, 3, 3)."""
    # exactly on an edge a ray can slip between the face and the wall that stands on it
    weights = np.maximum(barycentrics.astype(np.float64), EDGE_INSET)
    weights /= weights.sum(axis=1, keepdims=True)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    positions = np.einsum("nk,nkc->nc", weights, corners)
    normals = np.einsum("nk,nkc->nc", weights, corner_normals)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 1e-6, normals / np.maximum(lengths, 1e-6), flat)
    return positions + _lift(positions, corners, corner_normals, weights, flat)[:, None] * flat, normals


def _lift(positions, corners, corner_normals, weights, flat):
    """How far the smooth surface bulges out over the triangle [m]: the mean of the corners' tangent planes.

    Without it the receivers of a smooth ball lie inside its silhouette, and its own facets shade it (the terminator).
    """
    offsets = np.einsum("nkc,nkc->nk", positions[:, None] - corners, corner_normals)
    raised = -np.einsum("nk,nk,nkc->nc", weights, offsets, corner_normals)
    return np.maximum(np.einsum("nc,nc->n", raised, flat), 0.0)


def patch_receivers(scene: Scene, kernel: KernelScene, patches, samples: int, seed: int) -> Receivers:
    """``samples`` receivers on each side of patches (K,): row (2 k + side) * samples + i is point i of patch k."""
    triangles, barycentrics = kernel.patch_points(patches, samples, seed)
    # weights that do not sum to 1 would move the points off their plane, far from the origin by millimetres
    barycentrics = barycentrics.astype(np.float64)
    barycentrics /= barycentrics.sum(axis=1, keepdims=True)
    corners = scene.corners[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    positions = np.einsum("nk,nkc->nc", barycentrics, corners)

    def both(front, back):
        shape = (len(patches), 1, samples, *front.shape[1:])
        return np.concatenate([front.reshape(shape), back.reshape(shape)], axis=1).reshape(-1, *front.shape[1:])

    return Receivers(
        positions=both(positions, positions),
        normals=both(normals, -normals).astype(np.float32),
        triangle_sides=both(2 * triangles, 2 * triangles + 1).astype(np.int32),
    )


@dataclass(frozen=True, slots=True)
class CornerMeans:
    """How receivers inside the faces come together at the corners that share a vertex colour.

    Attributes
    ----------
    triangles : int32 (K,) triangles with corners to colour; receiver 3 k + c stands near corner c of triangles[k]
    shared : int64 (3 K,) which value each of these corners takes
    weights : float64 (3 K,) of each receiver in its value
    """

    triangles: np.ndarray
    shared: np.ndarray
    weights: np.ndarray

    def corner_values(self, receiver_values):
        """Values per receiver (3 K, C) -> per corner (K, 3, C)."""
        count = int(self.shared.max(initial=-1)) + 1
        total = np.bincount(self.shared, self.weights, count)
        means = np.stack([np.bincount(self.shared, self.weights * v, count) / total for v in receiver_values.T], 1)
        return means[self.shared].reshape(len(self.triangles), 3, -1)


def vertex_receivers(scene: Scene, smooth_angle_deg: float) -> tuple[Receivers, CornerMeans]:
    """A receiver inside every target face near each of its corners, and how they come together at vertices.

    A vertex's value is the mean over the adjoining faces, by area and by nearness (Cohen & Greenberg 1985, sec. 5), of
    what is gathered there; faces come together across edges that are not sharp where their corner normals differ by
    less than the smooth angle.
    """
    spans = [np.arange(o.first, o.first + o.count) for o in scene.objects if o.is_target]
    triangles = np.concatenate(spans).astype(np.int32) if spans else np.zeros(0, np.int32)
    barycentrics = np.full((3, 3), INSET, np.float32)
    np.fill_diagonal(barycentrics, 1 - 2 * INSET)
    receivers = surface_receivers(scene, np.repeat(triangles, 3), np.tile(barycentrics, (len(triangles), 1)))

    corners = scene.corners[triangles]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    distances = np.linalg.norm(receivers.positions - corners.reshape(-1, 3), axis=1)
    # a face without area must not make a mean without weight
    weights = (np.repeat(areas, 3) + 1e-12 * max(areas.max(initial=0.0), 1e-30)) / np.maximum(distances, 1e-12)
    shared = _shared_corners(scene, triangles, smooth_angle_deg)
    return receivers, CornerMeans(triangles, shared, weights)


def _shared_corners(scene, triangles, smooth_angle_deg):
    """Number of the value that each corner of the triangles takes, int64 (3 K,)."""
    vertices = scene.triangles[triangles]
    normals = scene.corner_normals[triangles].reshape(-1, 3)
    sharp = np.zeros((len(triangles), 3), bool)
    for obj in scene.objects:
        if obj.is_target and obj.sharp_edges is not None:
            sharp[np.searchsorted(triangles, obj.first) :][: obj.count] = obj.sharp_edges
    first, second = _adjoining_edges(vertices, sharp)
    links = []
    for a, b in ((first, _next_corner(second)), (_next_corner(first), second)):
        is_smooth = np.einsum("nc,nc->n", normals[a], normals[b]) > np.cos(np.radians(smooth_angle_deg))
        links.append(np.stack([a[is_smooth], b[is_smooth]], axis=1))
    return _components(3 * len(triangles), np.concatenate(links))


def _next_corner(corner):
    return corner - corner % 3 + (corner + 1) % 3


def _adjoining_edges(vertices, sharp):
    """Pairs of half edges (corner numbers 3 k + c) that run the same edge in opposite directions, none sharp."""
    start, end = vertices.ravel().astype(np.int64), np.roll(vertices, -1, axis=1).ravel().astype(np.int64)
    count = int(vertices.max(initial=0)) + 1
    usable = np.flatnonzero(~sharp.ravel())
    keys, opposite = start[usable] * count + end[usable], end[usable] * count + start[usable]
    order = np.argsort(keys, kind="stable")
    place = np.searchsorted(keys[order], opposite)
    found = place < len(keys)
    found[found] = keys[order][place[found]] == opposite[found]
    return usable[found], usable[order][place[found]]


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
