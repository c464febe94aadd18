"""What the nodes of lamps multiply their light by: a colour, and where that is not all, a profile that Cycles shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.environment import Environment
from ..core.luminance import LUMINANCE
from ..core.scene import BRIGHTEST
from .colour_nodes import blackbody
from .private_render import RenderError
from .render_lights import rendered_lamp
from .shader_nodes import Unreadable, constant, constant_colour, surface_shader

SHOWN = {"POINT", "SPOT"}
EVEN = 2e-3  # apart: what Cycles shows of a lamp that is the same all round
COLOURED = 0.02  # of the mean, in a channel


@dataclass(frozen=True, slots=True)
class NodeFactor:
    """What a lamp's light is multiplied by.

    Attributes
    ----------
    colour : (3,)
    profile : by direction in the lamp's space, float32 (height, width, 3) of equal channels, at most 1, as the pixels
        of a core Environment; None = 1
    distance_power : of the distance [m]
    """

    colour: np.ndarray
    profile: np.ndarray | None = None
    distance_power: float = 0.0


UNCHANGED = NodeFactor(np.ones(3))


def node_factors(lamps, frame: int, warn) -> dict[str, NodeFactor]:
    """By the name of each of ``lamps``, data-blocks that are not evaluated."""
    return {lamp.name_full: _factor(lamp, frame, warn) for lamp in lamps}


def _factor(lamp, frame, warn):
    if not lamp.use_nodes or lamp.node_tree is None:
        return UNCHANGED
    try:
        return NodeFactor(_constant(lamp.node_tree))
    except Unreadable as error:
        why = f"its {error} cannot be read"
    if lamp.type in SHOWN:
        try:
            return _as_shown(lamp, *rendered_lamp(lamp, frame), warn)
        except RenderError as error:
            why += f" nor rendered ({error})"
    warn(f"light '{lamp.name}': {why}: its own colour and power are used")
    return UNCHANGED


def _constant(tree):
    """A colour that is the same in all directions."""
    shader = surface_shader(tree, "OUTPUT_LIGHT")
    if shader is None:
        return np.zeros(3)
    if shader.node.type != "EMISSION":
        raise Unreadable(f"{shader.node.bl_label} node")
    reached = shader.feeding("Color")
    is_black_body = not reached.is_constant and reached.node.type == "BLACKBODY"
    colour = blackbody(constant(reached.feeding(0))) if is_black_body else constant_colour(reached)
    return colour * constant(shader.feeding("Strength"))


def _as_shown(lamp, pixels, distance_power, warn):
    """The colour of what is shown, and its luminance as a profile."""
    pixels = np.clip(np.nan_to_num(pixels, posinf=0.0), 0.0, BRIGHTEST).astype(np.float32)
    luminance = pixels @ LUMINANCE.astype(np.float32)
    most = float(luminance.max())
    if not most > 0:
        return NodeFactor(np.zeros(3))
    solid_angles = Environment(lamp.name, pixels).solid_angles[:, None, None]
    mean = (pixels * solid_angles).sum(axis=(0, 1), dtype=np.float64)
    hue = mean / (mean @ LUMINANCE)
    if (np.abs(pixels - luminance[..., None] * hue) > COLOURED * most * hue.max()).any():
        warn(f"light '{lamp.name}': its colour differs by direction: the mean is used")
    if np.ptp(luminance) <= EVEN * most:
        return NodeFactor(hue * most, None, distance_power)
    profile = np.repeat((luminance / most)[..., None], 3, axis=2).astype(np.float32)
    return NodeFactor(hue * most, np.ascontiguousarray(profile), distance_power)
