"""The demo room: a living room of 4.2 x 5 x 2.7 m on a late afternoon, with sun, sky and a lamp in the corner."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from .demo_furniture import add_bookcase, add_dining_set, add_lamp, add_plant, add_sofa, add_table_and_rug
from .demo_shapes import Shape, add_object, add_planar_uvs, box, cylinder, diffuse, joined, panel, shape, sphere
from .demo_textures import packed_image, painting, planks

WIDTH, DEPTH, HEIGHT = 4.2, 5.0, 2.7  # [m] inside: x from the window wall, y from the camera's wall, z
WALL = 0.22  # [m] thickness
GAP = 0.0005  # [m] between things that touch, so that no two faces lie in one plane
WINDOW = (1.55, 0.75, 3.65, 2.35)  # [m] y0, z0, y1, z1 of the opening in the wall x = 0
SUN_TRAVELS = (0.80, 0.06, -0.60)


@dataclass(frozen=True, slots=True)
class Palette:
    """The materials that several objects share."""

    plaster: bpy.types.Material
    white: bpy.types.Material
    oak: bpy.types.Material
    metal: bpy.types.Material


def build_room():
    """Fill the current, empty scene with the furnished room, its sun, sky, lamp and camera."""
    palette = Palette(
        plaster=diffuse("plaster", (0.78, 0.75, 0.70)),
        white=diffuse("white paint", (0.82, 0.81, 0.78)),
        oak=diffuse("oak", (0.40, 0.25, 0.13)),
        metal=diffuse("dark metal", (0.05, 0.05, 0.055)),
    )
    _add_shell(palette)
    _add_window(palette)
    _add_curtains(palette)
    _add_door(palette)
    _add_picture(palette)
    _add_skirting(palette)
    add_sofa((1.55, DEPTH - 0.50, 0.0), palette.oak)
    add_table_and_rug((2.06, 3.20, 0.0), palette.oak)
    add_dining_set((0.62, 2.00, 0.0), palette.oak)
    add_bookcase((WIDTH - 0.016, 3.65, 0.0), palette.white)
    add_lamp((2.88, DEPTH - 0.42, 0.0), palette.metal)
    add_plant((0.42, DEPTH - 0.42, 0.0))
    _add_sun_and_sky()
    _add_camera()


def _add_shell(palette):
    """Floor, ceiling and walls, one object each, facing the room; the window's wall is solid and has a facade too."""
    terracotta = diffuse("terracotta", (0.50, 0.19, 0.115))
    boards = diffuse("oak boards", (0.40, 0.25, 0.14), packed_image("oak boards", planks()))
    w, d, h = WIDTH, DEPTH, HEIGHT
    up = (0, 0, h)

    floor = add_object("floor", panel((0, 0, 0), (w, 0, 0), (0, d, 0)), boards)
    add_planar_uvs(floor, (0, 0, 0), (d, 0, 0), (0, d, 0))
    add_object("ceiling", panel((0, d, h), (w, 0, 0), (0, -d, 0)), palette.white)
    add_object("back wall", panel((0, d, 0), (w, 0, 0), up), palette.plaster)
    add_object("right wall", panel((w, d, 0), (0, -d, 0), up), terracotta)
    add_object("camera wall", panel((w, 0, 0), (-w, 0, 0), up), palette.plaster)
    y0, z0, y1, z1 = WINDOW
    inside = panel((0, 0, 0), (0, d, 0), up, (y0 / d, z0 / h, y1 / d, z1 / h))
    add_object("window wall", joined(inside, _reveal()), palette.plaster)
    add_object("facade", _facade(), diffuse("render", (0.60, 0.58, 0.54)))


def _reveal():
    """The four sides of the opening, from the room to the open air; they face its middle."""
    y0, z0, y1, z1 = WINDOW
    rim = [(y0, z0), (y1, z0), (y1, z1), (y0, z1)]
    points = [(x, y, z) for x in (-WALL, 0.0) for y, z in rim]
    return shape(points, [(i, 4 + i, 4 + (i + 1) % 4, (i + 1) % 4) for i in range(4)])


def _facade():
    """The outside of the window's wall and its four narrow ends."""
    d, h = DEPTH, HEIGHT
    y0, z0, y1, z1 = WINDOW
    thick, along, up = (WALL, 0, 0), (0, d, 0), (0, 0, h)
    opening = ((d - y1) / d, z0 / h, (d - y0) / d, z1 / h)
    return joined(
        panel((-WALL, d, 0), (0, -d, 0), up, opening),
        panel((-WALL, 0, 0), thick, up),
        panel((0, d, 0), (-WALL, 0, 0), up),
        panel((-WALL, 0, h), thick, along),
        panel((0, 0, 0), (-WALL, 0, 0), along),
    )


def _add_window(palette):
    """A frame with a post and a rail in each half, and a sill that stands out into the room."""
    y0, z0, y1, z1 = WINDOW
    y0, z0, y1, z1 = y0 + GAP, z0 + GAP, y1 - GAP, z1 - GAP
    back, front = -0.15, -0.09
    bar, thin = 0.055, 0.028
    middle = (y0 + y1) / 2
    rail = z0 + 0.70 * (z1 - z0)
    frame = [
        box((back, y0, z0), (front, y0 + bar, z1)),
        box((back, y1 - bar, z0), (front, y1, z1)),
        box((back, middle - bar, z0), (front, middle + bar, z1)),
    ]
    for left, right in ((y0 + bar + GAP, middle - bar - GAP), (middle + bar + GAP, y1 - bar - GAP)):
        frame += [
            box((back, left, z0), (front, right, z0 + bar)),
            box((back, left, z1 - bar), (front, right, z1)),
            box((back + 0.015, left, rail - thin / 2), (front - 0.015, right, rail + thin / 2)),
        ]
    add_object("window frame", joined(*frame), palette.white)
    sill_top = WINDOW[1] - GAP
    sill = box((GAP, y0 - 0.08, sill_top - 0.035), (0.10, y1 + 0.08, sill_top))
    add_object("window sill", sill, palette.white)


def _add_curtains(palette):
    """Two drawn-back curtains of folded cloth, 3 mm thick, on a rod."""
    linen = diffuse("linen", (0.74, 0.68, 0.58))
    y0, _, y1, z1 = WINDOW
    for name, start, stop in (("curtain near", y0 - 0.42, y0 - 0.02), ("curtain far", y1 + 0.02, y1 + 0.42)):
        add_object(name, _folds(start, stop, 0.02, z1 + 0.19), linen)
    length = y1 - y0 + 1.0
    rod = cylinder(0.011, length, 12)
    along_y = rod.points[:, [1, 2, 0]] + (0.085, y0 - 0.5, z1 + 0.165)
    knobs = [sphere(0.022, 16, 8).moved((0.085, y, z1 + 0.165)) for y in (y0 - 0.5, y1 + 0.5)]
    holders = [box((GAP, y - 0.008, z1 + 0.157), (0.074, y + 0.008, z1 + 0.173)) for y in (y0 - 0.46, y1 + 0.46)]
    rod = Shape(along_y, rod.faces, rod.smooth, rod.slots)
    add_object("curtain rod", joined(rod, *knobs, *holders), palette.metal)


def _folds(start, stop, low, high, folds=6, steps=72):
    t = np.linspace(0, 1, steps + 1)
    y = start + t * (stop - start)
    wave = np.sin(2 * np.pi * folds * t) + 0.25 * np.sin(2 * np.pi * 2.3 * t + 1)
    room_side, wall_side = 0.085 + 0.032 * wave, 0.082 + 0.032 * wave
    outline = np.concatenate([np.stack([room_side, y], 1), np.stack([wall_side, y], 1)[::-1]])
    count = len(outline)
    points = np.concatenate([np.insert(outline, 2, z, axis=1) for z in (low, high)])
    # the outline runs counter-clockwise seen from above: along the room's side with y, back along the wall's
    sides = [(i, (i + 1) % count, count + (i + 1) % count, count + i) for i in range(count)]
    hems = [(count - 1 - i, count - 2 - i, i + 1, i) for i in range(steps)]
    hems += [tuple(count + corner for corner in reversed(hem)) for hem in hems]
    ends = {steps, count - 1}
    smooth = [i not in ends for i in range(count)] + [False] * len(hems)
    return Shape(points, sides + hems, smooth, [0] * len(smooth))


def _add_door(palette):
    """A panelled door in the back wall with its architrave and a knob."""
    x0, x1, top, wall = 3.12, 3.98, 2.05, DEPTH - GAP
    leaf = [box((x0 + GAP, wall - 0.018, 0.006), (x1 - GAP, wall, top - GAP))]
    for z0, z1 in ((0.18, 0.86), (1.02, 1.90)):
        for left, right in ((x0 + 0.11, x0 + 0.39), (x0 + 0.47, x0 + 0.75)):
            leaf.append(box((left, wall - 0.030, z0), (right, wall - 0.018 - GAP, z1)))
    add_object("door", joined(*leaf), palette.white)
    trim = 0.075
    frame = [
        box((x0 - trim, wall - 0.040, GAP), (x0, wall, top)),
        box((x1, wall - 0.040, GAP), (x1 + trim, wall, top)),
        box((x0 - trim, wall - 0.040, top + GAP), (x1 + trim, wall, top + trim)),
    ]
    add_object("door frame", joined(*frame), palette.white)
    knob = sphere(0.026, 20, 10).moved((x0 + 0.055, wall - 0.075, 1.0))
    neck = box((x0 + 0.047, wall - 0.052, 0.992), (x0 + 0.063, wall - 0.018 - GAP, 1.008))
    add_object("door knob", joined(knob, neck), diffuse("brass", (0.55, 0.36, 0.12)))


def _add_picture(palette):
    """A framed landscape over the sofa."""
    width, height, bar = 1.20, 0.84, 0.03
    x, z, wall = 1.55, 1.66, DEPTH - GAP
    x0, x1, z0, z1 = x - width / 2, x + width / 2, z - height / 2, z + height / 2
    canvas = add_object(
        "picture",
        box((x0, wall - 0.012, z0), (x1, wall, z1)),
        diffuse("painting", (0.5, 0.5, 0.5), packed_image("painting", painting())),
    )
    add_planar_uvs(canvas, (x0, wall, z0), (width, 0, 0), (0, 0, height))
    frame = [
        box((x0 - bar, wall - 0.028, z0 - bar), (x1 + bar, wall, z0 - GAP)),
        box((x0 - bar, wall - 0.028, z1 + GAP), (x1 + bar, wall, z1 + bar)),
        box((x0 - bar, wall - 0.028, z0), (x0 - GAP, wall, z1)),
        box((x1 + GAP, wall - 0.028, z0), (x1 + bar, wall, z1)),
    ]
    add_object("picture frame", joined(*frame), palette.oak)


def _add_skirting(palette):
    """Boards along the foot of the walls, interrupted by the door."""
    thick, top = 0.014, 0.09
    w, d = WIDTH - GAP, DEPTH - GAP
    boards = [
        box((GAP, thick + 2 * GAP, GAP), (thick, d - thick - GAP, top)),
        box((w - thick, thick + 2 * GAP, GAP), (w, d - thick - GAP, top)),
        box((GAP, GAP, GAP), (w, thick + GAP, top)),
        box((GAP, d - thick, GAP), (3.045 - GAP, d, top)),
        box((4.055 + GAP, d - thick, GAP), (w, d, top)),
    ]
    add_object("skirting boards", joined(*boards), palette.white)


def _add_sun_and_sky():
    light = bpy.data.lights.new("sun", "SUN")
    light.energy = 6.0  # [W/m^2]
    light.color = (1.0, 0.86, 0.66)
    light.angle = np.radians(0.53)
    sun = bpy.data.objects.new("sun", light)
    sun.rotation_euler = Vector(SUN_TRAVELS).to_track_quat("-Z", "Y").to_euler()
    sun.location = (-3, 2, 4)
    bpy.context.scene.collection.objects.link(sun)

    sky = bpy.data.worlds.new("sky")
    sky.use_nodes = True
    background = sky.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (0.80, 0.91, 1.0, 1.0)
    background.inputs["Strength"].default_value = 1.2
    bpy.context.scene.world = sky


def _add_camera():
    camera = bpy.data.cameras.new("camera")
    camera.lens = 21.0  # [mm]
    camera.clip_start = 0.02
    camera.shift_y = -0.055  # level, so that verticals stay vertical, with more floor than ceiling
    obj = bpy.data.objects.new("camera", camera)
    obj.location = (2.62, 0.14, 1.38)
    obj.rotation_euler = (np.radians(90), 0, np.radians(9.0))
    scene = bpy.context.scene
    scene.collection.objects.link(obj)
    scene.camera = obj
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
