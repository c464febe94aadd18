"""Shadow rays go to the receivers whose noise is seen, until the error is met, held against a lamp of known noise."""

import numpy as np

from addon.core.direct_light import SHARE, first_direct, refined_direct
from addon.core.workers import Workers
from tests.graphs import row_graph

COUNT = 4096
LIGHT = 2.0


class Lamp:
    """Gives each receiver LIGHT; a penumbra's rays are independent, with a deviation of their own (N,)."""

    def __init__(self, deviation):
        self.deviation, self.rays, self.rng = deviation, 0, np.random.default_rng(5)

    def __call__(self, chosen, samples, seed, on_step, is_first):
        spread = self.deviation[chosen, None] / np.sqrt(samples / 2)
        self.rays += len(spread) * samples
        replicates = LIGHT + spread * self.rng.standard_normal((len(spread), 2))
        variance = 0.25 * (replicates[:, 0] - replicates[:, 1]) ** 2
        grey = np.repeat(replicates.mean(axis=1)[:, None], 3, axis=1)
        on_step(0.5)
        on_step(1.0)
        return grey.astype(np.float32), variance.astype(np.float32), len(spread) * samples


def run(deviation, error, scale=LIGHT, weights=1.0):
    lamp, told = Lamp(deviation), []
    first = first_direct(lamp, error, 1, told.append)
    assert told == [0.5, 1.0]
    told.clear()

    graph, ones = row_graph(COUNT, 1), np.ones(COUNT)  # pooled twice: over five, as good as four
    with Workers(1) as workers:

        def over_neighbours(noise):
            return graph.pooled(workers, None, noise)

        found = refined_direct(first, lamp, over_neighbours, scale * ones, weights * ones, error, 1, told.append)
    assert told == sorted(told)
    assert all(0 < done < 1 for done in told)
    return lamp, first, found


def penumbra():
    """Every other stretch of 256 receivers is in penumbra."""
    return np.where(np.arange(COUNT) // 256 % 2, 2.0, 0.0)


def test_noise_comes_to_its_share_of_the_error_and_not_by_more_rays_than_that_takes():
    error = 0.05
    _, first, found = run(penumbra(), error)
    before, after = (np.sqrt(np.mean((light.values[:, 0] / LIGHT - 1) ** 2)) for light in (first, found))
    # half the receivers, 2048 of them, each a chi square: the RMS is known to 2 %, pooled noise of nine to some more
    assert before > 2 * SHARE * error
    assert 0.5 * SHARE * error < after < 1.1 * SHARE * error


def test_what_is_calm_among_its_neighbours_gets_no_more_rays():
    deviation = penumbra()
    lamp, first, found = run(deviation, 0.02)
    # of calm stretches only the ends have noisy neighbours
    ends = np.convolve(deviation, np.ones(5), "same") > 0
    assert (found.samples[~ends] == first.samples[~ends]).all()
    assert np.mean(found.samples[deviation > 0] > first.samples[deviation > 0]) > 0.95
    assert found.rays == lamp.rays


def test_noise_that_other_light_hides_is_left_alone():
    _, first, found = run(penumbra(), 0.05, scale=100 * LIGHT)
    assert (found.samples == first.samples).all()


def test_noise_counts_by_how_much_of_it_is_seen():
    """A penumbra's rays go as the root of its weight [Neyman 1934]: a sixteenth has a quarter."""
    deviation, weights = np.full(COUNT, 2.0), np.where(np.arange(COUNT) < COUNT // 2, 1.0, 1 / 16)
    _, first, found = run(deviation, 0.02, weights=weights)
    seen, hardly = (found.samples[part].mean() for part in (slice(16, COUNT // 2 - 16), slice(COUNT // 2 + 16, -16)))
    # powers of two, at least of the first look; a pooled chi square of ten moves some of them to the next
    assert seen > first.samples[0]
    assert 2 < seen / hardly < 8
