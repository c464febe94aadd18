"""Which objects a bake can be stored on, and in one sentence why not the others."""

from __future__ import annotations

import numpy as np

from .read_mesh import corner_vertices

KINDS = {"CURVE": "a curve", "SURFACE": "a NURBS surface", "META": "a metaball", "FONT": "a text"}
CONVERT = "convert it to a mesh to bake it"

# Modifiers that move vertices and leave the faces alone; any other that is on is named when the faces differ.
KEEPS_FACES = {
    *("ARMATURE", "CAST", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE", "MESH_DEFORM", "SHRINKWRAP"),
    *("SIMPLE_DEFORM", "SMOOTH", "CORRECTIVE_SMOOTH", "LAPLACIANSMOOTH", "SURFACE_DEFORM", "WARP", "WAVE", "CLOTH"),
    *("SOFT_BODY", "UV_PROJECT", "UV_WARP", "NORMAL_EDIT", "WEIGHTED_NORMAL", "VOLUME_DISPLACE", "MESH_CACHE"),
}


def why_not_target(instance) -> str | None:
    """Why no result can be stored on this entry of the depsgraph, whatever its mesh, or None when it can."""
    blender_object = instance.object.original
    name = blender_object.name
    if blender_object.type != "MESH":
        return f"'{name}' is {KINDS.get(blender_object.type, 'no mesh object')}: it is not baked; {CONVERT}"
    if instance.is_instance:
        return _instanced(instance.parent.original.name, name)
    data = blender_object.data
    if blender_object.library or data.library or blender_object.override_library:
        return f"'{name}' is linked from another file: it is not baked; make it local to bake it"
    if data.is_editmode:
        return f"'{name}' is in Edit Mode: it is not baked; leave Edit Mode to bake it"
    return None


def _instanced(instancer, name):
    if instancer == name:
        return f"'{name}' makes instances: they are not baked; make them real to bake them"
    return f"'{name}' is instanced by '{instancer}': its instances are not baked; make them real to bake them"


def has_faces_of(mesh, original) -> bool:
    """Whether a mesh as it is evaluated has the faces of the original: a result for one is one for the other."""
    if len(mesh.loops) != len(original.loops) or len(mesh.polygons) != len(original.polygons):
        return False
    return np.array_equal(corner_vertices(mesh), corner_vertices(original))


def why_not_modified(blender_object, makes_instances: bool) -> str:
    """Why an object whose modifiers make new faces is not baked as it is, or with ``makes_instances`` not at all."""
    makers = [
        modifier.name
        for modifier in blender_object.modifiers
        if modifier.show_viewport and modifier.type not in KEEPS_FACES
    ]
    if not makers:
        return (
            f"'{blender_object.name}' has other faces once evaluated: it is not baked; make it a plain mesh to bake it"
        )
    noun = "modifier" if len(makers) == 1 else "modifiers"
    made, remedy = "new faces", f"apply the {noun} to bake it, or bake with Apply Modifiers (--apply-modifiers)"
    if makes_instances:
        made, remedy = "new faces and instances", "make its instances real and apply the rest to bake it"
    return f"{' and '.join(makers)} {noun} on '{blender_object.name}' makes {made}: it is not baked; {remedy}"
