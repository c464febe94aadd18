"""A bake's two ends in Blender: ``prepare`` reads, ``write`` stores, ``discard`` forgets. All on the main thread.

Between them the file may change under the bake (undo, an edit): nothing of Blender is kept but names, and ``write``
checks everything that it needs before it changes anything.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import numpy as np

from ..core.scene import Scene, SceneError, SceneObject
from ..core.settings import BakeSettings, SettingsError
from ..core.sound_faces import sound_faces
from .new_meshes import NewMeshes, give_mesh
from .read_scene import read_scene
from .write_lightmap import lightmap_image, require_layer_room, write_lightmap
from .write_vertex_colours import require_colour_room, write_vertex_colours


@dataclass(frozen=True, slots=True)
class PreparedBake:
    """What is to be baked, and where the result goes.

    Attributes
    ----------
    scene : the core Scene
    settings : the bake's settings
    corner_counts : face corners of each target's mesh when it was read, by the object's name
    new_meshes : those that replace objects' own
    """

    scene: Scene
    settings: BakeSettings
    corner_counts: dict[str, int]
    new_meshes: NewMeshes

    @property
    def targets(self) -> list[SceneObject]:
        return [scene_object for scene_object in self.scene.objects if scene_object.is_target]


def prepare(
    bpy_scene,
    settings: BakeSettings,
    object_names=None,
    subdivide: float | None = None,
    apply_modifiers: bool = False,
) -> PreparedBake:
    """Read a scene for a bake; the file stays as it is.

    Parameters
    ----------
    object_names : names of the objects to bake; None = all that can be
    subdivide : with target "vertex", edges longer than this [m] are cut in what is baked
    apply_modifiers : bake objects whose modifiers make faces, too; ``write`` applies these modifiers

    Raises
    ------
    SceneError, SettingsError : one sentence that names the object or argument
    """
    _require_subdivide(settings, subdivide)
    new_meshes = NewMeshes(apply_modifiers, subdivide, shares=settings.target == "lightmap")
    try:
        scene = read_scene(bpy_scene, settings, object_names, new_meshes)
        targets = [scene_object.name for scene_object in scene.objects if scene_object.is_target]
        meshes = {name: _new_or_own_mesh(name, new_meshes) for name in targets}
        _require_room(settings, meshes)
    except BaseException:
        new_meshes.remove()
        raise
    scene = replace(scene, warnings=(*scene.warnings, *new_meshes.warnings))
    return PreparedBake(scene, settings, {name: len(mesh.loops) for name, mesh in meshes.items()}, new_meshes)


def write(prepared: PreparedBake, result) -> None:
    """Store a BakeResult in the file: all of it, or nothing and a SceneError."""
    meshes = {target.name: _checked_mesh(prepared, target.name) for target in prepared.targets}
    _require_room(prepared.settings, meshes)
    if prepared.settings.target == "lightmap":
        _require_finite("the lightmap", result.lightmap.pixels)
        _require_complete(prepared, result.lightmap.uvs, "lightmap UVs")
        if not prepared.settings.keep_uvs:
            _require_same_sharing(prepared.targets, meshes)
    else:
        _require_complete(prepared, result.corner_colours, "colours")
    image = None
    if prepared.settings.target == "lightmap":  # first what needs most memory
        image = lightmap_image(result.lightmap.pixels)
    for name in prepared.new_meshes.names:
        blender_object = bpy.data.objects[(name, None)]
        give_mesh(blender_object, meshes[name])
        for modifier in prepared.new_meshes.modifiers.get(name, ()):
            if modifier in blender_object.modifiers:
                blender_object.modifiers.remove(blender_object.modifiers[modifier])
    if prepared.settings.target == "lightmap":
        write_lightmap(prepared.targets, result.lightmap, image, prepared.settings.keep_uvs)
    else:
        write_vertex_colours(prepared.targets, result.corner_colours)


def discard(prepared: PreparedBake) -> None:
    """Free what ``prepare`` made and ``write`` has not used; after ``write`` there is nothing left to free."""
    prepared.new_meshes.remove()


def _require_subdivide(settings, subdivide):
    if subdivide is None:
        return
    if not subdivide > 0:
        raise SettingsError(f"subdivide is {subdivide}: allowed is above 0 m")
    if settings.target != "vertex":
        raise SettingsError("subdivide cuts meshes for vertex colours: it goes with target vertex only")


def _require_room(settings, meshes):
    for name, mesh in meshes.items():
        if settings.target == "lightmap":
            require_layer_room(name, mesh)
        else:
            require_colour_room(name, mesh)


def _new_or_own_mesh(name, new_meshes):
    if name in new_meshes.names:
        return bpy.data.meshes[(new_meshes.names[name], None)]
    return bpy.data.objects[(name, None)].data


def _checked_mesh(prepared, name):
    """The mesh that a target's result goes to, or SceneError where it no longer is as it was read."""
    blender_object = bpy.data.objects.get((name, None))
    if blender_object is None or blender_object.type != "MESH":
        raise SceneError(f"'{name}' was removed during the bake: nothing has been written")
    if blender_object.data.is_editmode:
        raise SceneError(f"'{name}' is in Edit Mode: leave it to store the bake; nothing has been written")
    new_name = prepared.new_meshes.names.get(name)
    if new_name is not None and (new_name, None) not in bpy.data.meshes:
        raise SceneError(f"the new mesh of '{name}' was removed during the bake: nothing has been written")
    mesh = _new_or_own_mesh(name, prepared.new_meshes)
    if len(mesh.loops) != prepared.corner_counts[name]:
        raise SceneError(f"the mesh of '{name}' was changed during the bake: nothing has been written")
    return mesh


def _require_same_sharing(targets, meshes):
    """Objects that have come to share a mesh since it was read would write over each other's UVs."""
    read_as = {}
    for target in targets:
        if read_as.setdefault(meshes[target.name].name, target.mesh) != target.mesh:
            raise SceneError(f"'{target.name}' came to share its mesh during the bake: nothing has been written")


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
