"""Meshes as (vertices, faces), and scenes of them, for tests that look at shape alone."""

import numpy as np

from tests import scenes


def scene_of(*meshes, targets=None):
    """A scene of (vertices, faces) pairs, a grey object each; faces are polygons of any size."""
    parts = [
        scenes.Part(points, faces, name=f"object {number}", is_target=targets is None or number in targets)
        for number, (points, faces) in enumerate(meshes)
    ]
    return scenes.scene_of(parts)


def box(size=(1.0, 1.0, 1.0), centre=(0.0, 0.0, 0.0)):
    """Six quads that look outwards."""
    half = np.asarray(size) / 2
    part = scenes.box(centre - half, centre + half)
    return part.vertices, part.faces


def sphere(radius=1.0, rings=12, segments=24, centre=(0.0, 0.0, 0.0)):
    """Quads along the meridians, triangles at the poles."""
    part = scenes.sphere(centre, radius, rings, segments)
    return part.vertices, part.faces


def rough_sheet(rng, size=6, height=0.5):
    """A square sheet of bent quads with random heights: polygons that are not plane."""
    u, v = np.meshgrid(np.arange(size + 1.0), np.arange(size + 1.0))
    points = np.stack([u, v, rng.uniform(-height, height, u.shape)], axis=-1).reshape(-1, 3)
    corner = np.arange((size + 1) * size).reshape(size, size + 1)[:, :-1].reshape(-1)
    faces = [(c, c + 1, c + size + 2, c + size + 1) for c in corner]
    return points, faces
