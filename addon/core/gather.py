"""Irradiance at receivers: direct light by shadow rays, indirect light by final gather, until the error is met."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .emitters import LUMINANCE, Emitters
from .kernel import KernelScene
from .radiosity import PatchSolution
from .receivers import Receivers
from .smoothing import TexelGrid, smoothed

REPLICATES = 4  # independent randomisations; their spread is the error estimate
FIRST_RAYS = 8  # a replicate's rays in the first pass; every further pass doubles what there is
MOST_RAYS = 1 << 10  # of a replicate
POOL = 5  # neighbouring receivers whose variances are averaged: four replicates alone say little of one receiver
DARK = 0.3  # of the median irradiance: what is added to a receiver's own before its error is called relative


@dataclass(frozen=True, slots=True)
class Irradiance:
    """What arrives at the receivers.

    Attributes
    ----------
    values : float32 (N, 3) E [W/m^2]
    relative_error : estimated RMS over receivers of the error over (E + 0.3 median E), luminance
    target_reached : whether sampling met its target before the time limit
    rays : {"direct": shadow rays, "gather": rays}
    """

    values: np.ndarray
    relative_error: float
    target_reached: bool
    rays: dict[str, int]


def shadow_samples(error: float) -> int:
    """Shadow rays of a receiver in penumbra: stratified, so that their error falls nearly as 1 / rays."""
    return int(min(max(2 ** round(np.log2(3.2 / error)), 16), 2048))


def gather_irradiance(
    kernel: KernelScene,
    emitters: Emitters,
    solution: PatchSolution,
    receivers: Receivers,
    grid: TexelGrid | None,
    error: float,
    seed: int,
    is_late,
    on_step,
) -> Irradiance:
    """Direct plus gathered irradiance at receivers.

    Parameters
    ----------
    solution : the patches' reflected light; emission is left out of it, as emitters are sampled directly
    grid : the texels that the receivers are, over which gathered light is smoothed; None = no smoothing
    error : target of the relative error of every receiver [1]
    is_late : () -> bool, whether the time limit has passed; the first pass is always finished
    on_step : (0..1) -> None
    """
    direct, direct_variance, shadow_rays = kernel.direct(
        emitters, receivers, shadow_samples(error), seed, lambda done: on_step(0.3 * done)
    )
    sums = np.zeros((len(receivers), REPLICATES, 3), np.float32)
    counts = np.zeros(len(receivers), np.int64)
    active = np.arange(len(receivers), dtype=np.uint32)
    reached, done, take, rays = True, 0, FIRST_RAYS, 0
    estimate = _Estimate(direct, direct_variance, np.zeros(len(receivers)), np.zeros(len(receivers)))
    while len(active):
        share, width = 0.3 + 0.7 * done / MOST_RAYS, 0.7 * take / MOST_RAYS
        rays += kernel.gather(
            solution, emitters, receivers, active, REPLICATES, done, take, seed, sums,
            lambda part: on_step(share + width * part),
        )  # fmt: skip
        counts[active] += take
        done, take = done + take, done + take
        estimate = _estimate(kernel.workers, grid, receivers, sums, counts, direct, direct_variance)
        active = active[estimate.noise[active] > error] if done < MOST_RAYS else active[:0]
        if len(active) and is_late():
            reached = False
            break
    rms = float(np.sqrt(max(estimate.squared_errors.mean(), 0.0))) if len(receivers) else 0.0
    traced = {"direct": int(shadow_rays), "gather": int(rays)}
    return Irradiance(estimate.values, rms, reached and rms <= error, traced)


@dataclass(frozen=True, slots=True)
class _Estimate:
    """Irradiance so far.

    ``noise``: relative standard error of the gathered light, which says whether more rays are due; ``squared_errors``: of
    the whole, relative, bias of smoothing included, meaningful as a mean only.
    """

    values: np.ndarray
    variance: np.ndarray
    noise: np.ndarray
    squared_errors: np.ndarray


def _estimate(workers, grid, receivers, sums, counts, direct, direct_variance):
    means = sums / np.maximum(counts, 1)[:, None, None]
    if grid is None:
        gathered = means.mean(axis=1)
        variance = (means @ LUMINANCE).var(axis=1, ddof=1) / REPLICATES
        squared_errors = variance
        noise = np.convolve(variance, np.full(POOL, 1 / POOL), "same") if len(variance) >= POOL else variance
    else:
        smooth = smoothed(workers, grid, receivers, means)
        gathered, variance, squared_errors, noise = smooth.values, smooth.variances, smooth.squared_errors, smooth.variances
    total = direct + gathered
    luminance = total @ LUMINANCE
    lit = luminance[luminance > 1e-4 * max(luminance.mean(), 1e-30)]
    scale = luminance + DARK * (np.median(lit) if len(lit) else 1.0)
    return _Estimate(
        values=total.astype(np.float32),
        variance=variance + direct_variance,
        noise=np.sqrt(noise) / scale,
        squared_errors=(squared_errors + direct_variance) / scale**2,
    )
