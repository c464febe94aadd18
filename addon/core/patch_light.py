"""Light on patches before it bounces: the lights' and the world's, at points of every side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .emitters import Emitters
from .gather_sums import no_sums
from .guides import no_guides
from .kernel import EVEN_SIDE, KernelScene
from .patch_solution import PatchSolution
from .patches import Patches
from .receivers import patch_receivers
from .scene import Scene
from .seen_light import SeenLight

POINTS = 8  # of a patch side: where its direct light is measured
SMALL = 0.25  # of a full-size patch's area: smaller ones are measured at one point
SHADOW_SAMPLES = 8  # of each point of a full-size patch; small ones take 1
SKY_RAYS = 4  # of each point
QUICK_ERROR, FEWER = 0.2, 4  # where errors of this or more are good enough, so many times fewer rays are


@dataclass(frozen=True, slots=True)
class PatchLight:
    """What patches get before light bounces, and the rays that it took to measure.

    Attributes
    ----------
    direct, daylight : float64 (2 P, 3) mean irradiance of every side by the lights and by the world [W/m^2]
    spread : float64 (2 P,) between the brightest and the darkest point of a side, of the lights' [W/m^2]
    """

    patches: Patches
    direct: np.ndarray
    spread: np.ndarray
    daylight: np.ndarray
    rays: int


def measure_patches(
    scene: Scene,
    kernel: KernelScene,
    patches: Patches,
    emitters: Emitters,
    sky,
    error: float,
    seed: int,
    known: PatchLight | None,
    on_step,
) -> PatchLight:
    """Light on patches to about an ``error``; on cells that are as they were in ``known``, what it was there."""
    fewer = FEWER if error >= QUICK_ERROR else 1
    new, old = np.ones(len(patches), bool), np.zeros(0, bool)
    if known is not None:
        is_same = np.bincount(patches.cells) == np.bincount(known.patches.cells)
        new, old = ~is_same[patches.cells], is_same[known.patches.cells]
    light = scene, kernel, patches, new, emitters
    direct, spread, shadow_rays = _direct_on_patches(*light, SHADOW_SAMPLES // fewer, seed, on_step)
    daylight, sky_rays = _sky_on_patches(*light, sky, SKY_RAYS // fewer, seed)
    if known is not None:
        for all_of_them, before in ((direct, known.direct), (spread, known.spread), (daylight, known.daylight)):
            all_of_them[np.repeat(~new, 2)] = before[np.repeat(old, 2)]
    return PatchLight(patches, direct, spread, daylight, shadow_rays + sky_rays + (known.rays if known else 0))


def _direct_on_patches(scene, kernel, patches: Patches, wanted, emitters, samples, seed, on_step):
    """The lights' mean irradiance on every side, float64 (2 P, 3), its spread over the side (2 P,), and shadow rays.

    A full-size patch is measured at several points; a small one at one, as its neighbours stand in for it when light is
    gathered. What scatters nothing is left dark.
    """
    irradiance, spread = np.zeros((len(patches), 2, 3)), np.zeros((len(patches), 2))
    rays = 0
    for chosen, points, share in _measured(patches, wanted):
        receivers = patch_receivers(scene, kernel, chosen, points, seed)
        values, _, traced = kernel.direct(emitters, receivers, min(points, samples), seed)
        values = values.reshape(-1, 2, points, 3)
        irradiance[chosen] = values.mean(axis=2, dtype=np.float64)
        spread[chosen] = np.ptp(values.mean(axis=3), axis=2)
        rays += traced
        on_step(share)
    return irradiance.reshape(-1, 3), spread.ravel(), rays


def _sky_on_patches(scene, kernel, patches: Patches, wanted, emitters, sky, count, seed):
    """Mean irradiance of every side from the world, float64 (2 P, 3), and the rays it took.

    The sky is gathered with all surfaces black.
    """
    irradiance, rays = np.zeros((len(patches), 2, 3)), 0
    if sky.max() <= 0:
        return irradiance.reshape(-1, 3), rays
    black = PatchSolution(
        radiosity=np.zeros((kernel.side_count, 3), np.float32),
        direct=np.zeros((kernel.side_count, 3), np.float32),
        reflectance=np.zeros((2 * len(patches), 3), np.float32),
        kinds=np.full(kernel.side_count, EVEN_SIDE, np.uint8),
        reaches=np.zeros(kernel.side_count, np.float32),
        sky=sky,
    )
    for chosen, points, _ in _measured(patches, wanted):
        receivers = patch_receivers(scene, kernel, chosen, points, seed)
        sums = no_sums(len(receivers), 1)
        everyone = np.arange(len(receivers), dtype=np.uint32)
        guides = no_guides(len(receivers))
        rays += kernel.gather(SeenLight(black, emitters), receivers, guides, everyone, 0, count, seed, sums)
        irradiance[chosen] = sums.means(count).reshape(-1, 2, points, 3).mean(axis=2, dtype=np.float64)
    return irradiance.reshape(-1, 3), rays


def _measured(patches: Patches, wanted):
    """(patches, points on each, share of the work done after them) of those wanted that scatter: those of a full-size
    cell, and of small ones."""
    wanted = wanted & (patches.side_reflectance.reshape(-1, 6).any(axis=1) | patches.is_translucent)
    cell_areas = np.bincount(patches.cells, patches.areas)
    is_large = cell_areas[patches.cells] > SMALL * patches.size**2
    return (np.flatnonzero(is_large & wanted), POINTS, 0.5), (np.flatnonzero(~is_large & wanted), 1, 1.0)
