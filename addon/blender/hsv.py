"""Colours as hue, saturation and value, and back."""

from __future__ import annotations

import numpy as np


def hsv_of(c):
    """Hue, saturation and value (...) of colours (..., 3), each hue a share of the circle."""
    most, least = c.max(axis=-1), c.min(axis=-1)
    spread = most - least
    r, g, b = np.moveaxis((most[..., None] - c) / np.where(spread > 0, spread, 1)[..., None], -1, 0)
    hue = np.select([c[..., 0] == most, c[..., 1] == most], [b - g, 2 + r - b], 4 + g - r) / 6 % 1.0
    return np.where(spread > 0, hue, 0), np.where(most > 0, spread / np.where(most > 0, most, 1), 0), most


def rgb_of(hue, saturation, value):
    """Colours (..., 3) of hue, saturation and value (...)."""
    full = np.stack([np.abs(hue * 6 - 3) - 1, 2 - np.abs(hue * 6 - 2), 2 - np.abs(hue * 6 - 4)], axis=-1)
    return ((np.clip(full, 0, 1) - 1) * saturation[..., None] + 1) * value[..., None]
