"""What triangles are by their corners: which way they look, and how large they are."""

from __future__ import annotations

import numpy as np


def area_vectors(corners):
    """Normals of triangles (..., 3, 3), as long as their areas: (..., 3) [m^2]."""
    return 0.5 * np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])


def triangle_areas(corners):
    """Areas of triangles (..., 3, 3): (...) [m^2]."""
    return np.linalg.norm(area_vectors(corners), axis=-1)


def unit_normals(corners):
    """Unit normals of triangles (..., 3, 3): (..., 3), 0 of one without an area."""
    normals = area_vectors(corners)
    return normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-300)
