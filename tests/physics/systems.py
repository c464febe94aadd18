"""Systems for solvers: form factors as each solver wants them, and closed meshes whose rows the kernel samples."""

from __future__ import annotations

import numpy as np

from addon.core.conjugate_gradient import solve_conjugate_gradient
from addon.core.dense import solve_direct
from addon.core.exchange import exchange_of
from addon.core.patches import subdivide
from addon.core.progressive import solve_progressive
from addon.core.stochastic import solve_stochastic
from tests.scenes import Part, closed_box, kernel_of, scene_of, sphere

EXACT_SOLVERS = ("direct", "conjugate-gradient", "progressive")


class Rows:
    """Form factors from a matrix, as progressive refinement asks for them."""

    def __init__(self, matrix):
        self.matrix = matrix

    def rows(self, sides):
        return self.matrix[sides]


class RaysByChance:
    """A kernel that shoots into a matrix: where a side's rays land is drawn from its row, all at once."""

    def __init__(self, matrix):
        escaping = np.maximum(1 - matrix.sum(axis=1, keepdims=True), 0.0)
        self._shares = np.concatenate([np.maximum(matrix, 0.0), np.where(escaping < 1e-12, 0.0, escaping)], axis=1)
        self._shares /= self._shares.sum(axis=1, keepdims=True)

    def shoot(self, sides, first_samples, ray_flux, first_rays, seed):
        """As kernel.KernelScene.shoot: uint64 received (N, 3) and escaped (3,)."""
        rng = np.random.default_rng([seed, *first_samples[:4]])
        landed = rng.multinomial(np.diff(first_rays.astype(np.int64)), self._shares[sides]).astype(np.uint64)
        received = landed.T @ ray_flux
        return received[:-1], received[-1]


def solve(solver, system, reflectance, emitted, limit, rays=1 << 20, seed=0):
    """The Solution of a given matrix: system (form factors, areas); reflectance and emitted (N,) or (N, 3)."""
    matrix, areas = system
    reflectance, emitted = (
        np.broadcast_to(np.asarray(x, np.float64).reshape(-1, 1 if np.ndim(x) < 2 else 3), (len(areas), 3))
        for x in (reflectance, emitted)
    )
    if solver == "direct":
        return solve_direct(matrix, reflectance, emitted, areas)
    if solver == "conjugate-gradient":
        return solve_conjugate_gradient(exchange_of(matrix.copy(), areas), reflectance, emitted, areas, limit)
    if solver == "progressive":
        return solve_progressive(Rows(matrix), reflectance, emitted, areas, limit)
    return solve_stochastic(RaysByChance(matrix), reflectance, emitted, areas, rays, limit, seed)


def l_room():
    """A closed room with an L for a floor, 2 x 2 m less a quarter, 1 m high, seen from within."""
    outline = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    points = [(x, y, z) for z in (0.0, 1.0) for x, y in outline]
    walls = [(k + 6, (k + 1) % 6 + 6, (k + 1) % 6, k) for k in range(6)]
    floor = [(0, 1, 2, 3), (0, 3, 4, 5)]
    ceiling = [tuple(6 + k for k in reversed(face)) for face in floor]
    return scene_of([Part(np.array(points), [*walls, *floor, *ceiling], name="L")])


def sphere_of_5000():
    """A closed mesh of 5040 triangles, seen from within by their backs."""
    return scene_of([sphere((0, 0, 0), 1.0, rings=36, segments=72)])


def sampled(scene, size, rays, side=0):
    """Form factors of a closed scene's inner sides, repaired, float64 (P, P), and areas [m^2]."""
    with kernel_of(scene, 2) as kernel:
        patches = subdivide(scene, kernel, size, 100_000, 0)
        inner = np.arange(side, kernel.side_count, 2)
        parts = [
            kernel.form_factors_monte_carlo(inner[k : k + 512], rays, 0)[:, side::2]
            for k in range(0, len(inner), 512)
        ]  # fmt: skip
    return exchange_of(np.concatenate(parts), patches.areas, is_closed=True).form_factors(patches.areas), patches.areas


def closed_room(name):
    """One of the closed scenes by name, with a patch size [m] of some hundred patches."""
    return {"cube": (closed_box(), 0.2), "L": (l_room(), 0.25)}[name]
