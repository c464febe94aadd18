"""Passes of a gather: how many rays they begin with, may take, and what the last ones are for."""

import numpy as np
import pytest

from addon.core.gather_job import REPLICATES
from addon.core.passes import (
    ENOUGH,
    FREE_RAYS,
    LEAST_FIRST,
    MOST_FIRST,
    SPECKLE_SHARE,
    _Found,
    _next,
    _Samples,
    first_rays,
    ray_budget,
)
from addon.core.probes import Measured, Probes

COUNT = 4096


def test_the_smaller_the_error_the_more_rays_the_first_pass_takes_and_never_fewer_than_the_fewest():
    errors = [1.0, 0.05, 0.02, 0.01, 1e-4]
    assert [first_rays(LEAST_FIRST, error) for error in errors] == [2, 2, 4, 8, 8]
    assert [first_rays(MOST_FIRST, error) for error in errors] == [8, 8, 8, 8, 8]


def test_a_budget_goes_by_the_square_of_a_small_error_and_has_a_least():
    cost = 10 * FREE_RAYS
    assert ray_budget(cost, 0.025) == pytest.approx(4 * ray_budget(cost, 0.05))
    assert ray_budget(cost, 0.5) == ray_budget(cost, 0.05) > cost
    assert ray_budget(1, 0.5) == FREE_RAYS


def after_a_pass(noise, error_found):
    """What a first pass of 8 rays found, of that stated noise (N,) and an RMS error as measured at every 8th."""
    samples = _Samples(COUNT)
    samples.taken[:], samples.rays = 8, 8 * REPLICATES * COUNT
    chosen = np.arange(0, COUNT, 8)
    measured = Measured(np.zeros(len(chosen)), np.zeros(len(chosen)), 0)
    squares = np.full(len(chosen), error_found**2)
    return _Found(np.zeros((COUNT, 3)), noise, squares), samples, Probes(chosen, np.ones(len(chosen)), measured)


def test_a_target_that_is_met_leaves_speckles_an_eighth_of_the_rays_at_the_most():
    noise = np.where(np.arange(COUNT) % 32 == 0, 0.5, 0.001)
    found, samples, probes = after_a_pass(noise, 0.01)
    active, further, stopped = _next(found, samples, probes, 0.02, 1e12, np.inf)
    assert stopped is None
    assert set(active) <= set(np.flatnonzero(noise > 0.1))
    assert 0 < samples.cost * further[active].sum() <= SPECKLE_SHARE * samples.rays


def test_a_target_that_is_met_is_stopped_by_nothing():
    for noise, rays_left in ((np.full(COUNT, 0.001), 1e12), (np.full(COUNT, 0.5), 0)):
        found, samples, probes = after_a_pass(noise, 0.01)
        assert _next(found, samples, probes, 0.02, rays_left, np.inf)[2] == ""


def test_a_target_that_is_missed_names_what_ran_out():
    found, samples, probes = after_a_pass(np.full(COUNT, 0.2), 0.2)
    few = ENOUGH * samples.cost
    assert _next(found, samples, probes, 0.02, few, np.inf)[2] == "by the budget of rays"
    assert _next(found, samples, probes, 0.02, 1e12, few)[2] == "by the time limit"
    active, further, stopped = _next(found, samples, probes, 0.02, 1e12, np.inf)
    assert stopped is None
    assert len(active) == COUNT
    assert (further[active] >= 8).all()
