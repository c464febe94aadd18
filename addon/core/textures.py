"""Looking up textures, and what a material's textures come to over points of triangles."""

from __future__ import annotations

import numpy as np

from .scene import Scene, Texture

BLOCK = 1 << 16  # points that are looked up at once


def lookup(texture: Texture, uvs, extends=False):
    """Bilinear lookup at uvs (N, 2): float32 (N, 3). Row 0 of the pixels is at v = 0.

    Beyond 0 ... 1 the texture repeats, or ``extends``: goes on as at its edges.
    """
    height, width = texture.pixels.shape[:2]
    left_column, right_column, right = _texels_along(uvs[:, 0], width, extends)
    low_row, high_row, up = _texels_along(uvs[:, 1], height, extends)
    low = texture.pixels[low_row, left_column] * (1 - right) + texture.pixels[low_row, right_column] * right
    high = texture.pixels[high_row, left_column] * (1 - right) + texture.pixels[high_row, right_column] * right
    return (low * (1 - up) + high * up).astype(np.float32)


def _texels_along(coordinates, size, extends):
    """The two texels about coordinates (N,) along a side, and the share (N, 1) of the second."""
    coordinates = coordinates.astype(np.float64)
    places = (np.clip(coordinates, 0, 1) if extends else coordinates % 1.0) * size - 0.5
    first = np.floor(places).astype(np.int64)
    share = (places - first)[:, None]
    if extends:
        return np.clip(first, 0, size - 1), np.clip(first + 1, 0, size - 1), share
    return first % size, (first + 1) % size, share


def scattered_shares(scene: Scene, triangles, barycentrics):
    """Reflectance and translucence, no more than 1 together, at points of triangles: float32 (N, 3) each; the second is
    None where nothing is translucent."""
    reflectance = np.clip(textured_colours(scene, triangles, barycentrics, "reflectance"), 0, 1)
    if not any(material.is_translucent for material in scene.materials):
        return reflectance, None
    translucence = textured_colours(scene, triangles, barycentrics, "translucence")
    return reflectance, np.clip(translucence, 0, 1 - reflectance)


def textured_colours(scene: Scene, triangles, barycentrics, factor: str, of_back=False):
    """A material's ``factor``, as Material names it, times its texture, at points of triangles: float32 (N, 3).

    ``of_back``: of the back, as Back names it.
    """
    sides = [m.of_back if of_back else m for m in scene.materials]
    factors = np.array([getattr(side, factor) for side in sides], np.float32).reshape(-1, 3)
    materials = scene.triangle_materials[triangles]
    colours = factors[materials]
    for index, material in enumerate(scene.materials):
        image = getattr(sides[index], f"{factor}_texture")
        if image is None:
            continue
        at = np.flatnonzero(materials == index)
        for part in np.array_split(at, len(at) // BLOCK + 1):
            uvs = np.einsum("nk,nkc->nc", barycentrics[part], scene.uvs[triangles[part]])
            colours[part] *= lookup(image, uvs, material.textures_extend)
    return colours
