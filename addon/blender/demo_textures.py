"""Textures of the demo room, painted by NumPy: the same bytes every time, packed into the file.

Each painter returns float64 (height, width, 3), sRGB-encoded [0..1], row 0 at the bottom.
"""

from __future__ import annotations

import bpy
import numpy as np

from .image_pixels import write_pixels


def packed_image(name, pixels):
    """An 8-bit sRGB image of the given pixels, packed."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height)
    write_pixels(image, pixels)
    image.update()
    image.pack()
    return image


def planks(size=1024, columns=30, seed=1):
    """Oak boards that run along v, laid with shifted butt joints; ``columns`` boards side by side."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0:size, 0:size] / size
    column = np.minimum((u * columns).astype(int), columns - 1)
    across = u * columns - column
    length = 3.2  # boards per room length
    along = v * length + rng.random(columns)[column]
    board = (column * 7 + along.astype(int)) % 211

    tone = rng.normal(0.0, 0.055, 211)[board]
    hue = rng.normal(0.0, 0.02, 211)[board]
    grain = _streaks(rng, size) * 0.05
    figure = 0.02 * np.sin(2 * np.pi * (across * 2.5 + 0.35 * np.sin(along * 5 + board)))
    value = 1.0 + tone + grain + figure
    joint_width = 0.02
    joint = (across < joint_width * 1.5) | ((along % 1) < joint_width / 6)
    value = np.where(joint, value * 0.55, value)
    base = np.array([0.66, 0.49, 0.33])
    tint = np.stack([1 + hue, np.ones_like(hue), 1 - 1.5 * hue], axis=-1)
    return np.clip(base * tint * value[..., None], 0.02, 0.92)


def _streaks(rng, size):
    # noise smoothed far along the board and little across it
    noise = np.fft.rfft2(rng.normal(size=(size, size)))
    v = np.fft.fftfreq(size)[:, None] * size
    u = np.fft.rfftfreq(size)[None, :] * size
    streaks = np.fft.irfft2(noise * np.exp(-((v / 9) ** 2) - (u / 220) ** 2), s=(size, size))
    return streaks / streaks.std()


def rug(width=512, height=384, seed=2):
    """A flat-woven rug: a border, rows of diamonds, a woven grain."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0:height, 0:width]
    cream, navy, rust = np.array([0.86, 0.81, 0.71]), np.array([0.17, 0.24, 0.34]), np.array([0.70, 0.35, 0.22])
    pitch = 64
    diamond = np.abs((u % pitch) - pitch / 2) + np.abs((v % pitch) - pitch / 2)
    pixels = np.where((diamond < 26)[..., None], navy, cream)
    pixels = np.where((diamond < 15)[..., None], cream, pixels)
    pixels = np.where((diamond < 7)[..., None], rust, pixels)
    edge = np.minimum(np.minimum(u, width - 1 - u), np.minimum(v, height - 1 - v))
    pixels = np.where((edge < 32)[..., None], navy, pixels)
    pixels = np.where(((edge >= 12) & (edge < 17))[..., None], cream, pixels)
    pixels = np.where(((edge >= 32) & (edge < 36))[..., None], rust, pixels)
    weave = 1 + 0.05 * np.where((v // 2) % 2 == 0, 1, -1) + rng.normal(0, 0.03, (height, width))
    return np.clip(pixels * weave[..., None], 0.02, 0.93)


def painting(width=480, height=336):
    """A landscape of flat shapes: a low sun over hills."""
    v, u = np.mgrid[0:height, 0:width]
    u, v = u / height, v / height
    sky_top, sky_low = np.array([0.46, 0.62, 0.66]), np.array([0.93, 0.79, 0.60])
    pixels = sky_low + (sky_top - sky_low) * np.clip((v - 0.4) / 0.6, 0, 1)[..., None]
    sun = (u - 0.95) ** 2 + (v - 0.66) ** 2 < 0.15**2
    pixels = np.where(sun[..., None], [0.90, 0.42, 0.20], pixels)
    hills = [
        (0.47 + 0.07 * np.sin(4.1 * u + 0.4), [0.55, 0.57, 0.55]),
        (0.36 + 0.09 * np.sin(3.1 * u + 2.4), [0.31, 0.43, 0.45]),
        (0.22 + 0.08 * np.sin(4.3 * u + 4.4), [0.80, 0.55, 0.29]),
        (0.10 + 0.06 * np.sin(3.7 * u + 1.0), [0.21, 0.25, 0.29]),
    ]
    for crest, colour in hills:
        pixels = np.where((v < crest)[..., None], colour, pixels)
    return pixels
