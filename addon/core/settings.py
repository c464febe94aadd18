"""What a bake is asked to do: one frozen, validated dataclass, no globals, no dicts of options."""

from __future__ import annotations

import numbers
import os
from dataclasses import dataclass, fields

TARGETS = ("lightmap", "vertex")
METHODS = ("auto", "hemicube", "monte-carlo")
SOLVERS = ("auto", "direct", "conjugate-gradient", "progressive", "stochastic")


class SettingsError(ValueError):
    """A setting outside its range; the message names the setting, its value and the range."""


class BakeCancelled(Exception):
    """The progress callback asked to stop; nothing has been written."""


@dataclass(frozen=True, slots=True)
class BakeSettings:
    """What a bake may spend and when it may stop.

    Attributes
    ----------
    target : "lightmap" or "vertex"
    method : how form factors are estimated; "auto" is Monte Carlo
    solver : "auto" is stochastic, in bright rooms and with hemicubes conjugate-gradient while it fits, and progressive
        with hemicubes in larger scenes; the report says which it was, and why. Where light passes in a colour, or
        diffusely, it is stochastic with rays, and nothing else is taken
    error : target of the local relative RMS error of the irradiance; missed, the report says so [1]
    time_limit : sampling stops after so many seconds, target reached or not [s]; None = no limit
    texels : lightmap size as a number of texels, about
    density : texels per metre; when given, it decides the size instead of ``texels`` [1/m]
    keep_uvs : use the objects' existing "Lightmap" UV layers instead of unwrapping
    patch_size : longest edge of all patches [m]; None = chosen from the scene, and with solvers that need form factors
        the shorter, the more the light changes there
    denoise : let Blender's denoiser improve lightmaps where measured points say that it does
    smooth_angle_deg : faces that meet at less share vertex colours, unless the edge is sharp
    seed : same seed, same bytes; denoised, on the same processor and Blender only
    threads : 0 = all cores
    """

    target: str = "lightmap"
    method: str = "auto"
    solver: str = "auto"
    error: float = 0.02
    time_limit: float | None = None
    texels: int = 1 << 20
    density: float | None = None
    keep_uvs: bool = False
    patch_size: float | None = None
    denoise: bool = True
    smooth_angle_deg: float = 30.0
    seed: int = 0
    threads: int = 0

    def __post_init__(self):
        for field in fields(self):
            _require_type(field, getattr(self, field.name))
        _require_choice("target", self.target, TARGETS)
        _require_choice("method", self.method, METHODS)
        _require_choice("solver", self.solver, SOLVERS)
        _require("error", self.error, 1e-4 <= self.error <= 1.0, "0.0001 ... 1")
        _require("time_limit", self.time_limit, self.time_limit is None or self.time_limit > 0, "above 0 s")
        _require("texels", self.texels, 64 <= self.texels <= 1 << 28, "64 ... 268435456")
        _require("density", self.density, self.density is None or 0 < self.density <= 1e9, "up to 1e9 texels/m")
        _require("patch_size", self.patch_size, self.patch_size is None or self.patch_size > 0, "above 0 m")
        _require("smooth_angle_deg", self.smooth_angle_deg, 0 <= self.smooth_angle_deg <= 180, "0 ... 180 degrees")
        _require("seed", self.seed, 0 <= self.seed < 1 << 32, "0 ... 4294967295")
        require_threads(self.threads)
        if self.method == "hemicube" and self.solver == "stochastic":
            raise SettingsError("solver stochastic shoots Monte Carlo rays: it cannot use method hemicube")

    @property
    def thread_count(self) -> int:
        """Threads to run, at least 1."""
        return thread_count(self.threads)


def thread_count(threads: int) -> int:
    """Threads to run, at least 1, where ``threads`` are asked for, and 0 is all cores."""
    require_threads(threads)
    return threads or os.cpu_count() or 1


def require_threads(threads: int) -> None:
    """SettingsError where nobody could run so many."""
    _require("threads", threads, 0 <= threads <= 1024, "0 ... 1024")


KINDS = {
    "str": (str, "a word"),
    "bool": (bool, "True or False"),
    "int": (numbers.Integral, "a whole number"),
    "float": (numbers.Real, "a number"),
}


def _require_type(field, value):
    kind, _, none = field.type.partition(" | ")
    expected, called = KINDS[kind]
    is_none = none and value is None
    is_number = expected not in (str, bool) and isinstance(value, bool)  # which Python takes for one
    if not is_none and (not isinstance(value, expected) or is_number):
        raise SettingsError(f"{field.name} is {value!r}: allowed is {called}{' or None' if none else ''}")


def _require(name, value, holds, allowed):
    if not holds:
        raise SettingsError(f"{name} is {value}: allowed is {allowed}")


def _require_choice(name, value, choices):
    _require(name, value, value in choices, ", ".join(choices))
