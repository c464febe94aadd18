"""Meshes that take the place of targets' own: with their modifiers applied, or their long edges cut.

They are made while the scene is read; no object has them before the bake has succeeded.
"""

from __future__ import annotations

import hashlib
from uuid import uuid4

import bpy
import numpy as np

from .attribute_values import KINDS_OF_VALUES, read_values
from .cut_mesh import cut_mesh
from .read_mesh import corner_vertices

# What these do is not in the object's mesh, but for a fluid's domain: they stay on when all others are applied.
STAY_ON = {"COLLISION", "DYNAMIC_PAINT", "FLUID", "PARTICLE_SYSTEM", "SURFACE"}


class NewMeshes:
    """What is asked for, and what came of it.

    Parameters
    ----------
    applies_modifiers : objects whose modifiers make faces get the mesh that these make
    longest : edges longer than this are cut [m]; None = none
    shares : objects whose meshes were one, and are the same once the modifiers are applied, share the new one, too

    Attributes
    ----------
    names : of the new meshes, by the objects' names
    modifiers : names of the modifiers that are in them, by the objects' names
    """

    def __init__(self, applies_modifiers: bool = False, longest: float | None = None, shares: bool = True):
        self.names: dict[str, str] = {}
        self.modifiers: dict[str, tuple[str, ...]] = {}
        self._said: dict[str, list[str]] = {}  # by the objects' names
        self.applies_modifiers = applies_modifiers
        self._longest, self._shares = longest, shares
        self._applied: dict[tuple, str] = {}  # names of new meshes by what is in them

    def mesh_for(self, evaluated, depsgraph, matrix: np.ndarray, makes_faces: bool) -> bpy.types.Mesh | None:
        """The mesh to read in place of the object's, or None where that is read.

        ``matrix`` (4, 4) is its place in the world; ``makes_faces`` whether the object has others than its mesh.
        """
        blender_object, name = evaluated.original, evaluated.original.name
        mesh = blender_object.data
        is_modified = mesh.shape_keys or any(modifier.show_viewport for modifier in blender_object.modifiers)
        if self.applies_modifiers and (makes_faces or (is_modified and self._longest)):
            mesh = self._apply(evaluated, depsgraph)
        elif is_modified and self._longest:
            self._say(name, "has modifiers or shape keys: it is not subdivided")
            return None
        if self._longest:
            self._cut(name, mesh, matrix)
        return bpy.data.meshes[(self.names[name], None)] if name in self.names else None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences for the report."""
        return tuple(f"'{name}' {said}" for name, all_said in self._said.items() for said in all_said)

    def forget(self, object_name: str) -> None:
        """The object is not to be baked after all."""
        name = self.names.pop(object_name, None)
        self.modifiers.pop(object_name, None)
        self._said.pop(object_name, None)
        if name is not None and name not in self.names.values():
            self._applied = {content: made for content, made in self._applied.items() if made != name}
            _remove_unused(name)

    def remove(self) -> None:
        """Free those that no object has."""
        for name in self.names.values():
            _remove_unused(name)

    def _apply(self, evaluated, depsgraph):
        """The mesh as it is evaluated; of objects that share one and are modified alike, one for all."""
        blender_object, name = evaluated.original, evaluated.original.name
        mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
        self.names[name] = mesh.name
        for key in blender_object.data.keys():
            mesh[key] = blender_object.data[key]
        modifiers = [m for m in blender_object.modifiers if m.show_viewport and not _stays_on(m)]
        self.modifiers[name] = tuple(modifier.name for modifier in modifiers)
        parts = [*self.modifiers[name], *(["shape keys"] if blender_object.data.shape_keys else [])]
        self._say(name, f"has had {' and '.join(parts) or 'what makes its faces'} applied by the bake")
        content = (blender_object.data.name, _content(mesh)) if self._shares else None
        if content not in self._applied:
            if self._shares:
                self._applied[content] = mesh.name
            return mesh
        self.names[name] = self._applied[content]
        bpy.data.meshes.remove(mesh)
        return bpy.data.meshes[(self.names[name], None)]

    def _say(self, name, what):
        self._said.setdefault(name, []).append(what)

    def _cut(self, name, mesh, matrix):
        cut = cut_mesh(mesh, name, matrix, self._longest)
        if cut is None:
            return
        if mesh.has_custom_normals:
            self._say(name, "is subdivided: its custom normals are lost")
        whole, self.names[name] = self.names.get(name), cut.name
        if whole is not None:
            _remove_unused(whole)


def give_mesh(blender_object, mesh) -> None:
    """Give an object its new mesh, under the name of the old one where nobody else has that."""
    old = blender_object.data
    name = old.name
    blender_object.data = mesh
    if not old.users:
        bpy.data.meshes.remove(old)
        mesh.name = name


def _remove_unused(name):
    mesh = bpy.data.meshes.get((name, None))
    if mesh is not None and not mesh.users:
        bpy.data.meshes.remove(mesh)


def _stays_on(modifier):
    return modifier.type in STAY_ON and getattr(modifier, "fluid_type", "") != "DOMAIN"


def _content(mesh):
    """Faces, materials and attributes of a mesh as a digest, the same for two meshes only if these are."""
    digest = hashlib.sha256()
    own = [attribute for attribute in mesh.attributes if not attribute.name.startswith(".")]
    kinds = [(attribute.name, attribute.domain, attribute.data_type) for attribute in own]
    digest.update(repr(([material and material.name_full for material in mesh.materials], kinds)).encode())
    for values in (
        read_values(mesh.polygons, "loop_start", np.int32),
        corner_vertices(mesh),
        *map(_attribute_values, own),
    ):
        digest.update(values.tobytes())
    return digest.hexdigest()


def _attribute_values(attribute):
    # what cannot be read is of unknown content, the same as none
    kind = KINDS_OF_VALUES.get(attribute.data_type)
    if kind is None:
        return np.frombuffer(uuid4().bytes, np.uint8)
    return read_values(attribute.data, kind.name, kind.dtype, kind.width)
