"""The light of exact scenes: by every solver from the same patches, and by whole bakes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .bake import bake
from .bench_row import BenchRow, Outcome, measured, relative_error
from .bench_scenes import ExactScene, even_points
from .emitters import LUMINANCE
from .kernel import KernelScene
from .lightmap import look_up
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
BAKE_ERRORS = (0.1, 0.05, 0.02, 0.01)
QUICK = 2  # settings
TEXELS, QUICK_TEXELS = 1 << 15, 1 << 12
POINTS = 2048  # at which a bake is looked up


def solver_rows(exact: ExactScene, workers: Workers, is_quick: bool, runs: int, seed: int) -> Iterator[BenchRow]:
    """All solvers on the scene's patches, held against the exact radiosities of these patches."""
    errors = (ERRORS[0], ERRORS[2]) if is_quick else ERRORS
    for solver, method in SOLVERS:
        for error in errors:
            names = ("solve", exact.name, method, solver, f"error {error:g}")
            yield measured(names, runs, _solving(exact, workers, solver, method, error, seed))


def _solving(exact, workers, solver, method, error, seed):
    kernel = KernelScene(exact.scene, workers)
    patches = subdivide(exact.scene, kernel, exact.patch_size, 1 << 20, seed)
    emitted = np.zeros((2 * len(patches), 3))
    emitted[::2] = exact.emitted[patches.triangles][:, None]
    rho = patches.reflectance[:, 0].astype(np.float64)
    # what arrives: what is emitted is known, and would hide the error of the rest
    truth = (exact.system(patches) - emitted[::2, 0]) / rho

    def run(turn):
        settings = BakeSettings(method=method, solver=solver, error=error, seed=seed + turn)
        solution = solve_patches(kernel, patches, emitted, solver, method, settings, lambda done: None)

        def judge():
            arriving = (solution.radiosity[::2] @ LUMINANCE - emitted[::2, 0]) / rho
            stated = None
            if solution.standard_errors is not None:
                deviation = solution.standard_errors[::2] @ LUMINANCE / rho
                stated = relative_error(truth + deviation, truth, patches.areas)
            return Outcome(relative_error(arriving, truth, patches.areas), solution.rays, stated)

        return judge

    return run


def bake_rows(exact: ExactScene, threads: int, is_quick: bool, runs: int, seed: int) -> Iterator[BenchRow]:
    """Whole bakes into a lightmap, looked up at points as a viewer does, held against the continuum's light."""
    if exact.irradiance is None:
        return
    triangles, barycentrics = even_points(exact.scene, POINTS, seed)
    points = np.einsum("nk,nkc->nc", barycentrics, exact.scene.corners[triangles])
    truth = exact.irradiance(points, triangles)

    def error_of(found):
        if exact.parts is None:
            return relative_error(found, truth)
        parts = exact.parts[triangles]
        means = [np.bincount(parts, x) / np.bincount(parts) for x in (found, truth)]
        return relative_error(*means)

    ways = (("auto", "auto"),) if is_quick else (("auto", "auto"), *SOLVERS[1:3], SOLVERS[5])
    for solver, method in ways:
        for error in BAKE_ERRORS[:QUICK] if is_quick else BAKE_ERRORS:
            settings = BakeSettings(
                method=method, solver=solver, error=error, texels=QUICK_TEXELS if is_quick else TEXELS, threads=threads
            )
            names = ("bake", exact.name, method, solver, f"error {error:g}")
            yield measured(names, runs, _baking(exact.scene, settings, seed, triangles, barycentrics, error_of))


def _baking(scene, settings, seed, triangles, barycentrics, error_of):
    def run(turn):
        result = bake(scene, replace(settings, seed=seed + turn))

        def judge():
            found = look_up(result.lightmap, triangles, barycentrics) @ LUMINANCE
            report = result.report.with_stages({})
            return Outcome(error_of(found), sum(report.rays.values()), report.seen_error, report.seconds["bake"])

        return judge

    return run
