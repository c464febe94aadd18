"""Closed forms of form factors and radiosities, for the cases that are shipped; of rectangles also many at once.

Howell: J. R. Howell, A Catalog of Radiation Heat Transfer Configuration Factors, the numbers are its.
"""

from __future__ import annotations

import itertools

import numpy as np


def parallel_rectangles(x, y, xi, eta, z: float) -> float:
    """F of the rectangle x[0]..x[1], y[0]..y[1] to xi[0]..xi[1], eta[0]..eta[1], parallel, z apart (Howell C-13)."""
    return _corner_sum(x, y, xi, eta, lambda a, b, c, d: _parallel_term(a - c, b - d, z)) / _area(x, y)


def _parallel_term(u, v, z):
    p, q = np.hypot(u, z), np.hypot(v, z)
    return v * p * np.arctan2(v, p) + u * q * np.arctan2(u, q) - 0.5 * z * z * np.log(u * u + v * v + z * z)


def perpendicular_rectangles(x, y, xi, eta) -> float:
    """F of the rectangle x[0]..x[1], y[0]..y[1] in z = 0 to the one at x = 0, z = xi[0]..xi[1], y = eta[0]..eta[1].

    Howell C-15; x and xi are not negative.
    """
    return _corner_sum(x, y, xi, eta, lambda a, b, c, d: _perpendicular_term(a * a + c * c, b - d)) / _area(x, y)


def _perpendicular_term(squared, v):
    root, whole = np.sqrt(squared), squared + v * v
    logarithm = np.log(np.where(whole > 0, whole, 1.0))
    return v * root * np.arctan2(v, root) - 0.25 * (squared - v * v) * logarithm


def _corner_sum(x, y, xi, eta, term):
    total = 0.0
    for i, j, k, m in itertools.product((0, 1), repeat=4):
        total += (-1) ** (i + j + k + m) * term(x[i], y[j], xi[k], eta[m])
    return total / (2 * np.pi)


def _area(x, y):
    return (x[1] - x[0]) * (y[1] - y[0])


def coaxial_disks(r1: float, r2: float, h: float) -> float:
    """F of a disk to a parallel coaxial one, h apart (Howell C-41)."""
    x = 1 + (h * h + r2 * r2) / (r1 * r1)
    # the smaller root, without the difference of two large numbers
    return 2 * (r2 / r1) ** 2 / (x + np.sqrt(x * x - 4 * (r2 / r1) ** 2))


def element_under_corner(a: float, b: float, c: float) -> float:
    """F of an element to a parallel rectangle a x b at distance c, one corner straight above (Howell B-4)."""
    x, y = a / c, b / c
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return (x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2 * np.pi)


def integrating_sphere(shares, rho, emitted):
    """Irradiance, then radiosities of zones of a sphere: every zone sees zone j in proportion to its area."""
    shares, rho, emitted = (np.asarray(x, float) for x in (shares, rho, emitted))
    irradiance = (shares @ emitted) / (1 - shares @ rho)
    return [float(irradiance), *(emitted + rho * irradiance).tolist()]


def two_surfaces(form_factors, rho, emitted):
    """Radiosities of two surfaces with the form factors (2, 2), by Cramer's rule."""
    (f11, f12), (f21, f22) = form_factors
    a, b = 1 - rho[0] * f11, -rho[0] * f12
    c, d = -rho[1] * f21, 1 - rho[1] * f22
    determinant = a * d - b * c
    return [(emitted[0] * d - b * emitted[1]) / determinant, (a * emitted[1] - c * emitted[0]) / determinant]
