"""Irradiance at receivers: direct light by shadow rays, indirect light by final gather, until the error is met."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from .direct_light import first_direct, refined_direct
from .effort import Effort
from .gather_job import GatherJob
from .guides import learn_guides, no_guides
from .kernel import KernelScene
from .measuring import measure
from .passes import gather_until
from .probes import SeenPoints, rms_of
from .radiosity import Solved
from .receivers import Receivers
from .relative import scale_of, scale_of_luminance
from .smoothing import TexelGrid
from .texel_light import split_where_blocked, texel_light
from .vertex_graph import VertexGraph
from .workers import within

LOOK_RAYS, TEXEL_LOOK_RAYS = 4, 1  # for a look at the light: it is blurred over neighbours, of which vertices have few
LOOKS = 4  # the first sees the patches' light, each other what the one before it found on texels: patches straddle what
# light does, and what they leave wrong falls by the reflectance from look to look
NEAR = 10.0  # texels: rays that hit from nearer do not take a texel's light
NEAR_SHARE = 1 / 16  # of the scene, at the most: in a coarse lightmap all would be near
FAR = 3.3  # times as far do rays go on from patches, where texels have a light of their own: few are left that need it
FURTHER = 2.0  # seen points look so many times further before they take a texel's or a patch's light for what is there


@dataclass(frozen=True, slots=True)
class Irradiance:
    """What arrives at the receivers.

    Attributes
    ----------
    values : float32 (N, 3) E [W/m^2]
    relative_error : estimated RMS of the error over (E + 0.3 median E), luminance: over what is stored, by how much
        of the surface shows it
    seen_error : the same at random points of the surfaces, looked up in the result as a viewer does, and relative to
        the light that is there
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


def gather_irradiance(
    kernel: KernelScene,
    solved: Solved,
    receivers: Receivers,
    grid: TexelGrid | VertexGraph,
    seen: SeenPoints | None,
    effort: Effort,
) -> Irradiance:
    """Direct plus gathered irradiance at receivers, and how wrong it is.

    Parameters
    ----------
    solved : the patches' reflected light, and what direct light is sampled from
    grid : the texels that the receivers are, or the vertices' values, over which gathered light is smoothed
    seen : random points of the surfaces, at which the result is looked up, or None
    """
    if not len(receivers):
        nothing = {"direct": 0, "gather": 0, "probe": 0}
        return Irradiance(np.zeros((0, 3), np.float32), 0.0, 0.0, True, "", False, nothing)
    started, error, seed = time.perf_counter(), effort.error, effort.seed
    job = GatherJob(kernel, solved, receivers, grid.shown, no_guides(len(receivers)))
    job, direct, rays = _first_looks(job, grid, error, seed, within(effort.on_step, 0.0, 0.4))
    guides, learning = learn_guides(kernel, job.seen_light, receivers, seed + 3)
    job = replace(job, guides=guides)
    pace = (rays["direct"] + rays["gather"] + learning) / (time.perf_counter() - started)
    gathered = gather_until(job, grid, direct, effort.stage(0.4, 0.6), pace)
    seen_error, rays["probe"] = (
        _seen_error(job, seen, gathered.values, error, seed + 5) if seen is not None else (0.0, 0)
    )
    rays["gather"] += learning + gathered.rays
    rays["probe"] += gathered.probe_rays
    is_met = gathered.rms <= error
    return Irradiance(gathered.values, gathered.rms, seen_error, is_met, gathered.stopped, gathered.is_denoised, rays)


def _seen_error(job: GatherJob, seen: SeenPoints, values, error, seed):
    """How wrong the result is where it is looked up, and the rays that it took to tell."""
    at_points = measure(job.looking_further(FURTHER).at(seen.receivers), error, seed)
    # relative to what is there, not to what is shown: light that leaks into the dark has to count as all wrong
    scale = scale_of_luminance(at_points.luminance)
    return rms_of(at_points.squares_of(seen.look_up(values), scale)), at_points.rays


def _first_looks(job: GatherJob, grid: TexelGrid | VertexGraph, error, seed, on_step):
    """The job whose rays see about what is there, direct light as it is stored, and the rays of both."""
    direct, look, rays = _direct_and_look(job, grid, error, seed, within(on_step, 0.0, 0.875))
    if grid.is_image:
        job, further = _with_texel_light(job, grid, direct.values, look, seed + 2, within(on_step, 0.875, 0.125))
        rays += further
    return job, replace(direct, values=grid.stored(direct.values)), {"direct": direct.rays, "gather": rays}


def _direct_and_look(job: GatherJob, grid: TexelGrid | VertexGraph, error, seed, on_step):
    """Direct light, what a few gather rays find (N, 3) and how many these were.

    Direct light comes in two parts, as how much noise it may have depends on what else there is.
    """

    def trace(chosen, samples, seed, on_step, is_first):
        return job.part(chosen).direct(samples, seed, on_step, is_first)

    def over_neighbours(of_one_ray):
        return grid.pooled(job.kernel.workers, job.receivers, of_one_ray)

    first = first_direct(trace, error, seed, within(on_step, 0.0, 0.25))
    look, rays = job.glimpse(TEXEL_LOOK_RAYS if grid.is_image else LOOK_RAYS, seed + 2, within(on_step, 0.25, 0.25))
    look = grid.blurred(job.kernel.workers, job.receivers, look)
    scale = scale_of(first.values + look)
    rest = within(on_step, 0.5, 0.5)
    direct = refined_direct(first, trace, over_neighbours, scale, job.weights, error, seed, rest)
    return direct, look, rays


def _with_texel_light(job: GatherJob, grid: TexelGrid, direct, look, seed, on_step):
    """The job whose rays see the texels' light, found by a first ``look`` and mended by others; the rays of these."""
    reach = min(NEAR * grid.spacing, NEAR_SHARE * float(np.ptp(job.receivers.positions, axis=0).max()))
    is_split = split_where_blocked(job.kernel, grid.receivers, job.receivers, grid.spacing)
    # what arrives behind a translucent surface no texel has: rays take what patches show of it
    seen = grid.receivers
    if grid.translucence is not None:
        seen = np.where((seen >= 0) & ~grid.translucence.any(axis=1)[seen], seen, -1)
    job = replace(job.looking_further(FAR), texel_light=texel_light(grid.uvs, seen, is_split, reach))
    job.show(grid, direct, look)
    rays, share = 0, 1 / (LOOKS - 1)
    for again in range(1, LOOKS):
        look, traced = job.glimpse(TEXEL_LOOK_RAYS, seed + 1000 * again, within(on_step, (again - 1) * share, share))
        job.show(grid, direct, grid.blurred(job.kernel.workers, job.receivers, look))
        rays += traced
    return job, rays
