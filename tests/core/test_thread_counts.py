"""The same bytes at 1, 2 and 4 threads: every solver, the gather, the whole bake."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.bake import bake
from addon.core.effort import Effort
from addon.core.emitters import emitters_of
from addon.core.gather import gather_irradiance
from addon.core.probes import SeenPoints
from addon.core.radiosity import solve_radiosity
from addon.core.scene import AreaLight, Material
from addon.core.settings import BakeSettings
from addon.core.vertices import vertex_receivers
from tests.scenes import box, kernel_of, rectangle, scene_of, sphere

THREADS = (1, 2, 4)
ROUTES = [
    ("monte-carlo", "stochastic"),
    ("monte-carlo", "progressive"),
    ("monte-carlo", "direct"),
    ("hemicube", "progressive"),
    ("hemicube", "direct"),
]


def furnished(solver):
    """What takes every path of the kernel: smooth, flat, glass, cloth, a glowing mesh, a lamp, sky through a door."""
    glass = Material("glass", (0, 0, 0), transmittance=(0.7, 0.7, 0.7))
    cloth = Material("cloth", (0.6, 0.6, 0.6), transmittance=(0.3, 0.3, 0.3))
    if solver == "stochastic":  # others know no colour of what passes
        glass = replace(glass, transmittance=(0.9, 0.7, 0.5))
        cloth = replace(cloth, transmittance=(0.3, 0.5, 0.1), translucence=(0.2, 0.1, 0.0))
    glow = Material("glow", radiance=(5.0, 4.0, 3.0))
    panel = AreaLight("panel", (0.5, 0.5, 0.95), (0, 0.2, 0), (0.2, 0, 0), (3.0, 3.0, 4.0))
    parts = [
        box((0, 0, 0), (1, 1, 1), inwards=True, without=("-y",), name="room"),
        sphere((0.3, 0.5, 0.3), 0.2, rings=5, segments=8, name="ball"),
        rectangle((0.6, 0.3, 0.0), (0.0, 0.4, 0.0), (0.0, 0.0, 0.6), material=glass, name="pane"),
        rectangle((0.1, 0.1, 0.5), (0.3, 0.0, 0.0), (0.0, 0.0, 0.4), material=cloth, name="curtain"),
        rectangle((0.8, 0.4, 0.3), (0.0, 0.2, 0.0), (0.0, 0.0, 0.2), material=glow, name="screen"),
    ]
    return scene_of(parts, (panel,), world=(0.3, 0.4, 0.5))


def light_at(threads, method, solver):
    """Bytes of the solution, of what gather rays see, and of the irradiance; and the rays of each."""
    scene = furnished(solver)
    settings = BakeSettings(method=method, solver=solver, error=0.1, patch_size=0.25)
    with kernel_of(scene, threads) as kernel:
        emitters = emitters_of(scene, kernel.centre)
        solved = solve_radiosity(scene, kernel, emitters, settings, lambda done: None)
        receivers, graph = vertex_receivers(scene, kernel, 30.0)
        seen = SeenPoints(receivers, lambda values: values)
        light = gather_irradiance(kernel, solved, receivers, graph, seen, Effort(0.1))
    field = [np.ascontiguousarray(array).tobytes() for array in solved.patches.arrays()]
    return solved.solution.radiosity.tobytes(), field, light.values.tobytes(), {**solved.rays, **light.rays}


@pytest.mark.parametrize("route", ROUTES, ids="-".join)
def test_solvers_and_gather_do_not_hang_on_the_number_of_threads(route):
    first, *others = (light_at(threads, *route) for threads in THREADS)
    assert max(np.frombuffer(first[2], np.float32)) > 0
    for other in others:
        assert other == first


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
@pytest.mark.parametrize("route", ROUTES[:2], ids="-".join)
def test_the_whole_bake_does_not_hang_on_the_number_of_threads(route, target):
    """Furnished, and with a target that takes more than one pass."""
    method, solver = route
    settings = {"method": method, "solver": solver, "target": target, "texels": 1024, "error": 0.1, "patch_size": 0.25}
    results = [bake(furnished(solver), BakeSettings(**settings, threads=threads)) for threads in THREADS]
    stored = [r.lightmap.pixels if r.lightmap else r.corner_colours for r in results]
    assert stored[0].max() > 0
    for result, values in zip(results[1:], stored[1:]):
        assert values.tobytes() == stored[0].tobytes()
        assert result.report.rays == results[0].report.rays
        assert result.report.estimated_error == results[0].report.estimated_error
