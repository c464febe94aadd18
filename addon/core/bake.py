"""The bake, one straight line: triangles -> patches -> radiosity -> receivers -> irradiance -> lightmap or colours."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from . import findings
from .backs import translucent_backs, with_backs
from .denoiser import open_denoiser
from .denoising import needs_denoising
from .effort import Effort
from .emitters import emitters_of
from .find_seams import find_seams
from .gather import Irradiance, gather_irradiance
from .kernel import KernelScene
from .lightmap import Lightmap, assemble
from .probes import seen_through_corners, seen_through_lightmap
from .radiosity import MOST_REFLECTANCE, UNSHOT_LIMIT, Solved, solve_radiosity
from .receivers import surface_receivers
from .report import Report
from .scene import Scene, SceneError, radiance_from_exitance
from .settings import BakeSettings
from .sky import with_suns
from .smoothing import texel_grid
from .sound_faces import SoundFaces, sound_faces
from .texels import texels
from .unwrap import unwrap
from .vertices import vertex_receivers
from .workers import OnProgress, Progress, Workers

# how a bake's time falls to its stages, for the progress bar
STAGE_SHARES = {
    "lightmap": {"unwrap": 0.15, "texels": 0.05, "solve": 0.1, "gather": 0.7},
    "vertex": {"texels": 0.1, "solve": 0.15, "gather": 0.75},
}


@dataclass(frozen=True, slots=True)
class BakeResult:
    """What a bake gives; exactly one of ``lightmap`` and ``corner_colours`` is there.

    Attributes
    ----------
    lightmap : pixels of E / pi and where every triangle lies in them
    corner_colours : float32 (T, 3, 3) E / pi per triangle corner, NaN on triangles of objects that are not targets and
        of polygons that were left out whole
    report : seconds, rays, error, energy, warnings
    """

    lightmap: Lightmap | None
    corner_colours: np.ndarray | None
    report: Report


def bake(
    scene: Scene, settings: BakeSettings, on_progress: OnProgress | None = None, denoiser_library: Path | None = None
) -> BakeResult:
    """Light a scene: from triangles to E / pi on every texel or vertex of its target objects.

    ``denoiser_library`` is Open Image Denoise, None where there is none.

    Raises SceneError or SettingsError for what cannot be baked, BakeCancelled when ``on_progress`` returns False.
    """
    sound = sound_faces(scene)
    _require_targets(sound)
    scene = with_suns(sound.scene)
    progress = Progress(on_progress, STAGE_SHARES[settings.target])

    def seconds_left():
        return np.inf if settings.time_limit is None else settings.time_limit - progress.elapsed

    with (
        Workers(settings.thread_count) as workers,
        open_denoiser(denoiser_library, settings, progress.poll) as (denoise, no_denoiser),
    ):
        if settings.target == "lightmap":
            receivers, grid, seen, rects, found = _on_texels(scene, settings, progress)
            kernel = KernelScene(scene, workers)
            seams = find_seams(scene, kernel, receivers, grid.uvs, grid.receivers, progress.poll)
            grid = replace(grid, seams=seams)
        else:
            progress.begin("texels")
            found = ()
            kernel = KernelScene(scene, workers)
            receivers, grid = vertex_receivers(scene, kernel, settings.smooth_angle_deg)
            seen = seen_through_corners(scene, grid, settings.seed)

        progress.begin("solve")
        emitters = emitters_of(scene, kernel.centre)
        solved = solve_radiosity(scene, kernel, emitters, settings, progress.step)

        progress.begin("gather")
        backs = translucent_backs(scene, kernel, receivers, grid, settings.smooth_angle_deg)
        in_front = 1 if backs is None else len(receivers) / (len(receivers) + len(backs.receivers))  # of the time left
        effort = Effort(
            settings.error, settings.seed, denoise, lambda: in_front * seconds_left(), on_step=progress.step
        )
        irradiance = gather_irradiance(kernel, solved, receivers, grid, seen, effort)
        if backs is not None:
            effort = Effort(settings.error, settings.seed, None, seconds_left, lambda done: progress.poll())
            irradiance = with_backs(irradiance, backs, kernel, solved, effort)

        found += findings.of_light(scene, receivers, irradiance.values)
        progress.begin("texels")
        lightmap = corner_colours = None
        if settings.target == "lightmap":
            lightmap = assemble(irradiance.values, grid.receivers, grid.uvs, rects)
            lightmap = replace(lightmap, uvs=sound.spread(lightmap.uvs))
        else:
            corner_colours = np.full((len(scene.triangles), 3, 3), np.nan, np.float32)
            colours = radiance_from_exitance(grid.corner_values(irradiance.values))
            corner_colours[grid.triangles] = colours
            corner_colours = sound.spread(corner_colours)
        progress.end()
        denoiser = _denoiser_used(denoise, no_denoiser, irradiance, settings.error)
    report = _report(scene, found, settings, progress, solved, irradiance, lightmap, denoiser)
    return BakeResult(lightmap, corner_colours, report)


def _on_texels(scene: Scene, settings: BakeSettings, progress: Progress):
    """A lightmap's receivers, the grid of texels that they are, points at which it is looked up, objects' rects, and
    what the report is to say of it."""
    progress.begin("unwrap")
    charts = unwrap(scene, settings, progress.step)
    progress.begin("texels")
    texel_map = texels(charts)
    receivers = surface_receivers(scene, texel_map.triangles, texel_map.barycentrics)
    grid = texel_grid(scene, charts, texel_map, receivers)
    seen = seen_through_lightmap(scene, grid.receivers, grid.uvs, settings.seed)
    return receivers, grid, seen, charts.rects, findings.of_texels(scene, charts, texel_map, settings.keep_uvs)


def _require_targets(sound: SoundFaces) -> None:
    if any(obj.is_target and obj.count for obj in sound.scene.objects):
        return
    if any(obj.is_target and obj.count for obj in sound.whole.objects):
        raise SceneError(f"nothing to bake: no face of the target objects can be: {sound.target_faults[0]}")
    raise SceneError("nothing to bake: the scene has no target object with faces")


def _denoiser_used(denoise, reason, irradiance, error) -> str:
    """For the report: what was used, or "none" and why."""
    if irradiance.is_denoised:
        return denoise.name
    was_asked = needs_denoising(irradiance.relative_error, error)
    why_not = "no better than smoothing" if was_asked else "not needed for this target"
    return f"none: {reason or denoise.failure or why_not}"


def _report(scene, found, settings, progress, solved: Solved, irradiance: Irradiance, lightmap, denoiser) -> Report:
    warnings = [*scene.warnings, *found]
    if not irradiance.target_reached:
        warnings.append(
            f"the target error {settings.error:g} was not reached: sampling stopped at an estimated "
            f"{irradiance.relative_error:.3g} {irradiance.stopped}".rstrip()
        )
    if solved.keeps_all_light:
        warnings.append(
            f"some surfaces reflect all light: it is solved for at a reflectance of {MOST_REFLECTANCE}, as it "
            "would have no bound in a closed room"
        )
    energy = solved.solution.energy
    if solved.solution.solver != "direct" and energy.unshot > 2 * UNSHOT_LIMIT * energy.shot:
        warnings.append(
            f"the solver stopped with {energy.unshot / energy.shot:.2g} of the light unshot: too little is absorbed"
        )
    return Report(
        seconds=progress.seconds,
        rays={**solved.rays, **irradiance.rays},
        triangles=len(scene.triangles),
        patches=len(solved.patches),
        receivers=len(irradiance.values),
        lightmap_size=lightmap.pixels.shape[1::-1] if lightmap else None,
        method=solved.method,
        solver=solved.solution.solver,
        choice=solved.choice,
        denoiser=denoiser,
        residuals=solved.solution.residuals,
        estimated_error=irradiance.relative_error,
        seen_error=irradiance.seen_error,
        target_error=settings.error,
        target_reached=irradiance.target_reached,
        energy=energy,
        closure=solved.laws.closure,
        reciprocity=solved.laws.reciprocity,
        warnings=tuple(warnings),
    )
