"""Conjugate gradients on systems by hand: against bounces added up, few steps at any reflectance, black sides."""

import numpy as np
import pytest

from addon.core.conjugate_gradient import EXCHANGE_LIMIT, require_exchange_size, solve_conjugate_gradient
from addon.core.exchange import exchange_of
from addon.core.settings import SettingsError
from tests.physics.systems import l_room, sampled
from tests.reference.radiosity import by_series


@pytest.fixture(scope="module")
def room():
    return sampled(l_room(), 0.45, 256)


def solve(room, reflectance, emitted, limit=1e-12, **options):
    matrix, areas = room
    return solve_conjugate_gradient(exchange_of(matrix.copy(), areas), reflectance, emitted, areas, limit, **options)


@pytest.mark.parametrize("rho", [0.1, 0.9, 0.9999])
def test_all_bounces_added_up_are_the_same(room, rho):
    emitted = np.random.default_rng(0).random((len(room[1]), 3))
    solution = solve(room, np.full(emitted.shape, rho), emitted)
    exact = by_series(room[0], np.full(len(emitted), rho), emitted[:, 1])
    # unshot 1e-12, and rounding of hundreds of terms times 1 / (1 - rho)
    assert solution.radiosity[:, 1] == pytest.approx(exact, rel=1e-9)


def test_steps_hardly_depend_on_reflectance(room):
    emitted = np.zeros((len(room[1]), 3))
    emitted[:4] = 1.0
    steps = [len(solve(room, np.full(emitted.shape, rho), emitted, 1e-8).residuals) for rho in (0.5, 0.99, 0.9999)]
    # Jacobi takes log(1e-8) / log(rho): 27, 1833, 184000. Measured on a cube: 10, 17, 21
    assert steps[0] <= 15
    assert steps[2] <= 35


def test_the_residual_is_the_true_one_and_stops_the_steps(room):
    matrix, areas = room
    rng = np.random.default_rng(1)
    reflectance, emitted = rng.uniform(0, 0.95, (len(areas), 3)), rng.random((len(areas), 3))
    solution = solve(room, reflectance, emitted, 1e-5)
    rest = emitted + reflectance * (matrix @ solution.radiosity) - solution.radiosity
    share = (areas[:, None] * np.abs(rest)).sum() / (areas[:, None] * emitted).sum()
    assert solution.residuals[-1] == pytest.approx(share, rel=1e-6)
    assert solution.residuals[-1] <= 1e-5 < solution.residuals[-2]


def test_black_sides_emit_and_reflect_nothing(room):
    """Reflectance 0 divides by nothing: those sides are known, and light the others."""
    matrix, areas = room
    reflectance, emitted = np.full((len(areas), 3), 0.7), np.zeros((len(areas), 3))
    reflectance[::3], emitted[0] = 0.0, 2.0
    solution = solve(room, reflectance, emitted)
    assert (solution.radiosity[::3] == emitted[::3]).all()
    exact = by_series(matrix, reflectance[:, 0], emitted[:, 0])
    assert solution.radiosity[:, 0] == pytest.approx(exact, rel=1e-9)


def test_steps_are_told_and_can_be_limited(room):
    emitted = np.ones((len(room[1]), 3))
    told = []
    solution = solve(room, 0.9 * emitted, emitted * np.arange(len(emitted))[:, None], on_step=told.append, most_steps=3)
    assert told == sorted(told)
    assert len(told) == 3
    assert len(solution.residuals) == 4


def test_an_exchange_that_would_not_fit_is_refused_with_its_size():
    require_exchange_size(EXCHANGE_LIMIT)
    with pytest.raises(SettingsError, match=str(EXCHANGE_LIMIT + 1)):
        require_exchange_size(EXCHANGE_LIMIT + 1)
