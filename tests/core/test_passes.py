"""Passes of a gather: how many rays they begin with and may take, who gets them, and what stops them."""

import numpy as np
import pytest

from addon.core.gather_job import REPLICATES
from addon.core.passes import (
    AIM,
    DENOISED_AIM,
    ENOUGH,
    FINE,
    FREE_RAYS,
    HURRY,
    LEAST_FIRST,
    MANY,
    MOST_FIRST,
    MOST_RAYS,
    SPECKLE_SHARE,
    STEP,
    _due,
    _Found,
    _gathered_part,
    _next,
    _Samples,
    fewest_first,
    first_rays,
    ray_budget,
)
from addon.core.probes import Measured, Probes

COUNT = 4096


def test_the_smaller_the_error_the_more_rays_the_first_pass_takes_and_never_fewer_than_the_fewest():
    errors = [1.0, 0.05, 0.02, 0.01, 1e-4]
    assert [first_rays(LEAST_FIRST, error, np.inf) for error in errors] == [2, 2, 4, 8, 8]
    assert [first_rays(MOST_FIRST, error, np.inf) for error in errors] == [8, 8, 8, 8, 8]
    # a fine lightmap: half as many
    assert [first_rays(LEAST_FIRST // 2, error, np.inf) for error in errors] == [1, 1, 2, 4, 8]


def test_many_receivers_begin_with_fewer_rays_each_and_the_texels_of_a_fine_lightmap_with_half_of_them():
    assert fewest_first(MANY - 1, True) == fewest_first(MANY - 1, False) == MOST_FIRST
    assert fewest_first(MANY, True) == fewest_first(FINE, False) == LEAST_FIRST
    assert fewest_first(FINE, True) == LEAST_FIRST // 2


def test_a_time_limit_makes_the_first_pass_shorter_only_where_it_is_near():
    ample = HURRY * first_rays(LEAST_FIRST, 0.01, np.inf)
    assert first_rays(LEAST_FIRST, 0.01, ample) == first_rays(LEAST_FIRST, 0.01, np.inf) > LEAST_FIRST
    assert first_rays(LEAST_FIRST, 0.01, 0.9 * ample) == LEAST_FIRST


def test_a_budget_goes_by_the_square_of_a_small_error_and_has_a_least():
    cost = 10 * FREE_RAYS
    assert ray_budget(cost, 0.025) == pytest.approx(4 * ray_budget(cost, 0.05))
    assert ray_budget(cost, 0.5) == ray_budget(cost, 0.05) > cost
    assert ray_budget(1, 0.5) == FREE_RAYS


def samples_of(taken):
    samples = _Samples(COUNT)
    samples.taken[:], samples.rays = taken, taken * REPLICATES * COUNT
    return samples


def next_of(errors, rays_left=1e12, rays_in_time=np.inf, aim=AIM, taken=8, error_found=None):
    """What comes after errors (N,) for a target of 0.02: samples so far, receivers, further rays, what stops it."""
    samples, chosen = samples_of(taken), np.arange(0, COUNT, 8)
    # those that are measured have one error, so that it is known
    rms = float(np.sqrt(np.mean(errors**2))) if error_found is None else error_found
    found = _Found(np.zeros((COUNT, 3)), errors, np.full(len(chosen), rms**2))
    probes = Probes(
        chosen, np.ones(len(chosen)), np.ones(len(chosen)), Measured(np.zeros(len(chosen)), np.zeros(len(chosen)), 0)
    )
    due = _due(found, samples, probes, 0.02, aim, 0.0)
    return samples, *_next(due, samples, rms <= 0.02, rays_left, rays_in_time)


SPECKLED = np.where(np.arange(COUNT) % 32 == 0, 0.5, 0.001)


def test_a_target_that_is_met_leaves_speckles_an_eighth_of_the_rays_at_the_most():
    samples, active, further, stopped = next_of(SPECKLED, error_found=0.01)
    assert stopped is None
    assert set(active) <= set(np.flatnonzero(SPECKLED > 0.1))
    assert 0 < samples.cost * further[active].sum() <= SPECKLE_SHARE * samples.rays


def test_a_target_that_is_met_is_stopped_by_nothing():
    for noise, rays_left in ((np.full(COUNT, 0.001), 1e12), (np.full(COUNT, 0.5), 0)):
        assert next_of(noise, rays_left, error_found=0.01)[3] == ""


def test_a_target_missed_by_a_hair_is_gone_on_for():
    for aim in (AIM, DENOISED_AIM):
        active, further = next_of(np.full(COUNT, 0.0201), aim=aim)[1:3]
        assert len(active) == COUNT
        assert (further > 0).all()


def test_rays_are_to_take_off_what_direct_light_leaves():
    """Both parts' squares make up the error: with what is aimed at for gathered light, they come to the target."""
    errors, direct = np.full(COUNT, 0.06), 0.015
    part, target = _gathered_part(errors, 0.06, 0.02, direct)
    assert np.hypot(part[0], direct) == pytest.approx(0.06)
    assert np.hypot(target, direct) == pytest.approx(0.02)
    # never nothing, and never a step so small that nobody is due much
    assert _gathered_part(errors, 0.06, 0.02, 0.03)[1] == pytest.approx(0.01)
    part, target = _gathered_part(np.full(COUNT, 0.0201), 0.0201, 0.02, direct)
    assert target == pytest.approx(STEP * part[0])


def test_who_can_wait_for_a_denoiser_takes_fewer_rays():
    errors = np.linspace(0.01, 0.06, COUNT)
    alone, denoised = (next_of(errors, aim=aim)[2].sum() for aim in (AIM, DENOISED_AIM))
    assert denoised < alone


def test_a_target_that_is_missed_names_what_ran_out():
    errors = np.full(COUNT, 0.2)
    assert next_of(errors, 1)[3] == "by the budget of rays"
    assert next_of(errors, 1e12, 1)[3] == "by the time limit"
    assert next_of(errors, taken=MOST_RAYS)[3] == "as receivers have the most rays that they may"
    _, active, further, stopped = next_of(errors)
    assert stopped is None
    assert len(active) == COUNT
    assert (further[active] >= 8).all()


def test_a_pass_that_few_of_those_that_want_it_can_be_given_is_not_worth_it():
    # all are due some more, but when rays are short only the loudest are left, of whom there may be too few
    samples = samples_of(8)
    for share, expected in ((ENOUGH / 2, "by the budget of rays"), (2 * ENOUGH, None)):
        loud = np.arange(COUNT) < share * COUNT
        rays_left = REPLICATES * 16 * loud.sum()
        active, further, stopped = _next(np.where(loud, 40.0, 12.0), samples, False, rays_left, np.inf)
        assert set(active) == set(np.flatnonzero(loud))
        assert samples.cost * further[active].sum() <= rays_left
        assert stopped == expected
