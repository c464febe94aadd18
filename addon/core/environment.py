"""An image of all that is around: radiance by direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .ranges import SceneError, require_pixels

UNTURNED = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ORTHONORMAL = 1e-4  # how far the rows of a rotation may be off: matrices come from float32


def from_octahedron(x, y):
    """Unit vectors (..., 3) of places in [-1, 1] on an octahedron laid out flat, as the kernel's maps are.

    Engelhardt & Dachsbacher 2008, "Octahedron environment maps": |x| + |y| + |z| = 1, the lower half folded out.
    """
    z = 1 - np.abs(x) - np.abs(y)
    folded_x, folded_y = (1 - np.abs(y)) * np.copysign(1, x), (1 - np.abs(x)) * np.copysign(1, y)
    points = np.stack([np.where(z < 0, folded_x, x), np.where(z < 0, folded_y, y), z], axis=-1)
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


@dataclass(frozen=True, slots=True)
class Environment:
    """An equirectangular image, as Cycles lays it out: straight down in row 0, +X in the middle, +Y left of it.

    Attributes
    ----------
    name : str
    pixels : float32 (height, width, 3), linear Rec.709; the world's radiance multiplies them
    to_image : (3, 3) takes directions of the scene to the image's: a rotation, or one with a reflection
    """

    name: str
    pixels: np.ndarray
    to_image: tuple = UNTURNED

    def __post_init__(self):
        require_pixels(f"environment {self.name}", self.pixels)
        matrix = np.array(self.to_image, np.float64)
        if matrix.shape != (3, 3) or not (np.abs(matrix @ matrix.T - np.eye(3)) <= ORTHONORMAL).all():
            raise SceneError(f"environment {self.name}: to_image is not a rotation")

    @property
    def solid_angles(self):
        """Of a pixel of each row, float64 (height,) [sr]."""
        height, width = self.pixels.shape[:2]
        edges = np.sin(np.linspace(-np.pi / 2, np.pi / 2, height + 1))
        return np.diff(edges) * 2 * np.pi / width

    def directions(self, rows, columns):
        """Unit vectors of the scene (N, 3) to the middles of pixels."""
        height, width = self.pixels.shape[:2]
        elevation = ((rows + 0.5) / height - 0.5) * np.pi
        azimuth = (0.5 - (columns + 0.5) / width) * 2 * np.pi
        level = np.cos(elevation)
        of_image = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)
        return of_image @ np.array(self.to_image)

    def seen(self, directions):
        """Pixels float32 (N, 3) in unit directions of the scene (N, 3), bilinear."""
        height, width = self.pixels.shape[:2]
        x, y, z = (directions @ np.array(self.to_image).T).T
        columns = (0.5 - np.arctan2(y, x) / (2 * np.pi)) * width - 0.5
        rows = np.clip((0.5 + np.arcsin(np.clip(z, -1, 1)) / np.pi) * height - 0.5, 0, height - 1)
        left, low = np.floor(columns).astype(np.int64), np.floor(rows).astype(np.int64)
        right, up = (columns - left)[:, None], (rows - low)[:, None]
        left, beside, high = left % width, (left + 1) % width, np.minimum(low + 1, height - 1)
        below = self.pixels[low, left] * (1 - right) + self.pixels[low, beside] * right
        above = self.pixels[high, left] * (1 - right) + self.pixels[high, beside] * right
        return (below * (1 - up) + above * up).astype(np.float32)
