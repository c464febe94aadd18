"""Slow float64 twins of the kernel's form factors: brute-force rays from the definitions."""

from __future__ import annotations

import numpy as np

from .rays import closest_hit


def frame(normal):
    """Two unit vectors that complete a unit normal."""
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(helper, normal)
    u /= np.linalg.norm(u)
    return u, np.cross(normal, u)


def points_on(corners, count, rng):
    """Even points on triangles (T, 3, 3) in proportion to area, and the triangle of each."""
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = rng.choice(len(corners), count, p=areas / areas.sum())
    weights = rng.dirichlet((1, 1, 1), count)
    return np.einsum("nk,nkc->nc", weights, corners[chosen]), chosen


def cosine_directions(normal, count, rng):
    """Directions with density cos / pi: a uniform disc, lifted to the hemisphere (Malley)."""
    u, v = frame(normal)
    radius, angle = np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    return x[:, None] * u + y[:, None] * v + np.sqrt(1 - radius**2)[:, None] * normal


def by_cosine_rays(corners, emitters, receivers, rays, rng):
    """Share of cosine rays from the fronts of ``emitters`` (indices, one plane) whose first hit is in ``receivers``."""
    normal = _normal(corners[emitters[0]])
    origins, _ = points_on(corners[emitters], rays, rng)
    directions = cosine_directions(normal, rays, rng)
    hit, _ = closest_hit(corners, origins + 1e-9 * normal, directions)
    return np.isin(hit, receivers).mean()


def hemicube(resolution):
    """Directions (3 resolution^2, 3) in (u, v, n) through the pixels of a half cube, and their delta form factors.

    Integrals of cos / pi over each pixel's solid angle, by the form factor of a rectangle parallel or perpendicular to
    the element: differences of closed-form integrals, so that they sum to 1 without normalising.
    """
    edges = np.linspace(-1, 1, resolution + 1)
    middles, heights = 0.5 * (edges[1:] + edges[:-1]), np.linspace(0, 1, resolution // 2 + 1)
    x, y = np.meshgrid(middles, middles)
    directions = [np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)]
    factors = [_cells(_parallel, edges, edges)]
    y, z = np.meshgrid(middles, 0.5 * (heights[1:] + heights[:-1]))
    one = np.ones_like(y)
    side = _cells(_perpendicular, edges, heights)
    for around in ((one, y, z), (-one, y, z), (y, one, z), (y, -one, z)):
        directions.append(np.stack(around, axis=-1).reshape(-1, 3))
        factors.append(side)
    return np.concatenate(directions), np.concatenate(factors)


def _parallel(x, y):
    """Integral of 1 / (pi (x^2 + y^2 + 1)^2) over [0, x] x [0, y]."""
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return (x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2 * np.pi)


def _perpendicular(y, z):
    """Integral of z / (pi (y^2 + z^2 + 1)^2) over [0, y] x [0, z]."""
    q = np.sqrt(1 + z * z)
    return (np.arctan(y) - np.arctan(y / q) / q) / (2 * np.pi)


def _cells(integral, across, up):
    y, z = np.meshgrid(across, up)
    return np.diff(np.diff(integral(y, z), axis=0), axis=1).ravel()


def by_hemicubes(corners, emitters, receivers, resolution, positions, rng):
    """Mean over hemicubes at random points of ``emitters``, each turned at random."""
    normal = _normal(corners[emitters[0]])
    u, v = frame(normal)
    origins, _ = points_on(corners[emitters], positions, rng)
    local, factors = hemicube(resolution)
    total = 0.0
    for origin, turn in zip(origins, 2 * np.pi * rng.random(positions)):
        across = np.cos(turn) * u + np.sin(turn) * v
        directions = local @ np.stack([across, np.cross(normal, across), normal])
        hit, _ = closest_hit(corners, np.broadcast_to(origin + 1e-9 * normal, directions.shape), directions)
        total += factors[np.isin(hit, receivers)].sum()
    return total / positions


def _normal(triangle):
    normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    return normal / np.linalg.norm(normal)
