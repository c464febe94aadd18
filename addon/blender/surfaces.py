"""Colours and surfaces as a material's nodes combine them: a mix is a weighted sum, an add is a sum."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..core.luminance import LUMINANCE
from ..core.scene import BRIGHTEST, Texture
from .read_images import mean_colour, shrunk

BLACK = np.zeros(3)
FINEST = 512  # texels a side
GAIN = 1e-5  # over all light: rounding
LEAST_REST = 1e-3  # of light that does not pass, from which what it is like can be told


@dataclass(frozen=True, slots=True)
class Pixels:
    """What nodes made of images, float32 (height, width, 3): of any size and sign, until a surface takes it."""

    name: str
    pixels: np.ndarray


@dataclass(frozen=True, slots=True)
class Colour:
    """A linear colour, times a texture where there is one."""

    value: np.ndarray
    texture: Texture | Pixels | None = None

    @property
    def is_black(self) -> bool:
        return not np.any(self.value)

    @property
    def is_white(self) -> bool:
        return self.texture is None and bool(np.all(self.value == 1))

    @property
    def mean(self) -> np.ndarray:
        """One colour for the whole texture."""
        return self.value if self.texture is None else self.value * mean_colour(self.texture.pixels)

    @property
    def largest(self) -> float:
        """The largest number of any channel."""
        return float((self.value if self.texture is None else self.value * self.texture.pixels.max(axis=(0, 1))).max())

    def scaled(self, factor) -> Colour:
        return Colour(self.value * factor, self.texture)

    def times(self, other) -> Colour:
        """The product of two colours."""
        if self.texture is None or other.texture is None:
            return Colour(self.value * other.value, self.texture or other.texture)
        return pointwise(np.multiply, self, other)

    def within(self, most) -> Colour:
        """Clipped to [0, most], as a surface can have it; a surface cannot reflect more than 1, all that arrives."""
        if self.texture is None:
            return Colour(np.clip(self.value, 0.0, most))
        pixels = self.texture.pixels
        is_possible = pixels.min() >= 0 and (pixels.max(axis=(0, 1)) * self.value).max() <= most
        if isinstance(self.texture, Texture) and is_possible and self.value.min() >= 0 and self.value.max() <= most:
            return self
        clipped = np.clip(pixels * self.value, 0.0, most).astype(np.float32)
        return Colour(np.ones(3), Texture(self.texture.name, clipped))


@dataclass(frozen=True, slots=True)
class Surface:
    """What a shader does with light, each a share of all of it: reflect it diffusely, emit it, let it pass straight, or
    diffusely."""

    reflectance: Colour = field(default_factory=lambda: Colour(BLACK))
    radiance: Colour = field(default_factory=lambda: Colour(BLACK))
    transmittance: Colour = field(default_factory=lambda: Colour(BLACK))
    translucence: Colour = field(default_factory=lambda: Colour(BLACK))

    def without_gain(self) -> tuple[Surface, bool]:
        """The surface, dimmed where it would send on more than it gets, as sums of shaders can; and whether it was."""
        parts = self.reflectance, self.transmittance, self.translucence
        total = _sum_colours(list(parts))
        if total.largest <= 1 + GAIN:
            return self, False
        least = pointwise(lambda all_of_it: 1 / np.maximum(all_of_it, 1), total)
        reflectance, transmittance, translucence = (part.times(least) for part in parts)
        return replace(self, reflectance=reflectance, transmittance=transmittance, translucence=translucence), True

    def of_the_rest(self, scattered: Colour) -> Colour:
        """Of the light that does not pass straight, by its mean share (core.scene.Material): what is scattered.

        Where all passes, none is, and a mean over what an image cuts out must not see that as black.
        """

        def divided(scattered, passing):
            rest = 1 - passing.mean(axis=-1, keepdims=True)
            of_all = np.sum(scattered.reshape(-1, 3), axis=0) / max(np.sum(rest), LEAST_REST)
            return np.where(rest > LEAST_REST, scattered / np.maximum(rest, LEAST_REST), of_all)

        if scattered.is_black or self.transmittance.is_black:
            return scattered
        if self.transmittance.texture is None:
            return scattered.scaled(divided(np.ones(3), self.transmittance.value))
        return pointwise(divided, scattered, self.transmittance)


def grey(colour: Colour) -> Colour:
    """A colour as an input that is a number takes it: its luminance."""
    return pointwise(lambda c: np.repeat((c @ LUMINANCE)[..., None], 3, axis=-1), colour)


def mean_of_channels(colour: Colour) -> Colour:
    """A vector as an input that is a number takes it."""
    return pointwise(lambda c: np.repeat(c.mean(axis=-1, keepdims=True), 3, axis=-1), colour)


def weighted_sum(parts) -> Surface:
    """The surface that reflects, emits and passes the weighted sum of the parts: (weight, Surface) pairs, weights as
    greys, which may vary over the surface."""
    return Surface(
        _sum_colours([weight.times(surface.reflectance) for weight, surface in parts]),
        _sum_colours([weight.times(surface.radiance) for weight, surface in parts]),
        _sum_colours([weight.times(surface.transmittance) for weight, surface in parts]),
        _sum_colours([weight.times(surface.translucence) for weight, surface in parts]),
    )


def _sum_colours(colours) -> Colour:
    colours = [colour for colour in colours if not colour.is_black]
    textures = {id(colour.texture): colour.texture for colour in colours if colour.texture is not None}
    if len(textures) == 0:
        return Colour(sum((colour.value for colour in colours), BLACK))
    if len(textures) == 1 and all(colour.texture is not None for colour in colours):
        return Colour(sum((colour.value for colour in colours), BLACK), colours[0].texture)
    return pointwise(lambda *values: sum(values), *colours)


def pointwise(function, *colours) -> Colour:
    """What ``function`` of arrays (..., 3) makes of colours, at every texel of the largest of their textures.

    Of at most FINEST a side: light that bounces sees no finer ones, and materials may be many.
    """
    textures = {id(colour.texture): colour.texture for colour in colours if colour.texture is not None}
    if not textures:
        return Colour(_finite(function(*(np.asarray(colour.value, np.float64) for colour in colours))))
    small = {key: shrunk(texture.pixels, FINEST) for key, texture in textures.items()}
    shape = max((pixels.shape for pixels in small.values()), key=lambda shape: shape[0] * shape[1])
    arrays = [
        np.broadcast_to(np.asarray(colour.value, np.float32), shape)
        if colour.texture is None
        else np.float32(colour.value) * _resampled(small[id(colour.texture)], shape)
        for colour in colours
    ]
    name = ", ".join(dict.fromkeys(texture.name for texture in textures.values()))
    return Colour(np.ones(3), Pixels(name, _finite(function(*arrays)).astype(np.float32)))


def _finite(values):
    return np.clip(np.nan_to_num(values, posinf=BRIGHTEST, neginf=-BRIGHTEST), -BRIGHTEST, BRIGHTEST)


def _resampled(pixels, shape):
    if pixels.shape == shape:
        return pixels
    rows = np.arange(shape[0]) * pixels.shape[0] // shape[0]
    columns = np.arange(shape[1]) * pixels.shape[1] // shape[1]
    return pixels[rows[:, None], columns]
