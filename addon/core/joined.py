"""Small patches that lie together and look the same way, joined: a vase of ten thousand triangles needs no more light
than a box of its size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .kernel import KernelScene
from .patches import Grid, Patches, patch_middles
from .scene import Scene
from .triangles import unit_normals

SMALL = 0.25  # of a full-size patch's area: larger pieces stay as they are
TURN = 0.5  # by which components of the normals are told apart
MOST_KEYS = 1 << 62
MOST_ROOMS = 4  # that walls part a group into
LIFT = 0.15  # of a full-size patch over and under itself, a piece is to see the first of its group, as both may bend,
LOW = 0.02  # or no further, where there is not so much room


def joined(scene: Scene, kernel: KernelScene, grid: Grid, patches: Patches) -> Patches:
    """Patches of a grid, those of each object's small pieces joined that share a cube of their size, a turn and a
    material, and see each other. The kernel is told of them.
    """
    first = _first_of_group(scene, patches, np.bincount(patches.cells))
    places = _places(scene, kernel, patches, np.flatnonzero(np.bincount(first, minlength=len(first))[first] > 1))
    # what stands behind a wall has another light: it is joined with what stands there, too, or else left alone
    hidden = _hidden(kernel, places, first, np.arange(len(first)))
    for _ in range(MOST_ROOMS):
        _, leading, which = np.unique(first[hidden], return_index=True, return_inverse=True)
        first[hidden] = hidden[leading][which]
        hidden = _hidden(kernel, places, first, hidden)
    first[hidden] = hidden
    return _joined_by(kernel, grid, patches, first)


def _places(scene: Scene, kernel: KernelScene, patches: Patches, chosen):
    """Points over the chosen pieces' fronts and backs, float64 (2, Q, 3) [m], from which they look for their group."""
    middles = patch_middles(scene, patches, chosen)
    normals = patches.size * _normals(scene, patches.triangles[chosen])
    places = np.zeros((2, len(patches), 3))
    for side, sign in enumerate((1, -1)):
        high, low = (middles + sign * lift * normals for lift in (LIFT, LOW))
        # inside of what is thin, and where what is rough looks across a wall
        places[side, chosen] = np.where(kernel.occluded(low, high)[:, None], low, high)
    return places


def _hidden(kernel: KernelScene, places, first, chosen):
    """Those of the chosen pieces (K,) that do not see the first of their group, on one side or the other: int64."""
    asking = chosen[first[chosen] != chosen]
    blocked = kernel.occluded(places[0, asking], places[0, first[asking]])
    blocked |= kernel.occluded(places[1, asking], places[1, first[asking]])
    return asking[blocked]


def _first_of_group(scene: Scene, patches: Patches, pieces_of_cell):
    """The first piece of each one's group, int64 (Q,): itself where it is large, or its cell was cut for a reason."""
    is_small = (patches.areas <= SMALL * patches.size**2) & (pieces_of_cell[patches.cells] == 1)
    small = np.flatnonzero(is_small)
    triangles = patches.triangles[small]
    objects = np.repeat(np.arange(len(scene.objects)), [obj.count for obj in scene.objects])[triangles]
    middles = patch_middles(scene, patches, small)
    cubes = np.floor((middles - middles.min(axis=0, initial=np.inf)) / patches.size)
    turns = np.round(_normals(scene, triangles) / TURN) + 1 / TURN
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
            key, count = _ranks(key)
        if count * steps > MOST_KEYS:
            column, steps = _ranks(column)
        key, count = key * steps + column, count * steps
    return key


def _ranks(numbers):
    """The place of each number among those that there are, int64 (N,), and how many these are."""
    present, ranks = np.unique(numbers, return_inverse=True)
    return ranks, len(present)


def _joined_by(kernel: KernelScene, grid: Grid, pieces: Patches, first) -> Patches:
    """Patches of the pieces (Q,) that have the same ``first``; the kernel is told of them."""
    chosen, owners = np.unique(first, return_inverse=True)
    owners = owners.astype(np.int32)
    first_pieces = np.concatenate([[0], np.cumsum(np.bincount(pieces.cells))]).astype(np.int32)
    kernel.set_patches(grid.apexes, grid.first_rows, grid.first_cells, first_pieces, owners, pieces.areas)
    shares = np.maximum(pieces.met, 1e-300)
    total = np.bincount(owners, shares)

    def mean(of_pieces):
        means = np.stack([np.bincount(owners, shares * channel) / total for channel in of_pieces.T], axis=1)
        return np.minimum(means, 1.0).astype(np.float32)

    return replace(
        pieces,
        areas=np.bincount(owners, pieces.areas),
        met=np.bincount(owners, pieces.met),
        triangles=pieces.triangles[chosen],
        reflectance=mean(pieces.reflectance),
        translucence=mean(pieces.translucence)
        if pieces.is_translucent.any()
        else np.zeros((len(chosen), 3), np.float32),
        bounds=pieces.bounds[chosen],
        cells=pieces.cells[chosen],
        owners=owners,
        pieces=pieces,
    )


def _normals(scene: Scene, triangles):
    """Unit normals of triangles (K,), float64 (K, 3)."""
    return unit_normals(scene.vertices[scene.triangles[triangles]])
