"""Rays at a target only, aimed or through a hemicube's pixels: exact where nothing hides it, and what is hidden."""

import numpy as np
import pytest

from addon.core.aimed import pairs_apart
from addon.core.analytic import surface
from addon.core.estimators import AnalyticEstimator
from addon.core.kernel import sobol_points
from addon.core.sampled import SampledEstimator
from addon.core.workers import Workers
from tests.reference.exchange import exchange

FLOOR = surface("floor", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
CEILING = surface("ceiling", [(0, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0, 1)])
WALL = surface("wall", [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)])
C_11 = 0.19982489569838738  # Howell: opposed unit squares, distance 1
C_14 = 0.20004377607540316  # Howell: unit squares with a common edge, at a right angle


@pytest.fixture(params=["monte-carlo", "hemicube"])
def estimator(request):
    with Workers(2) as workers:
        yield SampledEstimator(request.param, workers)


@pytest.fixture
def hemicubes():
    with Workers(2) as workers:
        yield SampledEstimator("hemicube", workers)


def test_what_stands_apart_is_right_to_a_millionth(estimator):
    found = estimator.factor(FLOOR, CEILING)
    # 4e-7 is the bound at which rays stop
    assert found.bound < 4e-7
    assert found.value == pytest.approx(C_11, abs=1e-6)


def test_a_blocker_hides_all_or_half(estimator):
    whole = surface("whole", [(-1, -1, 0.5), (2, -1, 0.5), (2, 2, 0.5), (-1, 2, 0.5)])
    assert estimator.factor(FLOOR, CEILING, [whole]).value == 0
    # in the middle plane x = 1/2 hides every ray that crosses it; by symmetry a half is F between equal halves
    wall = surface("wall", [(0.5, 0, 0), (0.5, 1, 0), (0.5, 1, 1), (0.5, 0, 1)])
    left = [surface("a", [(0, 0, 0), (0.5, 0, 0), (0.5, 1, 0), (0, 1, 0)]),
            surface("b", [(0, 0, 1), (0, 1, 1), (0.5, 1, 1), (0.5, 0, 1)])]  # fmt: skip
    # what stands on the target is not taken for it: the bound of both, and rays' ends are good to 2^-19
    assert estimator.factor(FLOOR, CEILING, [wall]).value == pytest.approx(estimator.factor(*left).value, abs=1e-6)


def test_random_blockers_against_pairs_of_random_points(estimator):
    rng = np.random.default_rng(0)
    blockers = [
        rng.random(3) * (1, 1, 0.6) + (0, 0, 0.2) + rng.uniform(-0.5, 0.5, (3, 3)) * (1, 1, 0.3) for _ in range(5)
    ]
    found = estimator.factor(FLOOR, CEILING, [surface(f"blocker{k}", corners) for k, corners in enumerate(blockers)])
    mean, error = exchange(FLOOR.pieces[0], CEILING.pieces[0], blockers, 400_000, rng)
    # 99 % of ours, four standard errors of theirs
    assert 0.1 * C_11 < mean < 0.9 * C_11
    assert abs(found.value - mean) < found.bound + 4 * error


def test_surfaces_that_touch_have_no_pairs():
    assert pairs_apart(FLOOR.pieces, WALL.pieces) is None


def test_hemicubes_are_right_where_surfaces_touch(hemicubes):
    found = hemicubes.factor(FLOOR, WALL)
    # next to the edge what is seen of the wall changes at once: positions, not pixels, are what is left of the error
    assert found.value == pytest.approx(C_14, abs=found.bound)
    assert found.bound < 1e-6


@pytest.mark.parametrize("degrees", [0.1, 30.0, 179.0])
def test_hemicubes_between_leaves_at_any_angle(hemicubes, degrees):
    angle = np.radians(degrees)
    leaf = surface("leaf", [(0, 0, 0), (0, 1, 0), (np.cos(angle), 1, np.sin(angle)), (np.cos(angle), 0, np.sin(angle))])
    exact = AnalyticEstimator().factor(FLOOR, leaf).value
    found = hemicubes.factor(FLOOR, leaf)
    # what it states must hold, and be worth something: of the 1 that a leaf of 0.1 degrees gets, a ten-thousandth
    assert abs(found.value - exact) <= found.bound
    assert found.value == pytest.approx(exact, abs=1e-4)


def test_a_hemicube_without_pixels_on_a_needle_still_knows_its_size(hemicubes):
    needle = surface("needle", [(0, 0, 1), (1e-7, 0, 1), (1, 1, 1)][::-1])
    exact = AnalyticEstimator().factor(FLOOR, needle).value
    # no pixel over it tells what is hidden, so it is all seen: its size is the closed form at points of the floor
    assert hemicubes.factor(FLOOR, needle).value == pytest.approx(exact, rel=1e-4)


def test_surfaces_that_face_away_have_an_empty_list():
    below = surface("below", [(0, 0, -1), (1, 0, -1), (1, 1, -1), (0, 1, -1)])
    assert pairs_apart(FLOOR.pieces, below.pieces) == []


def test_sobol_points_are_even_in_each_coordinate():
    points = sobol_points(0, 64, 3)
    # a (0, m, 1) net in each: one point in each 64th
    assert (np.sort(np.floor(64 * points), axis=0) == np.arange(64)[:, None]).all()
