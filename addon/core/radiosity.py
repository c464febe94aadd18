"""The scene's radiosity: direct light on every patch side, then a solver for what bounces between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .conjugate_gradient import require_exchange_size, solve_conjugate_gradient
from .decomposition import finer
from .dense import require_direct_size, solve_direct
from .emitters import LUMINANCE, Emitters, with_sources
from .exchange import exchange_of
from .guides import no_guides
from .kernel import KernelScene
from .patches import Patches, cut, grid_of, patch_size_for, patch_triangles, subdivide, triangle_areas
from .progressive import solve_progressive
from .receivers import patch_receivers
from .scene import Scene, exitance_from_radiance, radiance_from_exitance
from .settings import BakeSettings
from .solver import Solution
from .stochastic import solve_stochastic
from .texel_light import NO_TEXEL_LIGHT
from .transport import form_factors

EVEN, MIXED_SIDE, LIGHT = 0, 1, 2  # kinds of sides, as the kernel has them
# patches, about, that each solver is given; triangles are never joined, so there may be more
PATCH_BUDGETS = {"direct": 1200, "conjugate-gradient": 5000, "progressive": 3000, "stochastic": 60000}
COARSE_SHARE = 1 / 4  # of these, that are all of one size at first,
ROUND_SHARES = (0.25, 0.75)  # and that each round may add by cutting them where the light changes
QUICK_ERROR = 0.2  # of the solutions that say where it does
LEAST_REFLECTANCE = 1e-3  # below it a side is dark whatever light it gets
EXCHANGE_TRIANGLES = 3000  # up to which "auto" takes conjugate gradients, which keep 4 n^2 bytes
BRIGHT_ROOM = 0.8  # mean reflectance from which conjugate gradients need less time than stochastic Jacobi
POINTS = 8  # of a patch side: where its direct light is measured
SMALL = 0.25  # of a full-size patch's area: smaller ones are measured at one point
PATCH_SHADOW_SAMPLES = 8  # of each point of a full-size patch; small ones take 1
PATCH_SKY_RAYS = 4  # of each point
UNSHOT_LIMIT = 1e-3  # of the first flux; what is left is in the report
CG_LIMIT = 1e-6  # the same of conjugate gradients, which take three steps for it
MOST_REFLECTANCE = 0.9999  # while light is solved for: in a closed room that absorbs nothing it has no bound
MIXED = 0.5  # of the radiosity: more spread of reflected direct light over a side is sampled anew by gather rays
BRIGHT = 20.0  # times the median radiosity: brighter sides are sampled as lights, which few gather rays would find
BRIGHT_SHARE = 0.005  # of all area that they may be: where much is bright, gather rays find it well
BRIGHT_FLUX = 0.1  # of all flux that they must send out: every receiver and every near hit pays for them
CONFINED = 0.5  # a side of which fewer rays leave its reach lies in a gap
OPENNESS_RAYS = 8
REACH = 3.0  # patch sizes: nearer hits go on from the point hit


@dataclass(frozen=True, slots=True)
class PatchSolution:
    """What gather rays see (native/include/patchlight.h, pl_solution).

    Attributes
    ----------
    radiosity : float32 (2 P, 3) reflected radiosity of the sides, emission left out [W/m^2]
    direct : float32 (2 P, 3) the part of it that is the lights' direct light reflected once [W/m^2]
    reflectance : float32 (P, 3)
    kinds : uint8 (2 P,) EVEN, MIXED (lights reach one part of the side only) or LIGHT (receivers sample it as a light)
    reaches : float32 (2 P,) rays that hit from nearer do not take the side's mean [m]; inf in narrow gaps
    sky : float32 (1, 3) pi times the world's radiance [W/m^2]
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
        return len(self.reflectance)

    def looking_further(self, factor: float) -> PatchSolution:
        """The same for rays that go on from further away."""
        return replace(self, reaches=np.float32(factor) * self.reaches)


@dataclass(frozen=True, slots=True)
class Solved:
    """The patches' light, and what it took.

    Attributes
    ----------
    patches : PatchSolution
    emitters : the scene's lights and glowing triangles
    sources : the same, and the sides that are so bright that receivers sample them as lights
    solution : the solver's own result
    method, choice : what was picked, and why
    rays : {"patches": ..., "solve": ...}
    """

    patches: PatchSolution
    emitters: Emitters
    sources: Emitters
    solution: Solution
    method: str
    choice: str
    rays: dict[str, int]


def solve_radiosity(scene: Scene, kernel: KernelScene, emitters: Emitters, settings: BakeSettings, on_step) -> Solved:
    """Subdivide, measure direct light on the patches, solve for the light that bounces."""
    solver, method, choice = choose(settings, len(scene.triangles), _mean_reflectance(scene))
    sky = np.asarray(exitance_from_radiance(scene.world_radiance), np.float32).reshape(1, 3)

    def measure(patches, known=None):
        return _light_on_patches(scene, kernel, patches, emitters, sky, settings.seed, known)

    def solve(lit, error, on_step):
        emitted = lit.patches.side_reflectance * (lit.direct + lit.daylight)
        precision = replace(settings, error=error)
        return solve_patches(kernel, lit.patches, emitted, solver, method, precision, on_step)

    budget = PATCH_BUDGETS[solver]
    if settings.patch_size or solver == "stochastic":
        # where a patch costs rays only, as many of one size are as good in the same time
        size = settings.patch_size or patch_size_for(scene, budget)
        lit = measure(subdivide(scene, kernel, size, budget, settings.seed))
    else:
        lit = _decompose(scene, kernel, budget, settings, measure, solve)
    on_step(0.5)
    solution = solve(lit, settings.error, lambda done: on_step(0.5 + 0.5 * done))

    patches = lit.patches
    reaches = _reaches(kernel, patches, settings.seed)
    kinds, bright = _side_kinds(patches, solution.radiosity, lit.spread, np.isinf(reaches))
    field = PatchSolution(
        radiosity=solution.radiosity.astype(np.float32),
        direct=(patches.side_reflectance * lit.direct).astype(np.float32),
        reflectance=np.ascontiguousarray(patches.reflectance, np.float32),
        kinds=kinds,
        reaches=reaches,
        sky=sky,
    )
    sources = _as_sources(scene, kernel, patches, emitters, solution.radiosity, bright)
    return Solved(field, emitters, sources, solution, method, choice, {"patches": lit.rays, "solve": solution.rays})


def _decompose(scene, kernel, budget, settings, measure, solve) -> _Lit:
    """Patches that are small where the light changes, and the light on them."""
    coarse = int(budget * COARSE_SHARE)
    grid = grid_of(scene, patch_size_for(scene, coarse), coarse)
    along = np.ones(len(grid), np.int64)
    lit = measure(cut(scene, kernel, grid, along, settings.seed))
    count = len(lit.patches)
    for share in ROUND_SHARES:
        first = solve(lit, max(settings.error, QUICK_ERROR), lambda done: None)
        reflectance = np.maximum(lit.patches.side_reflectance, LEAST_REFLECTANCE)
        irradiance = (first.radiosity / reflectance) @ LUMINANCE
        finer_along = finer(grid, along, lit.patches, irradiance, lit.spread, count + int(share * budget))
        lit = replace(lit, rays=lit.rays + first.rays)
        if (finer_along == along).all():
            break
        along = finer_along
        lit = measure(cut(scene, kernel, grid, along, settings.seed), lit)
    return lit


def _side_kinds(patches, radiosity, spread, is_confined):
    """The kind of each side, uint8 (2 P,), and which sides are LIGHT.

    What shines in a gap, between a lamp and the ceiling that it hangs from, lights next to nothing but the gap.
    """
    luminance = radiosity @ LUMINANCE
    lit = np.flatnonzero((luminance > 0) & (patches.side_areas > 0))
    typical = _weighted_median(luminance[lit], patches.side_areas[lit]) if len(lit) else 0.0
    spread = spread * patches.side_reflectance.mean(axis=1) / (luminance + typical + 1e-300)
    is_bright = (luminance > BRIGHT * typical) & (spread <= MIXED) & (patches.side_areas > 0)
    is_bright &= _brightest(luminance, patches.side_areas, BRIGHT_SHARE)
    is_bright &= ~is_confined
    flux = luminance * patches.side_areas * ~is_confined
    if flux[is_bright].sum() < BRIGHT_FLUX * flux.sum():
        is_bright[:] = False
    is_mixed = spread > MIXED
    return np.where(is_bright, LIGHT, np.where(is_mixed, MIXED_SIDE, EVEN)).astype(np.uint8), np.flatnonzero(is_bright)


def _reaches(kernel, patches, seed):
    """From how near a side's mean is not to be taken, float32 (2 P,) [m]: never, in a gap narrower than its patch."""
    reaches = np.repeat(REACH * np.sqrt(patches.areas), 2).astype(np.float32)
    reaches[kernel.openness(reaches, OPENNESS_RAYS, seed) < CONFINED] = np.inf
    return reaches


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


def _as_sources(scene, kernel, patches, emitters, radiosity, bright):
    """The emitters with the bright sides among them, each glowing on its own side only."""
    corners = patch_triangles(scene, patches, bright // 2)
    radiances = np.zeros((len(bright), 2, 3))
    radiances[np.arange(len(bright)), bright % 2] = radiance_from_exitance(radiosity[bright])
    corners = corners.reshape(-1, 3, 3)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return with_sources(
        emitters, corners[areas > 0], np.repeat(radiances.reshape(-1, 6), 2, axis=0)[areas > 0], kernel.centre
    )


def solve_patches(kernel, patches, emitted, solver, method, settings, on_step) -> Solution:
    """Radiosity of all sides from what they emit, float64 (2 P, 3) [W/m^2], by a named solver and method."""
    areas, reflectance = patches.side_areas, np.minimum(patches.side_reflectance, MOST_REFLECTANCE)
    if solver == "stochastic":
        rays = int(min(max(8 * len(emitted), 1 << 20) * (0.05 / settings.error), 1 << 25))
        return solve_stochastic(kernel, reflectance, emitted, areas, rays, UNSHOT_LIMIT, settings.seed, on_step)
    estimator = form_factors(kernel, method, settings.error, settings.seed)
    if solver == "progressive":
        return solve_progressive(estimator, reflectance, emitted, areas, UNSHOT_LIMIT, on_step)
    require_size = require_direct_size if solver == "direct" else require_exchange_size
    require_size(len(emitted))
    exchange = exchange_of(estimator.rows(np.arange(len(emitted))), areas)
    if solver == "direct":
        solution = solve_direct(exchange.form_factors(areas), reflectance, emitted, areas)
    else:
        solution = solve_conjugate_gradient(exchange, reflectance, emitted, areas, CG_LIMIT, on_step)
    return replace(solution, rays=estimator.rays_per_row * len(emitted))


def choose(settings: BakeSettings, triangle_count: int, reflectance: float = 0.5) -> tuple[str, str, str]:
    """Solver, method, and a sentence on why, after "auto" has looked at the scene's size and mean reflectance.

    By time to equal error, measured on closed cubes and the Cornell box of 240 to 12000 sides: rows of form factors and
    conjugate gradients take a third to a tenth of stochastic Jacobi's time at reflectance 0.9, a hundredth at 0.99, up
    to five times as much at 0.5; they fit up to some 16000 sides. Direct takes longer for the same, progressive
    refinement leaves twice the error, as it uses each row for one direction only.
    """
    method = "monte-carlo" if settings.method == "auto" else settings.method
    if settings.solver != "auto":
        return settings.solver, method, f"{settings.solver} and {method} as asked"
    if method == "hemicube":
        solver = "conjugate-gradient" if triangle_count <= EXCHANGE_TRIANGLES else "progressive"
        return solver, method, f"{solver} for {triangle_count} triangles, with form factors by hemicube as asked"
    if reflectance >= BRIGHT_ROOM and triangle_count <= EXCHANGE_TRIANGLES:
        reason = f"{triangle_count} triangles of mean reflectance {reflectance:.2f}, where light bounces long"
        return "conjugate-gradient", method, f"conjugate-gradient for {reason}"
    return "stochastic", method, f"stochastic for {triangle_count} triangles: it needs no form factors, at any size"


def _mean_reflectance(scene):
    """Mean over the scene's area of the brightest channel; textures, not read yet, count as grey."""
    brightest = [max(m.reflectance) * (0.5 if m.reflectance_texture is not None else 1.0) for m in scene.materials]
    areas = triangle_areas(scene)
    return float((areas * np.array(brightest)[scene.triangle_materials]).sum() / max(areas.sum(), 1e-300))


@dataclass(frozen=True, slots=True)
class _Lit:
    """Mean irradiance of every patch side by the lights and by the world (2 P, 3), the spread of the former (2 P,)."""

    patches: Patches
    direct: np.ndarray
    spread: np.ndarray
    daylight: np.ndarray
    rays: int


def _light_on_patches(scene, kernel, patches: Patches, emitters, sky, seed, known: _Lit | None) -> _Lit:
    """Direct light on patches; on those of cells that are as they were in ``known``, what was measured there."""
    new, old = np.ones(len(patches), bool), np.zeros(0, bool)
    if known is not None:
        is_same = np.bincount(patches.cells) == np.bincount(known.patches.cells)
        new, old = ~is_same[patches.cells], is_same[known.patches.cells]
    direct, spread, shadow_rays = _direct_on_patches(scene, kernel, patches, new, emitters, seed)
    daylight, sky_rays = _sky_on_patches(scene, kernel, patches, new, emitters, sky, seed)
    if known is not None:
        for all_of_them, before in ((direct, known.direct), (spread, known.spread), (daylight, known.daylight)):
            all_of_them[np.repeat(~new, 2)] = before[np.repeat(old, 2)]
    return _Lit(patches, direct, spread, daylight, shadow_rays + sky_rays + (known.rays if known else 0))


def _direct_on_patches(scene, kernel, patches: Patches, wanted, emitters, seed):
    """The lights' mean irradiance on every side, float64 (2 P, 3), its spread over the side (2 P,), and shadow rays.

    A full-size patch is measured at several points; a small one at one, as its neighbours stand in for it when light is
    gathered. What reflects nothing is left dark.
    """
    irradiance, spread = np.zeros((len(patches), 2, 3)), np.zeros((len(patches), 2))
    rays = 0
    for chosen, points in _measured(patches, wanted):
        receivers = patch_receivers(scene, kernel, chosen, points, seed)
        values, _, traced = kernel.direct(emitters, receivers, min(points, PATCH_SHADOW_SAMPLES), seed)
        values = values.reshape(-1, 2, points, 3)
        irradiance[chosen] = values.mean(axis=2, dtype=np.float64)
        spread[chosen] = np.ptp(values.mean(axis=3), axis=2)
        rays += traced
    return irradiance.reshape(-1, 3), spread.ravel(), rays


def _sky_on_patches(scene, kernel, patches: Patches, wanted, emitters, sky, seed):
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
        kinds=np.full(kernel.side_count, EVEN, np.uint8),
        reaches=np.zeros(kernel.side_count, np.float32),
        sky=sky,
    )
    for chosen, points in _measured(patches, wanted):
        receivers = patch_receivers(scene, kernel, chosen, points, seed)
        sums = np.zeros((len(receivers), 1, 3), np.float32)
        everyone = np.arange(len(receivers), dtype=np.uint32)
        count = PATCH_SKY_RAYS
        rays += kernel.gather(
            black, NO_TEXEL_LIGHT, emitters, receivers, no_guides(len(receivers)), everyone, 1, 0, count, seed, sums
        )
        irradiance[chosen] = (sums[:, 0] / count).reshape(-1, 2, points, 3).mean(axis=2, dtype=np.float64)
    return irradiance.reshape(-1, 3), rays


def _measured(patches: Patches, wanted):
    """(patches, points on each) of those wanted that reflect: those of a full-size cell, and of small ones."""
    wanted = wanted & (patches.reflectance.max(axis=1, initial=0.0) > 0)
    cell_areas = np.bincount(patches.cells, patches.areas)
    is_large = cell_areas[patches.cells] > SMALL * patches.size**2
    return (np.flatnonzero(is_large & wanted), POINTS), (np.flatnonzero(~is_large & wanted), 1)
