"""Irradiance at receivers: direct light by shadow rays, indirect light by final gather, until the error is met."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .allocation import measured_errors, next_pass, rays_due
from .denoising import denoised
from .direct_light import first_direct, refined_direct, shadow_samples
from .emitters import LUMINANCE
from .guides import Guides, learn_guides, no_guides
from .kernel import KernelScene
from .probes import Measured, SeenPoints, chosen_receivers, rms_of
from .radiosity import Solved
from .receivers import Receivers
from .relative import scale_of
from .smoothing import TexelGrid, blurred, pooled, smoothed
from .texel_light import NO_TEXEL_LIGHT, TexelLight, split_where_blocked

REPLICATES = 4  # independent randomisations; their spread is the error estimate
LOOK_RAYS = 1  # of a replicate, for the first look at the texels' light, which the first pass then sees
NEAR = 10.0  # texels: rays that hit from nearer do not take a texel's light
NEAR_SHARE = 1 / 16  # of the scene, at the most: in a coarse lightmap all would be near
FAR = 3.3  # times as far do rays go on from patches, where texels have a light of their own: few are left that need it
FIRST_RAYS = 2  # of a replicate, in the first pass, on MANY_TEXELS and more, whose neighbours vouch for them;
FIRST_ALONE = 8  # elsewhere: fewer may miss what is bright and small, and not know it
MANY_TEXELS = 1 << 16
MOST_RAYS = 2048  # of a replicate
MOST_COST = 15  # times the rays of the first pass that all passes may take, and FREE_RAYS at least,
FREE_RAYS = 1 << 26
WORTH_IT = 0.97  # of the error that a pass leaves at the most: after MOST_IDLE that leave more, what is wrong is not
MOST_IDLE = 2  # the noise
AIM = 0.95  # of the target: what receivers are due is an estimate
DENOISE = 1.15  # times the target: from there the denoiser may come to it; else it is asked in the end
SPECKLE = 2.0  # times the target: what is left, when it is met, is seen
MOST_EXTRA = 1  # pass after that, with four times the rays and no more than
SPECKLE_SHARE = 1 / 8  # of those traced: most speckles are gone by then
ENOUGH = 1 / 64  # of the receivers that want it: a pass that can afford fewer is not worth it
USUAL_ERROR = 0.05  # for an error of this; a smaller one takes more by its square
PROBE_DOUBT = 3.0  # times the error aimed at, squared: what a probe may be uncertain by; many of them average it out
PILOT = 4  # of a probe's rays, one in so many tells whether it needs more
MORE_RAYS, MOST_PROBE_RAYS = 16, 1024  # times as many, but not more, for probes more uncertain than the error aimed at
FURTHER = 2.0  # seen points look so many times further before they take a texel's or a patch's light for what is there


@dataclass(frozen=True, slots=True)
class Irradiance:
    """What arrives at the receivers.

    Attributes
    ----------
    values : float32 (N, 3) E [W/m^2]
    relative_error : estimated RMS of the error over (E + 0.3 median E), luminance: over receivers, of a lightmap by how
        much of the surface looks each up
    seen_error : the same at random points of the surfaces, looked up in the result as a viewer does
    target_reached : whether sampling met its target
    stopped : what ended it, "" where nothing was left to do
    is_denoised : whether the denoiser's estimate was the better one
    rays : {"direct": shadow rays, "gather": rays, "probe": rays that measure the error}
    """

    values: np.ndarray
    relative_error: float
    seen_error: float
    target_reached: bool
    stopped: str
    is_denoised: bool
    rays: dict[str, int]


def probe_rays(error: float) -> int:
    """Rays of a replicate at a probe: one ray is about as wrong as the light is bright."""
    return int(min(max(2 ** round(np.log2(1 / (REPLICATES * PROBE_DOUBT * error**2))), 16), 1024))


@dataclass(frozen=True, slots=True)
class _Job:
    """What all passes share."""

    kernel: KernelScene
    solved: Solved
    receivers: Receivers
    weights: np.ndarray  # (N,) of a receiver's squared error in the mean of all, 1 in the mean
    guides: Guides
    texel_light: TexelLight = NO_TEXEL_LIGHT
    denoise: Callable | None = None

    def part(self, chosen) -> _Job:
        """The same for some of the receivers."""
        return replace(
            self,
            receivers=self.receivers.part(chosen),
            weights=self.weights[chosen],
            guides=self.guides.part(chosen),
        )

    def at(self, receivers: Receivers) -> _Job:
        """The same light at other receivers."""
        return replace(self, receivers=receivers, weights=np.ones(len(receivers)), guides=no_guides(len(receivers)))

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
    denoise: Callable | None,
    seconds_left,
    on_step,
) -> Irradiance:
    """Direct plus gathered irradiance at receivers, and how wrong it is.

    Parameters
    ----------
    solved : the patches' reflected light, and what direct light is sampled from
    grid : the texels that the receivers are, over which gathered light is smoothed; None = no smoothing
    seen : random points of the surfaces, at which the result is looked up
    error : target of the relative error [1]
    denoise : a denoiser.Denoiser, or None
    seconds_left : () -> float, until the time limit [s]; the first pass is always finished
    on_step : (0..1) -> None
    """
    if not len(receivers):
        nothing = {"direct": 0, "gather": 0, "probe": 0}
        return Irradiance(np.zeros((0, 3), np.float32), 0.0, 0.0, True, "", False, nothing)
    weights = grid.shown if grid else np.ones(len(receivers), np.float32)
    job = _Job(kernel, solved, receivers, weights, no_guides(len(receivers)), denoise=denoise if grid else None)
    direct, look, looks = _first_look(job, grid, error, seed, on_step)
    if grid is not None:
        job = _with_texel_light(job, grid, direct.values, look)
    guides, learning = learn_guides(kernel, solved.patches, job.texel_light, solved.sources, receivers, seed + 3)
    gathered = _gather_until(replace(job, guides=guides), grid, direct.values, error, seed, seconds_left, on_step)
    at_points = _measure(gathered.job.looking_further(FURTHER).at(seen.receivers), error, seed + 5)
    shown = seen.look_up(gathered.values)
    seen_error = rms_of(at_points.squares_of(shown, scale_of(shown)))
    traced = {
        "direct": direct.rays,
        "gather": looks + learning + gathered.rays,
        "probe": gathered.probe_rays + at_points.rays,
    }
    is_met = gathered.rms <= error
    return Irradiance(gathered.values, gathered.rms, seen_error, is_met, gathered.stopped, gathered.is_denoised, traced)


def _first_look(job: _Job, grid: TexelGrid | None, error, seed, on_step):
    """Direct light, what a few gather rays find (N, 3), and how many these were.

    Direct light comes in two parts, as how much noise it may have depends on what else there is.
    """

    def trace(chosen, samples, seed, on_step):
        return job.part(chosen).direct(samples, seed, on_step)

    def over_neighbours(of_one_ray):
        return pooled(job.kernel.workers, grid, job.receivers, of_one_ray)

    first = first_direct(trace, error, seed, lambda done: on_step(0.1 * done))
    means, _, rays = _gathered(job, LOOK_RAYS, seed + 2, lambda done: on_step(0.1 + 0.1 * done))
    look = means.mean(axis=1) if grid is None else blurred(job.kernel.workers, grid, job.receivers, means)
    scale = scale_of(first.values + look)
    direct = refined_direct(
        first, trace, over_neighbours, scale, job.weights, error, seed, lambda done: on_step(0.2 + 0.2 * done)
    )
    return direct, look, rays


def _with_texel_light(job: _Job, grid: TexelGrid, direct, look):
    """The job whose rays see what a first look found on the texels."""
    reach = min(NEAR * grid.spacing, NEAR_SHARE * float(np.ptp(job.receivers.positions, axis=0).max()))
    cells = split_where_blocked(job.kernel, grid.receivers, job.receivers, grid.spacing)
    no_light = np.zeros((len(direct), 3), np.float32)
    job = replace(job.looking_further(FAR), texel_light=TexelLight(grid.uvs, cells, no_light, reach))
    return _seeing(job, grid, direct, look)


def _seeing(job: _Job, grid: TexelGrid, direct, gathered) -> _Job:
    """The job whose rays see direct and gathered light (N, 3) on the texels."""
    radiosity = (grid.reflectance * (direct + gathered)).astype(np.float32)
    return replace(job, texel_light=replace(job.texel_light, radiosity=radiosity))


def _measure(job: _Job, error, seed) -> Measured:
    """The light at a job's receivers, with many rays, and with more where that would not be enough to judge by.

    Where, a few rays of their own tell: those that happen to miss what is bright would take themselves to be certain.
    """
    direct, variance, rays = job.direct(4 * shadow_samples(error), seed)
    values, noise, count = direct.copy(), variance.copy(), probe_rays(error)
    pilot, spread, traced = _gathered(job, max(count // PILOT, 1), seed)
    quiet = np.sqrt(spread / PILOT) <= error * scale_of(direct + pilot.mean(axis=1))
    rays += traced
    more = max(min(MORE_RAYS * count, MOST_PROBE_RAYS), 2 * count)
    for part, share, own in ((quiet, count, seed + 1), (~quiet, more, seed + 2)):
        gathered, spread, traced = _gathered(job.part(np.flatnonzero(part)), share, own)
        values[part] += gathered.mean(axis=1)
        noise[part] += spread
        rays += traced
    return Measured(values @ LUMINANCE, noise, rays)


def _gathered(job: _Job, count, seed, on_step=None):
    """Means of ``count`` rays of each replicate (N, R, 3), variance of their mean's luminance (N,), the rays."""
    sums = np.zeros((len(job.receivers), REPLICATES, 3), np.float32)
    rays = job.gather(np.arange(len(sums), dtype=np.uint32), 0, count, seed, sums, on_step)
    means = sums / count
    return means, (means @ LUMINANCE).var(axis=1, ddof=1) / REPLICATES, rays


@dataclass(frozen=True, slots=True)
class _Gathered:
    """What passes have come to: irradiance (N, 3), its relative RMS error, what stopped them ("" = nothing to do)."""

    job: _Job  # whose rays see the light that was found last
    values: np.ndarray
    rms: float
    stopped: str
    is_denoised: bool
    rays: int
    probe_rays: int


@dataclass(frozen=True, slots=True)
class _Found:
    """Irradiance (N, 3), its squared relative errors at the probes, and whether the denoiser was believed."""

    values: np.ndarray
    squares: np.ndarray
    is_denoised: bool


def _denoised(job: _Job, grid, found: _Found, means, direct, chosen, probes) -> _Found:
    """What the denoiser makes of it, where there is one and the probes find it better."""
    if job.denoise is None:
        return found
    gathered = means.mean(axis=1, dtype=np.float32)
    values = denoised(job.denoise, grid, found.values, direct, gathered, chosen, probes)
    squares = job.weights[chosen] * probes.squares_of(values[chosen], scale_of(values)[chosen])
    return _Found(values, squares, True) if rms_of(squares) < rms_of(found.squares) else found


def _gather_until(job: _Job, grid, direct, error, seed, seconds_left, on_step) -> _Gathered:
    """Gather in passes, each for the receivers that still need it, until the measured error is the target."""
    count, chosen, probes = len(job.receivers), chosen_receivers(len(job.receivers)), None
    sums, taken = np.zeros((count, REPLICATES, 3), np.float32), np.zeros(count, np.int64)
    active, further = np.arange(count), np.full(count, FIRST_RAYS if grid and count >= MANY_TEXELS else FIRST_ALONE)
    rays, budget, idle, extra, begin, rms, started = 0, 0, 0, 0, 0.4, np.inf, time.perf_counter()
    while True:
        # half of what is left of the bar for each pass: nobody knows how many there will be
        width = 0.5 * (1 - begin)
        rays += _gather_pass(job, active, taken, further, seed, sums, lambda done: on_step(begin + width * done))  # noqa: B023
        begin += width
        budget = budget or int(max(MOST_COST * rays, FREE_RAYS) * max(1.0, (USUAL_ERROR / error) ** 2))
        means, before = sums / taken[:, None, None].astype(np.float32), rms
        near = None
        if grid:
            # blurred over neighbours only, which keeps the light there is: rays that see it average it anyway, while
            # smoothing that minds values would take some of a few rays' light away
            near = blurred(job.kernel.workers, grid, job.receivers, means)
            job = _seeing(job, grid, direct, near)
        probes = probes or _measure(job.part(chosen), error, seed + 1)
        found, relative = _best_estimate(job, grid, means, near, taken, direct, chosen, probes)
        is_asked = error < rms_of(found.squares) <= DENOISE * error
        if is_asked:
            found = _denoised(job, grid, found, means, direct, chosen, probes)
        squares = found.squares
        rms = rms_of(squares)

        def ended(why=""):
            last = found if is_asked else _denoised(job, grid, found, means, direct, chosen, probes)  # noqa: B023
            return _Gathered(job, last.values, rms_of(last.squares), why, last.is_denoised, rays, probes.rays)  # noqa: B023

        idle = idle + 1 if rms > max(error, WORTH_IT * before) else 0
        if idle == MOST_IDLE:
            return ended("as further rays no longer help")
        errors = measured_errors(relative, chosen, squares)
        extra += rms <= error
        speckled = np.where(relative > SPECKLE * error, np.inf, 0.0)
        due = rays_due(errors, taken, AIM * error) if rms > error else speckled
        left = budget - rays if rms > error else min(budget - rays, SPECKLE_SHARE * rays)
        in_time = seconds_left() * rays / (time.perf_counter() - started)
        cost = rays / int(taken.sum())  # of one more ray of all replicates, with those that it goes on as
        wanting, _ = next_pass(due, taken, MOST_RAYS, cost, np.inf)
        if extra > MOST_EXTRA or not len(wanting):
            return ended()
        active, further = next_pass(due, taken, MOST_RAYS, cost, min(left, in_time))
        if len(active) < ENOUGH * len(wanting):
            return ended("by the time limit" if in_time < left else "by the budget of rays")


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


def _best_estimate(job, grid, means, near, taken, direct, chosen, probes):
    """What replicate means (N, R, 3) come to, a _Found, and its relative noise (N,); ``near`` is the means blurred.

    Smoothed, or as it is where that turns out better: a lightmap of few texels has little that is smooth.
    """
    variance = (means @ LUMINANCE).var(axis=1, ddof=1) / REPLICATES
    estimates = [(means.mean(axis=1), pooled(job.kernel.workers, None, job.receivers, variance * taken) / taken)]
    if grid is not None:
        estimates.append(smoothed(job.kernel.workers, grid, job.receivers, means, near, taken))
    best = None
    for gathered, noise in estimates:
        values = (direct + gathered).astype(np.float32)
        scale = scale_of(values)
        squares = job.weights[chosen] * probes.squares_of(values[chosen], scale[chosen])
        if best is None or rms_of(squares) < rms_of(best[0].squares):
            best = _Found(values, squares, False), np.sqrt(job.weights * noise) / scale
    return best
