"""A mesh in its own space -> triangles in world space, wound to the front whatever the object's scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .read_mesh import LIGHTMAP_LAYER, MeshArrays

# Twice the area over the longest side squared; a triangle below has lost its normal to rounding.
DEGENERATE = 1e-12


@dataclass(frozen=True, slots=True)
class PlacedMesh:
    """One object or instance in world space; shapes as in core ``Scene`` and ``SceneObject``, vertices from 0."""

    vertices: np.ndarray
    triangles: np.ndarray
    corner_normals: np.ndarray
    uvs: np.ndarray
    materials: np.ndarray
    polygons: np.ndarray
    corners: np.ndarray
    lightmap_uvs: np.ndarray | None
    sharp_edges: np.ndarray

    def mesh_arrays(self) -> dict:
        """The fields that a SceneObject shares."""
        names = ("polygons", "corners", "lightmap_uvs", "sharp_edges")
        return {name: getattr(self, name) for name in names}


def place_mesh(mesh: MeshArrays, matrix: np.ndarray, materials: np.ndarray, uvs: np.ndarray) -> PlacedMesh:
    """Move a mesh by ``matrix`` (4, 4); ``materials`` (T,) and ``uvs`` (T, 3, 2) are its triangles' own."""
    linear = matrix[:3, :3]
    is_mirrored = np.linalg.det(linear) < 0
    order = [0, 2, 1] if is_mirrored else [0, 1, 2]
    vertices = mesh.positions @ linear.T + matrix[:3, 3]
    triangles = np.ascontiguousarray(mesh.triangles[:, order])
    face_normals = _face_normals(vertices[triangles])
    normals = mesh.corner_normals[:, order] @ _normal_matrix(linear).T
    lightmap_uvs = mesh.uvs.get(LIGHTMAP_LAYER)
    return PlacedMesh(
        vertices=vertices,
        triangles=triangles,
        corner_normals=_unit_normals(normals, face_normals, mesh.is_flat),
        uvs=np.ascontiguousarray(uvs[:, order]),
        materials=materials,
        polygons=mesh.polygons,
        corners=np.ascontiguousarray(mesh.corners[:, order]),
        lightmap_uvs=None if lightmap_uvs is None else np.ascontiguousarray(lightmap_uvs[:, order]),
        # Corners a, c, b: the edges are ac, cb, ba, which were numbers 2, 1, 0.
        sharp_edges=np.ascontiguousarray(mesh.sharp_edges[:, ::-1] if is_mirrored else mesh.sharp_edges),
    )


def _face_normals(corners):
    """Unit geometric normals (T, 3), +z where there is none."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(first, second)
    sides = np.stack([first, second, second - first])
    longest_squared = (sides**2).sum(axis=2).max(axis=0)
    lengths = np.linalg.norm(normals, axis=1)
    is_degenerate = lengths <= DEGENERATE * longest_squared
    normals[is_degenerate] = (0.0, 0.0, 1.0)
    lengths[is_degenerate] = 1.0
    return normals / lengths[:, None]


def _normal_matrix(linear):
    """The inverse transpose up to a positive factor; as cofactors, so that a scale of 0 needs no inverse."""
    rows = [np.cross(linear[i - 2], linear[i - 1]) for i in range(3)]
    return np.array(rows) * (-1.0 if np.linalg.det(linear) < 0 else 1.0)


def _unit_normals(normals, face_normals, is_flat):
    lengths = np.linalg.norm(normals, axis=2, keepdims=True)
    unit = normals / np.where(lengths > 0, lengths, 1.0)
    # Degenerate fans have normals of NaN or 0; there, and where flat shaded, the face itself decides.
    use_face = is_flat[:, None] | ~(lengths[..., 0] > 0) | ~np.isfinite(unit).all(axis=2)
    return np.where(use_face[..., None], face_normals[:, None, :], unit).astype(np.float32)
