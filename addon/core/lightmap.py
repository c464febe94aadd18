"""The finished lightmap: receivers' irradiance as an image whose gaps are filled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .charts import Charts
from .scene import exitance_from_radiance, radiance_from_exitance
from .texels import TexelMap

RINGS = 2  # around the charts that are filled by the mean of their neighbours; the rest coarse to fine


@dataclass(frozen=True, slots=True)
class Lightmap:
    """What a bake stores.

    Attributes
    ----------
    pixels : float32 (H, W, 3) E / pi, linear Rec.709; row 0 is at v = 0
    uvs : float32 (T, 3, 2) in 0..1; NaN on triangles without a place
    """

    pixels: np.ndarray
    uvs: np.ndarray


def assemble(irradiance: np.ndarray, texel_map: TexelMap, charts: Charts) -> Lightmap:
    """The lightmap of receivers' irradiance (N, 3) [W/m^2]; no texel stays empty, so that mipmaps see no black."""
    pixels = np.zeros((charts.height, charts.width, 3), np.float32)
    pixels[texel_map.rows, texel_map.columns] = radiance_from_exitance(irradiance)
    is_set = np.zeros(pixels.shape[:2], bool)
    is_set[texel_map.rows, texel_map.columns] = True
    for _ in range(RINGS):
        is_set = _dilate(pixels, is_set)
    _fill(pixels, is_set)
    return Lightmap(pixels, charts.uvs / np.float32([charts.width, charts.height]))


def look_up(lightmap: Lightmap, triangles, barycentrics):
    """Irradiance (N, 3) [W/m^2] that a viewer finds at points of triangles (N,), by barycentrics (N, 3)."""
    uvs = np.einsum("nk,nkc->nc", barycentrics, lightmap.uvs[triangles])
    return exitance_from_radiance(bilinear(lightmap.pixels, uvs))


def bilinear(pixels, uvs):
    """An image's values (N, C) at UVs (N, 2), between the middles of its pixels; clamped at its border."""
    height, width = pixels.shape[:2]
    places = np.clip(uvs * (width, height) - 0.5, 0, (width - 1, height - 1))
    low = np.minimum(places.astype(np.int64), np.maximum((width - 2, height - 2), 0))
    (x, y), (right, up) = (places - low).T[:, :, None], np.minimum(low + 1, (width - 1, height - 1)).T
    left, down = low.T
    below = (1 - x) * pixels[down, left] + x * pixels[down, right]
    return (1 - y) * below + y * ((1 - x) * pixels[up, left] + x * pixels[up, right])


def _dilate(pixels, is_set):
    """Set empty texels beside set ones to the mean of these, of eight neighbours; what is set now."""
    height, width = is_set.shape
    padded = np.pad(is_set, 1)
    near = np.zeros_like(is_set)
    for row, column in NEIGHBOURS:
        near |= padded[row : row + height, column : column + width]
    rows, columns = np.nonzero(near & ~is_set)
    sums, counts = np.zeros((len(rows), 3)), np.zeros(len(rows))
    for row, column in NEIGHBOURS:
        counted = padded[rows + row, columns + column]
        beside = np.clip(rows + row - 1, 0, height - 1), np.clip(columns + column - 1, 0, width - 1)
        sums += np.where(counted[:, None], pixels[beside], 0.0)
        counts += counted
    pixels[rows, columns] = sums / counts[:, None]
    is_set = is_set.copy()
    is_set[rows, columns] = True
    return is_set


NEIGHBOURS = tuple((row, column) for row in range(3) for column in range(3) if (row, column) != (1, 1))


def _fill(pixels, is_set):
    """Push-pull: the mean of what is set at half the size fills what is not, from coarse to fine; in place."""
    if is_set.all() or not is_set.any():
        return
    height, width = is_set.shape
    edge = ((0, height % 2), (0, width % 2))
    weights = np.pad(is_set, edge).astype(np.float32)
    sums = _halved(np.pad(pixels, (*edge, (0, 0))) * weights[..., None])
    counts = _halved(weights)
    coarse = sums / np.maximum(counts, 1)[..., None]
    _fill(coarse, counts > 0)
    rows, columns = np.nonzero(~is_set)
    pixels[rows, columns] = coarse[rows // 2, columns // 2]


def _halved(image):
    """Sums over 2 x 2 texels."""
    return image[::2, ::2] + image[1::2, ::2] + image[::2, 1::2] + image[1::2, 1::2]
