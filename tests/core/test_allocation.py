"""Which receivers get further rays: those whose noise costs the most, as far as the rays go."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.core.allocation import BINS, GROWTH, WORTH, measured_errors, next_pass, rays_due

COUNT = 20000
NO_END = np.inf


def noises(seed=1):
    """Noise of one ray (COUNT,) of receivers in a room: most of them quiet, some loud."""
    return np.random.default_rng(seed).lognormal(-1.0, 1.0, COUNT)


@pytest.mark.parametrize("power", [1.0, 4 / 3])
def test_rays_that_are_due_meet_the_target(power):
    noise, taken = noises(), np.random.default_rng(2).choice([2, 6, 22], COUNT)
    due = rays_due(noise / taken ** (power / 2), taken, 0.02, power)
    assert np.sqrt(np.mean(noise**2 / due**power)) == pytest.approx(0.02)


@pytest.mark.parametrize("power", [1.0, 4 / 3])
def test_no_other_share_of_as_many_rays_leaves_less(power):
    noise = noises()
    due = rays_due(noise, np.ones(COUNT), 0.02, power)
    for slant in (-0.8, -0.3, 0.1, 0.5):
        other = due * noise**slant
        other *= due.sum() / other.sum()
        assert np.mean(noise**2 / due**power) < np.mean(noise**2 / other**power)


@pytest.mark.parametrize("off", [0.5, 1.0, 3.0])
def test_noise_that_is_stated_wrong_is_put_right_by_what_was_measured(off):
    rng = np.random.default_rng(3)
    stated = noises()
    chosen = np.sort(rng.choice(COUNT, 4096, replace=False))
    squares = (off * stated[chosen] * rng.standard_normal(4096)) ** 2
    found = measured_errors(stated, chosen, squares)
    # a bin's mean of 256 squares of a normal number is known to 9 %, its root to half of that; the loudest bin of the
    # 16 has the longest tail
    assert np.median(found / stated) == pytest.approx(off, rel=0.1)
    assert np.sqrt(np.mean(found**2)) == pytest.approx(off * np.sqrt(np.mean(stated**2)), rel=0.25)


def test_receivers_whose_replicates_missed_the_light_are_not_taken_to_be_free_of_noise():
    stated = np.where(np.arange(COUNT) % 2, 0.0, 0.1)
    chosen = np.arange(0, COUNT, 7)
    found = measured_errors(stated, chosen, np.where(stated[chosen] > 0, 0.01, 0.04))
    assert found[stated == 0] == pytest.approx(0.2)


def test_a_measure_below_zero_is_no_error():
    assert not measured_errors(noises(), np.arange(BINS), np.full(BINS, -1.0)).any()


def test_one_receiver_that_was_measured_speaks_for_all():
    one = measured_errors(np.array([0.1]), np.array([0]), np.array([0.04]))
    assert one == pytest.approx([0.2])


COUNTS = st.lists(st.tuples(st.floats(0, 1e5) | st.just(NO_END), st.integers(1, 500)), min_size=1, max_size=50)


@given(COUNTS, st.sampled_from([1.0, 2.7]), st.sampled_from([0.0, 10.0, 1e4, NO_END]))
def test_a_pass_stays_within_what_it_may_take(receivers, cost, rays_left):
    due, taken = np.array([due for due, _ in receivers]), np.array([taken for _, taken in receivers])
    most = 600
    active, further = next_pass(due, taken, most, cost, rays_left)
    assert cost * further[active].sum() <= rays_left
    assert np.all(np.diff(active) > 0)
    assert np.all(further[active] <= GROWTH * taken[active])
    assert np.all(taken[active] + further[active] <= most)
    assert np.all(further & (further - 1) == 0)  # powers of two
    assert np.all(due[active] >= WORTH * taken[active])


def test_who_cannot_be_afforded_is_who_is_due_least():
    due, taken = np.array([130.0, 400.0, 300.0]), np.full(3, 100)
    everyone, further = next_pass(due, taken, 2048, 1.0, NO_END)
    assert list(everyone) == [0, 1, 2]
    # less for all, LESS times what they are due: 91, 280, 210
    active, fewer = next_pass(due, taken, 2048, 1.0, further.sum() - 1)
    assert list(active) == [1, 2]
    assert (fewer[active] <= further[active]).all()
