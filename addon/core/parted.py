"""Patches that something parts in two, as a wall does the one floor of two rooms: their mean would leak under it."""

from __future__ import annotations

import numpy as np

from .kernel import KernelScene
from .patches import Grid, Patches, laid_out, with_materials
from .scene import Scene

POINTS, LIFT = 8, 0.05  # of a side, so many of its sizes above it: where it is looked for what stands on it,
LARGE = 0.05  # if its cell has so much of a full-size patch's area
AT_ONCE = 1 << 15  # patches, for which points take 60 MB
ALONG = (4, 2)  # patches along the sides of a cell that is parted, as long as there are not too many


def is_parted(scene: Scene, kernel: KernelScene, patches: Patches, seed: int):
    """Sides on which something stands between their own points, bool (2 P,)."""
    cell_areas = np.bincount(patches.cells, patches.areas)[patches.cells]
    large = np.flatnonzero((cell_areas > LARGE * patches.size**2) & (patches.areas > 0))
    found = np.zeros((len(patches), 2), bool)
    for start in range(0, len(large), AT_ONCE):
        chosen = large[start : start + AT_ONCE]
        found[chosen] = _blocked_sides(scene, kernel, patches, chosen, seed)
    return found.ravel()


def _blocked_sides(scene, kernel, patches, chosen, seed):
    """The same of the fronts and the backs of some patches, bool (K, 2)."""
    triangles, barycentrics = kernel.patch_points(chosen, POINTS, seed)
    corners = scene.corners[triangles]
    along = corners[:, 1:] - corners[:, :1]
    # from a corner: weights of float32 do not sum to 1, which far from the origin is metres
    points = corners[:, 0] + np.einsum("nk,nkc->nc", barycentrics[:, 1:].astype(np.float64), along)
    normals = np.cross(along[:, 0], along[:, 1])
    lengths = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    lifts = normals * (LIFT * np.sqrt(np.repeat(patches.areas[chosen], POINTS)) / lengths)[:, None]
    blocked = np.zeros((len(chosen), 2), bool)
    for side, sign in enumerate((1, -1)):
        lifted = (points + sign * lifts).reshape(len(chosen), POINTS, 3)
        between = kernel.occluded(lifted[:, :-1].reshape(-1, 3), lifted[:, 1:].reshape(-1, 3))
        blocked[:, side] = between.reshape(len(chosen), POINTS - 1).any(axis=1)
    return blocked


def finer_where_parted(scene: Scene, kernel: KernelScene, grid: Grid, most: int, seed: int) -> Patches:
    """Patches of a grid, one a cell; those that are parted are cut into smaller ones, ``most`` more in all."""
    whole = np.ones(len(grid), np.int64)
    patches = laid_out(kernel, grid, whole)
    parted = is_parted(scene, kernel, patches, seed).reshape(-1, 2).any(axis=1)
    for along in ALONG:
        if 0 < (along**2 - 1) * parted.sum() <= most:
            patches = laid_out(kernel, grid, np.where(parted, along, whole))
            break
    return with_materials(scene, kernel, patches, seed)
