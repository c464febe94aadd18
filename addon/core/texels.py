"""Which texels of a lightmap are receivers, and of which point of the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import kernel
from .charts import Charts
from .z_order import z_order

INSET = 0.25  # texels inside a chart's edge, for texels whose centres are outside; half-way where a triangle is thinner
LEAST_SHOWN = 1 / 32  # texels, of which only corners of charts are looked up: noise there matters little, not nothing


@dataclass(frozen=True, slots=True)
class TexelMap:
    """Receivers, along a Z-shaped curve through the lightmap: those that follow each other are near on the surface.

    A texel is a receiver where the square over which bilinear lookup spreads it meets a chart; it stands for its own
    centre, or where that is outside, for a point a little inside the chart's nearest edge: right on it there often
    stands a wall, and light or shadow beside that would spread over half a texel.

    Attributes
    ----------
    rows, columns : int32 (N,) of the texels; row 0 is at v = 0
    triangles : int32 (N,) the scene's triangle that the receiver is on
    barycentrics : float32 (N, 3) where on it
    distances : float32 (N,) from the texel's centre to the chart, 0 inside [texels]
    width, height : of the lightmap [texels]
    """

    rows: np.ndarray
    columns: np.ndarray
    triangles: np.ndarray
    barycentrics: np.ndarray
    distances: np.ndarray
    width: int
    height: int

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def cells(self):
        """Which receiver each texel is, -1 for none: int32 (height, width)."""
        cells = np.full((self.height, self.width), -1, np.int32)
        cells[self.rows, self.columns] = np.arange(len(self))
        return cells

    @property
    def is_inside(self):
        """Whether texels' centres are inside the chart: bool (N,)."""
        return self.distances == 0

    @property
    def shown(self):
        """How much of the surface is looked up in each texel, of a mean of 1: float32 (N,).

        Bilinear lookup spreads a texel over a hat of area 1, of which a straight edge at a distance d from its centre
        leaves (1 - d)^2 / 2. The rim of a chart is a tenth of the texels and a fiftieth of what is seen; it lies in
        corners and contacts, where light costs most rays.
        """
        rim = np.maximum(0.5 * np.maximum(1 - self.distances, 0) ** 2, LEAST_SHOWN)
        areas = np.where(self.is_inside, 1, rim).astype(np.float32)
        return areas / areas.mean() if len(areas) else areas


def texels(charts: Charts) -> TexelMap:
    """The receivers of a lightmap: inside wins over outside, then near over far, then the lower triangle."""
    triangles, distances, barycentrics = kernel.rasterise_texels(charts.uvs, charts.width, charts.height)
    rows, columns = np.nonzero(triangles >= 0)
    order = np.argsort(z_order(columns, rows))
    rows, columns = rows[order], columns[order]
    triangles, weights, distances = triangles[rows, columns], barycentrics[rows, columns], distances[rows, columns]
    outside = np.flatnonzero(distances)
    centres = np.stack([columns, rows], axis=1)[outside] + 0.5
    weights[outside] = further_in(charts.uvs[triangles[outside]].astype(np.float64), centres, weights[outside])
    return TexelMap(
        rows.astype(np.int32), columns.astype(np.int32), triangles, weights, distances, charts.width, charts.height
    )


def further_in(corners, centres, weights):
    """Barycentrics (K, 3) of the points INSET further into triangles (K, 3, 2) than those nearest to ``centres``."""
    points = np.einsum("nk,nkc->nc", weights, corners)
    ahead = points - centres  # float32 may have rounded it to nothing
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-30)
    inwards = _change_of_weights(corners, ahead)
    # from a corner the way ahead may lead out again: then towards the middle
    length = _way_out(weights, inwards)
    middle = corners.mean(axis=1) - points
    far = np.maximum(np.linalg.norm(middle, axis=1), 1e-30)
    to_middle = (1 / 3 - weights) / far[:, None]
    leads_out = length < 1e-3
    inwards = np.where(leads_out[:, None], to_middle, inwards)
    length = np.where(leads_out, 2 * far, length)
    return (weights + np.minimum(INSET, length / 2)[:, None] * inwards).astype(np.float32)


def _change_of_weights(corners, direction):
    """What barycentrics (K, 3) of triangles (K, 3, 2) change by, a texel along directions (K, 2); 0 without an area."""
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    turned = opposite[..., 0] * direction[:, None, 1] - opposite[..., 1] * direction[:, None, 0]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])[:, None]
    return np.where(np.abs(area) > 1e-12, turned / np.where(area == 0, 1, area), 0.0)


def _way_out(weights, change):
    """How far (K,) it goes on inside, at least; 0 where it goes nowhere."""
    steps = np.where(change < -1e-12, weights / np.maximum(-change, 1e-12), np.inf).min(axis=1)
    return np.where(np.isfinite(steps), steps, 0.0)
