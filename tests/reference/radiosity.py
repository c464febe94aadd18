"""Slow float64 twins of the solvers, and systems whose radiosity is known in closed form."""

from __future__ import annotations

import numpy as np

# Howell's C-11 and C-14: opposed unit squares, and unit squares with a common edge
OPPOSED, ADJACENT = 0.19982489569838738304, 0.20004377607540315424


def by_series(form_factors, reflectance, emitted):
    """B = sum of (rho F)^k M for one channel, as the product of (I + T^(2^k)): 2^40 bounces, without any solver."""
    step = np.asarray(reflectance, np.longdouble)[:, None] * np.asarray(form_factors, np.longdouble)
    radiosity = np.asarray(emitted, np.longdouble).copy()
    for _ in range(40):
        radiosity = radiosity + step @ radiosity
        step = step @ step
    return radiosity.astype(np.float64)


def cube():
    """Exact form factors of a unit cube's faces, opposite faces next to each other in order; areas [m^2]."""
    matrix = np.full((6, 6), ADJACENT)
    for face in range(6):
        matrix[face, face], matrix[face, face ^ 1] = 0.0, OPPOSED
    return matrix, np.ones(6)


def sphere(areas):
    """Form factors of the zones of a sphere, F_ij = A_j / sum A, of any shape, each seeing itself."""
    areas = np.asarray(areas, np.float64)
    return np.tile(areas / areas.sum(), (len(areas), 1)), areas


def sphere_irradiance(areas, reflectance, emitted):
    """Irradiance everywhere in a sphere of zones: sum a M / (1 - sum a rho), a shares of the area."""
    shares = np.asarray(areas, np.float64) / np.sum(areas)
    return (shares * emitted).sum() / (1 - (shares * reflectance).sum())


def two_spheres(fraction, zones=(0.2, 0.3, 0.5)):
    """Two unit spheres that share a port of the given share of each; walls in zones. Form factors and areas [m^2].

    The port's disc and the cap that it replaces subtend the same form factor from every point of the wall, so light is
    even over each sphere: F_ij = A_j / (4 pi) in the same one, and ``fraction`` in proportion to area in the other.
    """
    walls = np.array(zones) / sum(zones) * 4 * np.pi * (1 - fraction)
    areas = np.concatenate([walls, walls])
    inside = np.tile(walls / (4 * np.pi), (len(walls), 1))
    across = np.tile(fraction * walls / walls.sum(), (len(walls), 1))
    return np.block([[inside, across], [across, inside]]), areas


def two_spheres_radiosity(fraction, rho):
    """B of both spheres when the first emits 1: B1 = 1 + rho ((1 - f) B1 + f B2), B2 = rho ((1 - f) B2 + f B1)."""
    kept, passed = 1 - rho * (1 - fraction), rho * fraction
    first = kept / ((kept - passed) * (kept + passed))
    return first, first * passed / kept
