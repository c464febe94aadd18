"""Rays that leave a long thin triangle: its plane is known to rounding by its length over its height only."""

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.receivers import surface_receivers
from addon.core.scene import PointLight
from tests.scenes import Part, kernel_of, moved, random_rotation, scene_of


@pytest.mark.parametrize("width", [0.1, 0.01, 0.001])
@pytest.mark.parametrize("seed", range(20))
def test_a_sliver_does_not_shade_itself(width, seed):
    """Ten metres long, as skirting boards and door frames are: every point of it sees the lamp above its middle."""
    rng = np.random.default_rng(seed)
    sliver = Part(np.array([(0, 0, 0), (10, 0, 0), (5, width, 0)]), [(0, 1, 2)])
    lamp = PointLight("lamp", (5.0, 0.5 * width, 2.0), (1.0, 1.0, 1.0))
    scene = moved(scene_of([sliver], [lamp]), random_rotation(rng), offset=rng.uniform(-3, 3, 3))
    weights = rng.dirichlet((1, 1, 1), 200).astype(np.float32)
    receivers = surface_receivers(scene, np.zeros(200, np.int32), weights)
    with kernel_of(scene) as kernel:
        values, _, _ = kernel.direct(emitters_of(scene, kernel.centre), receivers, 16, 0)
    assert (values > 0).all()
