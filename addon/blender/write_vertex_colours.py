"""Baked corner colours -> the colour attribute that the viewport and materials show."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.scene import SceneError
from .read_mesh import BAKED_COLOURS

COLOURS = {"FLOAT_COLOR", "BYTE_COLOR"}


def require_colour_room(name, mesh) -> None:
    """SceneError where something else has the name that the object's colours would get."""
    found = mesh.attributes.get(BAKED_COLOURS)
    if found is not None and found.data_type not in COLOURS:
        raise SceneError(f"'{name}' has an attribute '{BAKED_COLOURS}' that is no colour: rename it to bake")
    if BAKED_COLOURS in bpy.data.objects[(name, None)].vertex_groups:
        raise SceneError(f"'{name}' has a vertex group '{BAKED_COLOURS}', as its colours are called: rename it to bake")


def write_vertex_colours(targets, corner_colours) -> None:
    """Store E / pi per face corner; ``corner_colours`` is float32 (T, 3, 3) over the scene's triangles."""
    for target in targets:
        mesh = bpy.data.objects[(target.name, None)].data
        values = np.ones((len(mesh.loops), 4), np.float32)
        values[:, :3] = 0.0
        colours = corner_colours[target.span]
        is_lit = np.isfinite(colours).all(axis=(1, 2))  # a triangle without area may not be
        values[target.corners[is_lit], :3] = colours[is_lit]
        attribute = _attribute(mesh)
        attribute.data.foreach_set("color", values.ravel())
        mesh.update()


def _attribute(mesh):
    found = mesh.attributes.get(BAKED_COLOURS)
    if found is not None and (found.domain, found.data_type) != ("CORNER", "FLOAT_COLOR"):
        mesh.attributes.remove(found)
        found = None
    if found is None:
        mesh.color_attributes.new(BAKED_COLOURS, "FLOAT_COLOR", "CORNER")
    index = mesh.color_attributes.find(BAKED_COLOURS)
    mesh.color_attributes.active_color_index = index
    mesh.color_attributes.render_color_index = index
    return mesh.color_attributes[index]
