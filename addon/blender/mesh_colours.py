"""Colours that lie in a mesh, as a texture: an image of all colours, and each triangle's place in it.

So what nodes make of them is made of the image, texel by texel, as of any other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.scene import Texture

LEVELS = 64  # of a channel, evenly in the square root of its light: 3 % apart where it is bright
WIDTH, HEIGHT = 512, LEVELS**3 // 512  # as large as nodes leave an image


@dataclass(frozen=True, slots=True)
class MeshColours:
    """In place of UVs: the palette's texel of each triangle's mean colour, by an attribute ("" = the render one), or of
    the grey that its alpha is."""

    attribute: str
    is_alpha: bool = False
    extends: bool = False  # no place is beyond the palette's edges

    def uvs_of(self, mesh, chosen, instance) -> np.ndarray:
        """UVs of chosen triangles (K,) of read_mesh.MeshArrays, float32 (K, 3, 2)."""
        return palette_uvs(mesh.colours[self.attribute, self.is_alpha][chosen])


def palette() -> Texture:
    """All colours."""
    rank = np.arange(LEVELS**3)
    levels = np.stack([rank // LEVELS**2, rank // LEVELS % LEVELS, rank % LEVELS], axis=1)
    return Texture("colours of the mesh", ((levels / (LEVELS - 1)) ** 2).astype(np.float32).reshape(HEIGHT, WIDTH, 3))


def palette_uvs(colours) -> np.ndarray:
    """The middle of the texel next to each colour (T, 3), float32 (T, 3, 2), the same at all corners."""
    levels = np.rint(np.sqrt(np.clip(colours, 0, 1)) * (LEVELS - 1)).astype(np.int64)
    rank = levels @ (LEVELS**2, LEVELS, 1)
    uvs = (np.stack([rank % WIDTH, rank // WIDTH], axis=1) + 0.5) / (WIDTH, HEIGHT)
    return np.repeat(uvs[:, None].astype(np.float32), 3, axis=1)
