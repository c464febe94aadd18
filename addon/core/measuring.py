"""Light at a few receivers with many rays, to judge by."""

from __future__ import annotations

import numpy as np

from .direct_light import shadow_samples
from .emitters import LUMINANCE
from .gather_job import REPLICATES, GatherJob
from .probes import Measured, Probes, chosen_receivers
from .relative import scale_of

DOUBT = 3.0  # times the error aimed at, squared: what a probe may be uncertain by; many of them average it out
LEAST_RAYS, MOST_RAYS = 16, 1024  # of a replicate
PILOT = 4  # of a probe's rays, one in so many tells whether it needs more,
MORE_RAYS = 16  # times as many, where it is more uncertain than the error aimed at


def rays_for(error: float) -> int:
    """Rays of a replicate at a probe: one ray is about as wrong as the light is bright."""
    return int(min(max(2 ** round(np.log2(1 / (REPLICATES * DOUBT * error**2))), LEAST_RAYS), MOST_RAYS))


def probes_among(job: GatherJob, error, seed) -> Probes:
    """Some of a job's receivers, measured."""
    chosen = chosen_receivers(len(job.receivers))
    return Probes(chosen, job.weights[chosen], measure(job.part(chosen), error, seed))


def measure(job: GatherJob, error, seed) -> Measured:
    """The light at a job's receivers, with many rays, and with more where that would not be enough to judge by.

    Where, a few rays of their own tell: those that happen to miss what is bright would take themselves to be certain.
    """
    direct, variance, rays = job.direct(4 * shadow_samples(error), seed)
    values, noise, count = direct.copy(), variance.copy(), rays_for(error)
    pilot, spread, traced = job.gathered(max(count // PILOT, 1), seed)
    quiet = np.sqrt(spread / PILOT) <= error * scale_of(direct + pilot)
    rays += traced
    more = max(min(MORE_RAYS * count, MOST_RAYS), 2 * count)
    for part, share, own in ((quiet, count, seed + 1), (~quiet, more, seed + 2)):
        gathered, spread, traced = job.part(np.flatnonzero(part)).gathered(share, own)
        values[part] += gathered
        noise[part] += spread
        rays += traced
    return Measured(values @ LUMINANCE, noise, rays)
