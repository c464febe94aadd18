"""Scenes by chance for hypothesis: every mesh that a file may hold, and numbers that none should."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from addon.core.environment import Environment
from addon.core.scene import AreaLight, Back, Material, PointLight, Scene, SceneObject, SunLight, Texture

# lengths at which something breaks: denormal, lost in float32, a hair, a room, a planet, lost in float64, none at all
SMALL = (0.0, -0.0, 5e-324, 1e-30, -1e-30, 1e-7, -1e-3)
LARGE = (0.5, 1.0, -1.0, 1e4, 1e7, -1e8, 1e15, 1e30, np.nan, np.inf, -np.inf)
SCALES = (1.0, 1.0, 1.0, 1.0, 1e-3, 1e3, 1e-7, 1e6, 1e-30, 1e30)
OFFSETS = (0.0, 0.0, 0.0, 1.0, 1e3, -1e7, 1e30)
SHARES = (0.0, 0.3, 0.8, 1.0)
BRIGHTNESSES = (0.0, 1e-30, 1.0, 100.0, 1e15)

coordinate = st.sampled_from((0.0, 0.5, 1.0)) | st.floats(-1, 1)
colour = st.tuples(*[st.sampled_from(SHARES)] * 3)
brightness = st.tuples(*[st.sampled_from(BRIGHTNESSES)] * 3)
position = st.tuples(coordinate, coordinate, coordinate)


# ---- meshes: vertices (V, 3) and triangles (T, 3) ----


def box_mesh():
    points = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return np.array(points, float), _halves(quads)


def sheet_mesh():
    return np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float), _halves([(0, 1, 2, 3)])


def fan_mesh():
    """Three triangles on one edge: no manifold."""
    points = [(0, 0, 0), (0, 0, 1), (1, 0, 0.5), (-0.5, 0.8, 0.5), (-0.5, -0.8, 0.5)]
    return np.array(points, float), np.array([(0, 1, 2), (0, 1, 3), (0, 1, 4)])


def line_mesh():
    """Faces without an area: a line whose corners no float holds, a doubled corner, a point."""
    points = [(0.2, 0.2, 0.7), (0.4, 0.4, 0.7), (0.8, 0.8, 0.7)]
    return np.array(points), np.array([(0, 1, 2), (0, 1, 1), (2, 2, 2)])


def sliver_mesh():
    return np.array([(0, 0, 0.3), (1, 0, 0.3), (0.5, 1e-6, 0.3), (1, 1e-6, 0.3)]), np.array([(0, 1, 2), (1, 3, 2)])


def empty_mesh():
    return np.zeros((0, 3)), np.zeros((0, 3), int)


def _halves(quads):
    return np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


@st.composite
def soups(draw):
    """Triangles over a few shared points, some of them odd."""
    points = draw(st.lists(position, min_size=3, max_size=9))
    row = st.tuples(*[st.integers(0, len(points) - 1)] * 3)
    return np.array(points, float), np.array(draw(st.lists(row, min_size=1, max_size=12)))


MESHES = st.sampled_from((box_mesh, box_mesh, sheet_mesh, fan_mesh, line_mesh, sliver_mesh, empty_mesh))
meshes = MESHES.map(lambda make: make()) | soups()


@st.composite
def placed_meshes(draw):
    """A mesh somewhere at some size; perhaps turned inside out, doubled, back to back, or with odd corners."""
    points, triangles = draw(meshes)
    points = points * draw(st.sampled_from(SCALES)) + draw(st.sampled_from(OFFSETS)) + np.array(draw(position)) * 0.3
    twin = draw(st.sampled_from(("none", "none", "inside out", "doubled", "back to back")))
    if twin == "inside out":
        triangles = triangles[:, ::-1]
    elif twin != "none":
        triangles = np.concatenate([triangles, triangles[:, ::-1] if twin == "back to back" else triangles])
    for _ in range(draw(st.sampled_from((0, 0, 0, 1, 2))) if len(points) else 0):
        points[draw(st.integers(0, len(points) - 1)), draw(st.integers(0, 2))] = draw(st.sampled_from(SMALL + LARGE))
    return points, triangles


# ---- what is on them ----


@st.composite
def textures(draw):
    height, width = draw(st.sampled_from(((1, 1), (1, 3), (2, 2))))
    value = draw(st.sampled_from((0.0, 0.5, 1.0, 1e15)))
    return Texture("image", np.full((height, width, 3), value, np.float32))


@st.composite
def environments(draw):
    """Dark but for one pixel, or even: no brighter than the world's radiance may be."""
    height, width = draw(st.sampled_from(((1, 1), (1, 3), (4, 8), (64, 128))))
    pixels = np.full((height, width, 3), draw(st.sampled_from((0.0, 1e-30, 1e-6, 1.0))), np.float32)
    pixels[draw(st.integers(0, height - 1)), draw(st.integers(0, width - 1))] = draw(st.sampled_from((0.0, 1.0)))
    return Environment("sky", pixels, np.roll(np.eye(3), draw(st.integers(0, 2)), axis=0))


@st.composite
def materials(draw):
    """Transmittance, translucence and glow are rare, so that most scenes have surfaces to light."""
    clear = draw(st.sampled_from(((0.0, 0.0, 0.0),) * 4 + ((1.0, 1.0, 1.0), (0.5, 0.0, 0.0), (0.3, 0.3, 0.3))))
    through = draw(st.sampled_from(((0.0, 0.0, 0.0),) * 5 + ((0.2, 0.3, 0.0),)))
    glow = draw(st.just((0.0, 0.0, 0.0)) | brightness)
    image = st.none() | st.none() | textures()
    tint, shown = draw(image), draw(image)
    if shown and max(glow) * shown.pixels.max() > 1e15:  # refused, as test_scene.py shows
        shown = None
    cut_out, mask = draw(image), draw(image)
    if cut_out and cut_out.pixels.max() > 1:  # refused, too, as is what gives more than it gets
        cut_out = None
    reflected = np.array(draw(colour))
    most = (1 - np.array(clear)) / max(1 - np.mean(clear), 1e-9)
    dimmed = np.minimum(1, most / np.maximum(reflected + through, 1e-9)).min()
    reflected, through = (tuple(float(x) for x in dimmed * np.array(part)) for part in (reflected, through))
    made = Material("stuff", reflected, tint, glow, shown, clear, cut_out, through, mask)
    if not made.is_translucent:
        other = Back(draw(colour), draw(image), draw(brightness))
        side = {"open_side": draw(st.sampled_from(("front", "back"))), "back": draw(st.sampled_from((None, other)))}
        made = replace(made, **draw(st.sampled_from(({}, {}, {}, {"back": other}, side))))
    seen_by = draw(st.sampled_from(((True, True),) * 5 + ((True, False), (False, True), (False, False))))
    return made if all(seen_by) else made.seen_by(*seen_by)


@st.composite
def point_lights(draw):
    cone = draw(st.sampled_from(((-2.0, -2.0), (0.5, 0.7), (0.9, 0.9), (0.7, 0.5))))
    radius = draw(st.sampled_from((0.0, 0.0, 1e-30, 0.1, 10.0)))
    towards = draw(st.sampled_from(((0.0, 0.0, -1.0), (1e-9, 0.0, 0.0), (3.0, 4.0, 0.0))))
    lamp = PointLight("lamp", draw(position), draw(brightness), radius, draw(st.booleans()), towards, cone)
    profile, power = draw(st.none() | st.none() | environments()), draw(st.sampled_from((0.0, 0.0, 1.0, 2.0)))
    return replace(lamp, profile=profile, distance_power=power)


@st.composite
def area_lights(draw):
    axes = st.sampled_from(((0.3, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.0), (1e-20, 0.0, 0.0), (1e6, 0.0, 1e6)))
    spread = draw(st.sampled_from((np.pi, np.pi, 1.0, 1e-3, 0.0)))
    return AreaLight("panel", draw(position), draw(axes), draw(axes), draw(brightness), draw(st.booleans()), spread)


@st.composite
def sun_lights(draw):
    towards = draw(st.sampled_from(((0.0, 0.0, -1.0), (1e-9, 1e-9, 1e-9), (1e9, 0.0, -1e9))))
    return SunLight("sun", towards, draw(brightness), draw(st.sampled_from((0.0, 0.01, 1.0, np.pi))))


@st.composite
def lights_with_or_without_shadows(draw):
    light = draw(point_lights() | area_lights() | sun_lights())
    return light if draw(st.sampled_from((True, True, False))) else replace(light, casts_shadow=False)


lights = st.lists(lights_with_or_without_shadows(), max_size=3)
texture_uvs = st.sampled_from((0.0, 0.3, -7.5, 1e30, np.nan, np.inf))
atlas_uvs = st.sampled_from((0.0, 0.2, 0.5, 1.0)) | st.floats(0, 1, width=32)
bad_uvs = st.sampled_from((np.nan, np.inf, -0.1, 1.1))


@st.composite
def scenes(draw):
    """A core Scene of one to three objects; as sound as Scene's own checks ask for, and no sounder."""
    parts = draw(st.lists(placed_meshes(), min_size=1, max_size=3))
    owners = np.repeat(np.arange(len(parts)), [len(t) for _, t in parts])
    bases = np.concatenate([[0], np.cumsum([len(p) for p, _ in parts])[:-1]])
    triangles = np.concatenate([t + base for (_, t), base in zip(parts, bases)]).reshape(-1, 3)
    vertices = np.concatenate([p for p, _ in parts])
    count = len(triangles)
    return Scene(
        vertices=vertices,
        triangles=triangles.astype(np.int32),
        corner_normals=_normals(draw, vertices[triangles]),
        uvs=np.full((count, 3, 2), draw(texture_uvs), np.float32),
        triangle_materials=owners.astype(np.int32),
        objects=_objects(draw, parts),
        materials=tuple(draw(materials()) for _ in parts),
        lights=tuple(draw(lights)),
        world_radiance=draw(st.just((0.0, 0.0, 0.0)) | brightness),
        environment=draw(st.none() | st.none() | environments()),
    )


def _normals(draw, corners):
    kind = draw(st.sampled_from(("flat", "flat", "zero", "nan", "long", "across", "against")))
    with np.errstate(all="ignore"):
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        flat = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    fills = {"zero": 0.0, "nan": np.nan, "long": 1e30}
    if kind in fills:
        flat = np.full_like(flat, fills[kind])
    elif kind == "across":
        flat = np.roll(flat, 1, axis=1)
    return np.repeat((-flat if kind == "against" else flat)[:, None], 3, axis=1).astype(np.float32)


def _objects(draw, parts):
    first, objects = 0, []
    for number, (_, triangles) in enumerate(parts):
        count = len(triangles)
        obj = SceneObject(f"object {number}", first, count, draw(st.sampled_from((True, True, True, False))))
        if draw(st.booleans()):
            obj = replace(obj, **_loops(draw, triangles))
        if draw(st.booleans()):
            values = draw(st.lists(atlas_uvs, min_size=6, max_size=6))
            uvs = np.resize(np.array(values, np.float32), (count, 3, 2))
            if draw(st.sampled_from((False, False, False, True))) and count:
                uvs[0, 0, 0] = draw(bad_uvs)
            obj = replace(obj, lightmap_uvs=uvs)
        objects.append(obj)
        first += count
    return tuple(objects)


def _loops(draw, triangles):
    """Polygons of one or two triangles with a loop per vertex of each, sharp edges anywhere."""
    count, size = len(triangles), draw(st.sampled_from((1, 2)))
    polygons = np.arange(count) // size
    loops = np.unique(polygons[:, None] * 1000 + triangles, return_inverse=True)[1].reshape(count, 3)
    sharp = np.resize([draw(st.booleans()), False, True, False], (count, 3))
    return {"polygons": polygons.astype(np.int32), "corners": loops.astype(np.int32), "sharp_edges": sharp}
