"""Gathering in passes, each for the receivers that still need it, until the error that is measured is the target."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .allocation import measured_errors, next_pass, rays_due
from .denoising import denoised, needs_denoising
from .direct_light import DirectLight
from .effort import Effort
from .gather_job import REPLICATES, GatherJob
from .gather_sums import no_sums
from .measuring import probes_among
from .probes import Probes, rms_of
from .relative import scale_of
from .smoothing import TexelGrid
from .vertex_graph import VertexGraph
from .workers import within

# The first pass: rays of a replicate that each receiver starts with.
LEAST_FIRST, MOST_FIRST = 2, 8  # few rays may all miss what is bright and small, and their spread does not tell
MANY = 1 << 16  # receivers: neighbours vouch for each other, so that each may start with the fewest; else with the most
FINE = 3 << 20  # texels: neighbours lie so near that half as many do, as light is no finer than in coarser lightmaps
FIRST_ERROR = 0.1  # over the target is how many there are, to a power of two: one ray far off leaves a blotch
HURRY = 4  # first passes that the time limit must have room for; where it has not, all start with the fewest

# What ends the passes.
MOST_RAYS = 2048  # of a replicate, for any receiver
MOST_COST = 15  # times what a first pass of the fewest rays costs (of vertices, the most) is the budget of all passes
FREE_RAYS = 1 << 26  # that the budget is at the least
USUAL_ERROR = 0.05  # a smaller target has a budget larger by the square of the ratio
WORTH_IT = 0.97  # of the error before is what a pass must leave at the most, or else it was idle
MOST_IDLE = 2  # idle passes: what is wrong then is not the noise, and more rays do not help
ENOUGH = 1 / 64  # of the receivers that want more rays must be affordable, for a pass to be worth it

# What a pass aims at.
AIM = 0.95  # of the target: what receivers are due is an estimate
DENOISED_AIM = 1.03  # of the target, where a denoiser takes some off
VERTEX_AIM = 0.85  # of the target: estimates fall short by more where neighbours are few
STEP = 0.85  # of the gathered light's error, at the most: who is due hardly more than it has would get nothing
LEAST_PART = 0.5  # of the error aimed at is left to gathered light, however noisy the direct light is

# What comes after the target is met, or nearly.
DENOISE = 1.15  # times the target: from there the denoiser may come to it; else it is asked in the end
SPECKLE = 2.0  # times the target: receivers noisier than that get a pass of their own when the first pass meets it
SPECKLE_SHARE = 1 / 8  # of the rays so far is what that pass may take


@dataclass(frozen=True, slots=True)
class Gathered:
    """What passes have come to.

    Attributes
    ----------
    values : float32 (N, 3) irradiance [W/m^2]
    rms : its relative error, as measured
    stopped : what ended the passes, "" where nothing was left to do
    is_denoised : whether the denoiser's estimate was the better one
    rays, probe_rays : traced by the passes, and to measure the error
    """

    values: np.ndarray
    rms: float
    stopped: str
    is_denoised: bool
    rays: int
    probe_rays: int


class _Samples:
    """The rays of all passes: their sums, how many of a replicate each receiver has (N,), how many were traced."""

    def __init__(self, count: int):
        self.sums, self.taken, self.rays = no_sums(count, REPLICATES), np.zeros(count, np.int32), 0

    def add(self, job: GatherJob, active, further, seed, on_step) -> None:
        """Trace ``further`` (N,) rays of every replicate at the ``active`` receivers (K,), those of a kind at once."""
        done, kinds = 0.0, self.taken[active] * (MOST_RAYS + 1) + further[active]
        for kind in np.unique(kinds):
            group, (first, count) = active[kinds == kind], divmod(kind, MOST_RAYS + 1)
            share = len(group) / len(active)
            self.rays += job.gather(group, int(first), int(count), seed, self.sums, within(on_step, done, share))
            done += share
        self.taken[active] += further[active]

    @property
    def light(self):
        """What is gathered, float32 (N, 3): made of the sums when it is asked for, as it takes half their memory."""
        return self.sums.means(self.taken)

    @property
    def cost(self) -> float:
        """Rays traced for one of all replicates: with those that it goes on as."""
        return self.rays / int(self.taken.sum(dtype=np.int64))


@dataclass(frozen=True, slots=True)
class _Found:
    """An estimate: irradiance (N, 3), its stated relative noise (N,), and its squared errors at the probes, weighted.

    What the surface hardly looks up counts for little in both.
    """

    values: np.ndarray
    noise: np.ndarray
    squares: np.ndarray
    is_denoised: bool = False

    @property
    def rms(self) -> float:
        return rms_of(self.squares)


def gather_until(
    job: GatherJob,
    grid: TexelGrid | VertexGraph,
    direct: DirectLight,
    effort: Effort,
    pace: float,
) -> Gathered:
    """Gather until the error is the target, or further rays no longer help or cannot be afforded.

    In the end the job's rays see what was gathered.

    Parameters
    ----------
    grid : as in gather.gather_irradiance
    direct : what it is at the job's receivers; its values are those that are stored
    pace : rays that were traced in a second before
    """
    count, started, error = len(job.receivers), time.perf_counter(), effort.error
    samples, probes = _Samples(count), None
    # what the budget goes by: fewer neighbours take less off
    budgeted = LEAST_FIRST if grid.is_image and count >= MANY else MOST_FIRST
    first = first_rays(fewest_first(count, grid.is_image), error, pace * effort.seconds_left() / (REPLICATES * count))
    active, further = np.arange(count), np.full(count, first, np.int32)
    aim = VERTEX_AIM if not grid.is_image else AIM if effort.denoise is None else DENOISED_AIM
    budget, idle, begin, rms, is_first = 0, 0, 0.0, np.inf, True
    while True:
        # half of what is left of the bar for each pass: nobody knows how many there will be
        width = 0.5 * (1 - begin)
        samples.add(job, active, further, effort.seed, within(effort.on_step, begin, width))
        begin += width
        del active, further
        budget = budget or ray_budget(samples.rays * budgeted / first, error)
        scales = _show_what_was_gathered(job, grid, samples, direct.values)
        probes = probes or probes_among(job, grid, error, effort.seed + 1)
        found = _best_estimate(job, grid, samples, scales, direct.values, probes)
        is_asked = error < found.rms <= DENOISE * error
        if is_asked:
            found, aim = _denoised(effort.denoise, job, grid, found, samples, direct, probes), min(aim, AIM)
        idle = idle + 1 if found.rms > max(error, WORTH_IT * rms) else 0
        rms = found.rms
        if rms <= error and not is_first:
            stopped = ""
        elif idle == MOST_IDLE:
            stopped = "as further rays no longer help"
        else:
            due = _due(found, samples, probes, error, aim, direct.rms)
            in_time = effort.seconds_left() * samples.rays / (time.perf_counter() - started)
            active, further, stopped = _next(due, samples, rms <= error, budget - samples.rays, in_time)
            del due
        is_first = False
        if stopped is not None:
            if not is_asked and needs_denoising(found.rms, error):
                found = _denoised(effort.denoise, job, grid, found, samples, direct, probes)
            values = grid.stitched(found.values, lambda: effort.on_step(1.0))
            rms, traced = rms_of(probes.squares_of(values)), (samples.rays, probes.measured.rays)
            if found.rms <= error < rms:
                stopped = "as seams were stitched"
            return Gathered(values, rms, stopped, found.is_denoised, *traced)
        del found, scales  # a fine lightmap's are a gigabyte, which the next estimate needs


def fewest_first(count, is_image) -> int:
    """Rays of a replicate that ``count`` receivers start with at the fewest."""
    if count < MANY:
        return MOST_FIRST
    return LEAST_FIRST // 2 if is_image and count >= FINE else LEAST_FIRST


def first_rays(fewest, error, in_time) -> int:
    """Rays of a replicate that all receivers start with, where there is time for ``in_time``."""
    usual = FIRST_ERROR / error * min(fewest / LEAST_FIRST, 1)
    enough = int(np.clip(2.0 ** round(np.log2(usual)), fewest, MOST_FIRST))
    return enough if HURRY * enough <= in_time else fewest


def ray_budget(first_cost, error) -> int:
    """Rays that all passes may take: ``first_cost`` is what the first rays take that the budget goes by."""
    return int(max(MOST_COST * first_cost, FREE_RAYS) * max(1.0, (USUAL_ERROR / error) ** 2))


def _show_what_was_gathered(job: GatherJob, grid, samples: _Samples, direct):
    """Let rays see it where it is an image; what errors of it are relative to (N,)."""
    # blurred over neighbours only, which keeps the light there is: rays that see it average it anyway, while smoothing
    # that minds values would take some of a few rays' light away
    near = grid.blurred(job.kernel.workers, job.receivers, samples.light)
    if grid.is_image:
        job.show(grid, direct, near)
    return scale_of(near)


def _best_estimate(job: GatherJob, grid, samples: _Samples, scales, direct, probes: Probes) -> _Found:
    """What gathered light comes to; ``scales`` (N,): what errors of it are relative to.

    Smoothed, or as it is where that turns out better: a lightmap of few texels has little that is smooth.
    """
    workers, receivers, taken = job.kernel.workers, job.receivers, samples.taken
    variance = samples.sums.variances(taken)

    def found_by(gathered, noise):
        lit = direct + gathered
        relative = (np.sqrt(job.weights * noise) / scale_of(lit)).astype(np.float32)
        return _Found(lit, relative, probes.squares_of(lit))

    as_it_is = rms_of(probes.squares_of(direct + grid.stored(samples.light)))
    smooth = found_by(*grid.smoothed(workers, receivers, samples.light, variance, scales, taken))
    if smooth.rms < as_it_is:
        return smooth
    noise = grid.pooled(workers, receivers, variance * taken.astype(np.float32)) / taken
    return found_by(grid.stored(samples.light), noise)


def _denoised(denoise, job, grid, found: _Found, samples: _Samples, direct: DirectLight, probes: Probes) -> _Found:
    """What the denoiser makes of it, where there is one and the probes find it better."""
    if denoise is None or not grid.is_image:
        return found
    noise = np.square(found.noise) / job.weights + np.minimum(direct.variance / scale_of(found.values) ** 2, 1)
    pooled = partial(grid.pooled, job.kernel.workers, job.receivers)
    light = found.values, noise, direct.values, samples.light
    values = denoised(denoise, grid, *light, pooled, probes)
    other = replace(found, values=values, squares=probes.squares_of(values), is_denoised=True)
    return min(found, other, key=lambda estimate: estimate.rms)


def _due(found: _Found, samples: _Samples, probes: Probes, error, aim, direct_rms):
    """Rays of a replicate that each receiver is due (N,): when the target is met, only speckles.

    A speckle is a receiver whose noise is seen then, as a soft dot that smoothing has made of it.
    """
    if found.rms <= error:
        return np.where(found.noise > SPECKLE * error, np.float32(np.inf), np.float32(0))
    errors = measured_errors(found.noise, probes.receivers, probes.shares * found.squares)
    errors, aimed_at = _gathered_part(errors, found.rms, aim * error, direct_rms)
    return np.minimum(rays_due(errors, samples.taken, aimed_at), MOST_RAYS).astype(np.float32)


def _gathered_part(errors, rms, target, direct_rms):
    """Of errors (N,) and of the target for their ``rms`` what is gathered light's: no ray takes direct light's off."""
    left, wanted = (np.sqrt(max(both**2 - direct_rms**2, (LEAST_PART * both) ** 2)) for both in (rms, target))
    return errors * (left / rms), min(wanted, STEP * left)


def _next(due, samples: _Samples, is_met, rays_left, rays_in_time):
    """The receivers of the next pass (K,), further rays of each (N,), and what stops it, None where nothing does."""
    if is_met:
        rays_left = min(rays_left, SPECKLE_SHARE * samples.rays)
    wanting = len(next_pass(due, samples.taken, MOST_RAYS, samples.cost, np.inf)[0])
    active, further = next_pass(due, samples.taken, MOST_RAYS, samples.cost, min(rays_left, rays_in_time))
    if wanting and len(active) >= ENOUGH * wanting:
        return active, further, None
    if is_met:
        return active, further, ""
    if not wanting:
        return active, further, "as receivers have the most rays that they may"
    return active, further, "by the time limit" if rays_in_time < rays_left else "by the budget of rays"
