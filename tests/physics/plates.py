"""Shares of power from one object to others, and points on surfaces: what the tests of hard geometry share."""

import numpy as np

from addon.core.patches import subdivide
from addon.core.receivers import surface_receivers
from addon.core.transport import MonteCarloFormFactors
from tests.physics.test_form_factors import fronts
from tests.scenes import kernel_of

PUSH = 8 * 2.0**-23  # of the largest coordinate: how far off their face rays start


def factors(scene, rays=1 << 16, seed=0, size=10.0, to=(1,)):
    """Share of the power from the front of object 0 that lands on either side of the objects ``to``."""
    with kernel_of(scene, 2) as kernel:
        patches = subdivide(scene, kernel, size, 1000, seed)
        sources = fronts(patches, scene, 0)
        rows = MonteCarloFormFactors(kernel, rays, seed).rows(sources)
    targets = np.concatenate([fronts(patches, scene, obj) for obj in to])
    landed = rows[:, targets].sum(axis=1) + rows[:, targets + 1].sum(axis=1)
    return np.average(landed, weights=patches.side_areas[sources])


def noise(exact, rays):
    """Five standard errors of random rays, which quasi-random ones stay below, and two rays where there are few."""
    return 5 * np.sqrt(exact * (1 - exact) / rays) + 2 / rays


def well_inside(scene, count=200):
    rng = np.random.default_rng(0)
    triangles = rng.integers(0, len(scene.triangles), count).astype(np.int32)
    return surface_receivers(scene, triangles, 0.9 * rng.dirichlet((1, 1, 1), count) + 0.1 / 3)
