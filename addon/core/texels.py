"""Which texels of a lightmap are receivers, and of which point of the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import kernel
from .charts import Charts
from .z_order import z_order


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


def texels(charts: Charts) -> TexelMap:
    """The receivers of a lightmap: inside wins over outside, then near over far, then the lower triangle."""
    triangles, distances, barycentrics = kernel.rasterise_texels(charts.uvs, charts.width, charts.height)
    rows, columns = np.nonzero(triangles >= 0)
    order = np.argsort(z_order(columns, rows))
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
