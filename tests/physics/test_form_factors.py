"""Form factors: exact values, closure, reciprocity; by the kernel's two estimators and their brute-force twins."""

from functools import partial

import numpy as np
import pytest

from addon.core.patches import subdivide
from addon.core.transport import HemicubeFormFactors, MonteCarloFormFactors
from tests.reference import form_factors as twins
from tests.scenes import closed_box, corner, kernel_of, rectangle, room_with_occluder, scene_of, two_plates

C_11 = 0.19982489569838738  # Howell: opposed unit squares, distance 1
C_14 = 0.20004377607540315  # Howell: perpendicular unit squares with a common edge


def by_monte_carlo(kernel, seed, rays=4096):
    return MonteCarloFormFactors(kernel, rays, seed)


def by_hemicube(kernel, seed, resolution=16, positions=8):
    return HemicubeFormFactors(kernel, resolution, positions, seed)


ESTIMATORS = [by_monte_carlo, by_hemicube]


def fronts(patches, scene, obj):
    span = scene.objects[obj].span
    return 2 * np.flatnonzero((patches.triangles >= span.start) & (patches.triangles < span.stop))


def by_kernel(estimator, scene, seed):
    """Form factor from the front of object 0 to the front of object 1, each of several patches."""
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.5, 1000, seed)
        sources, targets = fronts(patches, scene, 0), fronts(patches, scene, 1)
        rows = estimator(kernel, seed).rows(sources)
    return np.average(rows[:, targets].sum(axis=1), weights=patches.side_areas[sources])


def by_twin(scene, seed, method=None, **spent):
    return method(scene.corners, [0, 1], [2, 3], rng=np.random.default_rng(seed), **spent)


ROUTES = {
    # the twin's pixels sample by midpoints, which leaves an error of the order of (1 / resolution)^2; the kernel's at
    # a point of their own for each hemicube, which leaves none
    "kernel, Monte Carlo": (partial(by_kernel, by_monte_carlo), 0),
    "kernel, hemicube": (partial(by_kernel, by_hemicube), 0),
    "twin, cosine rays": (partial(by_twin, method=twins.by_cosine_rays, rays=4000), 0),
    "twin, hemicube": (partial(by_twin, method=twins.by_hemicubes, resolution=16, positions=64), 1 / 16**2),
}


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize(("scene", "exact"), [(two_plates(), C_11), (corner(), C_14)], ids=["C-11", "C-14"])
def test_howells_squares(route, scene, exact):
    estimate, relative_bias = ROUTES[route]
    values = np.array([estimate(scene, seed=seed) for seed in range(16)])
    standard_error = values.std(ddof=1) / 4
    # four standard errors of 16 replicates (t: one false alarm in a thousand); they must say something, too
    assert abs(values.mean() - exact) < 4 * standard_error + relative_bias * exact
    assert standard_error < 0.02 * exact


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_closed_box_takes_all_the_light(estimator):
    scene = closed_box(size=(1.0, 2.0, 0.7))
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.4, 1000, 0)
        rows = estimator(kernel, 0).rows(np.arange(0, 2 * len(patches), 2))
    # each entry is rounded to float32, their sums are not: a furnace at 0.9999 needs this
    assert rows.sum(axis=1, dtype=np.float64) == pytest.approx(np.ones(len(rows)), abs=2e-7)
    # a box seen from inside shows no backs
    assert (rows[:, 1::2] == 0).all()


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_nothing_is_seen_from_outside_a_closed_box(estimator):
    scene = closed_box()
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.4, 1000, 0)
        rows = estimator(kernel, 0).rows(np.arange(1, 2 * len(patches), 2))
    assert (rows == 0).all()


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("scene", [corner(), room_with_occluder()], ids=["corner", "occluder"])
def test_reciprocity(estimator, scene):
    """A_i F_ij = A_j F_ji, both estimated from rays of their own."""
    rows = []
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.6, 1000, 0)
        for seed in range(8):
            rows.append(estimator(kernel, seed).rows(np.arange(2 * len(patches))))
    exchange = patches.side_areas[:, None] * np.array(rows, np.float64)
    difference = exchange.mean(axis=0) - exchange.mean(axis=0).T
    variance = exchange.var(axis=0, ddof=1) / 8
    upper = np.triu_indices(len(difference), 1)
    standard_error = np.sqrt(variance + variance.T)[upper]
    tried = exchange.mean(axis=0)[upper] > 1e-3 * patches.side_areas.mean()
    assert tried.sum() > 50
    score = difference[upper][tried] / standard_error[tried]
    # t with about 14 degrees of freedom: variance 1.17; hemicubes keep a little of their pixels' bias
    assert np.sqrt(np.mean(score**2)) < 1.5
    assert np.abs(score).max() < 8


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_plate_sees_none_of_what_an_occluder_hides(estimator):
    between = rectangle((-1, -1, 0.5), (3, 0, 0), (0, 3, 0))
    parts = [rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0)), between]
    assert by_kernel(estimator, scene_of(parts), 0) == 0


def test_a_hemicubes_delta_form_factors_sum_to_one_and_are_cosines_over_pi():
    directions, factors = twins.hemicube(32)
    assert factors.sum() == pytest.approx(1, abs=1e-12)  # rounding of 3072 differences
    squared = (directions**2).sum(axis=1)
    pixel = (2 / 32) ** 2
    # Cohen & Greenberg, eqs. 12-13: n / (pi r^4) at the pixel's middle; its curvature within a pixel is the rest
    assert factors == pytest.approx(pixel * directions[:, 2] / (np.pi * squared**2), rel=3e-3)
    # the mean cosine of a cosine-weighted direction is 2/3; midpoints again
    assert factors @ (directions[:, 2] / np.sqrt(squared)) == pytest.approx(2 / 3, abs=1e-3)


def test_more_rays_make_form_factors_better_at_the_slope_of_a_stratified_sequence():
    scene = two_plates()
    errors = []
    for rays in (64, 4096):
        values = [by_kernel(partial(by_monte_carlo, rays=rays), scene, seed) for seed in range(16)]
        errors.append(np.sqrt(np.mean((np.array(values) - C_11) ** 2)))
    # independent rays: 8 times better for 64 times the rays; RMS over 16 values is good to a factor 1.2 each
    assert errors[1] < errors[0] / 9
