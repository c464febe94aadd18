"""Irradiance at receivers: direct light by shadow rays, indirect light by final gather, until the error is met."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from .emitters import LUMINANCE
from .guides import Guides, learn_guides, no_guides
from .kernel import KernelScene
from .probes import Measured, SeenPoints, chosen_receivers
from .radiosity import Solved
from .receivers import Receivers
from .relative import scale_of
from .smoothing import TexelGrid, smoothed
from .texel_light import NO_TEXEL_LIGHT, TexelLight

REPLICATES = 4  # independent randomisations; their spread is the error estimate
LOOK_RAYS = 4  # of a replicate, for the first look at the texels' light, which further rays then see
NEAR = 10.0  # texels: rays that hit from nearer do not take a texel's light
NEAR_SHARE = 1 / 16  # of the scene, at the most: in a coarse lightmap all would be near
FAR = 3.3  # times as far do rays go on from patches, where texels have a light of their own: few are left that need it
FIRST_RAYS = 2  # of a replicate, in the first pass, on MANY_TEXELS and more, whose neighbours vouch for them;
FIRST_ALONE = 8  # elsewhere: fewer may miss what is bright and small, and not know it
MANY_TEXELS = 1 << 16
GROWTH = 3  # times the rays that a receiver has, about, that a further pass adds
MOST_RAYS = 2048  # of a replicate
MOST_COST = 15  # times the rays of the first pass that all passes may take, and FREE_RAYS at least,
FREE_RAYS = 1 << 26
FAR_OFF = 1.5  # times the target: what smoothing leaves of the noise is not known well enough to choose by it
WORTH_IT = 0.97  # of the error that a pass leaves at the most: after MOST_IDLE that leave more, what is wrong is not
MOST_IDLE = 2  # the noise
MOST_EXTRA = 2  # passes after the target is met, each with some four times the rays: speckles are gone by then
ENOUGH = 1 / 64  # of the receivers that want it: a pass that can afford fewer is not worth it
USUAL_ERROR = 0.05  # for an error of this; a smaller one takes more by its square
DIRECT_PASSES = 2  # each with four times the shadow rays of the one before, for the receivers that need it
DIRECT_SHARE = 0.5  # of the error that direct light may have
MOST_DOUBT = 4.0  # how much more than the replicates say the noise is taken to be at the most
PROBE_DOUBT = 3.0  # times the error aimed at, squared: what a probe may be uncertain by; many of them average it out
MORE_RAYS, MOST_PROBE_RAYS = 16, 2048  # times as many, but not more, for probes more uncertain than the error aimed at
FURTHER = 2.0  # seen points look so many times further before they take a texel's or a patch's light for what is there
POOL = 5  # neighbouring receivers whose variances are averaged: four replicates alone say little of one receiver


@dataclass(frozen=True, slots=True)
class Irradiance:
    """What arrives at the receivers.

    Attributes
    ----------
    values : float32 (N, 3) E [W/m^2]
    relative_error : estimated RMS over receivers of the error over (E + 0.3 median E), luminance
    seen_error : the same at random points of the surfaces, looked up in the result as a viewer does
    target_reached : whether sampling met its target
    stopped : what ended it, "" where nothing was left to do
    rays : {"direct": shadow rays, "gather": rays, "probe": rays that measure the error}
    """

    values: np.ndarray
    relative_error: float
    seen_error: float
    target_reached: bool
    stopped: str
    rays: dict[str, int]


def shadow_samples(error: float) -> int:
    """Shadow rays of a receiver in penumbra: stratified, so that their error falls nearly as 1 / rays."""
    return int(min(max(2 ** round(np.log2(3.2 / error)), 16), 2048))


def probe_rays(error: float) -> int:
    """Rays of a replicate at a probe: one ray is about as wrong as the light is bright."""
    return int(min(max(2 ** round(np.log2(1 / (REPLICATES * PROBE_DOUBT * error**2))), 16), 1024))


@dataclass(frozen=True, slots=True)
class _Job:
    """What all passes share."""

    kernel: KernelScene
    solved: Solved
    receivers: Receivers
    guides: Guides
    texel_light: TexelLight = NO_TEXEL_LIGHT

    def part(self, chosen) -> _Job:
        """The same for some of the receivers."""
        return replace(self, receivers=self.receivers.part(chosen), guides=self.guides.part(chosen))

    def looking_further(self, factor) -> _Job:
        """The same with less taken for granted of what rays hit."""
        solved = replace(self.solved, patches=self.solved.patches.looking_further(factor))
        return replace(self, solved=solved, texel_light=self.texel_light.looking_further(factor))

    def direct(self, samples, seed, on_step=None):
        return self.kernel.direct(self.solved.sources, self.receivers, samples, seed, on_step)

    def gather(self, selected, first, take, seed, sums, on_step=None) -> int:
        return self.kernel.gather(
            self.solved.patches,
            self.texel_light,
            self.solved.sources,
            self.receivers,
            self.guides,
            selected,
            REPLICATES,
            first,
            take,
            seed,
            sums,
            on_step,
        )


def gather_irradiance(
    kernel: KernelScene,
    solved: Solved,
    receivers: Receivers,
    grid: TexelGrid | None,
    seen: SeenPoints,
    error: float,
    seed: int,
    seconds_left,
    on_step,
) -> Irradiance:
    """Direct plus gathered irradiance at receivers, and how wrong it is.

    Parameters
    ----------
    solved : the patches' reflected light, and what direct light is sampled from
    grid : the texels that the receivers are, over which gathered light is smoothed; None = no smoothing
    seen : random points of the surfaces, at which the result is looked up
    error : target of the relative error of every receiver [1]
    seconds_left : () -> float, until the time limit [s]; the first pass is always finished
    on_step : (0..1) -> None
    """
    if not len(receivers):
        return Irradiance(np.zeros((0, 3), np.float32), 0.0, 0.0, True, "", {"direct": 0, "gather": 0, "probe": 0})
    job = _Job(kernel, solved, receivers, no_guides(len(receivers)))
    direct, shadow_rays = _direct_until(job, error, seed, lambda done: on_step(0.25 * done))
    looks = 0
    if grid is not None:
        job, looks = _with_texel_light(job, grid, direct, seed + 2, lambda done: on_step(0.25 + 0.15 * done))
    guides, learning = learn_guides(kernel, solved.patches, job.texel_light, solved.sources, receivers, seed + 3)
    job = replace(job, guides=guides)
    chosen = chosen_receivers(len(receivers))
    probes = _measure(job.part(chosen), error, seed + 1)
    values, rms, rays, stopped = _gather_until(job, grid, direct, chosen, probes, error, seed, seconds_left, on_step)
    at_points = _measure(
        replace(job, receivers=seen.receivers, guides=no_guides(len(seen.receivers))).looking_further(FURTHER),
        error,
        seed + 5,
    )
    shown = seen.look_up(values)
    traced = {
        "direct": shadow_rays,
        "gather": looks + learning + rays,
        "probe": probes.rays + at_points.rays,
    }
    return Irradiance(values, rms, at_points.error_of(shown, scale_of(shown)), rms <= error, stopped, traced)


def _with_texel_light(job: _Job, grid: TexelGrid, direct, seed, on_step):
    """The job whose rays see what a first look found on the texels, and the rays of that look."""
    sums = np.zeros((len(job.receivers), REPLICATES, 3), np.float32)
    rays = job.gather(np.arange(len(sums), dtype=np.uint32), 0, LOOK_RAYS, seed, sums, on_step)
    gathered, _ = smoothed(job.kernel.workers, grid, job.receivers, sums / LOOK_RAYS)
    radiosity = (grid.reflectance * (direct + gathered)).astype(np.float32)
    reach = min(NEAR * grid.spacing, NEAR_SHARE * float(np.ptp(job.receivers.positions, axis=0).max()))
    return replace(job.looking_further(FAR), texel_light=TexelLight(grid.uvs, grid.receivers, radiosity, reach)), rays


def _measure(job: _Job, error, seed) -> Measured:
    """The light at a job's receivers, with many rays, and with more where that is not enough to judge by."""
    direct, variance, rays = job.direct(4 * shadow_samples(error), seed)
    count = probe_rays(error)
    gathered, noise, traced = _gathered(job, count, seed)
    values, scale, rays = gathered.mean(axis=1) + direct, scale_of(direct + gathered.mean(axis=1)), rays + traced
    noisy = np.flatnonzero(np.sqrt(noise) > scale * error)
    if len(noisy):
        again, less_noise, traced = _gathered(job.part(noisy), min(MORE_RAYS * count, MOST_PROBE_RAYS), seed + 1)
        values[noisy], noise[noisy], rays = again.mean(axis=1) + direct[noisy], less_noise, rays + traced
    return Measured(values @ LUMINANCE, variance + noise, rays)


def _gathered(job: _Job, count, seed):
    """Means of ``count`` rays of each replicate (N, R, 3), variance of their mean's luminance (N,), the rays."""
    sums = np.zeros((len(job.receivers), REPLICATES, 3), np.float32)
    rays = job.gather(np.arange(len(sums), dtype=np.uint32), 0, count, seed, sums)
    means = sums / count
    return means, (means @ LUMINANCE).var(axis=1, ddof=1) / REPLICATES, rays


def _direct_until(job: _Job, error, seed, on_step):
    """Direct irradiance (N, 3), with more rays where an estimate is too noisy, and the rays."""
    samples = shadow_samples(error)
    direct, variance, rays = job.direct(samples, seed, on_step)
    for attempt in range(1, DIRECT_PASSES):
        noisy = np.flatnonzero(np.sqrt(variance) > DIRECT_SHARE * error * scale_of(direct))
        if not len(noisy):
            break
        samples *= 4
        again = job.part(noisy).direct(samples, seed + 1000 * attempt)
        direct[noisy], variance[noisy] = again[:2]
        rays += again[2]
    return direct, rays


def _gather_until(job: _Job, grid, direct, chosen, probes, error, seed, seconds_left, on_step):
    """Irradiance (N, 3), its relative RMS error, the rays, and what stopped it ("" = nothing more to do)."""
    count = len(job.receivers)
    sums, taken = np.zeros((count, REPLICATES, 3), np.float32), np.zeros(count, np.int64)
    active = np.arange(count)
    further = np.full(count, FIRST_RAYS if grid and count >= MANY_TEXELS else FIRST_ALONE)
    rays, budget, idle, extra, begin, rms, started = 0, 0, 0, 0, 0.4, np.inf, time.perf_counter()
    while True:
        # half of what is left of the bar for each pass: nobody knows how many there will be
        width = 0.5 * (1 - begin)
        rays += _gather_pass(job, active, taken, further, seed, sums, lambda done: on_step(begin + width * done))  # noqa: B023
        begin += width
        budget = budget or int(max(MOST_COST * rays, FREE_RAYS) * max(1.0, (USUAL_ERROR / error) ** 2))
        before = rms
        values, relative, rms = _best_estimate(job, grid, sums / taken[:, None, None], direct, chosen, probes)
        idle = idle + 1 if rms > max(error, WORTH_IT * before) else 0
        if idle == MOST_IDLE:
            return values, rms, rays, "as further rays no longer help"

        extra += rms <= error
        wanted = _wanting(relative, rms, error)
        wanted = wanted[taken[wanted] < MOST_RAYS]
        if extra > MOST_EXTRA or not len(wanted):
            return values, rms, rays, ""
        in_time = seconds_left() * rays / (time.perf_counter() - started)
        cost = rays / int(taken.sum())  # of one more ray of all replicates, with those that it goes on as
        active, further = _affordable(wanted, relative, _further_rays(taken), cost, min(budget - rays, in_time))
        if len(active) < ENOUGH * len(wanted):
            return values, rms, rays, "by the time limit" if in_time < budget - rays else "by the budget of rays"


def _wanting(relative, rms, error):
    """Receivers that should go on, in order: far from the target all, near it the noisy ones, then only speckles."""
    noisy = np.flatnonzero(relative > (error if rms > error else 2 * error))
    if rms > FAR_OFF * error or (rms > error and not len(noisy)):
        return np.arange(len(relative))
    return noisy


def _further_rays(taken):
    """Rays of a replicate that the next pass adds: a power of two, so that neighbours share its even spread."""
    return 2 ** np.ceil(np.log2(GROWTH * taken)).astype(np.int64)


def _gather_pass(job: _Job, active, taken, further, seed, sums, on_step) -> int:
    """Add further rays to the active receivers; the rays traced."""
    rays, done = 0, 0
    for first, count in np.unique(np.stack([taken[active], further[active]], axis=1), axis=0):
        group = active[(taken[active] == first) & (further[active] == count)]
        start, share = done / len(active), len(group) / len(active)
        rays += job.gather(
            np.ascontiguousarray(group, np.uint32),
            int(first),
            int(count),
            seed,
            sums,
            lambda part: on_step(start + share * part),  # noqa: B023
        )
        done += len(group)
    taken[active] += further[active]
    return rays


def _affordable(wanted, relative, further, cost, rays_left):
    """Receivers that a pass can afford, the noisiest first, in order, and how many further rays each gets."""
    if cost * further[wanted].sum() > rays_left:
        further = np.maximum(further // 2, 1)  # fewer for all are worth more than all for some
    noisiest = wanted[np.argsort(-relative[wanted], kind="stable")]
    return np.sort(noisiest[np.cumsum(cost * further[noisiest]) <= rays_left]), further


def _best_estimate(job, grid, means, direct, chosen, probes):
    """Irradiance (N, 3), its relative noise (N,) and relative RMS error, from replicate means (N, R, 3).

    Smoothed, or as it is where that turns out better: a lightmap of few texels has little that is smooth.
    """
    variance = (means @ LUMINANCE).var(axis=1, ddof=1) / REPLICATES
    pooled = np.convolve(variance, np.full(POOL, 1 / POOL), "same") if len(variance) >= POOL else variance
    estimates = [(means.mean(axis=1), pooled)]
    if grid is not None:
        estimates.append(smoothed(job.kernel.workers, grid, job.receivers, means))
    best = None
    for gathered, noise in estimates:
        values = (direct + gathered).astype(np.float32)
        scale = scale_of(values)
        rms = probes.error_of(values[chosen], scale[chosen])
        if best is None or rms < best[2]:
            relative = np.sqrt(noise) / scale
            # what the probes find and the replicates do not, is taken to be spread as the noise is
            stated = np.sqrt(np.mean(relative[chosen] ** 2))
            best = values, relative * min(max(rms / max(stated, 1e-12), 1.0), MOST_DOUBT), rms
    return best
