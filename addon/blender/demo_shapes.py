"""Shapes of the demo scenes: points and faces by NumPy, then meshes and materials by Blender's data API."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

RIM = np.radians(60.0)  # edges that bend by more are sharp, whatever is smooth around them


@dataclass(frozen=True, slots=True)
class Shape:
    """Points and faces, not yet in Blender.

    Attributes
    ----------
    points : float64 (V, 3) [m]
    faces : tuples of point indices, counter-clockwise seen from outside
    smooth : one bool per face; the edges of a flat face are sharp
    slots : one material slot per face
    """

    points: np.ndarray
    faces: list[tuple[int, ...]]
    smooth: list[bool]
    slots: list[int]

    def moved(self, offset, turn_deg=0.0):
        """The shape turned about the z axis of its own origin, then moved."""
        angle = np.radians(turn_deg)
        cos, sin = np.cos(angle), np.sin(angle)
        rotation = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        return Shape(self.points @ rotation + np.asarray(offset), self.faces, self.smooth, self.slots)

    def in_slot(self, slot):
        """The shape with all its faces in one material slot."""
        return Shape(self.points, self.faces, self.smooth, [slot] * len(self.faces))


def shape(points, faces, smooth=False):
    """A shape whose faces are all smooth or all flat, in material slot 0."""
    faces = [tuple(int(i) for i in face) for face in faces]
    return Shape(np.asarray(points, float), faces, [smooth] * len(faces), [0] * len(faces))


def joined(*shapes):
    """Several shapes as one; their points stay apart."""
    starts = np.cumsum([0] + [len(part.points) for part in shapes])
    faces = [tuple(i + int(start) for i in face) for part, start in zip(shapes, starts) for face in part.faces]
    smooth = [flag for part in shapes for flag in part.smooth]
    slots = [slot for part in shapes for slot in part.slots]
    return Shape(np.concatenate([part.points for part in shapes]), faces, smooth, slots)


def box(low, high):
    """A box with sharp edges between two opposite corners."""
    x, y, z = np.stack([np.minimum(low, high), np.maximum(low, high)], axis=1)
    points = [(x[i], y[j], z[k]) for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return shape(points, faces)


def rounded_box(size, radius, flat_steps=1, arc_steps=2, bulge=0.0):
    """A smooth box with round edges, centred on the origin; ``bulge`` [m] lifts top and bottom as a cushion's."""
    half = np.asarray(size, float) / 2
    axes = [_rounded_axis(h, radius, flat_steps, arc_steps) for h in half]
    grids, faces, start = [], [], 0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (-1, 1):
            grid = np.empty((len(axes[u]), len(axes[v]), 3))
            grid[..., axis] = side * half[axis]
            grid[..., u], grid[..., v] = np.meshgrid(axes[u], axes[v], indexing="ij")
            grids.append(grid.reshape(-1, 3))
            faces += _grid_faces(start, *grid.shape[:2], flip=side < 0)
            start += len(grids[-1])
    points = np.concatenate(grids)
    unique, inverse = np.unique(points.round(9), axis=0, return_inverse=True)
    inner = np.clip(unique, radius - half, half - radius)
    outward = unique - inner
    round_points = inner + radius * outward / np.linalg.norm(outward, axis=1, keepdims=True)
    swell = np.prod(1 - (round_points[:, :2] / half[:2]) ** 2, axis=1)
    round_points[:, 2] += bulge * swell * np.sign(round_points[:, 2])
    return shape(round_points, [tuple(inverse.ravel()[list(face)]) for face in faces], smooth=True)


def _rounded_axis(half, radius, flat_steps, arc_steps):
    # steps of equal angle on the arc: a tangent, as the points are pushed out from a cube's surface
    arc = half - radius + radius * np.tan(np.linspace(0, np.pi / 4, arc_steps + 1))[1:]
    flat = np.linspace(radius - half, half - radius, flat_steps + 1)
    return np.concatenate([-arc[::-1], flat, arc])


def _grid_faces(start, rows, columns, flip=False):
    first = start + np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)
    quads = np.stack([first, first + columns, first + columns + 1, first + 1], axis=-1).reshape(-1, 4)
    return [tuple(quad) for quad in (quads[:, ::-1] if flip else quads)]


def lathe(profile, segments=24, flat=()):
    """A profile of (radius, z) rows turned about the z axis; outside lies to the right of its direction.

    The profile may start and end on the axis. ``flat`` names the profile's edges whose faces are flat, with sharp rims.
    """
    profile = np.asarray(profile, float)
    edge_count = len(profile) - 1
    # a profile that comes back to its start shares the first ring
    ring_count = edge_count if np.array_equal(profile[0], profile[-1]) else len(profile)
    faces, smooth = [], []
    for edge in range(edge_count):
        a, b = edge * segments, (edge + 1) % ring_count * segments
        for i in range(segments):
            j = (i + 1) % segments
            if profile[edge, 0] == 0:
                faces.append((a, b + j, b + i))
            elif profile[edge + 1, 0] == 0:
                faces.append((a + i, a + j, b))
            else:
                faces.append((a + i, a + j, b + j, b + i))
            smooth.append(edge not in flat)
    turned = _without_unused(_rings(profile[:ring_count], segments), faces)
    return Shape(turned.points, turned.faces, smooth, [0] * len(faces))


def _rings(profile, segments):
    angles = np.arange(segments) * (2 * np.pi / segments)
    radius, height = profile[:, :1], np.broadcast_to(profile[:, 1:], (len(profile), segments))
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), height], axis=-1).reshape(-1, 3)


def _without_unused(points, faces):
    used = np.unique(np.concatenate([np.asarray(face) for face in faces]))
    renumbered = np.full(len(points), -1)
    renumbered[used] = np.arange(len(used))
    return shape(points[used], [tuple(renumbered[list(face)]) for face in faces])


def cylinder(radius, height, segments=20):
    """A cylinder that stands on the origin: round side, flat ends."""
    return lathe([(0, 0), (radius, 0), (radius, height), (0, height)], segments, flat=(0, 2))


def sphere(radius, segments=32, rings=16):
    """A smooth sphere around the origin."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    profile = np.stack([radius * np.cos(angles), radius * np.sin(angles)], axis=1)
    profile[[0, -1], 0] = 0
    return lathe(profile, segments)


def panel(origin, u, v, hole=None):
    """A rectangle from ``origin`` along ``u`` and ``v``, facing u x v; ``hole`` = (u0, v0, u1, v1) in shares."""
    us, vs = ([0, 1], [0, 1]) if hole is None else ([0, hole[0], hole[2], 1], [0, hole[1], hole[3], 1])
    points = [np.asarray(origin) + s * np.asarray(u) + t * np.asarray(v) for t in vs for s in us]
    columns = len(us)
    faces = [
        (j * columns + i, j * columns + i + 1, (j + 1) * columns + i + 1, (j + 1) * columns + i)
        for j in range(len(vs) - 1)
        for i in range(columns - 1)
        if hole is None or (i, j) != (1, 1)
    ]
    return shape(points, faces)


def add_object(name, form, *materials):
    """Make a mesh object of a shape in the current scene; the shape's slot k shows ``materials[k]``."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(form.points.tolist(), [], form.faces)
    mesh.polygons.foreach_set("use_smooth", form.smooth)
    for entry in materials:
        mesh.materials.append(entry)
    mesh.polygons.foreach_set("material_index", form.slots)
    mesh.update()
    mesh.set_sharp_from_angle(angle=RIM)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def add_planar_uvs(obj, origin, u, v):
    """Give an object the UV layer "UVMap": its points seen from ``origin`` in units of ``u`` and ``v`` (world axes)."""
    mesh = obj.data
    points = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", points)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    axes = np.stack([np.asarray(axis, float) / np.dot(axis, axis) for axis in (u, v)], axis=1)
    uvs = (points.reshape(-1, 3) - np.asarray(origin)) @ axes
    layer = mesh.uv_layers.new(name="UVMap", do_init=False)
    layer.uv.foreach_set("vector", uvs[corners].astype(np.float32).ravel())


def diffuse(name, colour, image=None, emission=None, strength=0.0):
    """A Lambertian material: Principled without gloss. ``colour`` is linear Rec.709; an image replaces it."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.diffuse_color = (*colour, 1.0)
    principled = made.node_tree.nodes["Principled BSDF"]
    principled.inputs["Base Color"].default_value = (*colour, 1.0)
    principled.inputs["Roughness"].default_value = 1.0
    principled.inputs["Specular IOR Level"].default_value = 0.0
    if emission is not None:
        principled.inputs["Emission Color"].default_value = (*emission, 1.0)
        principled.inputs["Emission Strength"].default_value = strength
    if image is not None:
        lookup = made.node_tree.nodes.new("ShaderNodeTexImage")
        lookup.image = image
        lookup.location = (-320, 300)
        made.node_tree.links.new(lookup.outputs["Color"], principled.inputs["Base Color"])
    return made
