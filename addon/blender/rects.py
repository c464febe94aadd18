"""Where in the lightmap an object's UVs lie, when several objects share a mesh and so its one UV layer.

A material reads it with an Attribute node of type Object: the UVs times its first two numbers, plus its last two.
"""

from __future__ import annotations

import numpy as np

from ..core.scene import SceneError

RECT_PROPERTY = "patchlight_rect"  # (scale_u, scale_v, offset_u, offset_v)
WHOLE = (1.0, 1.0, 0.0, 0.0)


def rect_of(blender_object) -> np.ndarray:
    """The object's rectangle, float64 (4,); the whole lightmap where it has none of its own."""
    value = blender_object.get(RECT_PROPERTY, WHOLE)
    try:
        rect = np.array(value, np.float64)
    except (TypeError, ValueError):
        rect = np.zeros(0)
    if rect.shape != (4,) or not np.isfinite(rect).all():
        name = f"'{blender_object.name}'"
        raise SceneError(f"{name}: its custom property {RECT_PROPERTY} is not four numbers: delete it, or unwrap anew")
    return rect


def set_rect(blender_object, rect) -> None:
    """Store a rectangle; None takes that of an earlier bake away."""
    if rect is not None:
        blender_object[RECT_PROPERTY] = [float(number) for number in rect]
    elif RECT_PROPERTY in blender_object:
        del blender_object[RECT_PROPERTY]


def in_lightmap(uvs: np.ndarray, rect) -> np.ndarray:
    """UVs of the mesh (..., 2) -> of the lightmap."""
    return uvs * rect[:2] + rect[2:]


def in_mesh(uvs: np.ndarray, rect) -> np.ndarray:
    """UVs of the lightmap (..., 2) -> of the mesh."""
    return (uvs - rect[2:]) / rect[:2]
