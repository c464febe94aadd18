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
    """Who shows which mesh.

    ``wanted`` are the names of the objects to bake, None = all that a render shows.
    """

    def __init__(self, depsgraph, settings: BakeSettings, wanted: set[str] | None):
        self._settings = settings
        self._shown = {}  # names by the mesh's pointer
        for instance in depsgraph.object_instances:
            blender_object = instance.object.original
            if instance.object.type == "MESH" and not instance.is_instance and not blender_object.hide_render:
                self._shown.setdefault(blender_object.data.as_pointer(), set()).add(blender_object.name)
        self._baked = {}
        for blender_object in bpy.data.objects:
            if blender_object.type == "MESH" and not blender_object.library and IMAGE_PROPERTY in blender_object:
                self._baked.setdefault(blender_object.data.as_pointer(), set()).add(blender_object.name)
        self._wanted = wanted

    def why_not(self, blender_object) -> str | None:
        """Why a bake of this object would spoil that of others which show its mesh, or None."""
        mesh = blender_object.data
        shown = self._shown[mesh.as_pointer()]
        shares = f"'{blender_object.name}' shares its mesh '{mesh.name}'"
        if self._settings.target == "vertex":
            if len(shown) == 1:
                return None
            return (
                f"{shares} with other objects, and so its vertex colours: it is not baked; bake a lightmap, or {SINGLE}"
            )
        if self._settings.keep_uvs:
            if len(shown) == 1 or RECT_PROPERTY in blender_object:
                return None
            return (
                f"{shares} with other objects, and so its 'Lightmap' UVs: it is not baked; unwrap it anew, or {SINGLE}"
            )
        baked_now = shown if self._wanted is None else shown & self._wanted
        lost = sorted(self._baked.get(mesh.as_pointer(), set()) - baked_now)
        if not lost:
            return None
        return f"{shares} with '{lost[0]}', whose lightmap would no longer fit: it is not baked; bake both, or {SINGLE}"
