"""What numbers of a scene may be: checked once, at the birth of what they belong to.

The bounds are what keeps 32-bit rays from overflowing: they square distances, and error estimates square light.
"""

from __future__ import annotations

import numpy as np

# [m] from the origin, eight Earths: its fourth power, and that of what lies between, is a float. The kernel's, too.
LARGEST_COORDINATE = 1e8
BRIGHTEST = 1e15  # of any light's radiance, intensity or irradiance, in its unit: its square is a float


class SceneError(ValueError):
    """A scene that cannot be baked; the message names the object, material or array."""


def require_colour(owner: str, field: str, colour, most: float) -> None:
    """Three numbers from 0 to ``most``."""
    values = _numbers(owner, field, colour, 3)
    if not ((values >= 0) & (values <= most)).all():
        raise SceneError(f"{owner}: {field} is {_spelled(values)}: allowed is 0 ... {most:g} in each channel")


def require_number(owner: str, field: str, value, least: float, most: float) -> None:
    """A number from ``least`` to ``most``."""
    (number,) = _numbers(owner, field, [value], 1)
    if not least <= number <= most:
        raise SceneError(f"{owner}: {field} is {number:g}: allowed is {least:g} ... {most:g}")


def require_vector(owner: str, field: str, vector, most: float = LARGEST_COORDINATE, count: int = 3) -> None:
    """Finite numbers of at most ``most``, either sign."""
    values = _numbers(owner, field, vector, count)
    if not (np.abs(values) <= most).all():
        raise SceneError(f"{owner}: {field} is {_spelled(values)}: allowed is -{most:g} ... {most:g}")


def require_direction(owner: str, field: str, vector) -> None:
    """A vector that points somewhere."""
    values = _numbers(owner, field, vector, 3)
    if not 1e-12 <= np.abs(values).max() <= 1e12:
        raise SceneError(f"{owner}: {field} is {_spelled(values)}: it points nowhere")


def require_pixels(owner: str, pixels) -> None:
    """An image: float32 (height, width, 3), no side 0, every value from 0 to BRIGHTEST."""
    is_image = isinstance(pixels, np.ndarray) and pixels.ndim == 3 and pixels.shape[2] == 3 and pixels.size > 0
    if not is_image or pixels.dtype != np.float32:
        found = f"{pixels.dtype} {pixels.shape}" if isinstance(pixels, np.ndarray) else type(pixels).__name__
        raise SceneError(f"{owner}: expected float32 (height, width, 3), got {found}")
    bad = ~((pixels >= 0) & (pixels <= BRIGHTEST)).all(axis=2)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        raise SceneError(f"{owner}: {int(bad.sum())} pixels leave 0 ... {BRIGHTEST:g}, first ({row}, {column})")


def _numbers(owner, field, values, count):
    try:
        numbers = np.array(values, np.float64)
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    if numbers.shape != (count,):
        raise SceneError(f"{owner}: {field} is {values!r}: expected {count} number{'s' if count > 1 else ''}")
    return numbers


def _spelled(values):
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"
