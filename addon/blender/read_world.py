"""The world -> its radiance, L = colour x strength, and the environment image that this multiplies."""

from __future__ import annotations

import numpy as np
from mathutils import Euler

from ..core.environment import UNTURNED, Environment
from ..core.scene import BRIGHTEST
from .private_render import RenderError
from .read_images import linear_pixels
from .render_world import rendered_world
from .shader_nodes import (
    Unreadable,
    constant,
    constant_colour,
    constant_vector,
    output_input,
    own_mapping,
    surface_shader,
)

BLACK = (0.0, 0.0, 0.0)
WHITE = (1.0, 1.0, 1.0)


def read_world(world, depsgraph, warn) -> tuple[tuple[float, float, float], Environment | None]:
    """L of the world [W/(m^2 sr)], and the image that it multiplies or None; no world is black."""
    if world is None:
        return BLACK, None
    evaluated = world.evaluated_get(depsgraph)
    if hasattr(world, "cycles_visibility") and not world.cycles_visibility.diffuse:
        return BLACK, None
    if not evaluated.use_nodes or evaluated.node_tree is None:
        return _radiance(evaluated.color, 1.0), None
    if output_input(evaluated.node_tree, "Volume", "OUTPUT_WORLD") is not None:
        warn(f"world '{world.name}': its volume is left out")
    try:
        shader = surface_shader(evaluated.node_tree, "OUTPUT_WORLD")
        if shader is None:
            return BLACK, None
        if shader.node.type not in {"BACKGROUND", "EMISSION"}:
            raise Unreadable(f"{shader.node.bl_label} node")
        strength = constant(shader.feeding("Strength"))
        if strength <= 0:
            return BLACK, None
        colour, environment = _colour(shader.feeding("Color"), warn)
        return _radiance(colour, strength), environment
    except Unreadable as unreadable:
        return _rendered(world, depsgraph, unreadable, warn)


def _rendered(world, depsgraph, unreadable, warn):
    """What Cycles shows of a world, or its viewport colour."""
    try:
        pixels = rendered_world(world, depsgraph.scene.frame_current)
    except RenderError as error:
        warn(f"world '{world.name}': its {unreadable} cannot be read ({error}): its viewport colour is used")
        return _radiance(world.color, 1.0), None
    return WHITE, Environment(world.name, np.clip(np.nan_to_num(pixels, posinf=0.0), 0.0, BRIGHTEST))


def _colour(reached, warn):
    """A colour, and the environment that it multiplies or None."""
    node = reached.node
    if node is None or node.type != "TEX_ENVIRONMENT":
        return constant_colour(reached), None
    if node.image is None or node.projection != "EQUIRECTANGULAR":
        raise Unreadable(f"{node.bl_label} node")
    turn = _turn(reached.feeding("Vector"))
    if own_mapping(node) is not None:
        raise Unreadable("Texture Mapping")
    return WHITE, Environment(node.image.name, linear_pixels(node.image, True, warn), turn)


def _turn(vector):
    """The matrix (3, 3) from directions of the world to those that are looked up; Unreadable where it is none."""
    if vector.is_constant or (vector.node.type == "TEX_COORD" and vector.socket.identifier == "Generated"):
        return UNTURNED
    if vector.node.type != "MAPPING":
        raise Unreadable(f"{vector.node.bl_label} coordinates")
    if vector.feeding("Vector").is_constant:
        raise Unreadable("Mapping node without coordinates")
    inner = np.array(_turn(vector.feeding("Vector")))
    if vector.node.vector_type not in {"POINT", "VECTOR", "TEXTURE"}:
        raise Unreadable(f"Mapping node of type {vector.node.vector_type.title()}")
    location, rotation, scale = (constant_vector(vector, name) for name in ("Location", "Rotation", "Scale"))
    if np.abs(location).max() > 0 or np.ptp(np.abs(scale)) > 1e-4 * np.abs(scale).max() or np.min(np.abs(scale)) == 0:
        raise Unreadable("Mapping node that does more than turn")
    turn, flips = np.array(Euler(rotation).to_matrix(), np.float64), np.diag(np.sign(scale))
    own = flips @ turn.T if vector.node.vector_type == "TEXTURE" else turn @ flips
    return tuple(map(tuple, own @ inner))


def _radiance(colour, strength):
    return tuple(float(c) for c in np.maximum(np.array(colour[:3], float) * strength, 0.0))
