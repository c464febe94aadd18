"""Light from all around, from the definition: pixels by direction, sums over the sphere, the octahedron."""

import numpy as np

UNTURNED = np.eye(3)


def sphere(rows, turn=UNTURNED):
    """Directions of an equirectangular image's pixels (rows, 2 rows, 3) and their solid angles (rows, 2 rows) [sr].

    Straight down in row 0; +X in the middle column, +Y a quarter of the width left of it. ``turn`` takes directions
    of the scene to the image's.
    """
    elevation = (np.arange(rows) + 0.5) / rows * np.pi - np.pi / 2
    azimuth = np.pi - (np.arange(2 * rows) + 0.5) / (2 * rows) * 2 * np.pi
    elevation, azimuth = np.meshgrid(elevation, azimuth, indexing="ij")
    of_image = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    )
    return of_image @ turn, np.cos(elevation) * (np.pi / rows) ** 2


def irradiance(radiance, directions, solid_angles, normal):
    """E = sum L cos dw over the half of the sphere that ``normal`` looks to, (3,)."""
    cosines = np.maximum(directions @ np.asarray(normal, np.float64), 0)
    return np.einsum("ijc,ij,ij->c", np.asarray(radiance, np.float64), cosines, solid_angles)


def octahedron_texel(direction, side):
    """(row, column) of the texel that a direction falls into, by the kernel's header (pl_solution.sky)."""
    x, y, z = np.asarray(direction, np.float64) / np.abs(direction).sum()
    if z < 0:
        x, y = (1 - abs(y)) * np.copysign(1, x), (1 - abs(x)) * np.copysign(1, y)
    return tuple(int(min(max((place / 2 + 0.5) * side, 0), side - 1)) for place in (y, x))
