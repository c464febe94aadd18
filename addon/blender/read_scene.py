"""The evaluated Blender scene -> core ``Scene``: triangles in world space, materials, lights.

Blender's units are taken as metres whatever the unit scale: its lights are defined in them too.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace

import bpy
import numpy as np

from ..core.scene import Scene, SceneError, SceneObject
from ..core.settings import BakeSettings
from .as_rendered import as_rendered
from .materials import Materials
from .mesh_colours import MeshColours
from .new_meshes import NewMeshes
from .object_colours import ObjectColours
from .place_mesh import PlacedMesh, make_unit_normals, place_mesh
from .read_lights import read_lights
from .read_mesh import MeshArrays, are_finite, read_mesh
from .read_world import read_world
from .rects import in_lightmap, rect_of
from .shared_meshes import SharedMeshes, why_not_without
from .targets import has_faces_of, why_not_modified, why_not_target
from .texture_coordinates import Coordinates
from .unseen import KINDS, say_what_is_unseen
from .visibility import Visibility, seen_by

DEFAULTS = BakeSettings()


class Warnings:
    """Sentences for the report, each once, in order."""

    def __init__(self):
        self._sentences = {}

    def __call__(self, sentence):
        self._sentences[sentence] = True

    def all(self) -> tuple[str, ...]:
        return tuple(self._sentences)


def read_scene(
    bpy_scene, settings: BakeSettings = DEFAULTS, object_names=None, new_meshes: NewMeshes | None = None
) -> Scene:
    """Read what a render of ``bpy_scene`` shows.

    Parameters
    ----------
    settings : what decides which objects can be baked
    object_names : names of the objects to bake; None = all that can be
    new_meshes : where meshes come from that are read in place of targets' own; None = nowhere

    Raises
    ------
    SceneError : a named object is unknown or cannot be baked, or nothing can be
    """
    view_layer = _view_layer(bpy_scene)
    wanted = None if object_names is None else set(object_names)
    with as_rendered(bpy_scene, view_layer):
        reading = SceneReading(view_layer, settings, wanted, new_meshes or NewMeshes())
        reading.read_objects()
        return reading.scene(_world(bpy_scene, view_layer))


def _view_layer(bpy_scene):
    return bpy.context.view_layer if bpy_scene == bpy.context.scene else bpy_scene.view_layers[0]


def _world(bpy_scene, view_layer):
    """What a render of the view layer has around it, or None."""
    override = getattr(view_layer, "world_override", None)  # none before Blender 4.4
    return (override or bpy_scene.world) if view_layer.use_sky else None


@dataclass
class SceneReading:
    """A scene on its way from the depsgraph into arrays."""

    view_layer: object
    settings: BakeSettings
    wanted: set[str] | None
    new_meshes: NewMeshes
    warn: Warnings = field(default_factory=Warnings)
    placed: list[PlacedMesh] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    target_meshes: list[str | None] = field(default_factory=list)  # names; None where the object is none to bake

    def __post_init__(self):
        self.depsgraph = self.view_layer.depsgraph
        self.visibility = Visibility(self.view_layer)
        self.materials = Materials(self.depsgraph, self.warn)
        self.refusals = {}
        entries = self.depsgraph.object_instances
        self.instancers = {entry.parent.original.name for entry in entries if entry.is_instance and entry.parent}

    def read_objects(self):
        """Append every mesh entry of the depsgraph that a render shows."""
        self._require_known()
        shared = SharedMeshes(self.depsgraph, self.settings)
        entries, unseen, told = Counter(), {}, set()
        # The iterator's objects are temporary: nothing of them is kept past its turn of the loop. Curves and their
        # like come twice, as themselves and as meshes; only the meshes are taken.
        for instance in self.depsgraph.object_instances:
            name = instance.object.name
            if instance.object.type in KINDS and self.visibility.shows(instance):
                unseen[name] = KINDS[instance.object.type]
            if instance.object.type != "MESH":
                continue
            number, entries[name] = entries[name], entries[name] + 1
            if self.visibility.shows(instance):
                if name not in told:  # instances may be many
                    say_what_is_unseen(instance.object, self.warn)
                    told.add(name)
                self._read_instance(instance, f"{name}#{number}" if instance.is_instance else name, shared)
        for name in sorted(unseen.keys() - entries.keys()):  # nodes may make meshes of them
            self.warn(f"'{name}' is {unseen[name]}: the bake does not see it")
        for name in self.visibility.missing_names():
            self.warn(f"'{name}' stays hidden in the viewport, by what drives it: the bake does not see it")
        self._spare_other_lightmaps(shared)
        self._require_targets()

    def scene(self, world) -> Scene:
        """All that was read, as one core Scene."""
        lights = read_lights(self.depsgraph, self.visibility, self.warn)
        world_radiance, environment = read_world(world, self.depsgraph, self.warn)
        self.materials.finish()
        first_vertices = np.cumsum([0] + [len(p.vertices) for p in self.placed])
        vertices = _joined([p.vertices for p in self.placed], np.float64, (0, 3))
        triangles = [p.triangles + first for p, first in zip(self.placed, first_vertices)]
        triangles = _joined(triangles, np.int32, (0, 3))
        corner_normals = _joined([p.corner_normals for p in self.placed], np.float32, (0, 3, 3))
        make_unit_normals(vertices, triangles, corner_normals, _joined([p.is_flat for p in self.placed], bool, (0,)))
        return Scene(
            vertices=vertices,
            triangles=triangles,
            corner_normals=corner_normals,
            uvs=_joined([p.uvs for p in self.placed], np.float32, (0, 3, 2)),
            triangle_materials=_joined([p.materials for p in self.placed], np.int32, (0,)),
            objects=self._objects(),
            materials=tuple(self.materials.entries),
            lights=lights,
            world_radiance=world_radiance,
            environment=environment,
            warnings=self.warn.all(),
        )

    def _objects(self):
        firsts = np.cumsum([0] + [len(p.triangles) for p in self.placed])
        return tuple(
            SceneObject(name, int(first), len(p.triangles), mesh is not None, mesh=mesh, **p.mesh_arrays())
            for name, first, mesh, p in zip(self.names, firsts, self.target_meshes, self.placed)
        )

    def _read_instance(self, instance, name, shared):
        evaluated = instance.object
        matrix = np.array(instance.matrix_world, np.float64)
        mesh = evaluated.to_mesh()
        try:
            if not len(mesh.polygons):
                return
            target_mesh, new = self._target_mesh(instance, mesh, matrix, shared)
            self._append(name, target_mesh, instance, new or mesh, matrix)
        finally:
            evaluated.to_mesh_clear()

    def _append(self, name, target_mesh, instance, mesh, matrix):
        evaluated = instance.object
        rows = self._slot_materials(evaluated, mesh, seen_by(instance))
        coordinates = [self.materials.coordinates[row] for row in rows]
        colours = {(each.attribute, each.is_alpha) for each in coordinates if isinstance(each, MeshColours)}
        arrays = read_mesh(mesh, {each.uv_layer for each in coordinates if isinstance(each, Coordinates)}, colours)
        if not (are_finite(arrays.positions) and are_finite(matrix)):
            self.refusals[name] = (
                f"'{name}' has vertices that are not finite, or as good as endlessly far: it is left out"
            )
            self.warn(self.refusals[name])
            self.new_meshes.forget(name)
            return
        for (attribute, _), values in arrays.colours.items():
            if values.max(initial=0.0) > 1:
                self.warn(f"'{name}': colours of its attribute '{attribute}' above 1 are read as 1")
        for each in coordinates:
            if isinstance(each, ObjectColours) and each.of(instance).max() > 1:
                self.warn(f"'{name}': its colour above 1, by an Object Info node, is read as 1")
        for attribute in arrays.unread_colours:
            self.warn(f"'{name}': its attribute '{attribute or 'of render colours'}' cannot be read: it is black")
        materials = rows[np.clip(arrays.material_slots, 0, len(rows) - 1)]
        if self.materials.volumes.issuperset(materials.tolist()):
            if target_mesh:
                self._refuse(name, f"'{name}' has a volume and no surface: it is not baked")
                self.new_meshes.forget(name)
            return
        placed = place_mesh(arrays, matrix, materials, self._texture_uvs(arrays, materials, instance))
        if target_mesh and self.settings.keep_uvs and placed.lightmap_uvs is not None:
            in_rect = in_lightmap(placed.lightmap_uvs, rect_of(evaluated.original)).astype(np.float32)
            placed = replace(placed, lightmap_uvs=in_rect)
        self.placed.append(placed)
        self.names.append(name)
        self.target_meshes.append(target_mesh)

    def _slot_materials(self, evaluated, mesh, is_seen_by):
        """Rows of ``materials`` by material slot, int32 (slots or 1,)."""
        if self.view_layer.material_override is not None:
            return np.array([self.materials.index_of(self.view_layer.material_override, is_seen_by)], np.int32)
        materials = list(mesh.materials)
        for index, slot in enumerate(evaluated.material_slots):
            if index >= len(materials):
                materials.append(slot.material)
            elif slot.link == "OBJECT":
                materials[index] = slot.material
        rows = [self.materials.index_of(material, is_seen_by) for material in materials or [None]]
        return np.array(rows, np.int32)

    def _texture_uvs(self, arrays: MeshArrays, materials, instance):
        """Each triangle's UVs as its material looks them up, float32 (T, 3, 2)."""
        uvs = np.zeros((len(materials), 3, 2), np.float32)
        for row in np.unique(materials):
            chosen = np.flatnonzero(materials == row)
            uvs[chosen] = self.materials.coordinates[row].uvs_of(arrays, chosen, instance)
        return uvs

    def _is_wanted(self, name):
        return self.wanted is None or name in self.wanted

    def _target_mesh(self, instance, mesh, matrix, shared):
        """Name of the mesh that the entry's result goes to, None where it gets none; and that mesh if it is new."""
        blender_object, name = instance.object.original, instance.object.original.name
        if not self._is_wanted(name):
            return None, None
        reason = why_not_target(instance)
        makes_faces = reason is None and not has_faces_of(mesh, blender_object.data)
        if makes_faces and (name in self.instancers or not self.new_meshes.applies_modifiers):
            reason = why_not_modified(blender_object, name in self.instancers)
        elif reason is None and (self.settings.keep_uvs or not makes_faces):
            reason = shared.why_not(blender_object)
        if reason is None:
            new = self.new_meshes.mesh_for(instance.object, self.depsgraph, matrix, makes_faces)
            return (new or blender_object.data).name, new
        self._refuse(name, reason)
        return None, None

    def _refuse(self, name, reason):
        # A named object may also be instanced elsewhere: only its own entry has to be bakeable.
        self.refusals.setdefault(name, reason)
        if self.wanted is None:
            self.warn(reason)

    def _spare_other_lightmaps(self, shared):
        """Make those no targets whose mesh's new UVs would spoil the lightmap of one that is none."""
        targets = {name for name, mesh in zip(self.names, self.target_meshes) if mesh is not None}
        for row, (name, mesh) in enumerate(zip(self.names, self.target_meshes)):
            spoilt = None if mesh is None else shared.spoilt(mesh, targets)
            if spoilt is not None:
                self.target_meshes[row] = None
                self._refuse(name, why_not_without(name, mesh, spoilt))

    def _require_known(self):
        hidden = self.visibility.hidden_names()
        for name in sorted(self.wanted or ()):
            if name not in self.view_layer.objects:
                raise SceneError(f"there is no object '{name}' in the view layer '{self.view_layer.name}'")
            if name in hidden:
                raise SceneError(f"'{name}' is hidden from renders: it cannot be baked")

    def _require_targets(self):
        targets = {name for name, mesh in zip(self.names, self.target_meshes) if mesh is not None}
        for name in sorted((self.wanted or set()) - targets):
            raise SceneError(self.refusals.get(name, f"'{name}' has no visible faces: it cannot be baked"))
        if not targets:
            reasons = "; ".join(list(self.refusals.values())[:1])
            raise SceneError(f"nothing to bake: {reasons or 'no visible mesh object has faces'}")


def _joined(arrays, dtype, empty_shape):
    return np.concatenate(arrays).astype(dtype, copy=False) if arrays else np.zeros(empty_shape, dtype)
