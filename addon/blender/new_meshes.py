"""Meshes that take the place of targets' own: with their modifiers applied, or their long edges cut.

They are made while the scene is read; no object has them before the bake has succeeded.
"""

from __future__ import annotations

import bpy
import numpy as np

from .cut_mesh import cut_mesh
from .read_mesh import corner_vertices
from .rebuild_mesh import VALUES

# What these do is not in the object's mesh: they stay on when all others are applied.
STAY_ON = {"COLLISION", "DYNAMIC_PAINT", "FLUID", "PARTICLE_SYSTEM"}


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
    warnings : sentences for the report
    """

    def __init__(self, applies_modifiers: bool = False, longest: float | None = None, shares: bool = True):
        self.names: dict[str, str] = {}
        self.modifiers: dict[str, tuple[str, ...]] = {}
        self.warnings: list[str] = []
        self.applies_modifiers = applies_modifiers
        self._longest, self._shares = longest, shares
        self._applied: dict[str, list[str]] = {}  # names of new meshes by what they are made of

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
            self.warnings.append(f"'{name}' has modifiers or shape keys: it is not subdivided")
            return None
        if self._longest:
            self._cut(name, mesh, matrix)
        return bpy.data.meshes[(self.names[name], None)] if name in self.names else None

    def remove(self) -> None:
        """Free those that no object has."""
        for name in self.names.values():
            _remove_unused(name)

    def _apply(self, evaluated, depsgraph):
        """The mesh as it is evaluated; of objects that share one and are modified alike, one for all."""
        blender_object, name = evaluated.original, evaluated.original.name
        mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
        self.names[name] = mesh.name
        modifiers = [m for m in blender_object.modifiers if m.show_viewport and m.type not in STAY_ON]
        self.modifiers[name] = tuple(modifier.name for modifier in modifiers)
        parts = [*self.modifiers[name], *(["shape keys"] if blender_object.data.shape_keys else [])]
        self.warnings.append(f"'{name}': the bake has applied {' and '.join(parts) or 'what makes its faces'}")
        if not self._shares:
            return mesh
        made = self._applied.setdefault(blender_object.data.name, [])
        for other in made:
            if _are_same(mesh, bpy.data.meshes[(other, None)]):
                self.names[name] = other
                bpy.data.meshes.remove(mesh)
                return bpy.data.meshes[(other, None)]
        made.append(mesh.name)
        return mesh

    def _cut(self, name, mesh, matrix):
        cut = cut_mesh(mesh, name, matrix, self._longest)
        if cut is None:
            return
        if mesh.has_custom_normals:
            self.warnings.append(f"'{name}' is subdivided: its custom normals are lost")
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


def _are_same(mesh, other):
    """Whether two meshes have the same faces, materials and attributes; what cannot be compared differs."""
    if list(mesh.materials) != list(other.materials) or len(mesh.polygons) != len(other.polygons):
        return False
    own, others = ([a for a in each.attributes if not a.name.startswith(".")] for each in (mesh, other))
    kinds = [[(a.name, a.domain, a.data_type) for a in attributes] for attributes in (own, others)]
    if kinds[0] != kinds[1] or any(data_type not in VALUES for _, _, data_type in kinds[0]):
        return False
    return (
        np.array_equal(_values(mesh.polygons, "loop_start"), _values(other.polygons, "loop_start"))
        and np.array_equal(corner_vertices(mesh), corner_vertices(other))
        and all(np.array_equal(_attribute_values(a), _attribute_values(b)) for a, b in zip(own, others))
    )


def _attribute_values(attribute):
    return _values(attribute.data, *VALUES[attribute.data_type][:3])


def _values(items, name, width=1, dtype=np.int32):
    values = np.empty(len(items) * width, dtype)
    items.foreach_get(name, values)
    return values
