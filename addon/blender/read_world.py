"""The world -> one constant radiance: L = colour x strength; an image is averaged over the sphere."""

from __future__ import annotations

import numpy as np

from .read_images import equirectangular_mean, linear_pixels, mean_colour
from .shader_nodes import Unreadable, constant, surface_shader

BLACK = (0.0, 0.0, 0.0)


def read_world(world, depsgraph, warn) -> tuple[float, float, float]:
    """L of the world [W/(m^2 sr)]; no world is black."""
    if world is None:
        return BLACK
    world = world.evaluated_get(depsgraph)
    if not world.use_nodes or world.node_tree is None:
        return _radiance(world.color, 1.0)
    shader = surface_shader(world.node_tree, "OUTPUT_WORLD")
    if shader is None:
        return BLACK
    try:
        if shader.node.type not in {"BACKGROUND", "EMISSION"}:
            raise Unreadable(f"{shader.node.bl_label} node")
        strength = constant(shader.feeding("Strength"))
        return BLACK if strength == 0 else _radiance(_colour(shader.feeding("Color"), world, warn), strength)
    except Unreadable as error:
        warn(f"world '{world.name}': its {error} cannot be read: its viewport colour is used")
        return _radiance(world.color, 1.0)


def _colour(reached, world, warn):
    if reached.is_constant:
        return reached.socket.default_value
    if reached.node.type == "RGB":
        return reached.node.outputs[0].default_value
    if reached.node.type not in {"TEX_ENVIRONMENT", "TEX_IMAGE"} or reached.node.image is None:
        raise Unreadable(f"{reached.node.bl_label} node")
    pixels = linear_pixels(reached.node.image, warn)
    warn(f"world '{world.name}': its image '{reached.node.image.name}' is averaged to one colour")
    is_equirectangular = getattr(reached.node, "projection", "") == "EQUIRECTANGULAR"
    return equirectangular_mean(pixels) if is_equirectangular else mean_colour(pixels)


def _radiance(colour, strength):
    return tuple(float(c) for c in np.maximum(np.array(colour[:3], float) * strength, 0.0))
