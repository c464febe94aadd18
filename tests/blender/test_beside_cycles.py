"""A room of panels with what materials do to light in it, baked here and by Cycles: the same light on every panel."""

from __future__ import annotations

from math import cos, pi, sin

import bpy
import numpy as np
import pytest

from addon.blender.read_scene import read_scene
from addon.core.bake import bake
from addon.core.settings import BakeSettings

pytestmark = pytest.mark.usefixtures("empty_file")

SIDE, TILE = 64, 21  # texels of the lightmap, of a panel in it
PLACES = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1)]  # of the panels, in tiles
SAMPLES = 256  # of Cycles for a texel; a panel has 361
AGREED = 0.01  # some four times the noise of a mean by Cycles, of which paths that find a lamp late are the most

PANELS = [  # a corner and two sides: they look inwards
    ((0, 0, 0), (4, 0, 0), (0, 4, 0)),
    ((0, 0, 3), (0, 4, 0), (4, 0, 0)),
    ((0, 0, 0), (0, 4, 0), (0, 0, 3)),
    ((4, 0, 0), (0, 0, 3), (0, 4, 0)),
    ((0, 4, 0), (0, 0, 3), (4, 0, 0)),
]


@pytest.fixture
def room(add_mesh, nodes):
    """Five sides of a room as one object, the sixth is open; each has a place in the lightmap."""
    material, tree = nodes("wall")
    tree.show(tree.new("BsdfDiffuse", Color=(0.7, 0.5, 0.3, 1)))
    points = [tuple(np.add(c, offset)) for c, u, v in PANELS for offset in ((0, 0, 0), u, np.add(u, v), v)]
    made = add_mesh("room", points, [tuple(range(4 * k, 4 * k + 4)) for k in range(5)], material)
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    uvs = np.array([np.add(place, corners) * TILE / SIDE for place in PLACES])
    made.data.uv_layers.new(name="Lightmap").uv.foreach_set("vector", uvs.ravel())
    return made


def quad(add_mesh, name, corner, u, v, material):
    """A single face, its UVs once over it."""
    corner, u, v = (np.array(x, float) for x in (corner, u, v))
    points = [tuple(corner), tuple(corner + u), tuple(corner + u + v), tuple(corner + v)]
    made = add_mesh(name, points, [(0, 1, 2, 3)], material)
    made.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", [0, 0, 1, 0, 1, 1, 0, 1])
    return made


def sunlight(strength=5.0):
    light = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    light.data.energy, light.data.angle, light.rotation_euler = strength, 0.02, (0.9, 0, 0.2)
    bpy.context.scene.collection.objects.link(light)


def lamp(location, watts=100.0):
    light = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT"))
    light.data.energy, light.data.shadow_soft_size, light.location = watts, 0.1, location
    bpy.context.scene.collection.objects.link(light)
    return light


def blobs():
    """An image of ellipses: white where they are, its alpha 0 elsewhere."""
    image = bpy.data.images.new("blobs", 64, 64, alpha=True, float_buffer=True)
    rng, (y, x) = np.random.default_rng(0), np.mgrid[:64, :64]
    pixels = np.zeros((64, 64, 4), np.float32)
    for _ in range(25):
        across, up, size = rng.uniform(0, 64), rng.uniform(0, 64), rng.uniform(3, 8)
        pixels[(x - across) ** 2 + 4 * (y - up) ** 2 < size**2] = 1
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(pixels.ravel())
    return image


def curtain(add_mesh, nodes):
    """Half of the light passes it, in the sun."""
    material, tree = nodes("cloth")
    tree.show(tree.new("BsdfPrincipled", Base_Color=(0.8, 0.7, 0.5, 1), Alpha=0.5, Specular_IOR_Level=0.0))
    quad(add_mesh, "curtain", (0, 0.05, 0), (4, 0, 0), (0, 0, 3), material)
    sunlight()


def leaves(add_mesh, nodes):
    """Cut out by an image, in the sun."""
    material, tree = nodes("leaf")
    shader, image = (
        tree.new("BsdfPrincipled", Base_Color=(0.3, 0.6, 0.2, 1), Specular_IOR_Level=0.0),
        tree.new("TexImage"),
    )
    image.image = blobs()
    tree.show(tree.link(image, shader, "Alpha", "Alpha"))
    for k in range(4):
        quad(add_mesh, f"leaf{k}", (0.2 + 0.9 * k, 0.4 + 0.3 * k, 0.2), (0.9, 0.3, 0), (0, 0, 2.5), material)
    sunlight()


def lampshade(add_mesh, nodes):
    """Paper around a lamp, half of it translucent."""
    material, tree = nodes("paper")
    mix = tree.new("MixShader", Fac=0.5)
    tree.link(tree.new("BsdfDiffuse", Color=(0.8, 0.7, 0.6, 1)), mix, 0, 1)
    tree.link(tree.new("BsdfTranslucent", Color=(0.8, 0.7, 0.6, 1)), mix, 0, 2)
    tree.show(mix)
    around = [(cos(2 * pi * k / 12), sin(2 * pi * k / 12)) for k in range(12)]
    points = [(2 + r * x, 2 + r * y, z) for x, y in around for r, z in ((0.4, 1.2), (0.3, 1.9))]
    faces = [(2 * k, (2 * k + 2) % 24, (2 * k + 3) % 24, 2 * k + 1) for k in range(12)]
    add_mesh("shade", points, faces, material)
    lamp((2, 2, 1.5))


def screen(add_mesh, nodes):
    """A picture that glows."""
    material, tree = nodes("screen")
    image = tree.new("TexImage")
    image.image = blobs()
    tree.show(tree.link(image, tree.new("Emission", Strength=20.0), "Color", "Color"))
    quad(add_mesh, "screen", (1, 3.9, 1), (2, 0, 0), (0, 0, 1.2), material)


def tiles(add_mesh, nodes):
    """A floor of a checker that no image holds."""
    material, tree = nodes("tiles")
    checker = tree.new("TexChecker", Color1=(0.9, 0.2, 0.1, 1), Color2=(0.05, 0.05, 0.3, 1), Scale=20.0)
    tree.show(tree.link(checker, tree.new("BsdfDiffuse"), "Color", "Color"))
    quad(add_mesh, "tiles", (0, 0, 0.05), (4, 0, 0), (0, 4, 0), material)
    lamp((2, 1.5, 2))


def painted(add_mesh, nodes):
    """A wall of which each half has a colour of its own, in the mesh."""
    material, tree = nodes("paint")
    colour = tree.new("VertexColor")
    colour.layer_name = "Paint"
    tree.show(tree.link(colour, tree.new("BsdfDiffuse"), "Color", "Color"))
    points = [(x, 3.9, z) for z in (0.2, 2.8) for x in (0.2, 2, 3.8)]
    mesh = add_mesh("painted", points, [(0, 1, 4, 3), (1, 2, 5, 4)], material).data
    values = np.repeat([(0.9, 0.1, 0.1, 1), (0.1, 0.1, 0.9, 1)], 4, axis=0)
    mesh.color_attributes.new("Paint", "FLOAT_COLOR", "CORNER").data.foreach_set("color", values.ravel())
    lamp((2, 1.5, 2))


def unseen(add_mesh, nodes):
    """Lamps and things that some rays miss, as Cycles' switches of ray visibility have it."""
    material, tree = nodes("board")
    tree.show(tree.new("BsdfDiffuse", Color=(0.6, 0.6, 0.3, 1)))
    for k, switch in enumerate(("visible_shadow", "visible_diffuse", "visible_camera")):
        setattr(quad(add_mesh, switch, (0.5 + k, 1, 1.2), (0.8, 0, 0), (0, 2, 0), material), switch, False)
    for k, kind in enumerate(("Is Shadow Ray", "Is Diffuse Ray")):
        trick, tree = nodes(kind)
        mix = tree.link(tree.new("LightPath"), tree.new("MixShader"), kind, 0)
        tree.link(tree.new("BsdfDiffuse", Color=(0.3, 0.6, 0.6, 1)), mix, 0, 1)
        tree.show(tree.link(tree.new("BsdfTransparent"), mix, 0, 2))
        quad(add_mesh, kind, (0.3 + 2 * k, 3.2, 1.5), (1.5, 0, 0), (0, 0.7, 0), trick)
    lamp((1.5, 2, 2.5))
    lamp((3, 1, 0.8), 30.0).data.use_shadow = False
    lamp((1, 3, 0.8), 500.0).visible_diffuse = False
    portal = bpy.data.objects.new("portal", bpy.data.lights.new("portal", "AREA"))
    portal.data.energy, portal.data.cycles.is_portal, portal.location = 500.0, True, (2, 2, 2)
    bpy.context.scene.collection.objects.link(portal)


def modified(add_mesh, nodes):
    """Things of which the viewport shows other faces than a render, or none."""
    material, tree = nodes("board")
    tree.show(tree.new("BsdfDiffuse", Color=(0.6, 0.6, 0.3, 1)))
    board = quad(add_mesh, "board", (0.5, 0.5, 1.2), (0.8, 0, 0), (0, 0.5, 0), material)
    array = board.modifiers.new("Array", "ARRAY")
    array.count, array.relative_offset_displace, array.show_viewport = 5, (0, 1, 0), False
    quad(add_mesh, "hidden", (2, 1, 1), (1.5, 0, 0), (0, 2, 0), material).hide_viewport = True
    ball = bpy.data.objects.new("ball", bpy.data.metaballs.new("ball"))
    ball.data.elements.new().radius, ball.data.resolution, ball.location = 0.8, 4.0, (3, 3, 0.5)
    ball.data.materials.append(material)
    bpy.context.scene.collection.objects.link(ball)
    lamp((1.5, 2, 2.5))


def fittings(add_mesh, nodes):
    """A lamp of a photometric file, turned, and one whose light does not fall off with the square of the distance."""
    text = bpy.data.texts.new("lamp.ies")
    text.write("IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 5 3 1 2 0 0 0\n1 1 100\n0 30 60 90 180\n0 90 180\n")
    text.write("1000 900 300 100 50\n1000 700 500 100 50\n1000 300 100 0 50\n")
    for k, kind in enumerate(("ShaderNodeTexIES", "ShaderNodeLightFalloff")):
        light = lamp((1 + 2 * k, 2, 2.2 - k), 20.0)
        light.rotation_euler, light.data.use_nodes = (0.5, 0.3, 0.7), True
        tree = light.data.node_tree
        node = tree.nodes.new(kind)
        output = node.outputs[0]
        if k == 0:
            node.mode, node.ies = "INTERNAL", text
        else:
            output = node.outputs["Linear"]
            node.inputs["Strength"].default_value = 1.0
        tree.links.new(output, next(n for n in tree.nodes if n.type == "EMISSION").inputs["Strength"])


def edges(add_mesh, nodes):
    """Images that do not repeat, each three times over a board; of one the alpha cuts it out."""
    for k, (extension, what) in enumerate(
        (("CLIP", "Color"), ("EXTEND", "Color"), ("MIRROR", "Color"), ("CLIP", "Alpha"))
    ):
        material, tree = nodes(extension)
        image, mapping = tree.new("TexImage"), tree.new("Mapping", Scale=(3, 3, 3), Location=(-0.5, -0.5, 0))
        image.image, image.extension = blobs(), extension
        image.image.pixels[: 4 * 64 * 20] = [1.0] * (4 * 64 * 20)  # what lies beyond its sides is not all the same
        tree.link(tree.link(tree.new("UVMap"), mapping, 0, "Vector"), image, 0, "Vector")
        diffuse = tree.new("BsdfDiffuse", Color=(0.8, 0.6, 0.4, 1))
        if what == "Color":
            tree.show(tree.link(image, diffuse, "Color", "Color"))
        else:
            mix = tree.link(image, tree.new("MixShader"), "Alpha", 0)
            tree.link(tree.new("BsdfTransparent"), mix, 0, 1)
            tree.show(tree.link(diffuse, mix, 0, 2))
        quad(add_mesh, extension, (0.2 + k % 2 * 1.9, 0.2 + k // 2 * 1.9, 0.8), (1.7, 0, 0), (0, 1.7, 0), material)
    lamp((2, 1.9, 2.6))


def velvet(add_mesh, nodes):
    """Sheen over a wall, a box of fog, and a sum of shaders on the floor."""
    material, tree = nodes("velvet")
    tree.show(tree.new("BsdfSheen", Color=(0.9, 0.8, 0.7, 1), Roughness=0.6))
    quad(add_mesh, "curtain", (0.05, 3.95, 0.05), (3.9, 0, 0), (0, 0, 2.9), material)
    material, tree = nodes("fog")
    tree.tree.links.new(tree.new("VolumeScatter", Density=1e-4).outputs[0], tree.new("OutputMaterial").inputs["Volume"])
    quad(add_mesh, "fog", (-1, -1, 1.5), (6, 0, 0), (0, 6, 0), material)
    material, tree = nodes("sum")
    added = tree.link(tree.new("BsdfDiffuse", Color=(0.4, 0.2, 0.1, 1)), tree.new("AddShader"), 0, 0)
    tree.show(tree.link(tree.new("BsdfDiffuse", Color=(0.1, 0.2, 0.3, 1)), added, 0, 1))
    quad(add_mesh, "carpet", (0.1, 0.1, 0.02), (3.8, 0, 0), (0, 3.7, 0), material)
    lamp((2, 1.5, 2))


def one_sided(add_mesh, nodes):
    """A panel that glows in front, a wall that is nothing from behind, in the sun, and a board of two colours."""
    warm, cold = ("BsdfDiffuse", {"Color": (0.7, 0.4, 0.1, 1)}), ("BsdfDiffuse", {"Color": (0.1, 0.3, 0.7, 1)})
    glow, nothing = ("Emission", {"Strength": 4.0}), ("BsdfTransparent", {})
    both = {
        "panel": (glow, cold),
        "wall": (warm, nothing),
        "cut": (nothing, cold),
        "board": (warm, cold),
        "sign": (glow, nothing),
    }
    places = {  # corner, and two sides
        "panel": ((0.5, 2.5, 1.5), (0, 1, 0), (1, 0, 0)),
        "wall": ((0, 0, 0), (4, 0, 0), (0, 0, 3)),
        "cut": ((0.4, 0.5, 0.6), (0, 1.5, 0), (0, 0, 1.5)),
        "board": ((3.5, 0.5, 0.6), (0, 2, 0), (0, 0, 1.5)),
        "sign": ((2, 1, 0.8), (0, 0.6, 0), (0, 0, 0.6)),
    }
    for name, shaders in both.items():
        material, tree = nodes(name)
        mix = tree.link(tree.new("NewGeometry"), tree.new("MixShader"), "Backfacing", 0)
        for k, (kind, inputs) in enumerate(shaders):
            tree.link(tree.new(kind, **inputs), mix, 0, k + 1)
        tree.show(mix)
        quad(add_mesh, name, *places[name], material)
    sunlight(2.0)


ROOMS = [curtain, leaves, lampshade, screen, tiles, painted, unseen, modified, fittings, edges, velvet, one_sided]


@pytest.mark.parametrize("furnish", ROOMS)
def test_every_panel_has_the_light_that_cycles_gives_it(room, add_mesh, nodes, furnish):
    furnish(add_mesh, nodes)
    ours, cycles = our_light(room), cycles_light(room)
    np.testing.assert_allclose(ours, cycles, rtol=AGREED, atol=AGREED * cycles.max())


def our_light(room):
    """Mean E / pi on each panel (5, 3)."""
    settings = BakeSettings(keep_uvs=True, texels=SIDE**2, error=0.01)
    scene = read_scene(bpy.context.scene, settings, [room.name])
    return on_panels(bake(scene, settings).lightmap.pixels)


def cycles_light(room):
    """The same by Cycles."""
    image = bpy.data.images.new("light", SIDE, SIDE, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    tree = room.data.materials[0].node_tree
    tree.nodes.active = tree.nodes.new("ShaderNodeTexImage")
    tree.nodes.active.image = image
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", SAMPLES, False
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 32
    scene.cycles.transparent_max_bounces, scene.cycles.sample_clamp_indirect = 64, 0
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = room
    room.select_set(True)
    bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT", "INDIRECT"}, margin=0)
    return on_panels(np.array(image.pixels[:], np.float32).reshape(SIDE, SIDE, 4)[..., :3])


def on_panels(pixels):
    """Means (5, 3) over the texels that lie in a panel's place as a whole."""
    places = [
        (slice(TILE * row + 1, TILE * row + TILE - 1), slice(TILE * column + 1, TILE * column + TILE - 1))
        for column, row in PLACES
    ]
    return np.array([pixels[place].mean(axis=(0, 1)) for place in places])
