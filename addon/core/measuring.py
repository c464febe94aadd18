"""Light at a few receivers with many rays, to judge by."""

from __future__ import annotations

import numpy as np

from .direct_light import shadow_samples
from .gather_job import REPLICATES, GatherJob
from .luminance import LUMINANCE
from .probes import Measured, Probes, chosen_values
from .relative import scale_of
from .smoothing import TexelGrid
from .vertex_graph import VertexGraph

DOUBT = 3.0  # times the error aimed at, squared: what a probe may be uncertain by; many of them average it out
LEAST_RAYS, MOST_RAYS = 16, 1024  # of a replicate
PILOT = 4  # of a probe's rays, one in so many tells whether it needs more,
MORE_RAYS = 16  # times as many, where it is more uncertain than the error aimed at
SHADOW, MORE_SHADOW = 4, 16  # times the shadow rays of a receiver, for all and for those that are as uncertain by them


def rays_for(error: float) -> int:
    """Rays of a replicate at a probe: one ray is about as wrong as the light is bright."""
    return int(min(max(2 ** round(np.log2(1 / (REPLICATES * DOUBT * error**2))), LEAST_RAYS), MOST_RAYS))


def probes_among(job: GatherJob, grid: TexelGrid | VertexGraph, error, seed) -> Probes:
    """Some of the values that are made of a job's receivers, measured."""
    members, starts, shares = grid.members(chosen_values(grid.value_count))
    measured = measure(job.part(members), error, seed).merged(starts, shares)
    weights = np.add.reduceat(job.weights[members], starts) * (grid.value_count / len(job.receivers))
    return Probes(members[starts], weights, job.weights[members[starts]] / np.maximum(weights, 1e-30), measured)


def measure(job: GatherJob, error, seed) -> Measured:
    """The light at a job's receivers, with many rays, and with more where that would not be enough to judge by.

    Where, a few rays of their own tell: those that happen to miss what is bright would take themselves to be certain.
    """
    shadow, count = shadow_samples(error), rays_for(error)
    direct, direct_variance, rays = job.direct(shadow, seed)
    gathered, variance, traced = job.gathered(max(count // PILOT, 1), seed)
    # what few shadow rays leave falls by more than half with the others: direct light is doubted early
    doubtful = error * scale_of(direct + gathered)
    more = max(min(MORE_RAYS * count, MOST_RAYS), 2 * count)
    samples, is_noisy = (SHADOW * shadow, MORE_SHADOW * shadow), np.sqrt(direct_variance) > doubtful
    by_direct = _in_parts(job, lambda part, *how: part.direct(*how), is_noisy, samples, seed)
    is_noisy = np.sqrt(variance / PILOT) > doubtful
    by_gather = _in_parts(job, lambda part, *how: part.gathered(*how), is_noisy, (count, more), seed)
    values, noise, further = (one + other for one, other in zip(by_direct, by_gather))
    return Measured(values @ LUMINANCE, noise, rays + traced + further)


def _in_parts(job: GatherJob, trace, is_noisy, counts, seed):
    """What ``trace`` finds by few rays, and by more of them where that was found noisy: as it does."""
    values, variance, rays = np.zeros((len(is_noisy), 3), np.float32), np.zeros(len(is_noisy), np.float32), 0
    for part, count, own in ((~is_noisy, counts[0], seed + 1), (is_noisy, counts[1], seed + 2)):
        values[part], variance[part], traced = trace(job.part(np.flatnonzero(part)), count, own)
        rays += traced
    return values, variance, rays
