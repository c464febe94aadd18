"""Blender images -> linear textures, each read once."""

from __future__ import annotations

import numpy as np

from ..core.scene import BRIGHTEST, Texture
from .image_pixels import read_pixels
from .mesh_colours import palette
from .shader_nodes import Unreadable

# Bounced light does not see texels finer than this; an 8k texture would cost a gigabyte.
LONGEST_SIDE = 2048
BAND = 64  # rows of a large image at once
RIM = 1 / 18  # of a clipped image: so much that some is left where nodes shrink it,
LEAST_CLIPPED = 16  # and that a side of so many texels has one

LEAST_ALPHA = np.float32(1e-6)  # of less nothing is seen, and no colour can be told

LINEAR_SPACES = {"Non-Color", "Raw", "Linear", "Linear Rec.709", "scene_linear"}


class Images:
    """The textures of one scene; images that several materials use are shared."""

    def __init__(self, warn):
        self._textures = {}
        self._warn = warn

    def texture(self, image, is_by_alpha: bool) -> Texture:
        """The image as linear Rec.709 pixels, those of linear_pixels; Unreadable where it has none."""
        what = "colour by alpha" if is_by_alpha else "colour"
        return self._read_once(image, what, lambda: linear_pixels(image, is_by_alpha, self._warn))

    def alpha(self, image) -> Texture:
        """The image's alpha as a grey."""
        return self._read_once(image, "alpha", lambda: alpha_pixels(image, self._warn))

    def clipped(self, texture) -> Texture:
        """With black around it, RIM of the whole on each side."""

        def clipped(pixels):
            for axis, side in enumerate(pixels.shape[:2]):
                pixels = np.repeat(pixels, -(-LEAST_CLIPPED // side), axis=axis)
            rims = [round(side * RIM / (1 - 2 * RIM)) for side in pixels.shape[:2]]
            return np.pad(pixels, ((rims[0],) * 2, (rims[1],) * 2, (0, 0)))

        return self._made(texture, "clipped", clipped)

    def mirrored(self, texture) -> Texture:
        """Four of it, mirrored at the lines between them."""

        def mirrored(pixels):
            wide = np.concatenate([pixels, pixels[:, ::-1]], axis=1)
            return np.concatenate([wide, wide[::-1]], axis=0)

        return self._made(texture, "mirrored", mirrored)

    def _made(self, texture, how, make):
        key = id(texture), how
        if key not in self._textures:
            self._textures[key] = Texture(texture.name, np.ascontiguousarray(make(texture.pixels)))
        return self._textures[key]

    def of_meshes(self) -> Texture:
        """What stands for the colours of all meshes that have some."""
        if "meshes" not in self._textures:
            self._textures["meshes"] = palette()
        return self._textures["meshes"]

    def _read_once(self, image, what, read):
        key = image.original.as_pointer(), what
        if key not in self._textures:
            self._textures[key] = Texture(image.name, read())
        return self._textures[key]


def linear_pixels(image, is_by_alpha: bool, warn) -> np.ndarray:
    """Pixels as float32 (height, width, 3), linear Rec.709, row 0 at the bottom.

    Cycles gives colours times alpha, black where nothing is, but where the node's Alpha is linked, too. Bytes it
    multiplies as they are stored; floats are stored as products.
    """
    stored = _stored_pixels(image, warn)
    space = "Non-Color" if image.is_float else image.colorspace_settings.name
    if space not in LINEAR_SPACES | {"sRGB"}:
        warn(f"image '{image.name}': colour space {space} is read as sRGB")
    has_alpha = _has_alpha(image, stored)

    def linear(part):
        pixels = _rgb(part)
        if has_alpha:
            alpha = part[..., 3:4]
            if is_by_alpha and not image.is_float:
                pixels = pixels * alpha
            elif not is_by_alpha and image.is_float:
                pixels = np.where(alpha > LEAST_ALPHA, pixels / np.maximum(alpha, LEAST_ALPHA), np.float32(0))
        if space not in LINEAR_SPACES:
            pixels = _linear_from_srgb_bytes(pixels)
        return np.clip(np.nan_to_num(pixels, posinf=0.0), 0.0, BRIGHTEST)

    return _in_bands(stored, linear)


def alpha_pixels(image, warn) -> np.ndarray:
    """Alpha as float32 (height, width, 3), three times the same; 1 where the image has none."""
    pixels = _stored_pixels(image, warn)
    alpha = pixels[..., 3:4] if pixels.shape[2] == 4 and image.alpha_mode != "NONE" else np.ones_like(pixels[..., :1])
    return _in_bands(alpha, lambda part: np.repeat(np.clip(np.nan_to_num(part), 0.0, 1.0), 3, axis=2))


def _has_alpha(image, stored):
    """Whether colours go by it: not those of data, nor where it is something else beside them."""
    is_data = image.colorspace_settings.is_data
    return stored.shape[2] == 4 and not is_data and image.alpha_mode in {"STRAIGHT", "PREMUL"}


def mean_colour(pixels) -> tuple[float, float, float]:
    """Mean over a texture's texels."""
    return tuple(float(c) for c in pixels.mean(axis=(0, 1), dtype=np.float64))


def shrunk(pixels, longest):
    """Pixels (height, width, channels), box-filtered by a whole factor each way until no side is longer than
    ``longest``."""
    return _reduced(pixels, *_factors(pixels, longest))


def _factors(pixels, longest):
    return tuple(-(-side // longest) for side in pixels.shape[:2])


def _reduced(pixels, down, across):
    if down == across == 1:
        return np.ascontiguousarray(pixels)
    height, width = pixels.shape[0] // down, pixels.shape[1] // across
    # as sums of every so many rows, and columns, which NumPy is far quicker at than at a mean over two axes
    rows = sum(pixels[first : height * down : down].astype(np.float32) for first in range(down))
    return sum(rows[:, first : width * across : across] for first in range(across)) / np.float32(down * across)


def _in_bands(stored, make):
    """What ``make`` makes of stored pixels, shrunk: of a few rows at a time, which stay in the cache meanwhile."""
    down, across = _factors(stored, LONGEST_SIDE)
    band, rows = -(-BAND // down) * down, stored.shape[0] // down * down
    return np.concatenate(
        [_reduced(make(stored[row : min(row + band, rows)]), down, across) for row in range(0, rows, band)]
    )


def _stored_pixels(image, warn):
    if not all(image.size):
        raise Unreadable(f"image '{image.name}', which cannot be loaded")
    if image.source in {"TILED", "MOVIE", "SEQUENCE"}:
        warn(f"image '{image.name}': only one picture of its {image.source.lower()} source is read")
    return read_pixels(image)


def _rgb(pixels):
    channels = pixels.shape[2]
    return pixels[..., :3] if channels >= 3 else np.repeat(pixels[..., :1], 3, axis=2)


def _linear_from_srgb_bytes(pixels):
    # Blender hands bytes out as value / 255, still encoded: 256 different values, one table.
    encoded = np.arange(256) / 255.0
    table = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4).astype(np.float32)
    return table[(np.clip(pixels, 0, 1) * np.float32(255) + np.float32(0.5)).astype(np.uint8)]
