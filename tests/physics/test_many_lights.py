"""Hundreds of weak lights, of which each receiver samples a few: the sum over all, within the error stated."""

import numpy as np
import pytest

from addon.core.luminance import LUMINANCE
from addon.core.scene import AreaLight, Material, PointLight
from tests.physics.lighting import direct_light, random_points
from tests.reference.polygon import point_to_polygon
from tests.scenes import Part, rectangle

COUNT = 200
BOARD = rectangle((-0.6, -0.6, 0.8), (1.2, 0, 0), (0, 1.2, 0))


def lamps(rng):
    places = np.concatenate([rng.uniform(-3, 3, (COUNT, 2)), rng.uniform(1, 3, (COUNT, 1))], axis=1)
    return [PointLight(f"lamp {i}", tuple(p), tuple(rng.uniform(0.2, 1, 3))) for i, p in enumerate(places)]


def exact_sum(lights, points):
    """I cos / d^2 of the lamps that the board does not hide."""
    total = np.zeros((len(points), 3))
    for light in lights:
        to = np.asarray(light.position) - points
        through = points + to * (0.8 / to[:, 2:])
        is_seen = (np.abs(through[:, :2]) > 0.6).any(axis=1)
        total += (is_seen * to[:, 2] / np.linalg.norm(to, axis=1) ** 3)[:, None] * light.intensity
    return total


def check(values, variance, exact, samples_say):
    errors = (values - exact) @ LUMINANCE
    stated = np.sqrt(variance.mean())
    # two halves state each variance: their mean over 400 receivers is good to 10 %, systematic sampling to a bit less
    assert np.sqrt(np.mean(errors**2)) < 1.5 * stated + 1e-5
    assert errors.mean() == pytest.approx(0, abs=4 * np.sqrt(np.mean(errors**2) / len(errors)) + 1e-6)
    assert stated < samples_say * (exact @ LUMINANCE).mean()


@pytest.mark.parametrize("samples", [16, 64])
def test_two_hundred_lamps_behind_a_board(samples):
    rng = np.random.default_rng(0)
    lights, points = lamps(rng), random_points(400, rng)
    values, variance = direct_light(lights, points, [BOARD], samples=samples)
    # each sample is 0 or its full share: at worst the deviation of a coin, over the root of the samples
    check(values, variance, exact_sum(lights, points), 1 / np.sqrt(samples))


def test_one_strong_lamp_among_weak_ones_has_no_noise_of_its_own():
    rng = np.random.default_rng(1)
    lights, points = lamps(rng), random_points(400, rng)
    strong = PointLight("strong", (0.1, 0.2, 2.5), (5000.0, 5000.0, 5000.0))
    values, variance = direct_light([*lights, strong], points, [BOARD], samples=64)
    exact = exact_sum([*lights, strong], points)
    # all noise is that of the weak lamps, less than their sum
    weak = exact_sum(lights, points) @ LUMINANCE
    assert np.sqrt(np.mean(((values - exact) @ LUMINANCE) ** 2)) < weak.mean()
    assert np.sqrt(variance.mean()) < weak.mean()


@pytest.mark.parametrize("samples", [4, 32])
def test_forty_glowing_meshes_and_lamps_give_what_many_rays_say(samples):
    """Near ones and far ones, that hide each other: what a light is taken for when rays are shared is not its light."""
    rng, meshes = np.random.default_rng(3), []
    for number in range(40):
        centre = np.append(rng.uniform(-3, 3, 2), rng.uniform(0.3, 3))
        glow = Material(f"glow {number}", (0, 0, 0), radiance=(rng.uniform(0.1, 5),) * 3)
        corners = centre + rng.uniform(0.05, 0.4) * rng.standard_normal((4, 3))
        meshes.append(Part(corners, [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)], glow))
    panels = [
        AreaLight(f"panel {k}", (x, 1.0, 2.9), (0.3, 0, 0), (0, 0.2, 0), (3.0, 3.0, 3.0)) for k, x in enumerate((-1, 1))
    ]
    points = random_points(60, rng)
    many = direct_light(panels, points, meshes, samples=2048)[0].mean()
    means = [direct_light(panels, points, meshes, samples, seed)[0].mean() for seed in range(40)]
    # at 4 standard errors; 2048 rays of each point are good to a tenth of that
    assert np.mean(means) == pytest.approx(many, abs=4.1 * np.std(means) / np.sqrt(40))
    assert np.std(means) < 0.1 * many


def test_a_wall_of_glowing_tiles_is_one_lamp():
    """1600 glowing triangles, in groups: the closed form of the whole."""
    glow = Material("glow", (0, 0, 0), radiance=(2.0, 2.0, 2.0))
    wall = rectangle((-2, -2, 1.5), (0, 4, 0), (4, 0, 0), cuts=(28, 28), material=glow)
    points = random_points(200, np.random.default_rng(2))
    values, variance = direct_light([], points, [wall], samples=128)
    corners = [(-2, -2, 1.5), (2, -2, 1.5), (2, 2, 1.5), (-2, 2, 1.5)]
    factors = np.array([point_to_polygon(p, np.array([0, 0, 1.0]), corners) for p in points])
    check(values, variance, 2 * np.pi * np.outer(factors, np.ones(3)), 0.05)


def test_lamps_that_shine_on_the_back_give_nothing():
    rng = np.random.default_rng(3)
    below = [PointLight(f"lamp {i}", (*rng.uniform(-3, 3, 2), -1.0), (1.0, 1.0, 1.0)) for i in range(COUNT)]
    values, variance = direct_light(below, random_points(50, rng))
    assert (values == 0).all()
    assert (variance == 0).all()
