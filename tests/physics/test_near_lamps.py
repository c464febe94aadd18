"""Light that bounces once, close to a large lamp of which a part is hidden: what of it is seen from where counts."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.gather_job import GatherJob
from addon.core.guides import no_guides
from addon.core.kernel import MIXED_SIDE
from addon.core.radiosity import solve_radiosity
from addon.core.receivers import Receivers
from addon.core.scene import AreaLight, Material
from addon.core.settings import BakeSettings
from tests.physics.lighting import direct_light
from tests.reference.polygon import point_to_polygon
from tests.scenes import BLACK, kernel_of, rectangle, scene_of

HIGH, HAIR = 1.5, 1e-3
GREY = Material("grey", (0.5, 0.5, 0.5))
UP = np.array([0, 0, 1.0])


def bounced_once(points, low, cells=64):
    """E (N,) under a ceiling, from a floor of reflectance 1/2 on which the lamp shines from ``low`` upwards."""
    rng = np.random.default_rng(1)
    # stratified cosine directions, down
    x, y = (np.stack(np.meshgrid(*[np.arange(cells)] * 2), -1).reshape(-1, 2) + rng.random((cells**2, 2))).T / cells
    way = np.stack([np.sqrt(x) * np.cos(2 * np.pi * y), np.sqrt(x) * np.sin(2 * np.pi * y), -np.sqrt(1 - x)], -1)
    lamp = [(0, -1, low), (0, 1, low), (0, 1, 1), (0, -1, 1)]
    found = []
    for point in points:
        floor = point + way * (point[2] / -way[:, 2:])
        on_floor = floor[floor[:, 0] > HAIR]
        found.append(0.5 * np.pi * sum(point_to_polygon(p, UP, lamp) for p in on_floor) / len(way))
    return np.array(found)


@pytest.mark.parametrize("glows", [False, True], ids=["lamp", "mesh"])
@pytest.mark.parametrize("hidden_below", [0.0, 0.5])
def test_light_bounced_off_a_floor_beside_a_half_hidden_lamp(glows, hidden_below):
    """The lamp's lower part gives the floor beside it most, and none where a board hides it."""
    parts = [
        rectangle((HAIR, -30, 0), (60, 0, 0), (0, 60, 0), material=GREY, name="floor"),
        rectangle((HAIR, -30, HIGH), (0, 60, 0), (60, 0, 0), material=BLACK, name="ceiling"),
    ]
    if hidden_below:
        parts.append(rectangle((HAIR / 2, -2, 0), (0, 4, 0), (0, 0, hidden_below), material=BLACK, name="board"))
    lamp = AreaLight("lamp", (0, 0, 0.5), (0, 1, 0), (0, 0, 0.5), (1.0, 1.0, 1.0))
    if glows:
        glow = Material("glow", (0, 0, 0), radiance=(1.0, 1.0, 1.0))
        parts.append(rectangle((0, -1, 0), (0, 2, 0), (0, 0, 1), material=glow, name="glow"))
    scene = scene_of(parts, [] if glows else [lamp])
    points = np.array([(0.1, 0.1, HIGH), (0.5, 0.1, HIGH), (1.5, 0.1, HIGH)])
    # the ceiling's diagonal runs along y + 30 = x
    receivers = Receivers(points, np.tile(np.float32((0, 0, -1)), (3, 1)), np.full(3, 4, np.int32))
    with kernel_of(scene) as kernel:
        emitters = emitters_of(scene, kernel.centre)
        solved = solve_radiosity(scene, kernel, emitters, BakeSettings(target="vertex", error=0.2), lambda done: None)
        # wherever a ray hits, it asks the lamp
        kinds = np.full_like(solved.patches.kinds, MIXED_SIDE)
        solved = replace(solved, patches=replace(solved.patches, kinds=kinds).looking_further(1e9))
        job = GatherJob(kernel, solved, receivers, np.ones(3, np.float32), no_guides(3))
        light, variance, _ = job.gathered(1 << 14, 0)
    exact = bounced_once(points, hidden_below)
    errors = light[:, 1] - exact
    # four standard errors, as four replicates state them together; 4096 stratified directions of the twin, which is 0
    # for half of them, are good to 2 / 4096^0.75
    tolerance = 4 * np.sqrt(np.maximum(variance, variance.mean())) + 4e-3 * exact
    assert (np.abs(errors) < tolerance).all(), errors / exact
    # a ray's sample is no larger than the whole hemisphere's light would be: 2^16 of them, of twice the mean each
    assert np.sqrt(variance.mean()) < 2 * 2 * exact.mean() / 256


@pytest.mark.parametrize("x", [0.2, 0.5])
@pytest.mark.parametrize("samples", [1, 4, 8, 14])
def test_few_shadow_rays_favour_neither_what_they_see_nor_what_is_hidden(samples, x):
    """Patches have hardly any: of a floor beside a lamp whose nearer half is hidden they made 2.5 times the light."""
    points = np.tile([x, 0.1, 0.0], (20000, 1))
    board = rectangle((HAIR / 2, -2, 0), (0, 4, 0), (0, 0, 0.5), material=BLACK, name="board")
    lamp = AreaLight("lamp", (0, 0, 0.5), (0, 1, 0), (0, 0, 0.5), (1.0, 1.0, 1.0))
    values, variance = direct_light([lamp], points, [board], samples=samples)
    exact = np.pi * point_to_polygon(points[0], UP, [(0, -1, 0.5), (0, 1, 0.5), (0, 1, 1), (0, -1, 1)])
    # four standard errors of the mean, as two replicates each state them; what would be below 0 counts as 0
    assert values[:, 0].mean() == pytest.approx(exact, abs=4 * np.sqrt(variance.mean() / len(points)) + 5e-3 * exact)
