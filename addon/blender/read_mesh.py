"""One Blender mesh -> arrays of its loop triangles, in the mesh's own space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .attribute_values import KINDS_OF_VALUES, read_values

LIGHTMAP_LAYER = "Lightmap"
FLAT_DEG = 2.0  # at the most do flat-shaded faces of one plane meet at, in the mesh's own space: nothing parts them
BAKED_COLOURS = "Patchlight"  # the attribute that holds light, and no colour
VECTORS, READABLE_DOMAINS = {"FLOAT2", "FLOAT_VECTOR"}, {"POINT", "CORNER", "FACE"}
INFINITE = 1e15  # Blender stores an infinite coordinate as the largest float


@dataclass(frozen=True, slots=True)
class MeshArrays:
    """The T loop triangles of a mesh of V vertices.

    Attributes
    ----------
    positions : float64 (V, 3)
    triangles : int32 (T, 3) vertices
    corners : int32 (T, 3) face corners (loops)
    polygons : int32 (T,)
    material_slots : int32 (T,)
    corner_normals : float32 (T, 3, 3); on flat faces the polygon's
    is_flat : bool (T,) flat shaded: the triangle's own normal holds
    sharp_edges : bool (T, 3) edge k runs from corner k to corner k + 1
    uvs : dict, name of a UV layer, or of an attribute of vectors -> float32 (T, 3, 2)
    render_layer : str, the UV layer that textures use; "" where there is none
    colours : dict, name of an attribute ("" = the render colours) and whether of its alpha -> float32 (T, 3), the
        mean; 0 where there is none
    unread_colours : names of those that are there, but cannot be read: 0, too
    """

    positions: np.ndarray
    triangles: np.ndarray
    corners: np.ndarray
    polygons: np.ndarray
    material_slots: np.ndarray
    corner_normals: np.ndarray
    is_flat: np.ndarray
    sharp_edges: np.ndarray
    uvs: dict
    render_layer: str
    colours: dict
    unread_colours: tuple


def read_mesh(mesh, uv_layers=(), colours=()) -> MeshArrays:
    """Read a mesh; of its UVs the render layer, "Lightmap", and those named, of its colours those named."""
    mesh.calc_loop_triangles()
    corners = read_values(mesh.loop_triangles, "loops", np.int32, 3)
    polygons = read_values(mesh.loop_triangles, "polygon_index", np.int32)
    is_flat = _flags(mesh, "sharp_face", len(mesh.polygons))
    edge_sharp = _sharp_corner_edges(mesh, is_flat)
    next_corner = _next_corners(mesh)
    # A triangle's edge inside its polygon (a diagonal) is no edge of the mesh, so it cannot be sharp.
    is_mesh_edge = next_corner[corners] == np.roll(corners, -1, axis=1)
    render_layer = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    wanted = {render_layer, LIGHTMAP_LAYER, *uv_layers}
    return MeshArrays(
        positions=read_positions(mesh),
        triangles=corner_vertices(mesh)[corners],
        corners=corners,
        polygons=polygons,
        material_slots=_material_slots(mesh)[polygons],
        corner_normals=read_values(mesh.corner_normals, "vector", np.float32, 3)[corners],
        # Custom normals are bent from whatever the face has, flat faces included.
        is_flat=is_flat[polygons] & (not mesh.has_custom_normals),
        sharp_edges=is_mesh_edge & edge_sharp[corners],
        uvs={name: uvs for name in wanted if (uvs := _uvs(mesh, name, corners, polygons)) is not None},
        render_layer=render_layer,
        colours={key: _triangle_colours(mesh, *key, corners, polygons) for key in colours},
        unread_colours=tuple(sorted({name for name, _ in colours if not _is_readable(mesh, name)})),
    )


def read_positions(mesh) -> np.ndarray:
    """Vertex positions, float64 (V, 3)."""
    return _attribute(mesh, "position", "vector", np.float32, 3).astype(np.float64)


def are_finite(positions) -> bool:
    """Whether rays can be traced to these positions."""
    return bool((np.abs(positions) < INFINITE).all())


def corner_vertices(mesh) -> np.ndarray:
    """Vertex of each face corner: two meshes with the same have the same faces. int32 (loops,)"""
    return _attribute(mesh, ".corner_vert", "value", np.int32, 1)


def _attribute(mesh, attribute, name, dtype, width):
    found = mesh.attributes.get(attribute)
    return (
        np.zeros((0, width) if width > 1 else 0, dtype)
        if found is None
        else read_values(found.data, name, dtype, width)
    )


def _triangle_colours(mesh, name, is_alpha, corners, polygons):
    """An attribute's mean over each triangle as a colour, or its alpha as a grey, float32 (T, 3); 0 where there is
    none, as Cycles has it."""
    found = _colour_attribute(mesh, name)
    if found is None or not _is_readable(mesh, name):
        return np.zeros((len(corners), 3), np.float32)
    name, width, dtype, _ = KINDS_OF_VALUES[found.data_type]
    values = np.nan_to_num(read_values(found.data, name, dtype, width).reshape(-1, width).astype(np.float32))
    if is_alpha:
        values = values[:, 3:] if width == 4 else np.ones_like(values[:, :1])
    values = values if values.shape[1] > 1 else np.repeat(values, 3, axis=1)
    values = np.pad(values, ((0, 0), (0, max(3 - values.shape[1], 0))))[:, :3]
    if found.domain == "FACE":
        return values[polygons]
    return values[corners if found.domain == "CORNER" else corner_vertices(mesh)[corners]].mean(axis=1)


def _colour_attribute(mesh, name):
    """The attribute of a name, "" = that which renders take, or another where that one holds baked light; or None."""
    if name:
        return mesh.attributes.get(name)
    render = mesh.color_attributes.render_color_index
    chosen = [mesh.color_attributes[render]] if render >= 0 else []
    return next((each for each in (*chosen, *mesh.color_attributes) if each.name != BAKED_COLOURS), None)


def _is_readable(mesh, name):
    """Whether an attribute is a colour, or not there, which is black; not what has baked light in its place only."""
    found = _colour_attribute(mesh, name)
    if found is None:
        return bool(name) or not len(mesh.color_attributes)
    return found.data_type in KINDS_OF_VALUES and found.domain in READABLE_DOMAINS


def _flags(mesh, attribute, count):
    found = mesh.attributes.get(attribute)
    return np.zeros(count, bool) if found is None else read_values(found.data, "value", bool)


def _material_slots(mesh):
    if "material_index" not in mesh.attributes:
        return np.zeros(len(mesh.polygons), np.int32)
    return _attribute(mesh, "material_index", "value", np.int32, 1)


def _uvs(mesh, name, corners, polygons):
    """A UV layer's, or the first two numbers of an attribute of vectors, as nodes that make meshes leave them."""
    found = mesh.attributes.get(name) if name else None
    if found is None or found.data_type not in VECTORS or found.domain not in READABLE_DOMAINS:
        return None
    width = KINDS_OF_VALUES[found.data_type].width
    values = read_values(found.data, "vector", np.float32, width)[:, :2]
    values = np.nan_to_num(values, posinf=0.0, neginf=0.0)
    if found.domain == "FACE":
        return np.repeat(values[polygons][:, None], 3, axis=1)
    return values[corners if found.domain == "CORNER" else corner_vertices(mesh)[corners]]


def _next_corners(mesh):
    """The corner that follows each corner around its polygon."""
    starts = read_values(mesh.polygons, "loop_start", np.int32)
    sizes = read_values(mesh.polygons, "loop_total", np.int32)
    following = np.arange(1, len(mesh.loops) + 1, dtype=np.int32)
    following[starts + sizes - 1] = starts
    return following


def _sharp_corner_edges(mesh, face_is_flat):
    """Whether the edge from each corner to the next is sharp: marked so, or where a flat-shaded face bends off."""
    edges = _attribute(mesh, ".corner_edge", "value", np.int32, 1)
    is_sharp = _flags(mesh, "sharp_edge", len(mesh.edges))
    sizes = read_values(mesh.polygons, "loop_total", np.int32)
    normals = np.repeat(read_values(mesh.polygon_normals, "vector", np.float32, 3), sizes, axis=0)
    is_bent = _bent_edges(edges, normals, len(is_sharp))
    of_flat = edges[np.repeat(face_is_flat, sizes)]
    is_sharp[of_flat] |= is_bent[of_flat]
    return is_sharp[edges]


def _bent_edges(edges, normals, count):
    """Which of ``count`` edges have faces in different planes: edges (C,) and face normals (C, 3) of corners."""
    faces = np.bincount(edges, minlength=count)
    # two unit normals so far apart have a sum of twice the cosine of half of it
    total = np.stack([np.bincount(edges, axis, count) for axis in normals.T], axis=1)
    return np.linalg.norm(total, axis=1) < np.cos(np.radians(FLAT_DEG / 2)) * faces
