"""Passes of a gather: how many rays they begin with, may take, and what the last ones are for."""

import numpy as np
import pytest

from addon.core.allocation import GROWTH
from addon.core.gather_job import REPLICATES
from addon.core.passes import (
    ENOUGH,
    FREE_RAYS,
    LAST,
    LEAST_FIRST,
    LEAST_SPECKLES,
    MOST_FIRST,
    SPECKLE_SHARE,
    _due,
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


def next_of(noise, error_found, error, rays_left=1e12, rays_in_time=np.inf, is_cleared=False):
    """What comes after it: samples so far, receivers, further rays, what stops it, whether it clears speckles."""
    found, samples, probes = after_a_pass(noise, error_found)
    due, clears = _due(found, samples, probes, error, error, is_cleared)
    return samples, *_next(due, samples, error_found <= error, rays_left, rays_in_time), clears


SPECKLED = np.where(np.arange(COUNT) % 32 == 0, 0.5, 0.001)


def test_a_target_that_is_met_leaves_speckles_an_eighth_of_the_rays_at_the_most():
    samples, active, further, stopped, clears = next_of(SPECKLED, 0.01, 0.02)
    assert stopped is None
    assert clears
    assert set(active) <= set(np.flatnonzero(SPECKLED > 0.1))
    assert 0 < samples.cost * further[active].sum() <= SPECKLE_SHARE * samples.rays


def test_speckles_are_cleared_once():
    _, active, _, stopped, clears = next_of(SPECKLED, 0.01, 0.02, is_cleared=True)
    assert len(active) == 0
    assert stopped == ""
    assert not clears


def test_few_speckles_are_not_worth_a_pass():
    noise = np.full(COUNT, 0.001)
    noise[: int(LEAST_SPECKLES * COUNT) - 1] = 0.5
    assert next_of(noise, 0.01, 0.02)[3] == ""


def test_the_pass_that_is_likely_the_last_clears_speckles_too_where_they_are_few():
    few, many = np.arange(COUNT) % 64 == 0, np.arange(COUNT) % 8 == 0
    for speckles, near, expected in ((few, LAST, True), (few, 1.1 * LAST, False), (many, LAST, False)):
        # as measured, what is noisy is not wrong: only as speckles do they get rays
        noise = np.where(speckles, 0.5, 0.02)
        _, _, further, _, clears = next_of(noise, 0.02 * near, 0.02)
        assert clears == expected
        assert (further[speckles] == GROWTH * 8).all() == expected


def test_a_target_that_is_met_is_stopped_by_nothing():
    for noise, rays_left in ((np.full(COUNT, 0.001), 1e12), (np.full(COUNT, 0.5), 0)):
        assert next_of(noise, 0.01, 0.02, rays_left)[3] == ""


def test_a_target_that_is_missed_names_what_ran_out():
    noise = np.full(COUNT, 0.2)
    few = ENOUGH * REPLICATES
    assert next_of(noise, 0.2, 0.02, few)[3] == "by the budget of rays"
    assert next_of(noise, 0.2, 0.02, 1e12, few)[3] == "by the time limit"
    _, active, further, stopped, _ = next_of(noise, 0.2, 0.02)
    assert stopped is None
    assert len(active) == COUNT
    assert (further[active] >= 8).all()
