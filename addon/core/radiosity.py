"""The scene's radiosity: direct light on every patch side, then a solver for what bounces between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .choose import EXCHANGE_TRIANGLES, choose, mean_reflectance
from .conjugate_gradient import EXCHANGE_LIMIT, require_exchange_size, solve_conjugate_gradient
from .decomposition import finer
from .dense import DIRECT_LIMIT, require_direct_size, solve_direct
from .emitters import Emitters
from .exchange import exchange_of
from .joined import joined
from .kernel import MANY_LIGHTS, KernelScene
from .laws import Laws, measured_laws
from .luminance import LUMINANCE
from .parted import finer_where_parted
from .patch_light import QUICK_ERROR, PatchLight, measure_patches
from .patch_solution import PatchSolution, reaches_of, side_kinds, with_bright_sides
from .patches import MOST_PATCHES, Grid, Patches, cut, grid_of, patch_size_for, subdivide
from .progressive import solve_progressive
from .scene import Scene
from .settings import BakeSettings
from .sky import sky_map
from .solver import Solution
from .stochastic import solve_stochastic
from .transport import form_factors
from .triangles import triangle_areas
from .workers import within

# How many patches there are, about.
PATCH_BUDGETS = {"direct": 1200, "conjugate-gradient": 5000, "progressive": 3000, "stochastic": 60000}
MOST_PATCHES_OF = {"direct": DIRECT_LIMIT // 2, "conjugate-gradient": EXCHANGE_LIMIT // 2}  # a patch has two sides
DRAFT_BUDGET = 15000  # of the stochastic solver, where DRAFT_ERROR or a larger one is good enough
DRAFT_ERROR = 0.05
COARSE_SHARE = 1 / 4  # of the budget goes to patches of one size, before any are cut where the light changes
ROUND_SHARES = (0.25, 0.75)  # of the budget is what each round of such cuts may add

# Where a lightmap has texels on nearly all of the scene, looks from texel to texel mend what patches have wrong.
MOST_AREA = 0.9  # of the scene's area: so much must have texels
LIGHTMAP_ERROR = QUICK_ERROR  # is then good enough for patches, if not a larger one is, and small patches are joined

# How many rays the solvers take.
USUAL_ERROR = 0.05  # the stochastic solver's rays are those below at this error, and more by the ratio at a smaller one
RAYS_A_SIDE = 8  # in its first step, shared by flux
MOST_SHOT = 500_000  # sides: of more, gather rays see the mean of many
LEAST_RAYS, MOST_RAYS = (
    1 << 18,
    1 << 25,
)  # in all: few sides need more than 8 each; small errors ask for too many
ROWS_SHARE = 0.8  # of a solver's time goes to the rows of form factors, where it needs them all

# Where light ends.
LEAST_REFLECTANCE = 1e-3  # below it a side is dark whatever light it gets
UNSHOT_LIMIT = 1e-3  # of the first flux; what is left is in the report
CG_LIMIT = 1e-6  # the same of conjugate gradients, which take three steps for it
MOST_REFLECTANCE = 0.9999  # while light is solved for: in a closed room that absorbs nothing it has no bound


@dataclass(frozen=True, slots=True)
class Solved:
    """The patches' light, and what it took.

    Attributes
    ----------
    patches : PatchSolution
    emitters : the scene's lights and glowing triangles
    sources : the same, and the sides that are so bright that receivers sample them as lights
    solution : the solver's own result
    laws : how far transport between the patches keeps them
    method, choice : what was picked, and why
    keeps_all_light : whether some patch sends on more than MOST_REFLECTANCE
    rays : {"patches": ..., "solve": ..., "laws": ...}
    """

    patches: PatchSolution
    emitters: Emitters
    sources: Emitters
    solution: Solution
    laws: Laws
    method: str
    choice: str
    keeps_all_light: bool
    rays: dict[str, int]


def solve_radiosity(scene: Scene, kernel: KernelScene, emitters: Emitters, settings: BakeSettings, on_step) -> Solved:
    """Subdivide, measure direct light on the patches, solve for the light that bounces."""
    # with more lights, rays that go on take patches' direct light, which is not mended
    is_rough = settings.target == "lightmap" and _target_share(scene) >= MOST_AREA and len(emitters) < MANY_LIGHTS
    light = scene, kernel, emitters, sky_map(scene), settings
    # half of the bar is kept for solving once more
    solved, patches = _solved(*light, is_rough, within(on_step, 0.0, 0.5))
    if is_rough and settings.error < LIGHTMAP_ERROR and len(solved.sources) > len(emitters):
        # receivers sample bright sides as lights: what is wrong with these no look takes off
        rays = solved.rays
        solved, patches = _solved(*light, False, within(on_step, 0.5, 0.5))
        solved = replace(solved, rays={stage: count + rays[stage] for stage, count in solved.rays.items()})
    laws, law_rays = measured_laws(scene, kernel, patches, settings.seed)
    return replace(solved, laws=laws, rays={**solved.rays, "laws": law_rays})


def _solved(
    scene, kernel, emitters: Emitters, sky, settings: BakeSettings, is_rough, on_step
) -> tuple[Solved, Patches]:
    """The same without the laws, and the patches: those that a lightmap's texels mend are rough."""
    error = max(settings.error, LIGHTMAP_ERROR) if is_rough else settings.error
    needs_rays = next((m.name for m in scene.materials if m.is_translucent or m.passes_colour or m.open_side), None)
    looked_at = len(scene.triangles), _side_count(scene, settings), mean_reflectance(scene), is_rough, needs_rays
    solver, method, choice = choose(settings, *looked_at)

    def measure(patches, on_step, known=None):
        return measure_patches(scene, kernel, patches, emitters, sky, error, settings.seed, known, on_step)

    def solve(lit, precision, on_step):
        emitted = lit.patches.scattered(lit.direct + lit.daylight)
        found = solve_patches(kernel, lit.patches, emitted, solver, method, precision, settings.seed, on_step)
        # no surface sends less than it emits: what overshooting or an iteration left below that is its error
        return replace(found, radiosity=np.maximum(found.radiosity, emitted, out=emitted))

    budget = _patch_budget(solver, settings, error)
    if settings.patch_size or solver == "stochastic":
        # where a patch costs rays only, as many of one size are as good in the same time
        if settings.patch_size:
            patches = subdivide(scene, kernel, settings.patch_size, budget, settings.seed)
        else:
            grid = grid_of(scene, patch_size_for(scene, budget), budget)
            patches = finer_where_parted(scene, kernel, grid, budget, settings.seed)
            if is_rough and patches.has_like_sides:  # what is joined has one reflectance
                patches = joined(scene, kernel, grid, patches)
        lit = measure(patches, within(on_step, 0.0, 0.4))
    else:
        most = MOST_PATCHES_OF.get(solver, budget + MOST_PATCHES)
        lit = _decompose(scene, kernel, budget, most, error, settings.seed, measure, solve, within(on_step, 0.0, 0.4))
    solution = solve(lit, error, within(on_step, 0.5, 0.5))

    patches = lit.patches
    reaches, is_confined = reaches_of(scene, kernel, patches, settings.seed)
    # those that are sampled as lights are seen by shadow rays
    kinds, bright = side_kinds(
        patches, solution.radiosity, lit.spread, is_confined if scene.hides_as_it_shows else np.ones_like(is_confined)
    )
    field = PatchSolution(
        radiosity=solution.radiosity.astype(np.float32),
        direct=patches.scattered(lit.direct).astype(np.float32),
        reflectance=np.ascontiguousarray(patches.side_reflectance, np.float32),
        kinds=kinds,
        reaches=reaches,
        sky=sky,
    )
    sources = with_bright_sides(scene, kernel.centre, patches, emitters, solution.radiosity, bright)
    rays = {"patches": lit.rays, "solve": solution.rays}
    sent_on = patches.side_reflectance + np.repeat(patches.translucence, 2, axis=0)
    keeps_all_light = bool((sent_on > MOST_REFLECTANCE).any())
    return Solved(field, emitters, sources, solution, Laws(), method, choice, keeps_all_light, rays), patches


def _target_share(scene: Scene) -> float:
    """Of the scene's area, how much is baked."""
    areas = triangle_areas(scene.corners)
    return sum(areas[obj.span].sum() for obj in scene.objects if obj.is_target) / max(areas.sum(), 1e-300)


def _patch_budget(solver: str, settings: BakeSettings, error: float) -> int:
    """How many patches, about, a solver is given."""
    budget = PATCH_BUDGETS[solver]
    if solver != "stochastic" or settings.patch_size:
        return budget
    return int(max(budget * min(1.0, DRAFT_ERROR / error), DRAFT_BUDGET))


def _coarse_grid(scene, budget) -> Grid:
    """What adaptive decomposition starts with."""
    coarse = int(budget * COARSE_SHARE)
    return grid_of(scene, patch_size_for(scene, coarse), coarse)


def _side_count(scene, settings: BakeSettings) -> int:
    """Of the patches that conjugate gradients would start with; where there are too many triangles these are enough."""
    if len(scene.triangles) > EXCHANGE_TRIANGLES:
        return 2 * len(scene.triangles)
    budget = PATCH_BUDGETS["conjugate-gradient"]
    if settings.patch_size:
        return 2 * len(grid_of(scene, settings.patch_size, budget))
    return 2 * len(_coarse_grid(scene, budget))


def _decompose(scene, kernel, budget, most, error, seed, measure, solve, on_step) -> PatchLight:
    """Patches that are small where the light changes, up to ``most`` of them, and the light on them."""
    grid = _coarse_grid(scene, budget)
    along = np.ones(len(grid), np.int64)
    rounds = 1 + 2 * len(ROUND_SHARES)  # to measure, and to solve and measure again each time
    lit = measure(cut(scene, kernel, grid, along, seed), within(on_step, 0.0, 1 / rounds))
    count = len(lit.patches)
    for turn, share in enumerate(ROUND_SHARES):
        begin = 1 + 2 * turn
        first = solve(lit, max(error, QUICK_ERROR), within(on_step, begin / rounds, 1 / rounds))
        reflectance = np.maximum(lit.patches.side_reflectance, LEAST_REFLECTANCE)
        irradiance = (first.radiosity / reflectance) @ LUMINANCE
        allowed = min(count + int(share * budget), most)
        finer_along = finer(grid, along, lit.patches, irradiance, lit.spread, allowed)
        lit = replace(lit, rays=lit.rays + first.rays)
        if (finer_along == along).all():
            break
        along = finer_along
        patches = cut(scene, kernel, grid, along, seed)
        lit = measure(patches, within(on_step, (begin + 1) / rounds, 1 / rounds), lit)
    return lit


def solve_patches(kernel, patches, emitted, solver, method, error, seed, on_step) -> Solution:
    """Radiosity of all sides from what they emit, float64 (2 P, 3) [W/m^2], by a named solver and method."""
    areas, reflectance = patches.side_areas, np.minimum(patches.side_reflectance, MOST_REFLECTANCE)
    if solver == "stochastic":
        usual = max(RAYS_A_SIDE * min(len(emitted), MOST_SHOT), LEAST_RAYS)
        rays = int(min(usual * (USUAL_ERROR / error), MOST_RAYS))
        translucence = np.minimum(patches.translucence, MOST_REFLECTANCE - reflectance[::2])
        return solve_stochastic(kernel, reflectance, emitted, areas, rays, UNSHOT_LIMIT, seed, on_step, translucence)
    estimator = form_factors(kernel, method, error, seed)
    if solver == "progressive":
        return solve_progressive(estimator, reflectance, emitted, areas, UNSHOT_LIMIT, on_step)
    require_size = require_direct_size if solver == "direct" else require_exchange_size
    require_size(len(emitted))
    # with the most patches and the smallest errors this is minutes
    rows = estimator.rows(np.arange(len(emitted)), within(on_step, 0.0, ROWS_SHARE))
    on_step = within(on_step, ROWS_SHARE, 1 - ROWS_SHARE)
    exchange = exchange_of(rows, areas)
    on_step(0.0)
    if solver == "direct":
        solution = solve_direct(exchange.form_factors(areas), reflectance, emitted, areas)
    else:
        solution = solve_conjugate_gradient(exchange, reflectance, emitted, areas, CG_LIMIT, on_step)
    return replace(solution, rays=estimator.rays_per_row * len(emitted))
