"""Looking up textures, and what a material's textures come to over points of triangles."""

from __future__ import annotations

import numpy as np

from .scene import Scene, Texture

BLOCK = 1 << 16  # points that are looked up at once


def lookup(texture: Texture, uvs):
    """Bilinear, repeating lookup at uvs (N, 2): float32 (N, 3). Row 0 of the pixels is at v = 0."""
    height, width = texture.pixels.shape[:2]
    x = uvs[:, 0].astype(np.float64) % 1.0 * width - 0.5
    y = uvs[:, 1].astype(np.float64) % 1.0 * height - 0.5
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    right, up = (x - column)[:, None], (y - row)[:, None]
    left_column, right_column = column % width, (column + 1) % width
    low_row, high_row = row % height, (row + 1) % height
    low = texture.pixels[low_row, left_column] * (1 - right) + texture.pixels[low_row, right_column] * right
    high = texture.pixels[high_row, left_column] * (1 - right) + texture.pixels[high_row, right_column] * right
    return (low * (1 - up) + high * up).astype(np.float32)


def scattered_shares(scene: Scene, triangles, barycentrics):
    """Reflectance and translucence, no more than 1 together, at points of triangles: float32 (N, 3) each; the second is
    None where nothing is translucent."""
    reflectance = np.clip(textured_colours(scene, triangles, barycentrics, "reflectance"), 0, 1)
    if not any(material.is_translucent for material in scene.materials):
        return reflectance, None
    translucence = textured_colours(scene, triangles, barycentrics, "translucence")
    return reflectance, np.clip(translucence, 0, 1 - reflectance)


def textured_colours(scene: Scene, triangles, barycentrics, factor: str):
    """A material's ``factor``, as Material names it, times its texture, at points of triangles: float32 (N, 3)."""
    factors = np.array([getattr(m, factor) for m in scene.materials], np.float32).reshape(-1, 3)
    materials = scene.triangle_materials[triangles]
    colours = factors[materials]
    for index, material in enumerate(scene.materials):
        image = getattr(material, f"{factor}_texture")
        if image is None:
            continue
        at = np.flatnonzero(materials == index)
        for part in np.array_split(at, len(at) // BLOCK + 1):
            uvs = np.einsum("nk,nkc->nc", barycentrics[part], scene.uvs[triangles[part]])
            colours[part] *= lookup(image, uvs)
    return colours
