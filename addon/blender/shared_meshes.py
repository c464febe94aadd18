"""Objects that share a mesh: what of a bake they can share as well, and in one sentence why not.

A lightmap they can: each has its rectangle (rects.py). Vertex colours are the mesh's, one set for all.
"""

from __future__ import annotations

import bpy

from ..core.settings import BakeSettings
from .rects import RECT_PROPERTY
from .write_lightmap import IMAGE_PROPERTY

SINGLE = "make it a single user (Object > Relations > Make Single User) to bake it"


class SharedMeshes:
    """Who shows which mesh."""

    def __init__(self, depsgraph, settings: BakeSettings):
        self._settings = settings
        self._shown = {}  # objects' rectangles by their names, by the mesh's name
        for instance in depsgraph.object_instances:
            blender_object = instance.object.original
            if instance.object.type == "MESH" and not instance.is_instance and not blender_object.hide_render:
                rects = self._shown.setdefault(_key(blender_object.data), {})
                rects[blender_object.name] = _stored_rect(blender_object)
        self._baked = {}  # names of objects that have a lightmap, in whatever scene, by the mesh's name
        for blender_object in bpy.data.objects:
            if blender_object.users_scene and isinstance(blender_object.get(IMAGE_PROPERTY), bpy.types.Image):
                if blender_object.type == "MESH" and not blender_object.library:
                    self._baked.setdefault(_key(blender_object.data), set()).add(blender_object.name)

    def why_not(self, blender_object) -> str | None:
        """Why this object cannot have a result of its own beside the others that show its mesh, or None."""
        shown, mesh = self._shown[_key(blender_object.data)], blender_object.data.name
        if len(shown) == 1:
            return None
        shares = f"'{blender_object.name}' shares its mesh '{mesh}' with other objects, and so its"
        if self._settings.target == "vertex":
            return f"{shares} vertex colours: it is not baked; bake a lightmap, or {SINGLE}"
        if not self._settings.keep_uvs:
            return None
        rect = shown[blender_object.name]
        if rect is None:
            return f"{shares} 'Lightmap' UVs: it is not baked; unwrap it anew, or {SINGLE}"
        if list(shown.values()).count(rect) > 1:
            return f"{shares} place in the lightmap ({RECT_PROPERTY}): it is not baked; unwrap it anew, or {SINGLE}"
        return None

    def spoilt(self, mesh_name: str, targets: set[str]) -> str | None:
        """An object that has a lightmap by this mesh's UVs and is not among the targets, None where these are kept."""
        if self._settings.target == "vertex" or self._settings.keep_uvs:
            return None
        return min(self._baked.get((mesh_name, None), set()) - targets, default=None)


def why_not_without(name: str, mesh_name: str, other: str) -> str:
    """Why an object is not baked while ``other`` is not."""
    return (
        f"'{name}' shares its mesh '{mesh_name}' with '{other}', whose lightmap would no longer fit and which is not "
        f"baked now: it is not baked; bake both, or {SINGLE}"
    )


def _key(data):
    return data.name, data.library


def _stored_rect(blender_object):
    """What the object's rectangle is, to be compared: None where it has none."""
    value = blender_object.get(RECT_PROPERTY)
    return tuple(value) if hasattr(value, "__len__") else value
