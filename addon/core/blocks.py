"""The layout that objects share as a block of texels, of which the atlas takes one for each of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from . import kernel
from .charts import FlatCharts
from .copies import Layout

CHART_START = 0.504  # PL_CHART_START of the kernel: where a chart starts in its first texel
CHART_MARGIN = 3  # texels that a chart takes beyond its size, with its gutter
MOST_STEPS = 2048  # across an atlas; a wider one is packed in steps of several texels
WIDTHS = (0.71, 0.84, 1.0, 1.19, 1.41)  # of the square's
MOST_HALVINGS = 12
ROUNDING = 1e-6
LONG = 0.1  # of its texels does a block cost more for each e times that it is longer than wide
LEAST_GROWTH = 1.5  # that leaves a free texel between charts 2 apart, wherever the texels' middles fall


@dataclass(frozen=True, slots=True)
class Block:
    """A layout at a density.

    Attributes
    ----------
    uvs : float64 (N, 3, 2) corners of the layout's triangles, from (0, 0) [texels of the smallest object's block]
    size : float64 (2,) the smallest block's [texels]
    scales : float64 (K, 2) how much larger each object's block is along u and v: 1, or so much that a free texel stays
        between its charts
    """

    uvs: np.ndarray
    size: np.ndarray
    scales: np.ndarray

    @property
    def sizes(self) -> np.ndarray:
        """The objects' blocks, float64 (K, 2) [texels]."""
        return self.size * self.scales


def pack_block(layout: Layout, density: float) -> Block:
    """The layout's charts in one rectangle, at ``density`` [texels/m] for the objects that need most."""
    flat, share = layout.flat, _least_share(layout, density)
    sides = flat.sizes * (density * share) + CHART_MARGIN
    square = math.sqrt(sides.prod(axis=1).sum())
    tries = (_packed(flat, density * share, math.ceil(max(square * width, sides.max()))) for width in WIDTHS)
    uvs = min(tries, key=lambda uvs: _cost(*_extent(uvs)))
    return Block(uvs, _extent(uvs), _scales(layout, share))


def _cost(width, height):
    """Texels of a block, and more for a long one: a few of these leave an atlas empty."""
    return width * height * (1 + LONG * abs(math.log(max(width, 1) / max(height, 1))))


def _scales(layout, share):
    scales = layout.factors / share
    return np.where(scales < 1 + ROUNDING, 1.0, np.maximum(scales, LEAST_GROWTH))


def _least_share(layout, density):
    """How much of the layout's full size the smallest block has.

    All objects' gutters grow with their blocks: as small as the smallest object needs would cost the large ones more
    than it saves, where the smallest has hardly a texel a chart.
    """

    sizes = layout.flat.sizes * density

    def texels(share):
        block = (sizes * share + CHART_MARGIN).prod(axis=1).sum()
        return block * _scales(layout, share).prod(axis=1).sum()

    return min((0.5**halvings for halvings in range(MOST_HALVINGS)), key=texels)


def _packed(flat: FlatCharts, density, width):
    places, _, _, step = pack_charts(flat, density, width)
    return placed(flat, density, places, step) - CHART_START


def pack_charts(flat: FlatCharts, density: float, width: int, upright: int = 0):
    """Charts in an atlas of about ``width`` texels, by the kernel's packer: places (C, 3), then width, height, and the
    step of the places [texels]."""
    step = -(-width // MOST_STEPS)
    width = -(-width // step) * step
    places, height = kernel.pack_charts(flat.uvs, flat.first_triangles, density, width, step, upright)
    return places, width, height, step


def placed(flat: FlatCharts, density: float, places: np.ndarray, step: int) -> np.ndarray:
    """Corners of charts (N, 3, 2) at the places that ``pack_charts`` gave them [texels]."""
    places = places[flat.chart_of_row]
    uvs = flat.uvs * density
    uvs = np.where(places[:, 2, None, None] == 1, uvs[..., ::-1], uvs)
    return uvs + (places[:, None, :2] * step + CHART_START)


def _extent(uvs):
    return uvs.max(axis=(0, 1))
