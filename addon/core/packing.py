"""Pack flat charts into one atlas: at a given density, or as dense as a number of texels allows.

The kernel's packer and not xatlas's: it places outlines by the very rule that makes texels receivers, so no texel can
serve two charts, does not stretch small charts to whole texels, and gets 1.2 to 1.4 times the surface into an atlas
of small charts (measured on furnished rooms).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .blocks import CHART_MARGIN, CHART_START, MOST_STEPS, Block, pack_block, pack_charts, placed
from .charts import Charts, FlatCharts
from .copies import Layout
from .settings import BakeSettings, SettingsError
from .workers import Workers

MOST_TEXELS = 1 << 28
FULL_ENOUGH = 0.985  # of the texels asked for
ATTEMPTS = 8
WIDTHS = (0.71, 0.84, 1.19, 1.41)  # other widths than the square's, where large charts leave gaps
FINE_WIDTHS = tuple(0.6 + 0.05 * step for step in range(21))
FEW_CHARTS = 300  # in an atlas of single texels: so quickly packed that all of these are tried
LARGE_CHART = 0.2  # of the width
MUCH_SMALLER = 0.99  # is what another width takes where it is worth several tries more


@dataclass(frozen=True)
class Surface:
    """What is to be packed: charts of objects with a mesh of their own, and layouts that objects share."""

    flat: FlatCharts
    layouts: tuple[Layout, ...]

    @cached_property
    def area(self) -> float:
        """[m^2]"""
        return self.flat.areas.sum() + sum(
            (layout.flat.areas.sum() * layout.factors.prod(axis=1)).sum() for layout in self.layouts
        )

    @cached_property
    def longest(self) -> float:
        """Side of a chart [m]."""
        sides = [layout.flat.sizes.max() * layout.factors.max() for layout in self.layouts]
        return max([*sides, self.flat.sizes.max(initial=0.0)])

    @property
    def chart_count(self) -> int:
        return self.flat.chart_count + sum(layout.flat.chart_count * len(layout.objects) for layout in self.layouts)


@dataclass(frozen=True, slots=True)
class Packing:
    """One try, at a density [texels/m].

    ``places`` int32 in steps of so many texels (column, row, is turned): of the charts, then of each layout's objects,
    whose ``blocks`` say how large they are. ``longest`` is the longest side of all of these [texels].
    """

    density: float
    places: np.ndarray
    width: int
    height: int
    step: int
    longest: float
    blocks: tuple[Block, ...]

    @property
    def texels(self) -> int:
        return self.width * self.height


def pack(surface: Surface, triangle_count: int, settings: BakeSettings) -> Charts:
    """The atlas of the charts, at most ``settings.texels`` texels, or of ``settings.density``."""
    if settings.density is not None:
        packing = _pack_at_density(surface, settings.density)
    else:
        with Workers(settings.thread_count) as workers:
            packing = _pack_into(surface, settings.texels, workers)
    return _charts(surface, triangle_count, packing)


def _pack_at_density(surface, density):
    area = surface.area * density**2
    if area <= MOST_TEXELS:
        sides = _boxes(surface, density)[0].sizes * density + CHART_MARGIN
        width = math.ceil(math.sqrt(sides.prod(axis=1).sum()))
        packing = _pack_once(surface, density, min(width, 1 << 15))
        area = packing.texels
    if area > MOST_TEXELS:
        raise too_dense(density, area)
    return packing


def too_dense(density, texels) -> SettingsError:
    """The error for a density [texels/m] that would take so many texels."""
    return SettingsError(
        f"density is {density:g} texels/m: the lightmap would have {texels:.3g} texels, allowed are {MOST_TEXELS}"
    )


def _pack_into(surface, texels, workers):
    """As dense as it fits; the width of the square first, others where large charts make it matter."""
    width = math.isqrt(texels)
    best = _densest(surface, texels, width, math.sqrt(0.7 * texels / surface.area))
    if best.longest < LARGE_CHART * width:
        return best
    if surface.chart_count <= FEW_CHARTS and width <= MOST_STEPS:
        widths = [round(width * factor) for factor in FINE_WIDTHS]
        others = workers.each(widths, lambda other: _densest(surface, texels, other, best.density))
        return max([best, *others], key=lambda packing: packing.density)
    widths = [round(width * factor) for factor in WIDTHS]
    others = workers.each(widths, lambda other: _pack_once(surface, best.density, other))
    smallest = min(others, key=lambda packing: packing.texels)
    if smallest.texels > MUCH_SMALLER * best.texels:
        return best
    density = best.density * math.sqrt(texels / smallest.texels)
    return max(best, _densest(surface, texels, smallest.width, density), key=lambda packing: packing.density)


def _densest(surface, texels, width, density):
    """The densest packing found in a few tries: what a density takes is known by trying only."""
    best, tries = None, []
    for _ in range(ATTEMPTS):
        # no chart is longer than all texels in a row, however thin
        tried = _pack_once(surface, min(density, texels / surface.longest), width)
        tries.append(tried)
        if tried.texels <= texels and (best is None or tried.density > best.density):
            best = tried
        if FULL_ENOUGH * texels <= tried.texels <= texels:
            return tried
        density = _next_density(tries, texels)
    return best or _loosest(surface, texels, width, min(tried.density for tried in tries))


def _next_density(tries, texels):
    """Texels grow as a power of density, of 2 for large charts, of less for small ones with their gutters."""
    power = 2.0
    last = tries[-1]
    if len(tries) > 1 and tries[-2].density != last.density and tries[-2].texels != last.texels:
        power = math.log(tries[-2].texels / last.texels) / math.log(tries[-2].density / last.density)
        power = min(max(power, 0.5), 3.0)
    return last.density * (0.995 * texels / last.texels) ** (1 / power)


def _loosest(surface, texels, width, density):
    """Go down until it fits; where even specks do not fit there are too many charts."""
    for _ in range(24):
        density *= 0.8
        tried = _pack_once(surface, density, width)
        if tried.texels <= texels:
            return tried
    raise SettingsError(
        f"texels is {texels}: {surface.chart_count} charts of the target objects need at least {tried.texels}"
    )


def _pack_once(surface, density, width):
    boxes, blocks = _boxes(surface, density)
    longest = boxes.sizes.max() * density
    width = max(width, min(math.ceil(longest + CHART_MARGIN), MOST_TEXELS))
    # a rectangle of UVs (scale, offset) cannot turn what lies in it
    upright = boxes.chart_count - surface.flat.chart_count
    return Packing(density, *pack_charts(boxes, density, width, upright), longest, blocks)


def _boxes(surface, density):
    """The charts, and behind them a rectangle for each object of the layouts, which are packed by themselves."""
    if not surface.layouts:
        return surface.flat, ()
    blocks = tuple(pack_block(layout, density) for layout in surface.layouts)
    u, v = (np.concatenate([block.sizes for block in blocks]) / density).T
    zero = np.zeros_like(u)
    corners = np.stack([zero, zero, u, zero, u, v, zero, zero, u, v, zero, v], axis=1).reshape(-1, 3, 2)
    flat = surface.flat
    firsts = np.append(flat.first_triangles, len(flat.uvs) + 2 * np.arange(1, len(u) + 1)).astype(np.int32)
    triangles = np.append(flat.triangles, np.full(len(corners), -1))
    return FlatCharts(triangles, np.concatenate([flat.uvs, corners]), firsts), blocks


def _charts(surface, triangle_count, packing):
    flat = surface.flat
    uvs = np.full((triangle_count, 3, 2), np.nan, np.float32)
    charts = np.full(triangle_count, -1, np.int32)
    uvs[flat.triangles] = placed(flat, packing.density, packing.places[: flat.chart_count], packing.step)
    charts[flat.triangles] = flat.chart_of_row
    count, rects, offsets = flat.chart_count, {}, packing.places[flat.chart_count :, :2] * packing.step + CHART_START
    for layout, block in zip(surface.layouts, packing.blocks):
        own_offsets, offsets = np.split(offsets, [len(layout.objects)])
        for obj, scale, offset in zip(layout.objects, block.scales, own_offsets):
            own_uvs, own_charts = layout.spread(block.uvs, obj)
            uvs[obj.span] = own_uvs * scale + offset
            charts[obj.span] = np.where(own_charts >= 0, own_charts + count, -1)
            count += layout.flat.chart_count
            rects[obj.name] = (*np.maximum(block.size, 1e-9) * scale, *offset)
    return Charts(uvs, charts, packing.width, packing.height, rects)
