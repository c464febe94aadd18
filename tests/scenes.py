"""Small scenes by hand, without Blender: parts of polygons with a material each, put together to a core scene."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from addon.core.kernel import KernelScene
from addon.core.scene import AreaLight, Material, PointLight, Scene, SceneObject, SunLight
from addon.core.workers import Workers

GREY = Material("grey", (0.5, 0.5, 0.5))
BLACK = Material("black", (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Part:
    """One object: polygons [m], a material, smooth normals per vertex where it is not flat."""

    vertices: np.ndarray
    faces: list
    material: Material = GREY
    name: str = "part"
    is_target: bool = True
    normals: np.ndarray | None = None


def scene_of(parts, lights=(), world=(0.0, 0.0, 0.0)) -> Scene:
    """The core scene of parts; polygons are cut into fans."""
    vertices, triangles, normals, objects = [], [], [], []
    for part in parts:
        base, first = sum(map(len, vertices)), sum(map(len, triangles))
        points = np.asarray(part.vertices, np.float64).reshape(-1, 3)
        own, polygons, corners = _fans(part.faces)
        with np.errstate(invalid="ignore"):  # corners may be infinite
            flat = np.cross(points[own[:, 1]] - points[own[:, 0]], points[own[:, 2]] - points[own[:, 0]])
        flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
        normals.append(np.repeat(flat[:, None], 3, axis=1) if part.normals is None else part.normals[own])
        vertices.append(points)
        triangles.append(own + np.int32(base))
        objects.append(SceneObject(part.name, first, len(own), part.is_target, polygons, corners))
    count = sum(map(len, triangles))
    materials = tuple(part.material for part in parts)
    return Scene(
        vertices=np.concatenate(vertices),
        triangles=np.concatenate(triangles).astype(np.int32),
        corner_normals=np.concatenate(normals).astype(np.float32),
        uvs=np.zeros((count, 3, 2), np.float32),
        triangle_materials=np.repeat(np.arange(len(parts)), [o.count for o in objects]).astype(np.int32),
        objects=tuple(objects),
        materials=materials,
        lights=tuple(lights),
        world_radiance=world,
    )


def _fans(faces):
    triangles, polygons, corners, loop = [], [], [], 0
    for polygon, face in enumerate(faces):
        for k in range(1, len(face) - 1):
            triangles.append([face[0], face[k], face[k + 1]])
            polygons.append(polygon)
            corners.append([loop, loop + k, loop + k + 1])
        loop += len(face)
    shape = np.array(triangles, np.int32).reshape(-1, 3)
    return shape, np.array(polygons, np.int32), np.array(corners, np.int32).reshape(-1, 3)


@contextmanager
def kernel_of(scene: Scene, threads: int = 1):
    """The scene's kernel, for as long as its workers live."""
    with Workers(threads) as workers:
        yield KernelScene(scene, workers)


# ---- shapes ----


def rectangle(corner, u, v, cuts=(1, 1), **options) -> Part:
    """A rectangle that faces u x v, cut into a grid of quads."""
    corner, u, v = (np.asarray(x, np.float64) for x in (corner, u, v))
    columns, rows = cuts
    a, b = np.meshgrid(np.arange(columns + 1) / columns, np.arange(rows + 1) / rows)
    points = corner + a.reshape(-1, 1) * u + b.reshape(-1, 1) * v
    starts = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    faces = [(s, s + 1, s + columns + 2, s + columns + 1) for s in starts]
    return Part(points, faces, **options)


def box(low, high, inwards=False, without=(), **options) -> Part:
    """Six quads; ``without`` names those to leave out: "-x", "+x", "-y", "+y", "-z", "+z"."""
    signs = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    points = np.asarray(low) + signs * (np.asarray(high) - np.asarray(low))
    faces = {
        "-x": (0, 1, 3, 2),
        "+x": (4, 6, 7, 5),
        "-y": (0, 4, 5, 1),
        "+y": (2, 3, 7, 6),
        "-z": (0, 2, 6, 4),
        "+z": (1, 5, 7, 3),
    }
    kept = [face for side, face in faces.items() if side not in without]
    return Part(points, [face[::-1] if inwards else face for face in kept], **options)


def sphere(centre, radius, rings=8, segments=16, **options) -> Part:
    """A smooth-shaded ball."""
    polar = np.pi * np.arange(1, rings) / rings
    around = 2 * np.pi * np.arange(segments) / segments
    ring = np.stack([np.cos(around), np.sin(around)], axis=1)
    grid = [(*(np.sin(p) * xy), np.cos(p)) for p in polar for xy in ring]
    normals = np.array([*grid, (0, 0, 1), (0, 0, -1)])
    faces, top, bottom, last = [], len(grid), len(grid) + 1, (rings - 2) * segments
    for s in range(segments):
        after = (s + 1) % segments
        faces += [(top, s, after), (bottom, last + after, last + s)]
        faces += [
            (r * segments + s, (r + 1) * segments + s, (r + 1) * segments + after, r * segments + after)
            for r in range(rings - 2)
        ]
    return Part(np.asarray(centre) + radius * normals, faces, normals=normals, **options)


# ---- scenes ----


def closed_box(material=GREY, size=(1.0, 1.0, 1.0), lights=()) -> Scene:
    """The inside of a box with one corner at the origin."""
    return scene_of([box((0, 0, 0), size, inwards=True, material=material, name="box")], lights)


def two_plates(distance=1.0) -> Scene:
    """Unit squares that face each other; object 0 below, object 1 above (Howell's C-11)."""
    return scene_of(
        [
            rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), name="lower"),
            rectangle((0, 0, distance), (0, 1, 0), (1, 0, 0), name="upper"),
        ]
    )


def corner() -> Scene:
    """Unit squares with a common edge at a right angle (Howell's C-14)."""
    return scene_of(
        [
            rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), name="floor"),
            rectangle((0, 0, 0), (0, 1, 0), (0, 0, 1), name="wall"),
        ]
    )


def lamp(position=(0.5, 0.5, 0.7), intensity=(10.0, 8.0, 6.0), **options) -> PointLight:
    """A point light."""
    return PointLight("lamp", position, intensity, **options)


LAMP, HIGH_LAMP, CORNER_LAMP = lamp(), lamp((0.5, 0.5, 1.8)), lamp((0.2, 0.2, 0.9))


def cube_room(lights=(LAMP,), size=1.0, material=GREY) -> Scene:
    """A closed cube with a lamp."""
    return closed_box(material, (size, size, size), lights)


def room_with_occluder(lights=(HIGH_LAMP,), is_open=True) -> Scene:
    """A 1 x 1 x 2 m room, open to one side, with a horizontal board half across it at mid height."""
    walls = box((0, 0, 0), (1, 1, 2), inwards=True, without=("-y",) if is_open else (), name="room")
    board = rectangle((0.25, 0.25, 1), (0.5, 0, 0), (0, 0.5, 0), name="board")
    return scene_of([walls, board], lights)


def sphere_in_room(lights=(CORNER_LAMP,), material=GREY) -> Scene:
    """A smooth ball in the middle of a closed cube; the ball is object 1."""
    ball = sphere((0.5, 0.5, 0.4), 0.2, name="ball", material=material)
    return scene_of([box((0, 0, 0), (1, 1, 1), inwards=True, name="room", material=material), ball], lights)


def cornell_box() -> Scene:
    """Red and green walls, a glowing square below the ceiling, two blocks; 1 m wide, open in front."""
    white, red, green = (
        Material(name, rho)
        for name, rho in (("white", (0.73, 0.73, 0.73)), ("red", (0.6, 0.06, 0.05)), ("green", (0.12, 0.45, 0.1)))
    )
    glow = Material("glow", (0.7, 0.7, 0.7), radiance=(15.0, 11.0, 6.0))
    return scene_of(
        [
            box((0, 0, 0), (1, 1, 1), inwards=True, without=("-x", "+x", "-y"), material=white, name="white walls"),
            rectangle((0, 0, 0), (0, 1, 0), (0, 0, 1), material=red, name="red wall"),
            rectangle((1, 0, 0), (0, 0, 1), (0, 1, 0), material=green, name="green wall"),
            box((0.15, 0.55, 0), (0.45, 0.8, 0.6), without=("-z",), material=white, name="tall block"),
            box((0.55, 0.2, 0), (0.85, 0.5, 0.3), without=("-z",), material=white, name="short block"),
            rectangle((0.38, 0.38, 0.99), (0, 0.24, 0), (0.24, 0, 0), material=glow, name="lamp", is_target=False),
        ]
    )


# ---- the same scene elsewhere ----


def moved(scene: Scene, rotation=None, offset=(0.0, 0.0, 0.0), scale=1.0) -> Scene:
    """The scene rotated, scaled, then shifted; lamps give the same irradiance as before."""
    rotation = np.eye(3) if rotation is None else np.asarray(rotation)
    normals = scene.corner_normals.astype(np.float64) @ rotation.T
    return replace(
        scene,
        vertices=scale * scene.vertices @ rotation.T + np.asarray(offset),
        corner_normals=normals.astype(np.float32),
        lights=tuple(_moved_light(light, rotation, np.asarray(offset), scale) for light in scene.lights),
    )


def _moved_light(light, rotation, offset, scale):
    def place(point):
        return tuple(scale * rotation @ np.asarray(point) + offset)

    def turn(vector):
        return tuple(rotation @ np.asarray(vector))

    if isinstance(light, SunLight):
        return replace(light, direction=turn(light.direction))
    if isinstance(light, AreaLight):
        axes = {name: tuple(scale * np.array(turn(getattr(light, name)))) for name in ("axis_u", "axis_v")}
        return replace(light, centre=place(light.centre), **axes)
    return replace(
        light,
        position=place(light.position),
        intensity=tuple(scale**2 * np.array(light.intensity)),
        radius=scale * light.radius,
        direction=turn(light.direction),
    )


def random_rotation(rng):
    """A rotation matrix, uniform."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    return q
