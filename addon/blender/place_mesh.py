"""A mesh in its own space -> triangles in world space, wound to the front whatever the object's scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .read_mesh import LIGHTMAP_LAYER, MeshArrays

# Twice the area over the longest side squared; a triangle below has lost its normal to rounding.
DEGENERATE = 1e-12
AT_ONCE = 1 << 18  # triangles, whose normals take 100 MB while they are made


@dataclass(frozen=True, slots=True)
class PlacedMesh:
    """One object or instance in world space; shapes as in core ``Scene`` and ``SceneObject``, vertices from 0.

    Its ``corner_normals`` are of any length yet, and nothing to go by where ``is_flat`` (T,).
    """

    vertices: np.ndarray
    triangles: np.ndarray
    corner_normals: np.ndarray
    is_flat: np.ndarray
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
    lightmap_uvs = mesh.uvs.get(LIGHTMAP_LAYER)
    return PlacedMesh(
        vertices=mesh.positions @ linear.T + matrix[:3, 3],
        triangles=np.ascontiguousarray(mesh.triangles[:, order]),
        corner_normals=mesh.corner_normals[:, order] @ _normal_matrix(linear, is_mirrored).T,
        is_flat=mesh.is_flat,
        uvs=np.ascontiguousarray(uvs[:, order]),
        materials=materials,
        polygons=mesh.polygons,
        corners=np.ascontiguousarray(mesh.corners[:, order]),
        lightmap_uvs=None if lightmap_uvs is None else np.ascontiguousarray(lightmap_uvs[:, order]),
        # Corners a, c, b: the edges are ac, cb, ba, which were numbers 2, 1, 0.
        sharp_edges=np.ascontiguousarray(mesh.sharp_edges[:, ::-1] if is_mirrored else mesh.sharp_edges),
    )


def make_unit_normals(vertices, triangles, io_normals, is_flat):
    """Make corner normals (T, 3, 3) of all meshes unit ones, of the triangle itself where it ``is_flat`` (T,).

    For the whole scene at once: 800 objects would pay NumPy's calls 800 times.
    """
    for start in range(0, len(triangles), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        face_normals = _face_normals(vertices[triangles[part]])
        smooth = np.flatnonzero(~is_flat[part])
        units = _unit_or_face(io_normals[part][smooth].astype(np.float64), face_normals[smooth])
        io_normals[part] = face_normals[:, None]
        io_normals[part][smooth] = units


def _face_normals(corners):
    """Unit geometric normals (T, 3), +z where there is none."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(first, second)
    longest_squared = np.max([_squared(first), _squared(second), _squared(second - first)], axis=0)
    lengths = np.sqrt(_squared(normals))
    is_degenerate = lengths <= DEGENERATE * longest_squared
    normals[is_degenerate] = (0.0, 0.0, 1.0)
    lengths[is_degenerate] = 1.0
    return normals / lengths[:, None]


def _squared(vectors):
    return np.einsum("nk,nk->n", vectors, vectors)


def _normal_matrix(linear, is_mirrored):
    """The inverse transpose up to a positive factor, float32 (3, 3): as cofactors, so that a scale of 0 needs none."""
    down, up = linear[[1, 2, 0]], linear[[2, 0, 1]]
    cofactors = down[:, [1, 2, 0]] * up[:, [2, 0, 1]] - down[:, [2, 0, 1]] * up[:, [1, 2, 0]]
    # of about 1, as scales of 1e-20 would be lost in 32 bits
    largest = np.abs(cofactors).max()
    return (cofactors * ((-1.0 if is_mirrored else 1.0) / (largest if largest > 0 else 1.0))).astype(np.float32)


def _unit_or_face(normals, face_normals):
    lengths = np.linalg.norm(normals, axis=2, keepdims=True)
    unit = normals / np.where(lengths > 0, lengths, 1.0)
    # Degenerate fans have normals of NaN or 0: there the face itself decides.
    use_face = ~(lengths[..., 0] > 0) | ~np.isfinite(unit).all(axis=2)
    return np.where(use_face[..., None], face_normals[:, None], unit)
