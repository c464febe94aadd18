"""What gather rays see of a solution: the radiosity of patch sides, and where it is too coarse to be taken as it is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .emitters import Emitters, with_sources
from .kernel import EVEN_SIDE, LIGHT_SIDE, MIXED_SIDE, KernelScene
from .luminance import LUMINANCE
from .parted import is_parted
from .patches import Patches, patch_triangles
from .scene import Scene, radiance_from_exitance
from .triangles import triangle_areas

MIXED = 0.5  # of the radiosity: more spread of reflected direct light over a side is sampled anew by gather rays
BRIGHT = 20.0  # times the median radiosity: brighter sides are sampled as lights, which few gather rays would find
BRIGHT_SHARE = 0.005  # of all area that they may be: where much is bright, gather rays find it well
BRIGHT_FLUX = 0.15  # of all flux that they must send out: every receiver and every near hit pays for them
CONFINED = 0.5  # a side of which fewer rays leave its reach lies in a gap
OPENNESS_RAYS = 8
REACH = 3.0  # patch sizes: nearer hits go on from the point hit
ALWAYS = -1.0  # a reach: of what is translucent, which shows what arrives behind it


@dataclass(frozen=True, slots=True)
class PatchSolution:
    """What gather rays see (native/include/patchlight.h, pl_solution).

    Attributes
    ----------
    radiosity : float32 (2 P, 3) reflected radiosity of the sides, emission left out [W/m^2]
    direct : float32 (2 P, 3) the part of it that is the lights' direct light reflected once [W/m^2]
    reflectance : float32 (2 P, 3)
    kinds : uint8 (2 P,) EVEN, MIXED (lights reach one part of the side only) or LIGHT (receivers sample it as a light)
    reaches : float32 (2 P,) rays that hit from nearer do not take the side's mean [m]; inf in narrow gaps, and
        where something parts them in two; ALWAYS where the mean is all that there is
    sky : float32 (n^2, 3) pi times the world's radiance, by direction [W/m^2] (sky.sky_map)
    """

    radiosity: np.ndarray
    direct: np.ndarray
    reflectance: np.ndarray
    kinds: np.ndarray
    reaches: np.ndarray
    sky: np.ndarray

    def arrays(self) -> tuple:
        """In the kernel's order."""
        return self.radiosity, self.direct, self.reflectance, self.kinds, self.reaches, self.sky

    def __len__(self) -> int:
        return len(self.reflectance) // 2

    def looking_further(self, factor: float) -> PatchSolution:
        """The same for rays that go on from further away."""
        return replace(self, reaches=np.float32(factor) * self.reaches)


def side_kinds(patches, radiosity, spread, is_confined):
    """The kind of each side, uint8 (2 P,), and which sides are LIGHT.

    What shines in a gap, between a lamp and the ceiling that it hangs from, lights next to nothing but the gap.
    """
    luminance = radiosity @ LUMINANCE
    lit = np.flatnonzero((luminance > 0) & (patches.side_areas > 0))
    typical = _weighted_median(luminance[lit], patches.side_areas[lit]) if len(lit) else 0.0
    is_mixed = spread * patches.side_reflectance.mean(axis=1) > MIXED * (luminance + typical)
    is_mixed &= ~np.repeat(patches.is_translucent, 2)
    is_bright = (luminance > BRIGHT * typical) & ~is_mixed & (patches.side_areas > 0)
    is_bright &= _brightest(luminance, patches.side_areas, BRIGHT_SHARE)
    is_bright &= ~is_confined
    flux = luminance * patches.side_areas * ~is_confined
    if flux[is_bright].sum() < BRIGHT_FLUX * flux.sum():
        is_bright[:] = False
    kinds = np.where(is_bright, LIGHT_SIDE, np.where(is_mixed, MIXED_SIDE, EVEN_SIDE))
    return kinds.astype(np.uint8), np.flatnonzero(is_bright)


def reaches_of(scene: Scene, kernel: KernelScene, patches: Patches, seed: int):
    """From how near a side's mean is not to be taken, float32 (2 P,) [m], and which sides are confined, bool (2 P,).

    Never, in a gap narrower than its patch (confined), or where something parts it in two; always, of what is
    translucent.
    """
    reaches = np.repeat(REACH * np.sqrt(patches.areas), 2).astype(np.float32)
    is_confined = kernel.openness(reaches, OPENNESS_RAYS, seed) < CONFINED
    reaches[is_confined | is_parted(scene, kernel, patches, seed)] = np.inf
    reaches[np.repeat(patches.is_translucent, 2)] = ALWAYS
    return reaches, is_confined


def _brightest(luminance, areas, share):
    """The brightest sides that make up at most ``share`` of the area, bool (2 P,)."""
    order = np.argsort(-luminance, kind="stable")
    chosen = np.zeros(len(luminance), bool)
    chosen[order[np.cumsum(areas[order]) <= share * areas.sum()]] = True
    return chosen


def _weighted_median(values, weights):
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(reached, 0.5 * reached[-1])]])


def with_bright_sides(scene: Scene, centre, patches: Patches, emitters: Emitters, radiosity, bright) -> Emitters:
    """The emitters with the bright sides among them, each glowing on its own side only; what is cut out of one, or lets
    rays pass, takes its share off all of it."""
    shining, which = np.unique(bright // 2, return_inverse=True)
    radiances = np.zeros((len(shining), 2, 3))
    radiances[which, bright % 2] = radiance_from_exitance(radiosity[bright])
    corners, which = patch_triangles(scene, patches, shining)
    areas = triangle_areas(corners)
    met = patches.met[shining] / np.maximum(np.bincount(which, areas), 1e-300)
    radiances *= np.minimum(met, 1.0)[:, None, None]
    return with_sources(emitters, corners[areas > 0], radiances.reshape(-1, 6)[which[areas > 0]], centre)
