"""All pixels of an image at once, as rows of channels: row 0 at the bottom, as stored, whatever the colour space."""

from __future__ import annotations

import numpy as np


def read_pixels(image) -> np.ndarray:
    """Float32 (height, width, channels)."""
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, image.channels)


def write_pixels(image, colours) -> None:
    """Fill an image of four channels, all of it opaque, by colours (height, width, 3)."""
    rgba = np.ones((*colours.shape[:2], 4), np.float32)
    rgba[..., :3] = colours
    image.pixels.foreach_set(rgba.ravel())
