"""Plates a hair apart, squares that share an edge at any angle: rays leave one face and meet the other."""

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.receivers import Receivers
from addon.core.scene import AreaLight
from tests.physics.lighting import floor, floor_receivers
from tests.physics.plates import PUSH, factors, noise
from tests.scenes import BLACK, kernel_of, rectangle, scene_of, two_plates

GAPS = {1e-1: 0.826994522397, 1e-2: 0.980416602926, 1e-3: 0.998005631908, 1e-4: 0.999800070978, 1e-5: 0.999980000856}
GAPS[1e-6] = 0.999998000010


@pytest.mark.parametrize("gap", GAPS)
def test_plates_a_hair_apart_see_nothing_but_each_other(gap):
    found = factors(two_plates(gap))
    # Howell C-11; rays start a push nearer to the other plate, which loses no more than a smaller gap does
    assert found == pytest.approx(GAPS[gap], abs=noise(GAPS[gap], 2 << 16))


@pytest.mark.parametrize("gap", [1e-5, 1e-6])
def test_a_lamp_a_hair_off_a_wall_does_not_shine_through_it(gap):
    """Floor, a hair above it a board, a lamp above: under the board it is dark, to the last bit."""
    points = np.column_stack([np.random.default_rng(0).uniform(-0.9, 0.9, (500, 2)), np.zeros(500)])
    board = rectangle((-1, -1, gap), (2, 0, 0), (0, 2, 0), material=BLACK)
    panel = AreaLight("panel", (0, 0, 1.0), (0, 0.3, 0), (0.3, 0, 0), (1.0, 1.0, 1.0))
    # 1 m from the middle a push is 9.5e-7 m: what lies nearer than that is beyond what rays can tell
    scene = scene_of([floor(1.9), board], (panel,))
    where = floor_receivers(points)
    with kernel_of(scene) as kernel:
        light, _, _ = kernel.direct(emitters_of(scene, kernel.centre), where, 64, 0)
        above = Receivers(points + np.array([0, 0, gap]), where.normals, np.full(500, 4, np.int32))
        lit, _, _ = kernel.direct(emitters_of(scene, kernel.centre), above, 64, 0)
    assert (light == 0).all()
    assert (lit > 0).all()


DIHEDRALS = {
    0.01: 0.999825556593,
    1.0: 0.982997178575,
    30.0: 0.619028323091,
    90.0: 0.200043776075,
    150.0: 0.021345325413,
    179.0: 2.36087831150e-5,
    179.9: 2.36086654e-7,
}


@pytest.mark.parametrize("degrees", DIHEDRALS)
def test_squares_that_share_an_edge_at_any_angle(degrees):
    angle, exact, rays = np.radians(degrees), DIHEDRALS[degrees], 1 << 18
    turned = (np.cos(angle), 0, np.sin(angle))
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), rectangle((0, 0, 0), (0, 1, 0), turned)])
    found = factors(scene, rays)
    # nearer to the edge than a push over the slope, a ray starts beyond the other square and misses it
    lost = PUSH * 1.0 / np.tan(angle) if degrees < 45 else 0
    assert exact - lost - noise(exact, 2 * rays) <= found <= exact + noise(exact, 2 * rays)
