"""Direct light at receivers: shadow rays go where they take most off its noise, until it is small beside the light."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .allocation import rays_due
from .workers import within

FIRST = 1 / 4  # of the shadow rays of a penumbra, for the first look at direct light, ...
LEAST_FIRST = 16  # ... but no fewer: with its neighbours' a receiver then has hundreds, and they know what is hidden
MOST_SAMPLES = 4096
WORTH = 0.25  # times the rays it has, further ones are for a receiver that goes on
SHARE = 0.55  # of the error that direct light may have
PASSES = 3  # after the first look; its noise says well what is due, and others mend what it missed
EVENNESS = 4 / 3  # shadow rays are spread so evenly that the square of their error falls as 1 / rays to this power


@dataclass(frozen=True, slots=True)
class DirectLight:
    """What lights give receivers straight.

    Attributes
    ----------
    values : float32 (N, 3) E [W/m^2]
    variance : float32 (N,) of its luminance, as two replicates state it
    samples : float32 (N,) as many shadow rays at once would be as good as those of each
    rays : shadow rays traced
    rms : what its relative noise comes to, once that is known
    """

    values: np.ndarray
    variance: np.ndarray
    samples: np.ndarray
    rays: int
    rms: float = 0.0


def shadow_samples(error: float) -> int:
    """Shadow rays of a receiver in penumbra: stratified, so that their error falls nearly as 1 / rays."""
    return int(min(max(2 ** round(np.log2(3.2 / error)), 16), 2048))


def first_direct(trace: Callable, error: float, seed: int, on_step: Callable[[float], None]) -> DirectLight:
    """A first look at the direct light of all receivers.

    ``trace`` is (chosen, samples, seed, on_step, is_first) -> what KernelScene.direct gives for the chosen receivers.
    """
    samples = max(int(FIRST * shadow_samples(error)), LEAST_FIRST)
    values, variance, rays = trace(slice(None), samples, seed, on_step, True)
    return DirectLight(values, variance, np.full(len(values), samples, np.float32), rays)


def refined_direct(
    first: DirectLight, trace: Callable, pooled: Callable, scale, weights, error: float, seed: int, on_step
) -> DirectLight:
    """Direct light whose noise comes to ``SHARE`` of the error, relative to ``scale`` (N,), RMS by ``weights`` (N,).

    ``pooled`` averages (N,) over neighbours: two replicates agree by chance as often as not, and all of their rays may
    miss a lamp that is seen through a gap.
    """
    values, variance, samples = first.values.copy(), first.variance.copy(), first.samples.copy()
    rays = first.rays
    for attempt in range(1, PASSES + 2):
        noise = np.minimum(np.sqrt(variance) / scale, 1.0) ** 2 * samples
        noise = np.sqrt(weights * np.minimum(pooled(noise) / samples, 1.0))
        rms = float(np.sqrt(np.mean(noise**2, dtype=np.float64)))
        if rms <= SHARE * error or attempt > PASSES:
            break
        wanted = _further_rays(rays_due(noise, samples, SHARE * error, EVENNESS), samples)
        if not wanted.any():
            break
        # half of what is left of the bar for each pass
        begin, width = 1 - 0.5 ** (attempt - 1), 0.5**attempt / max(wanted.sum(dtype=np.int64), 1)
        for count in np.unique(wanted[wanted > 0]):
            chosen = np.flatnonzero(wanted == count)
            share = width * count * len(chosen)
            again, its_variance, traced = trace(
                chosen, int(count), seed + 1000 * attempt, within(on_step, begin, share), False
            )
            before, worth = samples[chosen] ** EVENNESS, float(count) ** EVENNESS
            new = (worth / (worth + before)).astype(np.float32)
            values[chosen] += new[:, None] * (again - values[chosen])
            # by these alone: who goes on is who was found noisy, by chance as well
            variance[chosen] = new * its_variance
            samples[chosen] = (worth + before) ** (1 / EVENNESS)
            rays, begin = rays + traced, begin + share
    return DirectLight(values, variance, samples, rays, rms)


def _further_rays(due, samples):
    """Rays to trace besides ``samples`` (N,) to be as good as ``due`` (N,) would be, powers of two: int32 (N,)."""
    due = np.minimum(due, MOST_SAMPLES)
    further = np.maximum(due**EVENNESS - samples**EVENNESS, 1) ** (1 / EVENNESS)
    wanted = 2 ** np.round(np.log2(further)).astype(np.int32)
    wanted[wanted < WORTH * samples] = 0
    return wanted
