"""Small patches that lie together and look the same way, joined: a vase of ten thousand triangles needs no more light
than a box of its size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .kernel import KernelScene
from .parted import is_parted
from .patches import Grid, Patches, patch_middles
from .scene import Scene

SMALL = 0.25  # of a full-size patch's area: larger pieces stay as they are
TURN = 0.5  # by which components of the normals are told apart
MOST_KEYS = 1 << 62
FLAT = 0.999  # cosine of the angle to the first piece's normal


def joined(scene: Scene, kernel: KernelScene, grid: Grid, patches: Patches, seed: int) -> Patches:
    """Patches of a grid, those of each object's small pieces joined that share a cube of their size and a material.

    The kernel is told of them.
    """
    first = _first_of_group(scene, patches, np.bincount(patches.cells))
    found = _joined_by(kernel, grid, patches, first)
    # a flat one that something parts has two lights; of one that bends that may be said because it bends
    parted = is_parted(scene, kernel, found, seed).reshape(-1, 2).any(axis=1) & _are_flat(scene, patches, found)
    apart = parted[found.owners]
    if not (apart & (first != np.arange(len(first)))).any():
        return found
    return _joined_by(kernel, grid, patches, np.where(apart, np.arange(len(first)), first))


def _first_of_group(scene: Scene, patches: Patches, pieces_of_cell):
    """The first piece of each one's group, int64 (Q,): itself where it is large, or its cell was cut for a reason."""
    is_small = (patches.areas <= SMALL * patches.size**2) & (pieces_of_cell[patches.cells] == 1)
    small = np.flatnonzero(is_small)
    triangles = patches.triangles[small]
    objects = np.repeat(np.arange(len(scene.objects)), [obj.count for obj in scene.objects])[triangles]
    middles = patch_middles(scene, patches, small)
    cubes = np.floor((middles - middles.min(axis=0, initial=np.inf)) / patches.size)
    turns = np.round(_normals(scene)[triangles] / TURN) + 1 / TURN
    _, first, which = np.unique(
        _key(objects, scene.triangle_materials[triangles], *cubes.T, *turns.T), return_index=True, return_inverse=True
    )
    everyone = np.arange(len(patches))
    everyone[small] = small[first][which]
    return everyone


def _key(*columns):
    """One number, int64 (N,), for each row of columns (N,) of whole numbers from 0 on: the same for the same rows."""
    key, count = np.zeros(len(columns[0]), np.int64), 1
    for column in columns:
        column = column.astype(np.int64)
        steps = int(column.max(initial=0)) + 1
        if count * steps > MOST_KEYS:
            ranks, key = np.unique(key, return_inverse=True)
            count = len(ranks)
        key, count = key * steps + column, count * steps
    return key


def _joined_by(kernel: KernelScene, grid: Grid, pieces: Patches, first) -> Patches:
    """Patches of the pieces (Q,) that have the same ``first``; the kernel is told of them."""
    chosen, owners = np.unique(first, return_inverse=True)
    owners = owners.astype(np.int32)
    first_pieces = np.concatenate([[0], np.cumsum(np.bincount(pieces.cells))]).astype(np.int32)
    kernel.set_patches(grid.apexes, grid.first_rows, grid.first_cells, first_pieces, owners, pieces.areas)
    shares = np.maximum(pieces.areas, 1e-300)
    total = np.bincount(owners, shares)
    reflectance = np.stack([np.bincount(owners, shares * channel) / total for channel in pieces.reflectance.T], axis=1)
    return replace(
        pieces,
        areas=np.bincount(owners, pieces.areas),
        triangles=pieces.triangles[chosen],
        reflectance=np.minimum(reflectance, 1.0).astype(np.float32),
        bounds=pieces.bounds[chosen],
        cells=pieces.cells[chosen],
        owners=owners,
        pieces=pieces,
    )


def _are_flat(scene: Scene, pieces: Patches, found: Patches):
    """Patches whose pieces all look where the first of them does, bool (P,)."""
    normals = _normals(scene)
    cosines = (normals[pieces.triangles] * normals[found.triangles[found.owners]]).sum(axis=1)
    return np.bincount(found.owners, cosines < FLAT) == 0


def _normals(scene: Scene):
    """Unit normals of the triangles, float64 (T, 3)."""
    a, b, c = np.moveaxis(scene.corners, 1, 0)
    normals = np.cross(b - a, c - a)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
