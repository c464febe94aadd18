"""A new mesh whose every corner is a weighted mean of corners of another: all its attributes come along."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from .attribute_values import KINDS_OF_VALUES, read_values
from .cut_faces import edge_keys
from .read_mesh import corner_vertices


@dataclass(frozen=True, slots=True)
class Origins:
    """A mesh of C corners and F polygons, said in terms of another.

    Attributes
    ----------
    vertices : int64 (C,) vertex of each corner; below the other mesh's vertex count: the same vertex
    corners : int64 (C, 4) corners of the other mesh
    weights : float64 (C, 4) and their weights
    sizes : int64 (F,) corners of each polygon, in order
    polygons : int64 (F,) polygon of the other mesh
    edge_keys, edges : int64 (K,) sorted; keys of new edges that lie in an edge of the other mesh, and that edge
    """

    vertices: np.ndarray
    corners: np.ndarray
    weights: np.ndarray
    sizes: np.ndarray
    polygons: np.ndarray
    edge_keys: np.ndarray
    edges: np.ndarray


def rebuild_mesh(source, origins: Origins) -> bpy.types.Mesh:
    """A new mesh without users."""
    mesh = bpy.data.meshes.new(source.name)
    first_corners = _first_corners(origins.vertices, len(source.vertices))
    mesh.vertices.add(len(first_corners))
    mesh.loops.add(len(origins.vertices))
    mesh.polygons.add(len(origins.sizes))
    mesh.loops.foreach_set("vertex_index", origins.vertices.astype(np.int32))
    mesh.polygons.foreach_set("loop_start", (np.cumsum(origins.sizes) - origins.sizes).astype(np.int32))
    for material in source.materials:
        mesh.materials.append(material)
    mesh.update(calc_edges=True)
    for attribute in source.attributes:
        if not attribute.name.startswith(".") and attribute.data_type in KINDS_OF_VALUES:
            _copy(attribute, mesh, source, origins, first_corners)
    for key in source.keys():
        mesh[key] = source[key]
    _copy_choices(source, mesh)
    mesh.update()
    return mesh


def _first_corners(vertices, old_count):
    """A corner of each vertex, -1 for loose ones."""
    first = np.full(max(old_count, int(vertices.max()) + 1), -1, np.int64)
    first[vertices[::-1]] = np.arange(len(vertices))[::-1]
    return first


def _copy(attribute, mesh, source, origins, first_corners):
    name, width, dtype, is_linear = KINDS_OF_VALUES[attribute.data_type]
    old = read_values(attribute.data, name, dtype, width).reshape(-1, width)
    if attribute.domain == "CORNER":
        new = _blended(old, origins.corners, origins.weights, is_linear)
    elif attribute.domain == "POINT":
        new = _vertex_values(old, source, origins, first_corners, is_linear)
    elif attribute.domain == "FACE":
        new = old[origins.polygons]
    else:
        new = _edge_values(old, mesh, origins)
    target = mesh.attributes.get(attribute.name) or mesh.attributes.new(
        attribute.name, attribute.data_type, attribute.domain
    )
    target.data.foreach_set(name, np.ascontiguousarray(new, dtype).ravel())


def _blended(old, rows, weights, is_linear):
    if not is_linear:
        return old[np.take_along_axis(rows, weights.argmax(axis=1)[:, None], axis=1)[:, 0]]
    new = np.zeros((len(rows), old.shape[1]))
    for k in range(4):
        new += weights[:, k : k + 1] * old[rows[:, k]]
    return new


def _vertex_values(old, source, origins, first_corners, is_linear):
    """New vertices from their first corner; the old ones as they were, to the bit."""
    new = np.zeros((len(first_corners), old.shape[1]), old.dtype)
    added = first_corners[len(old) :]
    rows = corner_vertices(source)[origins.corners[added]]
    new[len(old) :] = _blended(old, rows, origins.weights[added], is_linear)
    new[: len(old)] = old
    return new


def _edge_values(old, mesh, origins):
    """Parts of old edges take the old value; edges across a face have none (not sharp, no seam)."""
    ends = np.empty(len(mesh.edges) * 2, np.int32)
    mesh.edges.foreach_get("vertices", ends)
    keys = edge_keys(*ends.reshape(-1, 2).astype(np.int64).T)
    rows = np.minimum(np.searchsorted(origins.edge_keys, keys), len(origins.edge_keys) - 1)
    found = origins.edge_keys[rows] == keys
    new = np.zeros((len(keys), old.shape[1]), old.dtype)
    new[found] = old[origins.edges[rows[found]]]
    return new


def _copy_choices(source, mesh):
    """Which UV map and colour attribute are active, and which are rendered."""
    for layer in source.uv_layers:
        mesh.uv_layers[layer.name].active_render = layer.active_render
    mesh.uv_layers.active_index = source.uv_layers.active_index
    if len(source.color_attributes):
        mesh.color_attributes.active_color_name = source.color_attributes.active_color_name
        mesh.color_attributes.render_color_index = source.color_attributes.render_color_index
