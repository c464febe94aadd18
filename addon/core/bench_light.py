"""The light of exact scenes: by every solver from the same patches, and by whole bakes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .bake import bake
from .bench_row import BenchRow, Outcome, measured, relative_error
from .bench_scenes import ExactScene, even_points
from .kernel import KernelScene
from .lightmap import look_up
from .luminance import LUMINANCE
from .patches import subdivide
from .radiosity import solve_patches
from .settings import BakeSettings
from .workers import Workers

# what a solver goes with: form factors by either method, or rays of its own
SOLVERS = (
    ("stochastic", "monte-carlo"),
    ("conjugate-gradient", "monte-carlo"),
    ("conjugate-gradient", "hemicube"),
    ("direct", "monte-carlo"),
    ("direct", "hemicube"),
    ("progressive", "monte-carlo"),
    ("progressive", "hemicube"),
)
ERRORS = (0.1, 0.02, 0.005, 0.002)
BAKE_ERRORS = (0.1, 0.03, 0.01)
# final gather is most of a bake: of its solvers, what "auto" takes, and the best one for small scenes
BAKE_WAYS = (("auto", "auto"), ("conjugate-gradient", "monte-carlo"))
QUICK = 2  # settings
FEW_TRIANGLES = 1000  # up to which patches are no more than conjugate gradients take; triangles are never joined
TEXELS, QUICK_TEXELS = 1 << 15, 1 << 12
POINTS = 2048  # at which a bake is looked up


def solver_rows(exact: ExactScene, workers: Workers, is_quick: bool, runs: int, seed: int) -> Iterator[BenchRow]:
    """All solvers on the scene's patches, held against the exact radiosities of these patches."""
    system = _System(exact, workers, seed)
    for solver, method in SOLVERS:
        for error in ERRORS[:QUICK] if is_quick else ERRORS:
            settings = BakeSettings(method=method, solver=solver, error=error, seed=seed)
            yield measured(("solve", exact.name, method, solver, f"error {error:g}"), runs, system.solving(settings))


class _System:
    """A scene's patches, what they emit, and what arrives at them in truth."""

    def __init__(self, exact: ExactScene, workers: Workers, seed: int):
        self._kernel = KernelScene(exact.scene, workers)
        self._patches = patches = subdivide(exact.scene, self._kernel, exact.patch_size, 1 << 20, seed)
        self._emitted = np.zeros((2 * len(patches), 3))
        self._emitted[::2] = exact.emitted[patches.triangles][:, None]
        # what arrives: what is emitted is known, and would hide the error of the rest
        self._truth = self._arriving(np.repeat(exact.system(patches), 2)[:, None] * np.ones(3))
        parts = None if exact.parts is None else exact.parts[patches.triangles]
        self._is_at_each = parts is None
        self._error_of = _judge(self._truth, patches.areas, parts)

    def solving(self, settings: BakeSettings):
        """A run, as ``measured`` wants it, that solves with these settings and a seed of its turn."""

        def run(turn):
            how = settings.solver, settings.method, settings.error, settings.seed + turn
            solution = solve_patches(self._kernel, self._patches, self._emitted, *how, lambda done: None)
            return lambda: self._judged(solution)

        return run

    def _judged(self, solution):
        stated = None
        if solution.standard_errors is not None and self._is_at_each:  # it is one of each patch, not of means
            deviation = self._arriving(solution.standard_errors + self._emitted)
            stated = relative_error(self._truth + deviation, self._truth, self._patches.areas)
        return Outcome(self._error_of(self._arriving(solution.radiosity)), solution.rays, stated)

    def _arriving(self, radiosity):
        """Irradiance of the fronts, float64 (P,) [W/m^2], from radiosity (2 P, 3)."""
        reflected = (radiosity - self._emitted)[::2] @ LUMINANCE
        return reflected / self._patches.reflectance[:, 0].astype(np.float64)


def _judge(truth, areas, parts):
    """The error of values (N,) that stand for areas (N,): at each, or of the means over parts, int64 (N,)."""
    if parts is None:
        return lambda found: relative_error(found, truth, areas)
    sizes = np.bincount(parts, areas)
    exact = np.bincount(parts, areas * truth) / sizes
    return lambda found: relative_error(np.bincount(parts, areas * found) / sizes, exact, sizes)


def bake_rows(exact: ExactScene, threads: int, is_quick: bool, runs: int, seed: int) -> Iterator[BenchRow]:
    """Whole bakes into a lightmap, looked up at points as a viewer does, held against the continuum's light."""
    if exact.irradiance is None:
        return
    triangles, barycentrics = even_points(exact.scene, POINTS, seed)
    points = np.einsum("nk,nkc->nc", barycentrics, exact.scene.corners[triangles])
    truth = exact.irradiance(points, triangles)

    parts = None if exact.parts is None else exact.parts[triangles]
    error_of = _judge(truth, np.ones(len(truth)), parts)
    ways = BAKE_WAYS if len(exact.scene.triangles) < FEW_TRIANGLES else BAKE_WAYS[:1]
    for solver, method in BAKE_WAYS[:1] if is_quick else ways:
        for error in BAKE_ERRORS[:QUICK] if is_quick else BAKE_ERRORS:
            settings = BakeSettings(
                method=method, solver=solver, error=error, texels=QUICK_TEXELS if is_quick else TEXELS, threads=threads
            )
            names = ("bake", exact.name, method, solver, f"error {error:g}")
            yield measured(
                names, runs, _baking(exact.scene, settings, seed, triangles, barycentrics, error_of, parts is None)
            )


def _baking(scene, settings, seed, triangles, barycentrics, error_of, states_points):
    def run(turn):
        result = bake(scene, replace(settings, seed=seed + turn))

        def judge():
            found = look_up(result.lightmap, triangles, barycentrics) @ LUMINANCE
            report = result.report.with_stages({})
            stated = report.seen_error if states_points else None
            return Outcome(error_of(found), sum(report.rays.values()), stated, report.seconds["bake"])

        return judge

    return run
