"""Ten thousand kilometres from the origin a scene is what it is at the origin."""

import numpy as np
import pytest

from addon.core.patches import subdivide
from addon.core.scene import AreaLight
from addon.core.transport import HemicubeFormFactors, MonteCarloFormFactors
from tests.physics.lighting import full_light
from tests.physics.plates import factors, noise, well_inside
from tests.scenes import box, kernel_of, moved, rectangle, scene_of, two_plates


@pytest.mark.parametrize("offset", [1e3, 1e5, 1e7])
def test_far_from_the_origin_form_factors_are_the_same_to_the_bit(offset):
    """Coordinates in eighths of a metre are exact in doubles out to 1e7 m, and so is what is left when re-centred."""
    scene = two_plates(0.125)
    there = moved(scene, offset=(offset, -offset, offset))
    for estimator in (lambda k: MonteCarloFormFactors(k, 1024, 0), lambda k: HemicubeFormFactors(k, 16, 4, 0)):
        rows = []
        for each in (scene, there):
            with kernel_of(each) as kernel:
                patches = subdivide(each, kernel, 0.5, 1000, 0)
                rows.append(estimator(kernel).rows(np.arange(2 * len(patches))))
        assert rows[0].tobytes() == rows[1].tobytes()


@pytest.mark.parametrize("offset", [1e4, 1e7])
def test_far_from_the_origin_plates_of_odd_sizes_are_still_seen(offset):
    """0.3 x 0.2 m, 0.1 m apart: 0.4755764365, where float32 vertices give 0.477 at 1e4 m and nothing at 1e7 m."""
    lower = rectangle((0, 0, 0), (0.3, 0, 0), (0, 0.2, 0), name="lower")
    upper = rectangle((0, 0, 0.1), (0, 0.2, 0), (0.3, 0, 0), name="upper")
    found = factors(moved(scene_of([lower, upper]), offset=(offset, offset, offset)))
    # doubles are 2e-9 m apart at 1e7 m: nothing of 0.1 m
    assert found == pytest.approx(0.475576436533, abs=noise(0.4756, 2 << 16))


@pytest.mark.parametrize("offset", [1e5, 1e7])
def test_far_from_the_origin_a_lamp_gives_the_same_light(offset):
    scene = box_with_panel()
    lights = []
    for each in (scene, moved(scene, offset=(offset, offset, -offset))):
        receivers = well_inside(each)
        lights.append(full_light(each, receivers, error=0.1, patch_size=0.25)[0])
    near, far = (light.values.astype(float) for light in lights)
    # the same patches and the same sequences: only rays on the very edge of something may go elsewhere
    assert np.sqrt(np.mean((far / near - 1) ** 2)) < 0.3 * max(lights[0].relative_error, 0.01)
    assert far.mean() == pytest.approx(near.mean(), rel=2e-3)


def box_with_panel():
    panel = AreaLight("panel", (0.5, 0.5, 0.875), (0, 0.25, 0), (0.25, 0, 0), (3.0, 3.0, 4.0))
    return scene_of([box((0, 0, 0), (1, 1, 1), inwards=True)], (panel,))
