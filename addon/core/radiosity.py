"""The scene's radiosity: direct light on every patch side, then a solver for what bounces between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .emitters import Emitters
from .kernel import KernelScene
from .patches import Patches, patch_size_for, subdivide
from .receivers import patch_receivers
from .scene import Scene, exitance_from_radiance
from .settings import BakeSettings
from .solver import Solution, require_direct_size, solve_direct, solve_progressive, solve_stochastic
from .transport import form_factors

# patches, about, that each solver is given; triangles are never joined, so there may be more
PATCH_BUDGETS = {"direct": 1200, "progressive": 3000, "stochastic": 30000}
DIRECT_TRIANGLES, PROGRESSIVE_TRIANGLES = 150, 1500  # up to which "auto" takes them
POINTS = 8  # of a patch side: where its direct light is measured
SMALL = 0.25  # of a full-size patch's area: smaller ones are measured at one point
PATCH_SHADOW_SAMPLES = 8  # of each point of a full-size patch; small ones take 1
PATCH_SKY_RAYS = 4  # of each point
UNSHOT_LIMIT = 1e-3  # of the first flux; what is left is in the report
MIXED = 0.25  # of the radiosity: more spread of reflected direct light over a side is sampled anew by gather rays
REACH = 2.0  # patch sizes: nearer hits go on from the point hit


@dataclass(frozen=True, slots=True)
class PatchSolution:
    """What gather rays see (native/include/patchlight.h, pl_solution).

    Attributes
    ----------
    radiosity : float32 (2 P, 3) reflected radiosity of the sides, emission left out [W/m^2]
    direct : float32 (2 P, 3) the part of it that is the lights' direct light reflected once [W/m^2]
    reflectance : float32 (P, 3)
    is_mixed : uint8 (2 P,) 1 where the lights reach one part of a side and not another
    reaches : float32 (P,) rays that hit from nearer do not take the patch's mean [m]
    sky : float32 (1, 3) pi times the world's radiance [W/m^2]
    """

    radiosity: np.ndarray
    direct: np.ndarray
    reflectance: np.ndarray
    is_mixed: np.ndarray
    reaches: np.ndarray
    sky: np.ndarray

    def arrays(self) -> tuple:
        """In the kernel's order."""
        return self.radiosity, self.direct, self.reflectance, self.is_mixed, self.reaches, self.sky

    def __len__(self) -> int:
        return len(self.reaches)


@dataclass(frozen=True, slots=True)
class Solved:
    """The patches' light, and what it took.

    Attributes
    ----------
    patches : PatchSolution
    solution : the solver's own result
    method, choice : what was picked, and why
    rays : {"patches": ..., "solve": ...}
    """

    patches: PatchSolution
    solution: Solution
    method: str
    choice: str
    rays: dict[str, int]


def solve_radiosity(
    scene: Scene, kernel: KernelScene, emitters: Emitters, settings: BakeSettings, on_step
) -> Solved:
    """Subdivide, measure direct light on the patches, solve for the light that bounces."""
    solver, method, choice = choose(settings, len(scene.triangles))
    budget = PATCH_BUDGETS[solver]
    size = settings.patch_size or patch_size_for(scene, budget)
    patches = subdivide(scene, kernel, size, budget, settings.seed)
    sky = np.asarray(exitance_from_radiance(scene.world_radiance), np.float32).reshape(1, 3)
    direct, spread, traced = _direct_on_patches(
        scene, kernel, patches, emitters, settings.seed, lambda done: on_step(0.4 * done)
    )
    daylight, sky_rays = _sky_on_patches(scene, kernel, patches, emitters, sky, settings.seed)
    emitted = patches.side_reflectance * (direct + daylight)
    solution = _solve(kernel, patches, emitted, solver, method, settings, lambda done: on_step(0.5 + 0.5 * done))

    typical = np.average(solution.radiosity.mean(axis=1), weights=patches.side_areas + 1e-300)
    is_mixed = spread * patches.side_reflectance.mean(axis=1) > MIXED * (solution.radiosity.mean(axis=1) + typical)
    field = PatchSolution(
        radiosity=solution.radiosity.astype(np.float32),
        direct=(patches.side_reflectance * direct).astype(np.float32),
        reflectance=np.ascontiguousarray(patches.reflectance, np.float32),
        is_mixed=is_mixed.astype(np.uint8),
        reaches=(REACH * np.sqrt(patches.areas)).astype(np.float32),
        sky=sky,
    )
    return Solved(field, solution, method, choice, {"patches": traced + sky_rays, "solve": solution.rays})


def _solve(kernel, patches, emitted, solver, method, settings, on_step) -> Solution:
    areas, reflectance = patches.side_areas, patches.side_reflectance
    if solver == "stochastic":
        rays = int(min(max(8 * len(emitted), 1 << 20) * (0.05 / settings.error), 1 << 25))
        return solve_stochastic(kernel, reflectance, emitted, areas, rays, UNSHOT_LIMIT, settings.seed, on_step)
    estimator = form_factors(kernel, method, settings.error, settings.seed)
    if solver == "progressive":
        return solve_progressive(estimator, reflectance, emitted, areas, UNSHOT_LIMIT, on_step)
    require_direct_size(len(emitted))
    rows = estimator.rows(np.arange(len(emitted)))
    return replace(
        solve_direct(rows, reflectance, emitted, areas), rays=estimator.rays_per_row * len(emitted)
    )


def choose(settings: BakeSettings, triangle_count: int) -> tuple[str, str, str]:
    """Solver, method, and a sentence on why, after "auto" has looked at the scene's size."""
    method = "monte-carlo" if settings.method == "auto" else settings.method
    if settings.solver != "auto":
        return settings.solver, method, f"{settings.solver} and {method} as asked"
    if method == "hemicube":
        solver = "direct" if triangle_count <= DIRECT_TRIANGLES else "progressive"
        return solver, method, f"{solver} for {triangle_count} triangles, with form factors by hemicube as asked"
    return "stochastic", method, f"stochastic for {triangle_count} triangles: it needs no form factors, at any size"


def _direct_on_patches(scene, kernel, patches: Patches, emitters, seed, on_step):
    """The lights' mean irradiance on every side, float64 (2 P, 3), its spread over the side (2 P,), and shadow rays.

    A full-size patch is measured at several points; a small one at one, as its neighbours stand in for it when light is
    gathered. What reflects nothing is left dark.
    """
    irradiance, spread = np.zeros((len(patches), 2, 3)), np.zeros((len(patches), 2))
    rays = 0
    for chosen, points, share in _measured(patches):
        receivers = patch_receivers(scene, kernel, chosen, points, seed)
        values, _, traced = kernel.direct(emitters, receivers, min(points, PATCH_SHADOW_SAMPLES), seed)
        values = values.reshape(-1, 2, points, 3)
        irradiance[chosen] = values.mean(axis=2, dtype=np.float64)
        spread[chosen] = np.ptp(values.mean(axis=3), axis=2)
        rays += traced
        on_step(share)
    return irradiance.reshape(-1, 3), spread.ravel(), rays


def _sky_on_patches(scene, kernel, patches: Patches, emitters, sky, seed):
    """Mean irradiance of every side from the constant world, float64 (2 P, 3), and the rays it took.

    The sky is gathered with all surfaces black.
    """
    irradiance, rays = np.zeros((len(patches), 2, 3)), 0
    if sky.max() <= 0:
        return irradiance.reshape(-1, 3), rays
    black = PatchSolution(
        radiosity=np.zeros((kernel.side_count, 3), np.float32),
        direct=np.zeros((kernel.side_count, 3), np.float32),
        reflectance=np.zeros((len(patches), 3), np.float32),
        is_mixed=np.zeros(kernel.side_count, np.uint8),
        reaches=np.zeros(len(patches), np.float32),
        sky=sky,
    )
    for chosen, points, _ in _measured(patches):
        receivers = patch_receivers(scene, kernel, chosen, points, seed)
        sums = np.zeros((len(receivers), 1, 3), np.float32)
        everyone = np.arange(len(receivers), dtype=np.uint32)
        count = PATCH_SKY_RAYS
        rays += kernel.gather(black, emitters, receivers, everyone, 1, 0, count, seed, sums)
        irradiance[chosen] = (sums[:, 0] / count).reshape(-1, 2, points, 3).mean(axis=2, dtype=np.float64)
    return irradiance.reshape(-1, 3), rays


def _measured(patches: Patches):
    """(patches, points on each, share of the work done after them): the full-size ones, and the small ones."""
    reflects = patches.reflectance.max(axis=1, initial=0.0) > 0
    is_large = patches.areas > SMALL * patches.size**2
    return (
        (np.flatnonzero(is_large & reflects), POINTS, 0.5),
        (np.flatnonzero(~is_large & reflects), 1, 1.0),
    )
