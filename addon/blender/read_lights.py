"""Lamps -> core lights, with Cycles' radiometry (each formula measured against Cycles bakes)."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin

import numpy as np

from ..core.environment import Environment
from ..core.scene import AreaLight, PointLight, SunLight
from .lamp_nodes import node_factors
from .unseen import warn_of_linking
from .visibility import seen_by

# A hard-edged cone is a very narrow soft one: the smoothstep over it stays finite.
NARROWEST_CONE_EDGE = 1e-6
EVEN, FLATTEST = 1e-4, 1e-6  # scales along a spot's axes: apart, and of the largest
ENOUGH_BOUNCES = 12  # Cycles' own limit for a scene, as Blender sets it


def read_lights(depsgraph, visibility, warn) -> tuple:
    """Every lamp that a render shows and that shines, instances included."""
    # rendering some may end the depsgraph's iteration
    lamps = {instance.object.data.original for instance in _shown(depsgraph, visibility)}
    ordered = sorted(lamps, key=lambda lamp: lamp.name_full)
    factors = node_factors(ordered, depsgraph.scene.frame_current, warn)
    lights = []
    for instance in _shown(depsgraph, visibility):
        lamp, name = instance.object.data, instance.object.name
        factor = factors[lamp.original.name_full]
        power = _power(lamp) * factor.colour
        if min(power) < 0:
            warn(f"light '{name}' is below 0: none is taken")
        power = np.maximum(power, 0.0)
        if max(power) <= 0:
            continue
        warn_of_linking(instance.object, warn)
        _warn_of_bounces(lamp, name, warn)
        matrix = np.array(instance.matrix_world, np.float64)
        if not np.isfinite(matrix).all():
            warn(f"light '{name}' has a transform that is not finite: it is left out")
            continue
        shape = {"casts_shadow": _casts_shadow(lamp), **_shape(name, factor, matrix)}
        lights += [replace(light, **shape) for light in READERS[lamp.type](lamp, name, matrix, power, warn)]
    return tuple(lights)


def _shown(depsgraph, visibility):
    """Entries of lamps that have power, or take some, whatever their nodes say, and that diffuse surfaces see."""
    for instance in depsgraph.object_instances:
        if instance.object.type == "LIGHT" and visibility.shows(instance) and seen_by(instance)[1]:
            lamp = instance.object.data
            if not _is_portal(lamp) and _power(lamp).any():
                yield instance


def _shape(name, factor, matrix):
    """Of a point or a spot, what its nodes make of it but for its colour."""
    if factor.profile is None:
        return {"distance_power": factor.distance_power} if factor.distance_power else {}
    left, _, right = np.linalg.svd(matrix[:3, :3])  # the nearest rotation, or reflection
    to_lamp = tuple(_triple(row) for row in (left @ right).T)
    return {"distance_power": factor.distance_power, "profile": Environment(name, factor.profile, to_lamp)}


def _of_cycles(lamp, name, otherwise):
    """A setting of Cycles' own, if that is there and has it."""
    return getattr(getattr(lamp, "cycles", None), name, otherwise)


def _is_portal(lamp):
    return lamp.type == "AREA" and _of_cycles(lamp, "is_portal", False)


def _casts_shadow(lamp):
    return _of_cycles(lamp, "cast_shadow", lamp.use_shadow)  # Blender's own does it for Cycles, too, since 4.3


def _warn_of_bounces(lamp, name, warn):
    most = _of_cycles(lamp, "max_bounces", ENOUGH_BOUNCES)
    if most < ENOUGH_BOUNCES:
        warn(f"light '{name}': its limit of {most} bounces is not read")


def _power(lamp):
    """P = energy x colour x 2^exposure, per channel, without what its nodes say; [W], of a sun [W/m^2]."""
    power = np.array(lamp.color[:], float) * lamp.energy * 2.0 ** getattr(lamp, "exposure", 0.0)
    return power * np.array(lamp.temperature_color[:]) if getattr(lamp, "use_temperature", False) else power


def _is_normalised(lamp):
    return getattr(lamp, "normalize", True)


def _point(lamp, name, matrix, power, warn):
    return [PointLight(name, _triple(matrix[:3, 3]), _triple(_intensity(lamp, power)), **_sphere(lamp))]


def _spot(lamp, name, matrix, power, warn):
    outer = cos(lamp.spot_size / 2)
    inner = outer + max((1 - outer) * lamp.spot_blend, NARROWEST_CONE_EDGE)
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    if not scale.min() > FLATTEST * scale.max():
        warn(f"light '{name}' is scaled to nothing along an axis: it is left out")
        return []
    return [
        PointLight(
            name,
            _triple(matrix[:3, 3]),
            _triple(_intensity(lamp, power)),
            **_sphere(lamp),
            cone_cosines=(outer, inner),
            **(
                {"direction": _triple(_looks_to(matrix))} if np.ptp(scale) <= EVEN * scale.max() else _stretched(matrix)
            ),
        )
    ]


def _stretched(matrix):
    """A spot's cone in its own, unevenly scaled space: where it looks and how directions are measured there."""
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    axes = matrix[:3, :3] / scale
    scale = scale / scale[2]  # only ratios count
    metric = (axes / scale**2) @ axes.T
    measured = tuple(float(metric[row, column]) for row, column in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return {"direction": _triple(-axes[:, 2]), "cone_metric": measured}


def _intensity(lamp, power):
    """I [W/sr]; what the cone of a spot cuts off is not given to the rest."""
    if _is_normalised(lamp):
        return power / (4 * pi)
    radius = lamp.shadow_soft_size
    return power * radius**2 if radius > 0 else power / pi  # a sphere of L = P / pi; a point of I = P / pi


def _sphere(lamp):
    return {"radius": float(lamp.shadow_soft_size), "soft_falloff": bool(getattr(lamp, "use_soft_falloff", False))}


def _area(lamp, name, matrix, power, warn):
    is_oblong = lamp.shape in {"RECTANGLE", "ELLIPSE"}
    axis_u = matrix[:3, 0] * lamp.size / 2
    axis_v = matrix[:3, 1] * (lamp.size_y if is_oblong else lamp.size) / 2
    is_ellipse = lamp.shape in {"DISK", "ELLIPSE"}
    facing = np.cross(axis_u, axis_v)
    area = 4 * np.linalg.norm(facing) * (pi / 4 if is_ellipse else 1.0)
    if area <= 0:
        warn(f"light '{name}' has no area: it is left out")
        return []
    if facing @ _looks_to(matrix) < 0:
        axis_v = -axis_v
    radiance = power / (pi * area if _is_normalised(lamp) else pi)
    axes = _triple(axis_u), _triple(axis_v)
    return [AreaLight(name, _triple(matrix[:3, 3]), *axes, _triple(radiance), is_ellipse, float(lamp.spread))]


def _sun(lamp, name, matrix, power, warn):
    # With normalize off the disc's radiance is given, not the irradiance.
    disc = pi * sin(lamp.angle / 2) ** 2
    irradiance = power if _is_normalised(lamp) or disc == 0 else power * disc
    return [SunLight(name, _triple(_looks_to(matrix)), _triple(irradiance), float(lamp.angle))]


def _looks_to(matrix):
    axis = -matrix[:3, 2]
    length = np.linalg.norm(axis)
    return axis / length if length > 0 else np.array([0.0, 0.0, -1.0])


def _triple(vector):
    return tuple(float(x) for x in vector)


READERS = {"POINT": _point, "SPOT": _spot, "AREA": _area, "SUN": _sun}
