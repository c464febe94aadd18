"""Form factors of a few pairs with closed forms, by every method, and by peers where they are installed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from . import closed_forms as forms
from .analytic import surface, surface_exchange
from .bench_peers import Peer
from .bench_row import BenchRow, Outcome, measured
from .kernel import KernelScene
from .patches import subdivide
from .quadrature import fan
from .scene import Material, Scene, SceneObject
from .transport import REPLICATES, HemicubeFormFactors, MonteCarloFormFactors, estimate, replicated
from .workers import Workers

POSITIONS = 8  # of hemicubes on a triangle, as a bake has them
RAYS = tuple(1 << k for k in range(6, 17, 2))  # of a triangle, in each of its replicates
RESOLUTIONS = (4, 8, 16, 32, 64)
QUICK = 3  # settings


@dataclass(frozen=True, slots=True)
class FactorCase:
    """F(emitter -> target) among blockers: convex polygons (K, 3) [m], and the exact value."""

    name: str
    emitter: np.ndarray
    target: np.ndarray
    blockers: tuple[np.ndarray, ...]
    exact: float

    @property
    def polygons(self) -> list[np.ndarray]:
        """All of them: the emitter, the target, the blockers."""
        return [self.emitter, self.target, *self.blockers]


def factor_cases() -> list[FactorCase]:
    """Opposed unit squares, two with a common edge, and two between which a board hides half of the light."""
    one = (0.0, 1.0)
    floor = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
    ceiling = floor[::-1] + np.array((0, 0, 1))
    wall = np.array([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)], float)
    # as good as a half-plane: light between the squares is above the floor half way up; peers' work grows with area
    board = np.array([(-0.1, -0.1, 0.5), (0.5, -0.1, 0.5), (0.5, 1.1, 0.5), (-0.1, 1.1, 0.5)])
    clear = forms.parallel_rectangles(one, one, one, one, 1.0)
    return [
        FactorCase("opposed", floor, ceiling, (), clear),
        FactorCase("common edge", floor, wall, (), forms.perpendicular_rectangles(one, one, one, one)),
        FactorCase("half hidden", floor, ceiling, (board,), clear / 2),
    ]


def factor_rows(workers: Workers, peers: list[Peer], is_quick: bool, runs: int, seed: int) -> Iterator[BenchRow]:
    """The rows of all cases and methods."""
    for case in factor_cases():
        yield _analytic_row(case, runs)
        for name, make, settings in (
            ("monte-carlo", MonteCarloFormFactors, RAYS),
            ("hemicube", lambda kernel, size, seed: HemicubeFormFactors(kernel, size, POSITIONS, seed), RESOLUTIONS),
        ):
            word = "rays" if name == "monte-carlo" else "pixels"
            for setting in settings[:QUICK] if is_quick else settings:
                names = ("factor", case.name, name, "-", f"{word} {setting}")
                yield measured(names, runs, _sampled(case, workers, make, setting, seed))
        for peer in peers:
            for setting in peer.settings[:QUICK] if is_quick else peer.settings:
                yield _peer_row(case, peer, setting, runs, seed)


def _analytic_row(case, runs):
    emitter, target, *blockers = (surface("", polygon) for polygon in case.polygons)

    def run(_):
        value = surface_exchange(emitter, target, blockers) / emitter.area
        return Outcome(abs(value / case.exact - 1), stated_error=1e-6 if blockers else 1e-9)

    return measured(("factor", case.name, "analytic", "-", "-"), runs, run)


def _sampled(case, workers, make, setting, seed):
    scene, owners = _scene(case)

    def run(turn):
        kernel = KernelScene(scene, workers)
        patches = subdivide(scene, kernel, 1e30, 8 * len(owners), 0)
        sides, target = 2 * np.flatnonzero(owners == 0), 2 * np.flatnonzero(owners == 1)
        weights = patches.areas[owners == 0] / patches.areas[owners == 0].sum()
        # replicates of one run are neighbours in seed; runs are far apart
        one = make(kernel, setting, seed + 1000 * turn)
        rays, equal_rays = (REPLICATES * len(sides) * per_row for per_row in (one.rays_per_row, one.equal_rays_per_row))
        found = estimate(replicated(one, sides, lambda rows: weights @ rows[:, target].sum(axis=1)), equal_rays)
        return Outcome(abs(float(found.value) / case.exact - 1), rays, float(found.bound) / case.exact)

    return run


def _peer_row(case, peer, setting, runs, seed):
    peer.run(case, setting, seed)  # compilers and caches warm up before what is timed

    def run(turn):
        value, rays, stated = peer.run(case, setting, seed + 1000 * turn)
        return Outcome(abs(value / case.exact - 1), rays, None if stated is None else stated / case.exact)

    return measured(("factor", case.name, peer.name, "-", peer.label(setting)), runs, run)


def _scene(case):
    """The case as a core scene, black; and which polygon each triangle is of (T,)."""
    fans = [fan(polygon) for polygon in case.polygons]
    owners = np.repeat(np.arange(len(fans)), [len(part) for part in fans])
    count = len(owners)
    scene = Scene(
        vertices=np.concatenate(fans).reshape(-1, 3),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        corner_normals=np.zeros((count, 3, 3), np.float32),
        uvs=np.zeros((count, 3, 2), np.float32),
        triangle_materials=np.zeros(count, np.int32),
        objects=(SceneObject("polygons", 0, count),),
        materials=(Material("black", (0.0, 0.0, 0.0)),),
    )
    return scene, owners
