"""Probes: points where light is measured anew, with many more rays, to know how wrong a result is.

Two kinds. Some of the values that are stored, of texels or vertices: what noise and smoothing leave there is what more
rays can mend. And random points of the surfaces, where the result is looked up as a viewer does: that is what an
artist sees, texel size and all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .lookup import bilinear
from .luminance import LUMINANCE
from .receivers import Receivers, surface_receivers
from .relative import scale_of
from .scene import Scene
from .triangles import triangle_areas
from .vertex_graph import VertexGraph

LEAST_PROBES, MOST_PROBES = 512, 2048
PROBE_OF = 64  # values that one stands for, between these: measuring is not to take longer than baking
MOST_OF_OBJECT = 0.25  # of the seen points that lie on one object: a ground plane must not take all


@dataclass(frozen=True, slots=True)
class SeenPoints:
    """Random points of the target surfaces, and what a viewer finds there.

    Attributes
    ----------
    receivers : (M,) the points
    look_up : irradiance of all receivers of a bake (N, 3) -> what the stored result shows at the points (M, 3)
    """

    receivers: Receivers
    look_up: Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, slots=True)
class Measured:
    """Light at probes, measured.

    Attributes
    ----------
    luminance, variance : (M,) of the irradiance, and of that estimate [W/m^2], squared
    rays : traced
    """

    luminance: np.ndarray
    variance: np.ndarray
    rays: int

    def merged(self, starts, shares) -> Measured:
        """Of runs of probes that begin at ``starts`` (K,), their means by shares (M,): (K,)."""
        luminance = np.add.reduceat(shares * self.luminance, starts)
        return Measured(luminance, np.add.reduceat(shares**2 * self.variance, starts), self.rays)

    def squares_of(self, values, scale):
        """Squared relative errors (M,) of irradiance (M, 3), without what the probes are uncertain by themselves."""
        # one wrong point counts as one, however wrong
        squares = np.minimum(((values @ LUMINANCE - self.luminance) / scale) ** 2, 1.0)
        return squares - np.minimum(np.sqrt(self.variance) / scale, 1.0) ** 2


@dataclass(frozen=True, slots=True)
class Probes:
    """Some of the values that are stored, measured.

    Attributes
    ----------
    receivers : (K,) one receiver of each
    weights : (K,) of their squared errors
    shares : (K,) of these, what is the one receiver's weight: 1 where each value has one
    measured : what light they have
    """

    receivers: np.ndarray
    weights: np.ndarray
    shares: np.ndarray
    measured: Measured

    def squares_of(self, values):
        """Squared relative errors (K,) of all receivers' irradiance (N, 3), weighted."""
        scale = scale_of(values)[self.receivers]
        return self.weights * self.measured.squares_of(values[self.receivers], scale)


def rms_of(squares) -> float:
    """Root of the mean of squared errors, of which some may be below 0 by noise; 0 of none.

    Never below what that mean itself may be off by: probes that are less sure than that cannot say there is none.
    """
    if not len(squares):
        return 0.0
    return float(np.sqrt(max(squares.mean(), squares.std() / len(squares) ** 0.5)))


def probe_count(values: int) -> int:
    """How many points are measured in a bake of so many values."""
    return min(max(values // PROBE_OF, LEAST_PROBES), MOST_PROBES)


def chosen_values(count: int):
    """Values that are measured, evenly through ``count`` of them: uint32 (K,)."""
    return np.unique(np.linspace(0, count - 1, min(probe_count(count), count)).round().astype(np.uint32))


def seen_through_lightmap(scene: Scene, cells: np.ndarray, uvs: np.ndarray, seed: int) -> SeenPoints:
    """Points that are looked up in a lightmap bilinearly, as a viewer does.

    ``cells`` int32 (H, W) is the receiver that each texel is, -1 for none, ``uvs`` the corners' in texels (T, 3, 2).
    """
    is_laid_out = np.isfinite(uvs).all(axis=(1, 2))
    count = probe_count(np.count_nonzero(cells >= 0))
    triangles, barycentrics = _random_points(scene, is_laid_out, count, seed)
    texels, shares = bilinear(cells, np.einsum("nk,nkc->nc", barycentrics, uvs[triangles].astype(np.float64)))
    receivers = surface_receivers(scene, triangles, barycentrics)
    return SeenPoints(receivers, lambda values: np.einsum("nk,nkc->nc", shares, values[texels]))


def seen_through_corners(scene: Scene, graph: VertexGraph, seed: int) -> SeenPoints:
    """Points between whose triangle's corners colours are interpolated."""
    is_coloured = np.zeros(len(scene.triangles), bool)
    is_coloured[graph.triangles] = True
    triangles, barycentrics = _random_points(scene, is_coloured, probe_count(graph.value_count), seed)
    rows = np.searchsorted(graph.triangles, triangles)
    receivers = surface_receivers(scene, triangles, barycentrics)
    return SeenPoints(
        receivers, lambda values: np.einsum("nk,nkc->nc", barycentrics, graph.corner_values(values)[rows])
    )


def _random_points(scene, is_usable, count, seed):
    """Points by area on the usable triangles of the targets: triangles int32 (M,), barycentrics float64 (M, 3)."""
    rng = np.random.default_rng([seed, 0x5EE4])
    areas = triangle_areas(scene.corners)
    areas[~is_usable] = 0.0
    total = areas.sum()
    for obj in scene.objects:
        share = areas[obj.span].sum() / max(total, 1e-300)
        if share > MOST_OF_OBJECT:
            areas[obj.span] *= MOST_OF_OBJECT / share
    if not areas.any():
        return np.zeros(0, np.int32), np.zeros((0, 3))
    triangles = rng.choice(len(areas), count, p=areas / areas.sum()).astype(np.int32)
    root, across = np.sqrt(rng.random(count)), rng.random(count)
    return triangles, np.stack([1 - root, root * (1 - across), root * across], axis=1)
