"""Laws that transport keeps whatever the scene, measured in the one at hand: closure and reciprocity.

Sides are taken in six groups by where they look: what single patches exchange is too little for rays to tell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .kernel import KernelScene
from .patches import Patches
from .scene import Scene
from .triangles import area_vectors

RAYS = 1 << 13  # of each group: what two of them exchange is known to two per cent or so
FLUX = 1 << 20  # of a ray, in the kernel's fixed point


@dataclass(frozen=True, slots=True)
class Laws:
    """How far they are kept.

    Attributes
    ----------
    closure : of the flux that a group sends, the share that neither lands nor leaves the scene: the largest of the
        groups. 0 but for what tinted glass takes, and noise of what is coloured by passing cloth; where one side of a
        surface is open, what lands and goes on counts twice, and light has no way back
    reciprocity : sum over pairs of groups of |A_i F_ij - A_j F_ji|, relative to the sum of A_i F_ij + A_j F_ji: 0 but
        for noise, a per cent or two
    """

    closure: float = 0.0
    reciprocity: float = 0.0


def measured_laws(scene: Scene, kernel: KernelScene, patches: Patches, seed: int) -> tuple[Laws, int]:
    """The laws by rays that the groups send to each other, and how many."""
    areas, groups = patches.side_areas, _groups(scene, patches)
    present = np.unique(groups[areas > 0])
    exchanged, lost, rays = np.zeros((6, 6)), 0.0, 0
    for group in present:
        sides = np.flatnonzero((groups == group) & (areas > 0)).astype(np.int32)
        received, escaped, traced = _shot(kernel, sides, areas[sides], seed)
        landed = np.bincount(groups, received, 6) / (traced * FLUX)
        exchanged[group] = areas[sides].sum() * landed
        lost = max(lost, abs(1 - landed.sum() - escaped / (traced * FLUX)))
        rays += traced
    np.fill_diagonal(exchanged, 0)
    apart, both = np.abs(exchanged - exchanged.T).sum(), (exchanged + exchanged.T).sum()
    return Laws(float(lost), float(apart / both) if both > 0 else 0.0), rays


def _groups(scene: Scene, patches: Patches):
    """Of every side, which way it looks, about: 0 ... 5 for +x, -x, +y, -y, +z, -z (2 P,)."""
    normals = area_vectors(scene.corners)
    axes = np.argmax(np.abs(normals), axis=1)
    fronts = (2 * axes + (normals[np.arange(len(axes)), axes] < 0)).astype(np.int8)[patches.triangles]
    return np.stack([fronts, fronts ^ 1], axis=1).ravel()


def _shot(kernel, sides, areas, seed):
    """Flux received by every side (2 P,) and escaped, of RAYS rays from sides (K,) by their areas, and the rays."""
    until = np.concatenate([[0], np.floor(np.cumsum(areas) / areas.sum() * RAYS + 0.5)]).astype(np.uint64)
    flux = np.full((len(sides), 3), FLUX, np.uint64)
    received, escaped = kernel.shoot(sides, np.zeros(len(sides), np.uint32), flux, until, seed)
    return received[:, 1].astype(np.float64), float(escaped[1]), int(until[-1])
