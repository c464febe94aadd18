"""The demo room's furniture. Each function takes where the piece stands on the floor [m]."""

from __future__ import annotations

import bpy
import numpy as np

from .demo_shapes import (
    Shape,
    add_object,
    add_planar_uvs,
    box,
    cylinder,
    diffuse,
    joined,
    lathe,
    rounded_box,
    shape,
    sphere,
)
from .demo_textures import packed_image, rug

GAP = 0.0005  # [m] between things that touch, so that no two faces lie in one plane


def add_sofa(position, wood):
    """A two-seat sofa that looks along -y, with cushions and two pillows."""
    cloth = diffuse("blue-green cloth", (0.10, 0.235, 0.265))
    x, y, z = position
    frame = [
        rounded_box((1.56, 0.80, 0.16), 0.03).moved((x, y, z + 0.20)),
        rounded_box((1.56, 0.20, 0.44), 0.06).moved((x, y + 0.30, z + 0.502)),
        rounded_box((0.17, 0.86, 0.50), 0.06).moved((x - 0.868, y, z + 0.37)),
        rounded_box((0.17, 0.86, 0.50), 0.06).moved((x + 0.868, y, z + 0.37)),
    ]
    add_object("sofa", joined(*frame), cloth)
    leg = cylinder(0.022, 0.12 - 2 * GAP, 12)
    legs = [leg.moved((x + dx, y + dy, z + GAP)) for dx in (-0.7, 0.7) for dy in (-0.32, 0.32)]
    add_object("sofa legs", joined(*legs), wood)
    seats = [
        rounded_box((0.772, 0.60, 0.15), 0.05, flat_steps=3, bulge=0.02).moved((x + side * 0.388, y - 0.112, z + 0.378))
        for side in (-1, 1)
    ]
    add_object("sofa seat cushions", joined(*seats), cloth)
    for name, dx, colour, turn in (
        ("pillow ochre", -0.52, (0.60, 0.33, 0.05), 14),
        ("pillow rose", 0.55, (0.62, 0.30, 0.24), -10),
    ):
        add_object(name, _leaning_pillow(turn).moved((x + dx, y + 0.035, z + 0.655)), diffuse(name, colour))


def _leaning_pillow(turn_deg):
    flat = rounded_box((0.42, 0.42, 0.07), 0.034, flat_steps=3, bulge=0.045)
    angle = np.radians(68)
    cos, sin = np.cos(angle), np.sin(angle)
    upright = flat.points @ np.array([[1, 0, 0], [0, cos, sin], [0, -sin, cos]])
    return Shape(upright, flat.faces, flat.smooth, flat.slots).moved((0, 0, 0), turn_deg)


def add_table_and_rug(position, wood):
    """A woven rug and on it a round coffee table with a vase, a bowl of two oranges and a book."""
    x, y, z = position
    size = (2.10, 1.65, 0.012)
    low = np.array([x - size[0] / 2, y - size[1] / 2, z + GAP])
    carpet = add_object("rug", box(low, low + size), diffuse("rug", (0.4, 0.4, 0.4), packed_image("rug", rug())))
    add_planar_uvs(carpet, low, (size[0], 0, 0), (0, size[1], 0))

    y += 0.12
    foot, top = z + size[2] + 2 * GAP, z + 0.40
    slab = lathe([(0, 0), (0.40, 0), (0.40, 0.030), (0, 0.030)], 48, flat=(0, 2))
    parts = [slab.moved((x, y, top - 0.030))]
    for angle in np.radians([30, 150, 270]):
        leg = cylinder(0.020, top - 0.030 - GAP - foot, 12)
        parts.append(leg.moved((x + 0.28 * np.cos(angle), y + 0.28 * np.sin(angle), foot)))
    add_object("coffee table", joined(*parts), wood)

    add_object("vase", _vase().moved((x - 0.13, y + 0.10, top + GAP)), diffuse("vase glaze", (0.70, 0.72, 0.70)))
    fruit = diffuse("orange peel", (0.75, 0.25, 0.03))
    add_object("orange", sphere(0.042, 24, 12).moved((x + 0.16, y - 0.02, top + GAP + 0.042)), fruit)
    add_object("orange second", sphere(0.040, 24, 12).moved((x + 0.235, y + 0.035, top + GAP + 0.040)), fruit)
    book = box((-0.11, -0.08, 0), (0.11, 0.08, 0.026)).moved((x - 0.06, y - 0.21, top + GAP), 24)
    add_object("book on table", book, diffuse("book red", (0.45, 0.06, 0.05)))


def _vase():
    outside = [
        (0.0, 0.0), (0.045, 0.0), (0.058, 0.008), (0.078, 0.05), (0.088, 0.10), (0.084, 0.145), (0.064, 0.19),
        (0.042, 0.225), (0.034, 0.255), (0.037, 0.285), (0.048, 0.305),
    ]  # fmt: skip
    inside = [(0.044, 0.306), (0.033, 0.284), (0.030, 0.255), (0.038, 0.225), (0.05, 0.19), (0.0, 0.16)]
    return lathe(outside + inside, 36, flat=(0,))


def add_dining_set(position, wood):
    """A table along the window wall and two chairs."""
    x, y, z = position
    half = (0.40, 0.62)
    parts = [box((x - half[0], y - half[1], z + 0.715), (x + half[0], y + half[1], z + 0.745))]
    for dx in (-1, 1):
        for dy in (-1, 1):
            cx, cy = x + dx * (half[0] - 0.05), y + dy * (half[1] - 0.05)
            parts.append(box((cx - 0.025, cy - 0.025, z + GAP), (cx + 0.025, cy + 0.025, z + 0.715 - GAP)))
    add_object("table", joined(*parts), wood)
    seat = diffuse("woven seat", (0.55, 0.43, 0.27))
    walnut = diffuse("walnut", (0.13, 0.075, 0.045))
    add_object("chair side", _chair().moved((x + 0.60, y + 0.10, z), -98), walnut, seat)
    add_object("chair end", _chair().moved((x + 0.06, y + 0.92, z), 8), walnut, seat)
    outside = [(0, 0), (0.05, 0), (0.09, 0.02), (0.125, 0.055), (0.14, 0.085)]
    inside = [(0.134, 0.087), (0.118, 0.06), (0.08, 0.028), (0, 0.018)]
    bowl = lathe(outside + inside, 36, flat=(0,))
    add_object("bowl", bowl.moved((x - 0.05, y + 0.22, z + 0.745 + GAP)), diffuse("bowl glaze", (0.25, 0.38, 0.42)))


def _chair():
    """A chair at the origin that looks along -y; slot 1 is its seat."""
    legs = []
    for dx in (-0.19, 0.19):
        legs.append(box((dx - 0.016, -0.20, GAP), (dx + 0.016, -0.168, 0.43 - GAP)))
        legs.append(box((dx - 0.016, 0.178, GAP), (dx + 0.016, 0.21, 0.84)))
    rails = [box((-0.174 + GAP, 0.186, low), (0.174 - GAP, 0.202, low + 0.06)) for low in (0.56, 0.67, 0.78)]
    frame = [
        box((-0.174 + GAP, -0.196, 0.37), (0.174 - GAP, -0.176, 0.43 - GAP)),
        box((-0.174 + GAP, 0.182, 0.37), (0.174 - GAP, 0.202, 0.43 - GAP)),
    ]
    seat = rounded_box((0.43, 0.376, 0.035), 0.012).moved((0, -0.014, 0.4475)).in_slot(1)
    return joined(*legs, *rails, *frame, seat)


def add_bookcase(position, paint):
    """A bookcase with its back to the wall at ``position``, open along -x, with three rows of books and two vessels."""
    x1, y, z = position
    depth, width, height, board = 0.30, 1.10, 1.85, 0.022
    x0, y0, y1 = x1 - depth, y - width / 2, y + width / 2
    levels = [0.06, 0.42, 0.78, 1.14, 1.50]
    parts = [
        box((x0, y0, z + GAP), (x1, y0 + board, z + height)),
        box((x0, y1 - board, z + GAP), (x1, y1, z + height)),
        box((x0, y0 + board + GAP, z + height - board), (x1, y1 - board - GAP, z + height)),
        box((x1 - 0.008, y0 + board + GAP, z + GAP), (x1, y1 - board - GAP, z + height - board - GAP)),
    ]
    for level in levels:
        low, high = (x0 + 0.005, y0 + board + GAP, z + level - board), (x1 - 0.008 - GAP, y1 - board - GAP, z + level)
        parts.append(box(low, high))
    add_object("bookcase", joined(*parts), paint)

    covers = [
        diffuse(f"cover {name}", colour)
        for name, colour in (
            ("navy", (0.03, 0.06, 0.16)), ("cream", (0.66, 0.58, 0.42)), ("brick", (0.40, 0.09, 0.05)),
            ("green", (0.06, 0.19, 0.10)), ("ochre", (0.58, 0.32, 0.05)), ("grey", (0.30, 0.31, 0.33)),
        )
    ]  # fmt: skip
    spans = {0.42: (0.04, 0.80), 0.78: (0.28, 1.03), 1.14: (0.04, 0.66)}
    for row, (level, (start, stop)) in enumerate(spans.items()):
        row_of_books = _books(x1 - 0.03, y0 + start, y0 + stop, z + level + GAP, seed=row)
        add_object(f"books row {row + 1}", row_of_books, *covers)
    ball = sphere(0.085, 36, 18).moved((x0 + 0.15, y0 + 0.90, z + 1.14 + GAP + 0.085))
    add_object("ball", ball, diffuse("ball glaze", (0.74, 0.70, 0.62)))
    jar = _vase().moved((x0 + 0.15, y0 + 0.16, z + 0.78 + GAP))
    add_object("jar", jar, diffuse("jar glaze", (0.55, 0.24, 0.12)))


def _books(back, start, stop, level, seed):
    rng = np.random.default_rng(seed)
    books, y = [], start
    while True:
        thick, deep, high = rng.uniform(0.022, 0.048), rng.uniform(0.15, 0.20), rng.uniform(0.19, 0.285)
        if y + thick > stop:
            return joined(*books)
        book = box((back - deep, y, level), (back, y + thick, level + high))
        books.append(book.in_slot(int(rng.integers(6))))
        y += thick + 0.001


def add_lamp(position, metal):
    """A floor lamp: a small warm bulb in a glowing shade that is open above and below."""
    x, y, z = position
    low, high, bulb = 1.32, 1.60, 1.46
    stand = [
        lathe([(0, 0), (0.15, 0), (0.15, 0.018), (0, 0.018)], 32, flat=(0, 2)).moved((x, y, z + GAP)),
        cylinder(0.010, bulb - 0.06 - 0.018 - 2 * GAP, 12).moved((x, y, z + 0.018 + 2 * GAP)),
    ]
    # a cross of wires carries the shade
    for direction in (0, 90, 180, 270):
        wire = box((0.0095, -0.002, 0), (0.199, 0.002, 0.004)).moved((x, y, z + low + 0.02), direction)
        stand.append(wire)
    add_object("floor lamp", joined(*stand), metal)
    wall = 0.003
    outline = [(0.21, low), (0.15, high), (0.15 - wall, high), (0.21 - wall, low), (0.21, low)]
    shade = lathe(outline, 40, flat=(1, 3)).moved((x, y, z))
    glow = diffuse("lamp shade", (0.72, 0.62, 0.46), emission=(1.0, 0.62, 0.28), strength=0.55)
    add_object("lamp shade", shade, glow)

    light = bpy.data.lights.new("lamp bulb", "POINT")
    light.energy = 14.0  # [W]
    light.color = (1.0, 0.68, 0.36)
    light.shadow_soft_size = 0.04
    light.use_soft_falloff = False
    lamp = bpy.data.objects.new("lamp bulb", light)
    lamp.location = (x, y, z + bulb)
    bpy.context.scene.collection.objects.link(lamp)


def add_plant(position):
    """A pot with upright tapering leaves."""
    x, y, z = position
    profile = [(0, 0), (0.105, 0), (0.14, 0.27), (0.128, 0.27), (0.122, 0.235), (0, 0.235)]
    pot = lathe(profile, 36, flat=(0, 2, 4)).moved((x, y, z + GAP))
    add_object("plant pot", pot, diffuse("pot", (0.62, 0.60, 0.56)))
    rng = np.random.default_rng(5)
    leaves = []
    for i in range(13):
        angle, out = 2.4 * i, 0.015 + 0.075 * np.sqrt(i / 13)
        foot = (x + out * np.cos(angle), y + out * np.sin(angle), z + 0.225)
        leaf = _leaf(length=rng.uniform(0.45, 0.80), lean=rng.uniform(0.05, 0.22) + out, bend=rng.uniform(0.0, 0.3))
        leaves.append(leaf.moved(foot, np.degrees(angle)))
    add_object("plant", joined(*leaves), diffuse("leaf", (0.07, 0.17, 0.06)))


def _leaf(length, lean, bend, steps=8):
    """A blade that rises from the origin and leans along x: a flat rhombus as cross-section."""
    t = np.linspace(0, 1, steps + 1)[:-1]
    wide = 0.030 * np.sqrt(t + 0.25) * (1 - t**3)
    spine = np.stack([length * (lean * t + bend * t**2), np.zeros_like(t), length * t * (1 - 0.3 * bend * t)], axis=1)
    ring = np.array([[0.12, 0, 0], [0, 1, 0], [-0.12, 0, 0], [0, -1, 0]])
    points = (spine[:, None] + wide[:, None, None] * ring).reshape(-1, 3)
    tip = np.array([[length * (lean + bend), 0, length * (1 - 0.3 * bend)]])
    faces = []
    for ring_start in range(0, 4 * (steps - 1), 4):
        for i in range(4):
            j = (i + 1) % 4
            faces.append((ring_start + i, ring_start + j, ring_start + 4 + j, ring_start + 4 + i))
    last = 4 * (steps - 1)
    faces += [(last + i, last + (i + 1) % 4, last + 4) for i in range(4)]
    faces.append((3, 2, 1, 0))
    return shape(np.concatenate([points, tip]), faces, smooth=True)
