"""Receivers: the points and normals where irradiance is wanted, on texels, beside vertices, on patches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .kernel import KernelScene
from .scene import Scene
from .triangles import unit_normals

BLOCK = 1 << 16  # receivers that are placed at once: with all corners of all they would take ten times their memory
EDGE_INSET = 1e-3  # of a triangle: receivers keep so far off its edges


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
    flat = unit_normals(corners)
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
    normals = unit_normals(corners)
    positions = np.einsum("nk,nkc->nc", barycentrics, corners)

    def both(front, back):
        shape = (len(patches), 1, samples, *front.shape[1:])
        return np.concatenate([front.reshape(shape), back.reshape(shape)], axis=1).reshape(-1, *front.shape[1:])

    return Receivers(
        positions=both(positions, positions),
        normals=both(normals, -normals).astype(np.float32),
        triangle_sides=both(2 * triangles, 2 * triangles + 1).astype(np.int32),
    )
