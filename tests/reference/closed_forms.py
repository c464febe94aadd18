"""Howell's catalog as it is printed: form factors that do not come from the code under test."""

from __future__ import annotations

import numpy as np


def c11(a, b, c):
    """Identical, parallel, directly opposed rectangles a x b, c apart."""
    x, y = a / c, b / c
    p, q = np.sqrt(1 + x**2), np.sqrt(1 + y**2)
    logarithm = np.log(p * q / np.sqrt(1 + x**2 + y**2))
    angles = x * q * np.arctan(x / q) + y * p * np.arctan(y / p) - x * np.arctan(x) - y * np.arctan(y)
    return 2 / (np.pi * x * y) * (logarithm + angles)


def c14(w, h, length):
    """From a rectangle w x length to the perpendicular one h x length that shares the edge ``length``."""
    w, h = w / length, h / length
    s = h**2 + w**2
    angles = w * np.arctan(1 / w) + h * np.arctan(1 / h) - np.sqrt(s) * np.arctan(1 / np.sqrt(s))
    logarithm = (
        np.log((1 + w**2) * (1 + h**2) / (1 + s))
        + w**2 * np.log(w**2 * (1 + s) / ((1 + w**2) * s))
        + h**2 * np.log(h**2 * (1 + s) / ((1 + h**2) * s))
    )
    return (angles + logarithm / 4) / (np.pi * w)


def c41(r1, r2, h):
    """From a disk to a parallel coaxial one."""
    a, b = r1 / h, r2 / h
    x = 1 + (1 + b**2) / a**2
    return 0.5 * (x - np.sqrt(x**2 - 4 * (b / a) ** 2))


def crossed_strings(angle):
    """Between two infinite strips of unit width that share an edge at this angle [rad]: 1 - sin(angle / 2) (Hottel)."""
    return 1 - np.sin(angle / 2)


def b4(a, b, c):
    """From an element to the parallel rectangle a x b at distance c, its corner straight above."""
    p, q = np.hypot(a, c), np.hypot(b, c)
    return (a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * np.pi)
