"""A bake's two ends in Blender: ``prepare`` reads, ``write`` stores, ``discard`` forgets. All on the main thread.

Between them the file may change under the bake (undo, an edit): nothing of Blender is kept but names, and ``write``
checks everything that it needs before it changes anything.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import bpy
import numpy as np

from ..core.scene import Scene, SceneError, SceneObject
from ..core.settings import BakeSettings, SettingsError
from ..core.sound_faces import sound_faces
from .cut_mesh import cut_mesh
from .read_scene import read_scene
from .write_lightmap import require_layer_room, write_lightmap
from .write_vertex_colours import write_vertex_colours


@dataclass(frozen=True, slots=True)
class PreparedBake:
    """What is to be baked, and where the result goes.

    Attributes
    ----------
    scene : the core Scene
    settings : the bake's settings
    corner_counts : face corners of each target's mesh when it was read, by the object's name
    cut_meshes : name of the mesh that replaces the object's own, by the object's name
    """

    scene: Scene
    settings: BakeSettings
    corner_counts: dict[str, int]
    cut_meshes: dict[str, str]

    @property
    def targets(self) -> list[SceneObject]:
        return [scene_object for scene_object in self.scene.objects if scene_object.is_target]


def prepare(bpy_scene, settings: BakeSettings, object_names=None, subdivide: float | None = None) -> PreparedBake:
    """Read a scene for a bake; the file stays as it is.

    Parameters
    ----------
    object_names : names of the objects to bake; None = all that can be
    subdivide : with target "vertex", edges longer than this [m] are cut in what is baked

    Raises
    ------
    SceneError, SettingsError : one sentence that names the object or argument
    """
    _require_subdivide(settings, subdivide)
    cuts = Cuts(subdivide)
    try:
        scene = read_scene(bpy_scene, settings, object_names, cuts.mesh_for if subdivide else None)
        targets = [scene_object.name for scene_object in scene.objects if scene_object.is_target]
        meshes = {name: _cut_or_own_mesh(name, cuts.meshes) for name in targets}
        if settings.target == "lightmap":
            for name, mesh in meshes.items():
                require_layer_room(name, mesh)
    except BaseException:
        _remove_meshes(cuts.meshes.values())
        raise
    if cuts.warnings:
        scene = _with_warnings(scene, cuts.warnings)
    return PreparedBake(scene, settings, {name: len(mesh.loops) for name, mesh in meshes.items()}, cuts.meshes)


def write(prepared: PreparedBake, result) -> None:
    """Store a BakeResult in the file: all of it, or nothing and a SceneError."""
    meshes = {target.name: _checked_mesh(prepared, target.name) for target in prepared.targets}
    if prepared.settings.target == "lightmap":
        _require_finite("the lightmap", result.lightmap.pixels)
        _require_complete(prepared, result.lightmap.uvs, "lightmap UVs")
        for name, mesh in meshes.items():
            require_layer_room(name, mesh)
        if not prepared.settings.keep_uvs:
            _require_own_places(meshes, result.lightmap.rects)
    else:
        _require_complete(prepared, result.corner_colours, "colours")
    for name in prepared.cut_meshes:
        _swap_mesh(bpy.data.objects[(name, None)], meshes[name])
    if prepared.settings.target == "lightmap":
        write_lightmap(prepared.targets, result.lightmap, prepared.settings.keep_uvs)
    else:
        write_vertex_colours(prepared.targets, result.corner_colours)


def discard(prepared: PreparedBake) -> None:
    """Free what ``prepare`` made and ``write`` has not used; after ``write`` there is nothing left to free."""
    _remove_meshes(prepared.cut_meshes.values())


class Cuts:
    """The cut copies of targets' meshes, made while the scene is read."""

    def __init__(self, longest):
        self.meshes = {}
        self.warnings = []
        self._longest = longest

    def mesh_for(self, blender_object, matrix):
        """The cut copy of the object's mesh, or None where the mesh itself is read."""
        data = blender_object.data
        if any(modifier.show_viewport for modifier in blender_object.modifiers) or data.shape_keys:
            self.warnings.append(f"'{blender_object.name}' has modifiers or shape keys: it is not subdivided")
            return None
        mesh = cut_mesh(blender_object, matrix, self._longest)
        if mesh is not None:
            self.meshes[blender_object.name] = mesh.name
            if data.has_custom_normals:
                self.warnings.append(f"'{blender_object.name}' is subdivided: its custom normals are lost")
        return mesh


def _require_subdivide(settings, subdivide):
    if subdivide is None:
        return
    if not subdivide > 0:
        raise SettingsError(f"subdivide is {subdivide}: allowed is above 0 m")
    if settings.target != "vertex":
        raise SettingsError("subdivide cuts meshes for vertex colours: it goes with target vertex only")


def _cut_or_own_mesh(name, cut_meshes):
    return bpy.data.meshes[(cut_meshes[name], None)] if name in cut_meshes else bpy.data.objects[(name, None)].data


def _checked_mesh(prepared, name):
    """The mesh that a target's result goes to, or SceneError where it no longer is as it was read."""
    blender_object = bpy.data.objects.get((name, None))
    if blender_object is None or blender_object.type != "MESH":
        raise SceneError(f"'{name}' was removed during the bake: nothing has been written")
    if blender_object.data.is_editmode:
        raise SceneError(f"'{name}' is in Edit Mode: leave it to store the bake; nothing has been written")
    if name in prepared.cut_meshes and (prepared.cut_meshes[name], None) not in bpy.data.meshes:
        raise SceneError(f"the subdivided mesh of '{name}' was removed during the bake: nothing has been written")
    mesh = _cut_or_own_mesh(name, prepared.cut_meshes)
    if len(mesh.loops) != prepared.corner_counts[name]:
        raise SceneError(f"the mesh of '{name}' was changed during the bake: nothing has been written")
    return mesh


def _require_own_places(meshes, rects):
    """Objects that have come to share a mesh since it was read would write over each other's UVs."""
    users = Counter(mesh.name for mesh in meshes.values())
    for name, mesh in meshes.items():
        if users[mesh.name] > 1 and name not in rects:
            raise SceneError(f"'{name}' came to share its mesh during the bake: nothing has been written")


def _require_finite(what, values):
    if not np.isfinite(values).all():
        raise SceneError(f"{what} of the bake has values that are not finite: nothing has been written")


def _require_complete(prepared, values, what):
    """Every triangle of a target has its values; one that the bake left out may lack them, nobody sees it."""
    kept = sound_faces(prepared.scene).kept
    for target in prepared.targets:
        is_missing = ~np.isfinite(values[target.span]).all(axis=(1, 2))
        if (is_missing & kept[target.span]).any():
            raise SceneError(f"the bake has no {what} for some faces of '{target.name}': nothing has been written")


def _swap_mesh(blender_object, cut):
    """Give an object its cut mesh, under the name of the old one."""
    old = blender_object.data
    name = old.name
    blender_object.data = cut
    if not old.users:
        bpy.data.meshes.remove(old)
        cut.name = name


def _remove_meshes(names):
    for name in names:
        mesh = bpy.data.meshes.get((name, None))
        if mesh is not None and not mesh.users:
            bpy.data.meshes.remove(mesh)


def _with_warnings(scene, warnings):
    fields = {name: getattr(scene, name) for name in Scene.__dataclass_fields__}
    return Scene(**{**fields, "warnings": (*scene.warnings, *warnings)})
