"""Solvers on small systems by hand; the worked example is the classic lecture's, its matrix taken as it is given."""

import numpy as np
import pytest

from addon.core.dense import DIRECT_LIMIT, require_direct_size, solve_direct
from addon.core.progressive import ProgressiveRefinement, solve_progressive
from addon.core.settings import SettingsError

# three patches of one area; the rest of what the rows lack escapes
FORM_FACTORS = np.array([[0, 0.4, 0.6], [0.4, 0, 0.2], [0.6, 0.2, 0]])
REFLECTANCE = np.full((3, 3), 0.5)
EMITTED = np.array([[1.0] * 3, [0.0] * 3, [0.0] * 3])
AREAS = np.ones(3)

# order of shooting (patches counted from 1 in the lecture), and B after each step
SHOTS = (
    (1, (1, 0.2, 0.3)),
    (3, (1.09, 0.23, 0.3)),
    (2, (1.136, 0.23, 0.323)),
    (1, (1.136, 0.2572, 0.3638)),
    (3, (1.15514, 0.26358, 0.3638)),
    (2, (1.16186, 0.26358, 0.36716)),
)


class Rows:
    """Form factors from a matrix, as solvers ask for them."""

    def __init__(self, matrix):
        self.matrix = matrix

    def rows(self, sides):
        return self.matrix[sides]


def random_closed(rng, count, escaping=0.0):
    """Form factors of made-up patches: A_i F_ij symmetric, rows that sum to 1 - escaping."""
    exchange = rng.random((count, count))
    exchange = exchange + exchange.T
    np.fill_diagonal(exchange, 0)
    for _ in range(200):  # Sinkhorn: symmetric scaling to areas 1
        scale = 1 / np.sqrt(exchange.sum(axis=1))
        exchange = scale[:, None] * exchange * scale
    return (1 - escaping) * exchange


def test_progressive_refinement_goes_through_the_worked_example_step_by_step():
    state = ProgressiveRefinement(Rows(FORM_FACTORS), REFLECTANCE, EMITTED, AREAS)
    for number, expected in SHOTS:
        state.shoot(number - 1)
        # the lecture rounds to five decimals
        assert state.radiosity[:, 0] == pytest.approx(expected, abs=6e-6)
        assert state.unshot[number - 1] == pytest.approx(0)


def test_direct_solves_the_worked_example():
    solution = solve_direct(FORM_FACTORS, REFLECTANCE, EMITTED, AREAS)
    assert solution.radiosity[:, 1] == pytest.approx((1.16745, 0.27123, 0.37736), abs=6e-6)  # given to five decimals
    assert solution.residuals[0] < 1e-14  # rounding of three terms


def test_progressive_refinement_left_to_itself_reaches_the_direct_solution():
    solution = solve_progressive(Rows(FORM_FACTORS), REFLECTANCE, EMITTED, AREAS, 1e-9)
    exact = solve_direct(FORM_FACTORS, REFLECTANCE, EMITTED, AREAS).radiosity
    # each unshot watt adds at most rho / (1 - rho) = 1 W in all
    assert solution.radiosity == pytest.approx(exact, abs=3 * 3e-9)
    assert solution.residuals[0] == 1
    assert solution.residuals[-1] <= 1e-9
    # with rho sum F < 1 no shot adds to what is unshot
    assert (np.diff(solution.residuals) < 0).all()


def test_the_largest_unshot_flux_is_shot_first():
    areas = np.array([1.0, 4.0, 1.0])
    emitted = np.array([[1.0] * 3, [0.5] * 3, [1.5] * 3])  # flux 1, 2, 1.5: the large patch, not the brightest
    matrix = np.array([[0, 0.4, 0.1], [0.1, 0, 0.1], [0.1, 0.4, 0]])
    asked = []

    class Watched(Rows):
        def rows(self, sides):
            asked.append(int(sides[0]))
            return super().rows(sides)

    solve_progressive(Watched(matrix), REFLECTANCE, emitted, areas, 0.9)
    assert asked[0] == 1


@pytest.mark.parametrize("escaping", [0.0, 0.3])
def test_direct_and_progressive_agree_and_lose_no_flux(escaping):
    rng = np.random.default_rng(1)
    matrix = random_closed(rng, 30, escaping)
    reflectance, emitted = rng.uniform(0, 0.9, (30, 3)), rng.random((30, 3)) * (rng.random((30, 1)) < 0.2)
    areas = np.ones(30)
    direct = solve_direct(matrix, reflectance, emitted, areas)
    progressive = solve_progressive(Rows(matrix), reflectance, emitted, areas, 1e-8)
    # unshot flux 1e-8 of the first, times at most 1 / (1 - rho) = 10 on its way
    assert progressive.radiosity == pytest.approx(direct.radiosity, abs=1e-7 * emitted.sum())
    for energy in (direct.energy, progressive.energy):
        assert energy.shot == pytest.approx(emitted.sum())
        # float64 sums of thousands of shots
        assert energy.absorbed + energy.escaped + energy.unshot == pytest.approx(energy.shot, rel=1e-10)
    assert direct.energy.escaped == pytest.approx(escaping * direct.radiosity.sum())
    assert progressive.energy.escaped == pytest.approx(direct.energy.escaped, abs=1e-6)


def test_a_scene_without_light_is_dark_and_done():
    dark = np.zeros((3, 3))
    for solution in (
        solve_direct(FORM_FACTORS, REFLECTANCE, dark, AREAS),
        solve_progressive(Rows(FORM_FACTORS), REFLECTANCE, dark, AREAS, 1e-3),
    ):
        assert (solution.radiosity == 0).all()
        assert solution.energy.shot == 0


def test_a_dense_system_that_would_not_fit_is_refused_with_its_size():
    require_direct_size(DIRECT_LIMIT)
    with pytest.raises(SettingsError, match=str(DIRECT_LIMIT + 1)):
        require_direct_size(DIRECT_LIMIT + 1)
