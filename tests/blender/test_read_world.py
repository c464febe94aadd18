"""Worlds: colours, images and whatever Cycles has to render, against what Cycles lights with them."""

from __future__ import annotations

from math import cos, degrees, pi, radians, sin

import bpy
import numpy as np
import pytest

from addon.blender.private_render import RenderError
from addon.blender.read_scene import read_scene
from addon.core.bake import bake
from addon.core.environment import Environment
from addon.core.settings import BakeSettings
from addon.core.sky import with_suns

pytestmark = pytest.mark.usefixtures("empty_file")

COLOUR, FLOAT32 = (1.0, 0.5, 0.25), 1e-6  # a colour that is exact in float32


@pytest.fixture
def read(add_cube):
    """Read a scene with a cube in it."""

    def read_with_cube():
        add_cube()
        return read_scene(bpy.context.scene)

    return read_with_cube


@pytest.fixture
def set_world():
    """Give the scene a world of one background, and return its node tree and background node."""

    def make(colour=(0, 0, 0, 1), strength=1.0):
        world = bpy.data.worlds.new("Sky")
        world.use_nodes = True
        bpy.context.scene.world = world
        background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
        background.inputs["Color"].default_value = colour
        background.inputs["Strength"].default_value = strength
        return world.node_tree, background

    return make


def test_the_view_layer_decides_what_is_around(set_world, read):
    set_world((*COLOUR, 1), 4.0)
    layer = bpy.context.view_layer
    layer.use_sky = False
    assert read().world_radiance == (0, 0, 0)
    layer.use_sky = True
    if hasattr(layer, "world_override"):
        layer.world_override = bpy.data.worlds.new("Night")
        layer.world_override.color = (0, 0, 0.25)
        layer.world_override.use_nodes = False
        assert read().world_radiance == (0, 0, 0.25)


def test_a_world_that_diffuse_rays_do_not_see_is_black_without_nodes_too(set_world, read):
    set_world((*COLOUR, 1), 4.0)
    world = bpy.context.scene.world
    world.use_nodes, world.cycles_visibility.diffuse = False, False
    assert read().world_radiance == (0, 0, 0)


def test_a_volume_around_is_named(set_world, read):
    tree, _ = set_world((*COLOUR, 1), 4.0)
    output = next(node for node in tree.nodes if node.type == "OUTPUT_WORLD")
    tree.links.new(tree.nodes.new("ShaderNodeVolumeScatter").outputs[0], output.inputs["Volume"])
    assert any("'Sky'" in warning and "volume" in warning for warning in read().warnings)


def test_no_world_is_black(read):
    assert read().world_radiance == (0, 0, 0)


def test_the_world_is_colour_times_strength(set_world, read):
    set_world((*COLOUR, 1), 4.0)
    np.testing.assert_allclose(read().world_radiance, np.array(COLOUR) * 4)


@pytest.fixture
def sky_image(set_world, add_image):
    """Give the scene a world of an image of 32 x 64 pixels, and return (its pixels, node tree, its node)."""

    def make(strength=2.0):
        tree, background = set_world(strength=strength)
        pixels = np.random.default_rng(0).uniform(0, 1, (32, 64, 3)).astype(np.float32)
        pixels[24:28, 8:16] = 20.0
        node = tree.nodes.new("ShaderNodeTexEnvironment")
        node.image = add_image(pixels, "Sunset", is_float=True, space="Non-Color")
        tree.links.new(node.outputs[0], background.inputs["Color"])
        return pixels, tree, node

    return make


def turned(tree, node, coordinates="Generated", **inputs):
    """Link a Mapping node between the coordinates and the image."""
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.vector_type = inputs.pop("kind", "POINT")
    for name, value in inputs.items():
        mapping.inputs[name].default_value = value
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs[coordinates], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], node.inputs["Vector"])


def test_a_sky_image_is_an_environment(sky_image, read):
    pixels, _, _ = sky_image()
    scene = read()
    assert scene.world_radiance == (2, 2, 2)
    assert scene.environment.name == "Sunset"
    np.testing.assert_array_equal(scene.environment.pixels, pixels)
    np.testing.assert_array_equal(scene.environment.to_image, np.eye(3))
    assert not scene.warnings


def test_a_mapping_turns_the_sky(sky_image, read):
    """A quarter turn about Z takes +X to +Y; a texture that is turned is looked up the other way round."""
    _, tree, node = sky_image()
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    turned(tree, node, Rotation=(0, 0, pi / 2))
    np.testing.assert_allclose(read().environment.to_image, quarter, atol=FLOAT32)
    turned(tree, node, kind="TEXTURE", Rotation=(0, 0, pi / 2), Scale=(-3, 3, 3))
    np.testing.assert_allclose(read().environment.to_image, np.diag([-1, 1, 1]) @ quarter.T, atol=FLOAT32)


def counts():
    """How many data-blocks of each kind the file has."""
    kinds = ("scenes", "worlds", "objects", "cameras", "images", "node_groups")
    return {kind: len(getattr(bpy.data, kind)) for kind in kinds}


def test_a_world_image_with_a_texture_mapping_of_its_own_is_what_cycles_shows(sky_image, read):
    pixels, _, node = sky_image(strength=0.5)
    node.texture_mapping.rotation = (0, 0, np.pi / 2)
    scene = read()
    assert not scene.warnings
    before = Environment("Sunset", pixels)
    rows, columns = (part.ravel() for part in np.mgrid[64:448:37, 0:1024:31])
    directions = scene.environment.directions(rows, columns)
    # turned by a right angle about z, as a Mapping node of that rotation turns it
    x, y, z = directions.T
    turned = before.seen(np.stack([-y, x, z], axis=1)) / 2
    found = scene.environment.seen(directions) * np.array(scene.world_radiance)
    assert np.median(np.abs(found - turned)) < 0.01 * turned.mean()


def test_a_world_that_cannot_be_read_is_rendered_and_the_file_stays_as_it_is(sky_image, read):
    """A sky by way of coordinates that no Mapping node gives is what it is by its image."""
    pixels, tree, node = sky_image(strength=0.5)
    geometry = tree.nodes.new("ShaderNodeNewGeometry")
    scaled = tree.nodes.new("ShaderNodeVectorMath")
    scaled.operation = "SCALE"
    scaled.inputs["Scale"].default_value = -1
    tree.links.new(geometry.outputs["Incoming"], scaled.inputs[0])
    tree.links.new(scaled.outputs[0], node.inputs["Vector"])
    before = counts()
    scene = read()
    assert {**counts(), "objects": before["objects"]} == before  # the cube
    assert not scene.warnings
    rows, columns = (part.ravel() for part in np.mgrid[0:512:7, 0:1024:7])
    seen = Environment("Sunset", pixels).seen(scene.environment.directions(rows, columns))
    # a sixteenth of a pixel of the image wide: between 20 and 0 light changes by so much over one
    np.testing.assert_allclose(scene.environment.pixels[rows, columns], 0.5 * seen, atol=0.5 * 20 / 16 / 2)


def test_the_world_is_what_a_diffuse_surface_sees_and_not_the_camera(set_world, read):
    tree, shown = set_world((*COLOUR, 1), 1.0)
    lighting, mix = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeMixShader")
    lighting.inputs["Color"].default_value = (0.25, 0.5, 1, 1)
    output = next(node for node in tree.nodes if node.type == "OUTPUT_WORLD")
    tree.links.new(tree.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(lighting.outputs[0], mix.inputs[1])
    tree.links.new(shown.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    scene = read()
    np.testing.assert_allclose(scene.environment.pixels[::50, ::50], np.full((11, 21, 3), (0.25, 0.5, 1)), rtol=1e-5)
    np.testing.assert_allclose(scene.world_radiance, 1)


def sky_texture(set_world, degrees):
    """A sky whose sun is 35 degrees up, and of that many wide."""
    tree, background = set_world(strength=0.1)
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_elevation, sky.sun_rotation, sky.sun_size = radians(35), radians(40), radians(degrees)
    tree.links.new(sky.outputs[0], background.inputs["Color"])


def test_the_sky_texture_has_its_sun_where_it_says_and_as_bright_whatever_its_size(set_world, read):
    towards = np.array([sin(radians(40)) * cos(radians(35)), cos(radians(40)) * cos(radians(35)), sin(radians(35))])
    light = []
    for size in (0.05, 0.545, 5.0):
        sky_texture(set_world, size)
        (sun,) = with_suns(read()).lights
        np.testing.assert_allclose(sun.direction, -towards, atol=radians(0.1))
        # less for the limb, which is darker; more for pixels, a third of a degree wide
        assert 0.9 * max(size, 0.5) < degrees(sun.angle) < max(size, 0.5) + 0.5
        light.append(sun.irradiance)
    # the sky around the disc that is brighter than 30 times the mean goes with it
    np.testing.assert_allclose(light, np.broadcast_to(light[1], (3, 3)), rtol=0.03)


def test_a_cube_under_the_sky_texture_has_the_light_that_cycles_gives_it(set_world, add_cube):
    sky_texture(set_world, 0.545)
    cube = add_cube()
    ours, cycles = our_light(cube), cycles_light(cube)
    # noise as above; the lower face sees the dark below the horizon only
    np.testing.assert_allclose(ours, cycles, rtol=0.03, atol=1e-3 * cycles.max())


@pytest.mark.parametrize("image", ["none", "lost"])
def test_a_sky_image_that_is_not_there_is_named_and_not_pink(sky_image, read, image):
    _, _, node = sky_image()
    bpy.context.scene.world.color = COLOUR
    if image == "none":
        node.image = None
    else:
        node.image = bpy.data.images.new("Lost", 1, 1)
        node.image.source, node.image.filepath = "FILE", "/nowhere/lost.exr"
        node.image.reload()
    scene = read()
    assert scene.environment is None
    np.testing.assert_allclose(scene.world_radiance, COLOUR)
    assert any("'Sky'" in warning for warning in scene.warnings)


def test_a_world_that_cameras_do_not_see_lights_as_any_other(set_world, read):
    tree, background = set_world((0, 0, 0, 1), 2.0)
    gradient = tree.nodes.new("ShaderNodeTexGradient")
    tree.links.new(gradient.outputs[0], background.inputs["Color"])
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], gradient.inputs["Vector"])
    output = next(node for node in tree.nodes if node.type == "OUTPUT_WORLD")
    tree.links.new(tree.nodes.new("ShaderNodeVolumeScatter").outputs[0], output.inputs["Volume"])
    world = bpy.context.scene.world
    world.cycles_visibility.camera = False
    scene = read()
    rows, columns = (part.ravel() for part in np.mgrid[0:512:50, 0:1024:50])
    # a gradient is x, from 0 to 1
    exact = 2 * np.clip(scene.environment.directions(rows, columns)[:, 0], 0, 1)
    np.testing.assert_allclose(scene.environment.pixels[rows, columns, 1], exact, atol=0.02)
    assert any("'Sky'" in warning and "volume" in warning for warning in scene.warnings)
    world.cycles_visibility.diffuse = False
    assert read().world_radiance == (0, 0, 0)


def test_light_path_is_a_diffuse_rays_in_groups_too_and_a_muted_link_stays_muted(set_world, read):
    tree, background = set_world((*COLOUR, 1), 1.0)
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Factor", in_out="OUTPUT", socket_type="NodeSocketFloat")
    path, out = group.nodes.new("ShaderNodeLightPath"), group.nodes.new("NodeGroupOutput")
    group.links.new(path.outputs["Diffuse Depth"], out.inputs[0])
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    product = tree.nodes.new("ShaderNodeMath")
    product.operation = "ADD"
    tree.links.new(node.outputs[0], product.inputs[0])
    product.inputs[1].default_value = 2.0
    tree.links.new(tree.nodes.new("ShaderNodeLightPath").outputs["Is Diffuse Ray"], product.inputs[1]).is_muted = True
    tree.links.new(product.outputs[0], background.inputs["Strength"])
    before = counts()
    scene = read()
    assert counts()["node_groups"] == before["node_groups"]
    np.testing.assert_allclose(
        scene.environment.pixels[::50, ::50], np.full((11, 21, 3), 3 * np.array(COLOUR)), rtol=1e-5
    )


def test_what_was_moved_without_a_key_stays_there_while_the_world_is_rendered(set_world, add_cube):
    tree, background = set_world()
    tree.links.new(tree.nodes.new("ShaderNodeTexSky").outputs[0], background.inputs["Color"])
    cube = add_cube()
    cube.keyframe_insert("location", frame=1)
    cube.location.x = 5
    read_scene(bpy.context.scene)
    assert cube.location.x == 5


def test_a_world_of_a_muted_background_is_what_cycles_shows(set_world, read):
    _, background = set_world((*COLOUR, 1), 4.0)
    background.mute = True
    scene = read()
    seen = np.array(scene.world_radiance) * (1 if scene.environment is None else scene.environment.pixels[::50, ::50])
    np.testing.assert_allclose(seen, np.broadcast_to(0.0, seen.shape), atol=1e-6)


def test_a_world_that_cannot_be_rendered_is_never_silently_black(set_world, read, monkeypatch):
    tree, background = set_world()
    bpy.context.scene.world.color = COLOUR
    tree.links.new(tree.nodes.new("ShaderNodeTexSky").outputs[0], background.inputs["Color"])

    def fail(world, frame):
        raise RenderError("out of memory")

    monkeypatch.setattr("addon.blender.read_world.rendered_world", fail)
    scene = read()
    np.testing.assert_allclose(scene.world_radiance, COLOUR)
    (warning,) = scene.warnings
    assert warning == "world 'Sky': its Sky Texture node cannot be read (out of memory): its viewport colour is used"


def test_a_cube_under_a_turned_sky_has_the_light_that_cycles_gives_it(sky_image, add_cube):
    _, tree, node = sky_image()
    turned(tree, node, kind="TEXTURE", Rotation=(0.3, -0.6, 1.2), Scale=(1, -1, 1))
    cube = add_cube()
    light = {}
    for name, bake_it in (("cycles", cycles_light), ("ours", our_light)):
        light[name] = bake_it(cube)
    # Cycles' 1024 samples and our error of 0.003, over the 24 corners of each; no two faces are alike to a third
    np.testing.assert_allclose(light["ours"], light["cycles"], rtol=0.03)


def cycles_light(obj):
    """E / pi on the six faces, by Cycles: (6, 3)."""
    scene, mesh = bpy.context.scene, obj.data
    if not mesh.materials:
        mesh.materials.append(bpy.data.materials.new("grey"))
        mesh.materials[0].use_nodes = True
    mesh.color_attributes.active_color = mesh.color_attributes.new("light", "FLOAT_COLOR", "CORNER")
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 1024, False
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT", "INDIRECT"}, target="VERTEX_COLORS")
    colours = np.empty(len(mesh.loops) * 4, np.float32)
    mesh.color_attributes["light"].data.foreach_get("color", colours)
    return np.array([colours.reshape(-1, 4)[list(face.loop_indices), :3].mean(axis=0) for face in mesh.polygons])


def our_light(obj):
    """The same by the bake."""
    scene = read_scene(bpy.context.scene)
    # of the light and a third of the median: the dimmest face is a tenth of that, and is to be known to 3 %
    colours = bake(scene, BakeSettings(target="vertex", error=0.003)).corner_colours
    faces = scene.objects[0].polygons
    return np.array([colours[faces == face].mean(axis=(0, 1)) for face in range(len(obj.data.polygons))])
