"""Which texels of a lightmap are receivers, and of which point of the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import kernel
from .charts import Charts
from .scene import Scene


@dataclass(frozen=True, slots=True)
class TexelMap:
    """Receivers, along a Z-shaped curve through the lightmap: those that follow each other are near on the surface.

    A texel is a receiver where the square over which bilinear lookup spreads it meets a chart; it stands for its own
    centre, or where that is outside, for the chart's nearest point.

    Attributes
    ----------
    rows, columns : int32 (N,) of the texels; row 0 is at v = 0
    triangles : int32 (N,) the scene's triangle that the receiver is on
    barycentrics : float32 (N, 3) where on it
    is_inside : bool (N,) the texel's centre is inside the chart
    width, height : of the lightmap [texels]
    """

    rows: np.ndarray
    columns: np.ndarray
    triangles: np.ndarray
    barycentrics: np.ndarray
    is_inside: np.ndarray
    width: int
    height: int

    def __len__(self) -> int:
        return len(self.rows)


def texels(scene: Scene, charts: Charts) -> TexelMap:
    """The receivers of a lightmap: inside wins over outside, then near over far, then the lower triangle."""
    triangles, distances, barycentrics = kernel.rasterise_texels(charts.uvs, charts.width, charts.height)
    rows, columns = np.nonzero(triangles >= 0)
    order = np.argsort(_spread_bits(rows) << np.uint64(1) | _spread_bits(columns))
    rows, columns = rows[order], columns[order]
    return TexelMap(
        rows.astype(np.int32),
        columns.astype(np.int32),
        triangles[rows, columns],
        barycentrics[rows, columns],
        distances[rows, columns] == 0,
        charts.width,
        charts.height,
    )


def _spread_bits(x):
    """The bits of x to every second place (Morton 1966)."""
    x = x.astype(np.uint64)
    for shift, mask in (
        (16, 0x0000FFFF0000FFFF),
        (8, 0x00FF00FF00FF00FF),
        (4, 0x0F0F0F0F0F0F0F0F),
        (2, 0x3333333333333333),
        (1, 0x5555555555555555),
    ):
        x = (x | x << np.uint64(shift)) & np.uint64(mask)
    return x
