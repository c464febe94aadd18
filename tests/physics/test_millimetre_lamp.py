"""The very small in the very large."""

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.receivers import Receivers
from addon.core.scene import AreaLight, Material
from tests.physics.lighting import SINGLE
from tests.scenes import BLACK, box, kernel_of, rectangle, scene_of


def hall():
    """100 x 100 x 20 m, black, centred on the origin of floor_receivers."""
    return box((-50, -50, 0), (50, 50, 20), inwards=True, material=BLACK, name="hall")


def millimetre_lamps():
    """1 W from a square of 1 mm in the ceiling's plane: as an area lamp, and as a glowing face."""
    radiance = (1 / (np.pi * 1e-6),) * 3
    half = 0.0005
    lamp = AreaLight("lamp", (0, 0, 20), (0, half, 0), (half, 0, 0), radiance)
    glow = Material("glow", (0.0,) * 3, radiance=radiance)
    mesh = rectangle((-half, -half, 20), (0, 2 * half, 0), (2 * half, 0, 0), material=glow, name="lamp")
    return {"lamp": ((), (lamp,)), "mesh": ((mesh,), ())}


@pytest.mark.parametrize("kind", ["lamp", "mesh"])
def test_a_millimetre_lamp_lights_a_hall_of_a_hundred_metres(kind):
    """E = cos^4 / (pi h^2) of 1 W: below the lamp 1 / (400 pi), in the corner 4.36639e-6."""
    parts, lights = millimetre_lamps()[kind]
    below, corner = 7.95774714796e-4, 4.3663907574584609e-6
    scene = scene_of([hall(), *parts], lights)
    below_all = np.flatnonzero((scene.corners[:12, :, 2] == 0).all(axis=1))
    points = np.array([(0.0, 0.0, 0.0), (49.999, 49.999, 0.0)])
    with kernel_of(scene) as kernel:
        light, _, _ = kernel.direct(emitters_of(scene, kernel.centre), on_floor(scene, below_all, points), 64, 0)
    # the corner is a millimetre outside the receiver: 2e-5 / m x 1.4 mm at the sixth power of the distance
    assert light[0] == pytest.approx([below] * 3, rel=SINGLE)
    assert light[1] == pytest.approx([corner] * 3, rel=2e-4)


def on_floor(scene, triangles, points):
    """Receivers at points of the floor, on whichever of its two triangles holds them."""
    sides = []
    for point in points:
        for triangle in triangles:
            a, b, c = scene.corners[triangle][:, :2]
            weights = np.linalg.solve(np.array([b - a, c - a]).T, point[:2] - a)
            if weights.min() >= -1e-9 and weights.sum() <= 1 + 1e-9:
                sides.append(2 * triangle)
                break
    return Receivers(points, np.tile(np.float32([0, 0, 1]), (len(points), 1)), np.array(sides, np.int32))
