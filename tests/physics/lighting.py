"""Irradiance at points of a floor: what the tests of direct light share."""

import numpy as np

from addon.core.effort import Effort
from addon.core.emitters import emitters_of
from addon.core.gather import gather_irradiance
from addon.core.probes import SeenPoints
from addon.core.radiosity import solve_radiosity
from addon.core.receivers import Receivers
from addon.core.settings import BakeSettings
from tests.graphs import row_graph
from tests.scenes import BLACK, kernel_of, rectangle, scene_of

# what float32 geometry of metres and the shift of some 1e-6 off the floor leave of an exact value
SINGLE = 2e-5


def floor(size=20.0, **options):
    """A black floor around the origin that faces up."""
    options = {"material": BLACK, "name": "floor", **options}
    return rectangle((-size / 2, -size / 2, 0), (size, 0, 0), (0, size, 0), **options)


def floor_receivers(points):
    """Receivers on the floor, which is triangles 0 and 1, facing up."""
    points = np.array(points, np.float64).reshape(-1, 3)
    normals = np.tile(np.float32([0, 0, 1]), (len(points), 1))
    # the floor's diagonal runs along x = y
    return Receivers(points, normals, np.where(points[:, 0] >= points[:, 1], 0, 2).astype(np.int32))


def random_points(count, rng, reach=2.0):
    return np.concatenate([rng.uniform(-reach, reach, (count, 2)), np.zeros((count, 1))], axis=1)


def direct_light(lights, points, parts=(), samples=64, seed=0, threads=1):
    """Direct irradiance (N, 3) on the floor and the variance of its luminance, stated by the kernel."""
    scene = scene_of([floor(), *parts], lights)
    with kernel_of(scene, threads) as kernel:
        values, variance, _ = kernel.direct(emitters_of(scene, kernel.centre), floor_receivers(points), samples, seed)
    return values.astype(np.float64), variance.astype(np.float64)


def full_light(scene, receivers, threads=2, grid=None, **settings):
    """Irradiance of the whole pipeline at receivers: a gather.Irradiance, and the Solved. ``grid``: of a lightmap."""
    settings = BakeSettings(**{"target": "lightmap" if grid else "vertex", **settings})
    with kernel_of(scene, threads) as kernel:
        emitters = emitters_of(scene, kernel.centre)
        solved = solve_radiosity(scene, kernel, emitters, settings, lambda done: None)
        light = gather_irradiance(
            kernel=kernel,
            solved=solved,
            receivers=receivers,
            grid=grid or row_graph(len(receivers)),
            seen=SeenPoints(receivers, lambda values: values),
            effort=Effort(settings.error, settings.seed),
        )
    return light, solved
