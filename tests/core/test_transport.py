"""Form factor estimators as the solvers see them: one interface, a choice by name, finer for a smaller error."""

import numpy as np
import pytest

from addon.core.patches import subdivide
from addon.core.transport import (
    REPLICATES,
    HemicubeFormFactors,
    MonteCarloFormFactors,
    estimate,
    form_factors,
    replicated,
)
from tests.scenes import cornell_box, kernel_of


@pytest.fixture
def kernel():
    scene = cornell_box()
    with kernel_of(scene, 2) as kernel:
        subdivide(scene, kernel, 0.3, 1000, 0)
        yield kernel


@pytest.mark.parametrize(
    ("method", "kind"), [("monte-carlo", MonteCarloFormFactors), ("hemicube", HemicubeFormFactors)]
)
def test_the_method_names_the_estimator_and_the_error_its_price(kernel, method, kind):
    coarse, fine = (form_factors(kernel, method, error, 0) for error in (0.1, 0.001))
    assert type(coarse) is type(fine) is kind
    assert coarse.rays_per_row < fine.rays_per_row


@pytest.mark.parametrize("method", ["monte-carlo", "hemicube"])
def test_a_row_is_the_same_alone_and_among_others(kernel, method):
    estimator = form_factors(kernel, method, 0.1, 7)
    sides = np.arange(0, kernel.side_count, 3)
    together = estimator.rows(sides)
    assert together.shape == (len(sides), kernel.side_count)
    assert together.dtype == np.float32
    for k in (0, 5, len(sides) - 1):
        assert estimator.rows(sides[k : k + 1])[0].tobytes() == together[k].tobytes()


@pytest.mark.parametrize("method", ["monte-carlo", "hemicube"])
def test_rows_are_shares(kernel, method):
    rows = form_factors(kernel, method, 0.1, 7).rows(np.arange(kernel.side_count))
    assert (rows >= 0).all()
    # float32 sums of some thousand shares
    assert rows.sum(axis=1).max() <= 1 + 1e-4
    # a flat patch does not see itself, neither side
    own = np.arange(kernel.side_count)
    assert (rows[own, own] == 0).all()
    assert (rows[own, own ^ 1] == 0).all()


def test_a_seed_of_its_own_makes_another_estimate(kernel):
    first, again, other = (form_factors(kernel, "monte-carlo", 0.1, seed).rows([0]) for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).any()


def test_a_side_that_is_none_is_refused(kernel):
    with pytest.raises(ValueError, match="range"):
        form_factors(kernel, "monte-carlo", 0.1, 0).rows([kernel.side_count])


# ---- stated errors ----


def test_nothing_hit_is_the_rule_of_three():
    found = estimate(np.zeros((REPLICATES, 2)), rays=3000)
    assert (found.value == 0).all()
    assert found.bound == pytest.approx([1e-3, 1e-3])


def test_a_99_percent_bound_covers_99_percent():
    rng = np.random.default_rng(0)
    values = rng.normal(0.3, 0.01, size=(REPLICATES, 20_000))
    found = estimate(values, rays=10**9)
    missed = np.mean(np.abs(found.value - 0.3) > found.bound)
    # 20 000 trials of 1 %: standard error 7e-4, four of them
    assert abs(missed - 0.01) < 0.003


def test_replicates_are_independent_and_repeatable(kernel):
    estimator = form_factors(kernel, "monte-carlo", 0.1, 3)
    first, again = (replicated(estimator, [0, 4], lambda rows: rows.astype(np.float64)) for _ in range(2))
    assert first.shape == (REPLICATES, 2, kernel.side_count)
    assert (first == again).all()
    assert len(np.unique(first.reshape(REPLICATES, -1), axis=0)) == REPLICATES
