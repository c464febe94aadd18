"""What rays have seen, and what it is uncertain by: means and variances, from their definition."""

import numpy as np
import pytest

from addon.core.gather_sums import BLOCK, LARGEST_VARIANCE, GatherSums, no_sums


def test_means_and_variances_are_those_of_replicates():
    rng, count, replicates = np.random.default_rng(0), BLOCK + 7, 4
    taken = rng.integers(1, 9, count)
    of_replicates = rng.random((count, replicates)) * taken[:, None]
    sums = GatherSums(
        np.repeat(of_replicates.sum(axis=1)[:, None], 3, axis=1).astype(np.float32), of_replicates.astype(np.float32)
    )
    means = of_replicates / taken[:, None]
    # float32
    assert sums.means(taken) == pytest.approx(np.repeat(means.mean(axis=1)[:, None], 3, axis=1), rel=1e-6)
    # of the mean of four; differences of numbers below 1 in float32
    assert sums.variances(taken) == pytest.approx(means.var(axis=1, ddof=1) / replicates, rel=1e-4, abs=1e-8)


def test_one_number_of_rays_is_that_of_all():
    rng = np.random.default_rng(1)
    sums = GatherSums(rng.random((9, 3)).astype(np.float32), rng.random((9, 2)).astype(np.float32))
    assert (sums.means(3) == sums.means(np.full(9, 3))).all()
    assert (sums.variances(3) == sums.variances(np.full(9, 3))).all()


def test_whatever_shines_has_a_variance_that_can_be_added():
    sums = no_sums(3, 2)
    sums.luminances[:, 0] = 1e30
    with np.errstate(over="raise", invalid="raise"):
        variances = sums.variances(1)
    assert (variances == np.float32(LARGEST_VARIANCE)).all()


def test_nobody_has_seen_nothing():
    nothing = no_sums(0, 4)
    assert nothing.means(1).shape == (0, 3)
    assert nothing.variances(1).shape == (0,)
