"""What "auto" stands for: the solver for a scene's size and reflectance, and how form factors are estimated."""

from __future__ import annotations

import math

import numpy as np

from .conjugate_gradient import EXCHANGE_LIMIT
from .scene import Scene
from .settings import BakeSettings, SettingsError
from .triangles import triangle_areas

EXCHANGE_TRIANGLES = 3000  # up to which "auto" takes conjugate gradients, which keep 4 n^2 bytes
BRIGHT_ROOM = 0.8  # mean reflectance from which conjugate gradients need less time than stochastic Jacobi,
BRIGHT_LIGHTMAP = 0.96  # and where texels mend what patches leave wrong: there rough patches do until then
FEW_SIDES = 3200  # at first: a room so simple that no more are needed; others soon have five times as many, and take
SIDES = 570  # times 1 / sqrt(1 - rho) as many to be slower: their time grows as sides^2, stochastic's as 1 / (1 - rho)


def choose(
    settings: BakeSettings,
    triangle_count: int,
    side_count: int,
    reflectance: float = 0.5,
    is_rough: bool = False,
    needs_rays: str | None = None,
) -> tuple[str, str, str]:
    """Solver, method, and a sentence on why, after "auto" has looked at the scene's size and mean reflectance.

    ``side_count`` are the sides of the patches that conjugate gradients would start with: thin triangles have many.
    ``needs_rays`` names a material that lets light through in a colour, diffusely or on one side: form factors know
    none of these.

    By time to equal error, measured on closed cubes and the Cornell box of 240 to 12000 sides: rows of form factors and
    conjugate gradients take a third to a tenth of stochastic Jacobi's time at reflectance 0.9, a hundredth at 0.99, up
    to five times as much at 0.5. They fit up to some 16000 sides, and take long for many: a ball on a floor of 0.8 is
    26 s, 1 by stochastic Jacobi. Direct takes longer for the same, progressive refinement leaves twice the error,
    as it uses each row for one direction only.
    """
    method = "monte-carlo" if settings.method == "auto" else settings.method
    if needs_rays is not None:
        return _choose_rays(settings, needs_rays)
    if settings.solver != "auto":
        return settings.solver, method, f"{settings.solver} and {method} as asked"
    fits = triangle_count <= EXCHANGE_TRIANGLES and side_count <= EXCHANGE_LIMIT
    is_quick = side_count <= max(FEW_SIDES, SIDES / math.sqrt(max(1 - reflectance, 1e-9)))
    if method == "hemicube":
        solver = "conjugate-gradient" if fits else "progressive"
        return solver, method, f"{solver} for {triangle_count} triangles, with form factors by hemicube as asked"
    if reflectance >= (BRIGHT_LIGHTMAP if is_rough else BRIGHT_ROOM) and fits and is_quick:
        reason = f"{triangle_count} triangles of mean reflectance {reflectance:.2f}, where light bounces long"
        return "conjugate-gradient", method, f"conjugate-gradient for {reason}"
    return "stochastic", method, f"stochastic for {triangle_count} triangles: it needs no form factors, at any size"


def _choose_rays(settings, material):
    why = f"material '{material}' lets light through diffusely, in a colour or on one side"
    for name, value, others in (
        ("solver", settings.solver, ("auto", "stochastic")),
        ("method", settings.method, ("auto", "monte-carlo")),
    ):
        if value not in others:
            raise SettingsError(f"{name} is {value}: {why}, which takes {others[1]} (or auto)")
    return "stochastic", "monte-carlo", f"stochastic, as {why}"


def mean_reflectance(scene: Scene) -> float:
    """Mean over the scene's area of the brightest channel; textures count as grey."""
    brightest = [max(m.reflectance) * (0.5 if m.reflectance_texture is not None else 1.0) for m in scene.materials]
    areas = triangle_areas(scene.corners)
    return float((areas * np.array(brightest)[scene.triangle_materials]).sum() / max(areas.sum(), 1e-300))
