"""Form factors between surfaces by a named method: analytic, hemicube, Monte Carlo; one interface, errors stated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .analytic import Surface, element_form_factor, exchange_matrix, surface_exchange
from .bodies import Body, body_exchanges
from .kernel import KernelScene
from .patches import subdivide
from .polygon import polygon_area
from .quadrature import fan
from .scene import Material, Scene, SceneObject
from .transport import REPLICATES, Estimate, HemicubeFormFactors, MonteCarloFormFactors, estimate, replicated
from .workers import Workers

PANEL_ERROR = 1e-3  # relative, of flat panels for curved bodies: falls with the square of their size
METHODS = ("analytic", "hemicube", "monte-carlo")


class AnalyticEstimator:
    """Float64, deterministic; the error it states is what the integration allows itself."""

    name = "analytic"
    setting = "contour integral to 1e-9, hidden parts to 1e-7 of the pair"

    def factor(self, emitter: Surface, target: Surface, blockers=()) -> Estimate:
        """F from emitter to target among blockers."""
        return _certain(surface_exchange(emitter, target, blockers) / emitter.area)

    def element(self, point, normal, target: Surface, blockers=()) -> Estimate:
        """F from an element (3,), (3,) to target among blockers."""
        return _certain(element_form_factor(point, normal, target, blockers))

    def matrix(self, surfaces, blockers=()) -> Estimate:
        """F of all pairs, float64 (N, N)."""
        areas = np.array([s.area for s in surfaces])
        return _certain(exchange_matrix(surfaces, blockers) / areas[:, None])

    def body_matrix(self, bodies: list[Body]) -> Estimate:
        """F of all pairs of bodies of revolution between which nothing stands, float64 (N, N)."""
        areas = np.array([body.area for body in bodies])
        return _certain(body_exchanges(bodies) / areas[:, None], PANEL_ERROR)


def _certain(value, relative=1e-7):
    value = np.asarray(value, np.float64)
    return Estimate(value, np.zeros_like(value), relative * np.abs(value))


@dataclass(frozen=True, slots=True)
class SampledEstimator:
    """By the kernel's rays, in independent replicates, with more rays until the error is small enough.

    Attributes
    ----------
    name : "hemicube" or "monte-carlo"
    workers : threads
    wanted : bound of the error at which it stops
    ray_limit : rays of one factor, all replicates together
    resolution : pixels along a hemicube's top face
    seed : int
    """

    name: str
    workers: Workers
    wanted: float = 1e-4
    ray_limit: int = 1 << 25
    resolution: int = 64
    seed: int = 0

    @property
    def setting(self) -> str:
        """What is the same for every case, in words."""
        how = f"hemicubes of {self.resolution}^2 at several positions, " if self.name == "hemicube" else ""
        return f"{how}{REPLICATES} replicates, up to 2^{self.ray_limit.bit_length() - 1} rays, until {self.wanted:g}"

    def factor(self, emitter: Surface, target: Surface, blockers=()) -> Estimate:
        """F from emitter to target among blockers; from the smaller of the two, by reciprocity."""
        share = 1.0
        if target.area < emitter.area:
            share = target.area / emitter.area
            emitter, target = target, emitter
        found = self._rows([emitter, target, *blockers], [0])
        pick = [part[0, 1] * share for part in (found.value, found.standard_error, found.bound)]
        return Estimate(*(np.asarray(part) for part in pick))

    def element(self, point, normal, target: Surface, blockers=()) -> Estimate:
        """F from an element to target among blockers: a triangle so small that F changes by some 1e-5 across it."""
        nearest = min(np.linalg.norm(piece - point, axis=1).min() for piece in target.pieces)
        return self.factor(Surface("dA", (_triangle_at(point, normal, 3e-3 * nearest),)), target, blockers)

    def matrix(self, surfaces, blockers=()) -> Estimate:
        """F of all pairs, float64 (N, N); what is much smaller than the emitter by reciprocity from its own side."""
        found = self._rows([*surfaces, *blockers], range(len(surfaces)))
        areas = np.array([s.area for s in surfaces])
        parts = [part[:, : len(surfaces)] for part in (found.value, found.standard_error, found.bound)]
        is_small = areas[None, :] < areas[:, None] / 16
        other_way = [part.T * areas[None, :] / areas[:, None] for part in parts]
        return Estimate(*(np.where(is_small, there, here) for here, there in zip(parts, other_way)))

    def body_matrix(self, bodies: list[Body]) -> Estimate:
        """F of all pairs of bodies, float64 (N, N)."""
        return self.matrix([body.surface() for body in bodies])

    def _rows(self, surfaces, emitters) -> Estimate:
        """Rows of F from each of the emitters (indices) to all surfaces, float64 (E, N)."""
        scene, owner = _scene_of(surfaces)
        kernel = KernelScene(scene, self.workers)
        patches = subdivide(scene, kernel, 1e30, 8 * len(scene.triangles), 0)
        owners = owner[patches.triangles]
        member = (owners[:, None] == np.arange(len(surfaces))).astype(np.float64)
        found = [self._row(kernel, patches.areas, owners == k, member) for k in emitters]
        return Estimate(*(np.stack([getattr(f, part) for f in found]) for part in Estimate.__slots__))

    def _row(self, kernel, areas, is_emitter, member) -> Estimate:
        """One surface's row, float64 (N,): the mean over its patches, refined until the bound is as wanted."""
        sides = 2 * np.flatnonzero(is_emitter)
        weights = areas[is_emitter] / areas[is_emitter].sum()

        def reduce(rows):
            return weights @ (rows[:, ::2].astype(np.float64) @ member)

        spent, done = max(1, (1 << 18) // (REPLICATES * len(sides))), []
        while True:
            estimator = self._estimator(kernel, 1 << (spent - 1).bit_length())
            rays = REPLICATES * len(sides) * estimator.rays_per_row
            done = replicated(estimator, sides, reduce, first=1000 * len(done))
            # midpoints of pixels: the relative error of an even rule
            bias = 1 / self.resolution**2 if self.name == "hemicube" else 0.0
            found = estimate(done, rays, bias)
            if found.bound.max() <= self.wanted or 4 * rays > self.ray_limit:
                return found
            spent *= 4

    def _estimator(self, kernel, rays):
        if self.name == "hemicube":
            positions = max(1, rays // (3 * self.resolution**2))
            return HemicubeFormFactors(kernel, self.resolution, positions, self.seed)
        return MonteCarloFormFactors(kernel, rays, self.seed)


def _triangle_at(point, normal, size):
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(helper, normal)
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    turns = 2 * np.pi * np.arange(3) / 3
    return point + size * (np.cos(turns)[:, None] * u + np.sin(turns)[:, None] * v)


def _scene_of(surfaces):
    """The surfaces as a scene of triangles, and which surface each triangle is of, int64 (T,)."""
    triangles, owners = [], []
    for k, one in enumerate(surfaces):
        for piece in one.pieces:
            parts = fan(piece)
            parts = parts[[polygon_area(part) > 0 for part in parts]]
            triangles.append(parts)
            owners += [k] * len(parts)
    corners = np.concatenate(triangles)
    count = len(corners)
    scene = Scene(
        vertices=corners.reshape(-1, 3),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        corner_normals=np.zeros((count, 3, 3), np.float32),
        uvs=np.zeros((count, 3, 2), np.float32),
        triangle_materials=np.zeros(count, np.int32),
        objects=(SceneObject("surfaces", 0, count),),
        materials=(Material("black"),),
    )
    return scene, np.array(owners)


def make_estimator(method: str, workers: Workers, seed: int = 0):
    """The estimator that ``method`` names."""
    return AnalyticEstimator() if method == "analytic" else SampledEstimator(method, workers, seed=seed)
