"""Which UVs an Image Texture node looks up: the UV layer, and the Mapping node between."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from .shader_nodes import NOTHING, Reached, Unreadable, constant_vector, own_mapping

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The UV layer ("" = the mesh's render layer), the affine map after it, the rows of a 2 x 3 matrix, and whether the
    image goes on beyond 0 ... 1 as at its edges."""

    uv_layer: str = ""
    affine: tuple[float, ...] = IDENTITY
    extends: bool = False

    def of_part(self, low, high, extends) -> Coordinates:
        """Of an image that has this one from ``low`` to ``high`` of its sides, (2,) each."""
        low, high = np.array(low, float), np.array(high, float)
        return Coordinates(self.uv_layer, _after(np.column_stack([np.diag(high - low), low]), self.affine), extends)

    def uvs_of(self, mesh, chosen, instance) -> np.ndarray:
        """UVs of chosen triangles (K,) of read_mesh.MeshArrays, float32 (K, 3, 2); 0 where it has no such layer."""
        layer = mesh.uvs.get(self.uv_layer or mesh.render_layer)
        if layer is None:
            return np.zeros((len(chosen), 3, 2), np.float32)
        uvs = layer[chosen]
        if self.affine == IDENTITY:
            return uvs
        matrix = np.array(self.affine).reshape(2, 3)
        return (uvs @ matrix[:, :2].T + matrix[:, 2]).astype(np.float32)


def read_coordinates(vector: Reached) -> Coordinates:
    """Where the Vector input of an Image Texture comes from; Unreadable when not from UVs."""
    if vector.is_constant:
        if vector.socket is NOTHING:
            raise Unreadable("coordinates of a muted node without a link")
        return Coordinates()
    node = vector.node
    if node.type == "UVMAP":
        return Coordinates(node.uv_map)
    if node.type == "ATTRIBUTE" and node.attribute_type == "GEOMETRY" and node.attribute_name:
        if vector.socket.identifier in {"Vector", "Color"}:
            return Coordinates(node.attribute_name)
    if node.type == "TEX_COORD" and vector.socket.identifier == "UV":
        return Coordinates()
    if node.type == "MAPPING":
        inner = read_coordinates(vector.feeding("Vector"))
        if vector.feeding("Vector").is_constant:
            raise Unreadable("Mapping node without coordinates")
        return Coordinates(inner.uv_layer, _after(_mapping_affine(vector), inner.affine))
    raise Unreadable(f"{node.bl_label} coordinates")


def with_own_mapping(coordinates: Coordinates, node) -> Coordinates:
    """The same with the Texture Mapping of an Image Texture ``node`` after them."""
    numbers = own_mapping(node)
    if numbers is None:
        return coordinates
    own = _affine(node.texture_mapping.vector_type, *numbers)
    return Coordinates(coordinates.uv_layer, _after(own, coordinates.affine), coordinates.extends)


def _mapping_affine(mapping: Reached):
    numbers = (constant_vector(mapping, name) for name in ("Location", "Rotation", "Scale"))
    return _affine(mapping.node.vector_type, *numbers)


def _affine(vector_type, location, rotation, scale):
    """Of a mapping, as a matrix (2, 3)."""
    if abs(rotation[0]) > 1e-6 or abs(rotation[1]) > 1e-6:
        raise Unreadable("Mapping node that turns out of the UV plane")
    turn = np.array([[cos(rotation[2]), -sin(rotation[2])], [sin(rotation[2]), cos(rotation[2])]])
    if vector_type == "TEXTURE":
        if min(abs(scale[0]), abs(scale[1])) == 0:
            raise Unreadable("Mapping node of scale 0")
        linear = np.diag(1 / np.array(scale[:2])) @ turn.T
        return np.column_stack([linear, -linear @ location[:2]])
    if vector_type not in {"POINT", "VECTOR"}:
        raise Unreadable(f"Mapping node of type {vector_type.title()}")
    shift = location[:2] if vector_type == "POINT" else (0.0, 0.0)
    return np.column_stack([turn @ np.diag(scale[:2]), shift])


def _after(outer, inner):
    """outer(inner(uv)) as six numbers."""
    square = [np.vstack([np.reshape(affine, (2, 3)), (0, 0, 1)]) for affine in (outer, inner)]
    return tuple(float(x) for x in (square[0] @ square[1])[:2].ravel())
