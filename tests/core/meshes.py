"""Small meshes as core scenes, without Blender."""

import numpy as np

from addon.core.scene import Material, Scene, SceneObject


def scene_of(*meshes, targets=None):
    """A scene of (vertices, faces) pairs, an object each; faces are polygons of any size, cut into fans."""
    vertices, triangles, objects = [], [], []
    for number, (points, faces) in enumerate(meshes):
        base = sum(len(earlier) for earlier in vertices)
        first = sum(len(earlier) for earlier in triangles)
        own, polygons, corners, loop = [], [], [], 0
        for polygon, face in enumerate(faces):
            for k in range(1, len(face) - 1):
                own.append([face[0], face[k], face[k + 1]])
                polygons.append(polygon)
                corners.append([loop, loop + k, loop + k + 1])
            loop += len(face)
        vertices.append(np.asarray(points, np.float64).reshape(-1, 3))
        triangles.append(np.asarray(own, np.int32).reshape(-1, 3) + np.int32(base))
        objects.append(
            SceneObject(
                f"object {number}",
                first,
                len(own),
                is_target=targets is None or number in targets,
                polygons=np.array(polygons, np.int32),
                corners=np.array(corners, np.int32).reshape(-1, 3),
            )
        )
    triangles = np.concatenate(triangles)
    count = len(triangles)
    return Scene(
        vertices=np.concatenate(vertices),
        triangles=triangles,
        corner_normals=np.zeros((count, 3, 3), np.float32),
        uvs=np.zeros((count, 3, 2), np.float32),
        triangle_materials=np.zeros(count, np.int32),
        objects=tuple(objects),
        materials=(Material("grey"),),
    )


def box(size=(1.0, 1.0, 1.0), centre=(0.0, 0.0, 0.0)):
    """Six quads that look outwards."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return signs * np.asarray(size) / 2 + np.asarray(centre), faces


def sphere(radius=1.0, rings=12, segments=24, centre=(0.0, 0.0, 0.0)):
    """Quads along the meridians, triangles at the poles."""
    polar = np.pi * np.arange(1, rings) / rings
    around = 2 * np.pi * np.arange(segments) / segments
    grid = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(around),
            np.sin(polar)[:, None] * np.sin(around),
            np.broadcast_to(np.cos(polar)[:, None], (rings - 1, segments)),
        ],
        axis=-1,
    )
    points = np.concatenate([grid.reshape(-1, 3), [(0, 0, 1), (0, 0, -1)]]) * radius + np.asarray(centre)
    faces = []
    for s in range(segments):
        after = (s + 1) % segments
        faces.append((len(points) - 2, s, after))
        last = (rings - 2) * segments
        faces.append((len(points) - 1, last + after, last + s))
        for r in range(rings - 2):
            low, high = r * segments, (r + 1) * segments
            faces.append((low + s, high + s, high + after, low + after))
    return points, faces


def rough_sheet(rng, size=6, height=0.5):
    """A square sheet of bent quads with random heights: polygons that are not plane."""
    u, v = np.meshgrid(np.arange(size + 1.0), np.arange(size + 1.0))
    points = np.stack([u, v, rng.uniform(-height, height, u.shape)], axis=-1).reshape(-1, 3)
    corner = np.arange((size + 1) * size).reshape(size, size + 1)[:, :-1].reshape(-1)
    faces = [(c, c + 1, c + size + 2, c + size + 1) for c in corner]
    return points, faces
