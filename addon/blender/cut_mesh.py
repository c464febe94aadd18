"""Cutting long edges of a copy of a mesh: vertex colours need vertices where the light changes."""

from __future__ import annotations

import bmesh
import bpy
import numpy as np
from mathutils import Matrix

from ..core.scene import SceneError
from .read_mesh import read_positions

MOST_FACES = 20_000_000


def cut_mesh(blender_object, matrix: np.ndarray, longest: float):
    """A copy of the object's mesh with every edge at most ``longest`` [m, world space] long.

    Returns a new Mesh without users, or None where no edge is longer (or the mesh is not finite: reading it says so).
    Edges are halved until they are short enough, in all their faces at once, so that no T-junction appears. Materials,
    UVs, sharp edges and smooth shading are kept.
    """
    if not np.isfinite(read_positions(blender_object.data)).all():
        return None
    bm = bmesh.new()
    try:
        bm.from_mesh(blender_object.data)
        linear = Matrix(matrix[:3, :3].tolist())
        if not _long_edges(bm, linear, longest) and not _wide_ngons(bm, linear, longest):
            return None
        _require_possible(bm, linear, longest, blender_object.name)
        _cut(bm, linear, longest)
        return _new_mesh(bm, blender_object.data)
    finally:
        bm.free()


def _cut(bm, linear, longest):
    # Cutting adds no inner vertices to a polygon of five or more corners, and crosses over in a concave quad.
    _triangulate(bm, _wide_ngons(bm, linear, longest) + _wide_concave_quads(bm, linear, longest))
    while edges := _long_edges(bm, linear, longest):
        bmesh.ops.subdivide_edges(bm, edges=edges, cuts=1, use_grid_fill=True)
        _triangulate(bm, [face for face in bm.faces if len(face.verts) > 4])


def _long_edges(bm, linear, longest):
    limit = longest * (1 + 1e-6)  # an edge of just that length is not cut by rounding
    return [edge for edge in bm.edges if (linear @ (edge.verts[0].co - edge.verts[1].co)).length > limit]


def _wide_ngons(bm, linear, longest):
    return [face for face in bm.faces if len(face.verts) > 4 and _is_wide(face, linear, longest)]


def _is_wide(face, linear, longest):
    corners = np.array([linear @ vertex.co for vertex in face.verts])
    return np.linalg.norm(np.ptp(corners, axis=0)) > longest


def _wide_concave_quads(bm, linear, longest):
    quads = [face for face in bm.faces if len(face.verts) == 4 and not all(loop.is_convex for loop in face.loops)]
    return [face for face in quads if _is_wide(face, linear, longest)]


def _triangulate(bm, faces):
    if faces:
        bmesh.ops.triangulate(bm, faces=faces, quad_method="BEAUTY", ngon_method="BEAUTY")


def _require_possible(bm, linear, longest, name):
    scale = abs(linear.determinant()) ** (2 / 3) or 1.0
    count = sum(face.calc_area() for face in bm.faces) * scale / longest**2
    if count > MOST_FACES:
        raise SceneError(
            f"subdivide is {longest:g} m: '{name}' would get about {count:.1e} faces, allowed is {MOST_FACES:.0e}"
        )


def _new_mesh(bm, source):
    mesh = bpy.data.meshes.new(source.name)
    bm.to_mesh(mesh)
    for material in source.materials:
        mesh.materials.append(material)
    for key in source.keys():
        mesh[key] = source[key]
    render = next((index for index, layer in enumerate(source.uv_layers) if layer.active_render), None)
    if render is not None:
        mesh.uv_layers[render].active_render = True
        mesh.uv_layers.active_index = source.uv_layers.active_index
    return mesh
