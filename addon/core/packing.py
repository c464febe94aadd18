"""Pack flat charts into one atlas: at a given density, or as dense as a number of texels allows.

The kernel's packer and not xatlas's: it places outlines by the very rule that makes texels receivers, so no texel can
serve two charts, does not stretch small charts to whole texels, and gets 1.2 to 1.4 times the surface into an atlas
of small charts (measured on furnished rooms).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from . import kernel
from .charts import Charts, FlatCharts
from .settings import BakeSettings, SettingsError

CHART_START = 0.504  # PL_CHART_START of the kernel: where a chart starts in its first texel
CHART_MARGIN = 3  # texels that a chart takes beyond its size, with its gutter
MOST_TEXELS = 1 << 28
MOST_BLOCKS = 2048  # across the atlas; wider ones are packed in blocks of several texels
FULL_ENOUGH = 0.985  # of the texels asked for
ATTEMPTS = 8
WIDTHS = (0.71, 0.84, 1.19, 1.41)  # other widths than the square's, where large charts leave gaps
FINE_WIDTHS = tuple(0.6 + 0.05 * step for step in range(21))
FEW_CHARTS = 300  # in an atlas of single texels: so quickly packed that all of these are tried
LARGE_CHART = 0.2  # of the width


@dataclass(frozen=True, slots=True)
class Packing:
    """One try: places int32 (C, 3) in blocks (column, row, is turned), at a density [texels/m]."""

    places: np.ndarray
    density: float
    width: int
    height: int
    block: int

    @property
    def texels(self) -> int:
        return self.width * self.height


def pack(flat: FlatCharts, triangle_count: int, settings: BakeSettings) -> Charts:
    """The atlas of the charts, at most ``settings.texels`` texels, or of ``settings.density``."""
    if settings.density is not None:
        packing = _pack_at_density(flat, settings.density)
    else:
        packing = _pack_into(flat, settings.texels)
    return _charts(flat, triangle_count, packing)


def _pack_at_density(flat, density):
    area = _area(flat) * density**2
    if area <= MOST_TEXELS:
        width = math.ceil(math.sqrt(np.prod(flat.sizes * density + CHART_MARGIN, axis=1).sum()))
        packing = _pack_once(flat, density, min(width, 1 << 15))
        area = packing.texels
    if area > MOST_TEXELS:
        raise SettingsError(
            f"density is {density:g} texels/m: the lightmap would have {area:.3g} texels, allowed are {MOST_TEXELS}"
        )
    return packing


def _pack_into(flat, texels):
    """As dense as it fits; the width of the square first, others where large charts make it matter."""
    width = math.isqrt(texels)
    best = _densest(flat, texels, width, math.sqrt(0.7 * texels / _area(flat)))
    if flat.sizes.max() * best.density < LARGE_CHART * width:
        return best
    if flat.chart_count <= FEW_CHARTS and width <= MOST_BLOCKS:
        others = [_densest(flat, texels, round(width * factor), best.density) for factor in FINE_WIDTHS]
        return max([best, *others], key=lambda packing: packing.density)
    others = [_pack_once(flat, best.density, round(width * factor)) for factor in WIDTHS]
    smallest = min(others, key=lambda packing: packing.texels)
    if smallest.texels >= best.texels:
        return best
    density = best.density * math.sqrt(texels / smallest.texels)
    return max(best, _densest(flat, texels, smallest.width, density), key=lambda packing: packing.density)


def _densest(flat, texels, width, density):
    """The densest packing found in a few tries: what a density takes is known by trying only."""
    best, tries = None, []
    for _ in range(ATTEMPTS):
        # no chart is longer than all texels in a row, however thin
        tried = _pack_once(flat, min(density, texels / flat.sizes.max()), width)
        tries.append(tried)
        if tried.texels <= texels and (best is None or tried.density > best.density):
            best = tried
        if FULL_ENOUGH * texels <= tried.texels <= texels:
            return tried
        density = _next_density(tries, texels)
    return best or _loosest(flat, texels, width, min(tried.density for tried in tries))


def _next_density(tries, texels):
    """Texels grow as a power of density, of 2 for large charts, of less for small ones with their gutters."""
    power = 2.0
    last = tries[-1]
    if len(tries) > 1 and tries[-2].density != last.density and tries[-2].texels != last.texels:
        power = math.log(tries[-2].texels / last.texels) / math.log(tries[-2].density / last.density)
        power = min(max(power, 0.5), 3.0)
    return last.density * (0.995 * texels / last.texels) ** (1 / power)


def _loosest(flat, texels, width, density):
    """Go down until it fits; where even specks do not fit there are too many charts."""
    for _ in range(24):
        density *= 0.8
        tried = _pack_once(flat, density, width)
        if tried.texels <= texels:
            return tried
    raise SettingsError(
        f"texels is {texels}: {flat.chart_count} charts of the target objects need at least {tried.texels}"
    )


def _pack_once(flat, density, width):
    longest = flat.sizes.max() * density + CHART_MARGIN
    width = max(width, min(math.ceil(longest), MOST_TEXELS))
    block = -(-width // MOST_BLOCKS)
    width = width // block * block if width % block == 0 else (width // block + 1) * block
    places, height = kernel.pack_charts(flat.uvs, flat.first_triangles, density, width, block)
    return Packing(places, density, width, height, block)


def _charts(flat, triangle_count, packing):
    places = packing.places[flat.chart_of_row]
    uvs = flat.uvs * packing.density
    uvs = np.where(places[:, 2, None, None] == 1, uvs[..., ::-1], uvs)
    uvs += places[:, None, :2] * packing.block + CHART_START
    out = np.full((triangle_count, 3, 2), np.nan, np.float32)
    charts = np.full(triangle_count, -1, np.int32)
    out[flat.triangles] = uvs
    charts[flat.triangles] = flat.chart_of_row
    return Charts(out, charts, packing.width, packing.height)


def _area(flat):
    """Of the flat charts [m^2]."""
    a, b = flat.uvs[:, 1] - flat.uvs[:, 0], flat.uvs[:, 2] - flat.uvs[:, 0]
    return np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2
