"""The finished lightmap: receivers' irradiance as an image whose gaps are filled."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .gaps import fill_gaps
from .scene import exitance_from_radiance, radiance_from_exitance


@dataclass(frozen=True, slots=True)
class Lightmap:
    """What a bake stores.

    Attributes
    ----------
    pixels : float32 (H, W, 3) E / pi, linear Rec.709; row 0 is at v = 0
    uvs : float32 (T, 3, 2) in 0..1; NaN on triangles without a place
    rects : (scale_u, scale_v, offset_u, offset_v) of the objects that share a mesh, by name: ``uvs`` are what they make
        of the mesh's own, which lie in 0..1, too
    """

    pixels: np.ndarray
    uvs: np.ndarray
    rects: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)


def assemble(irradiance: np.ndarray, cells: np.ndarray, uvs: np.ndarray, rects=None) -> Lightmap:
    """The lightmap of receivers' irradiance (N, 3) [W/m^2]; no texel stays empty, so that mipmaps see no black.

    ``cells`` int32 (H, W) is the receiver that each texel is, -1 for none, ``uvs`` the corners' in texels (T, 3, 2),
    ``rects`` those of Charts.
    """
    height, width = cells.shape
    pixels, is_set = np.zeros((height, width, 3), np.float32), cells >= 0
    pixels[is_set] = radiance_from_exitance(irradiance)[cells[is_set]]
    fill_gaps(pixels, is_set)
    size = (width, height)
    rects = {name: tuple(np.divide(rect, size + size).tolist()) for name, rect in (rects or {}).items()}
    return Lightmap(pixels, uvs / np.float32(size), rects)


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
