"""The picture of a bake shows base colour x stored light + emission, and leaves the file as it was."""

import bpy
import numpy as np
import pytest

from addon.blender import demo, picture

# Levels of an 8-bit PNG: half a one is rounding, one is the reach of Blender's triangular dither
PNG_LEVELS = 1.5 / 255


@pytest.fixture
def wall():
    """A grey wall that fills the camera's view, with a sun and a bright world that must not be seen in it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    mesh = bpy.data.meshes.new("wall")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    layer = mesh.uv_layers.new(name="Lightmap", do_init=False)
    layer.uv.foreach_set("vector", np.array([0, 0, 1, 0, 1, 1, 0, 1], np.float32))
    obj = bpy.data.objects.new("wall", mesh)
    mesh.materials.append(_principled("grey", (0.8, 0.8, 0.8)))

    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location = (0, 0, 1)  # 50 mm on 36 mm sees 0.72 of the wall's 2
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy = 100
    for entry in (obj, camera, sun):
        scene.collection.objects.link(entry)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 10
    return obj


def _principled(name, colour, emission=0.0):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (*colour, 1)
    inputs["Emission Color"].default_value = (1, 1, 1, 1)
    inputs["Emission Strength"].default_value = emission
    return material


def _image(pixels):
    """A lightmap of (H, W) grey values."""
    pixels = np.asarray(pixels, np.float32)
    image = bpy.data.images.new("light", pixels.shape[1], pixels.shape[0], float_buffer=True, is_data=True)
    rgba = np.repeat(pixels[..., None], 4, axis=2)
    image.pixels.foreach_set(rgba.ravel())
    image.pack()
    return image


def _shown(tmp_path):
    """The rendered PNG's values, (H, W, 3), row 0 at the bottom, through the view that changes nothing."""
    path = tmp_path / "picture.png"
    picture.render(path, width=16, height=16, samples=2, view_transform="Raw", exposure=0.0)
    return _read(path)


def _read(path):
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    size = tuple(image.size)
    bpy.data.images.remove(image)
    return pixels.reshape(size[1], size[0], 4)[..., :3]


def test_shows_lightmap_times_base_colour(wall, tmp_path):
    wall["patchlight_lightmap"] = _image(np.full((8, 8), 0.5))
    assert _shown(tmp_path) == pytest.approx(0.5 * 0.8, abs=PNG_LEVELS)


def test_shows_vertex_colours_times_base_colour(wall, tmp_path):
    attribute = wall.data.color_attributes.new("Patchlight", "FLOAT_COLOR", "CORNER")
    attribute.data.foreach_set("color", np.tile(np.array([0.25, 0.5, 0.75, 1], np.float32), 4))
    assert _shown(tmp_path) == pytest.approx(np.broadcast_to([0.2, 0.4, 0.6], (16, 16, 3)), abs=PNG_LEVELS)


def test_an_object_is_shown_by_its_own_place_in_the_atlas(wall, tmp_path):
    left_dark_right_light = np.repeat([[0.1, 0.7]], 8, axis=0).repeat(8, axis=1)
    wall["patchlight_lightmap"] = _image(left_dark_right_light)
    # the right half; the view sees the middle 0.72 / 2 of it, so no lookup reaches the dark half's texels
    wall["patchlight_rect"] = (0.5, 1.0, 0.5, 0.0)
    assert _shown(tmp_path) == pytest.approx(0.7 * 0.8, abs=PNG_LEVELS)


def test_emission_is_added(wall, tmp_path):
    wall["patchlight_lightmap"] = _image(np.full((8, 8), 0.5))
    wall.data.materials[0] = _principled("glowing", (0.4, 0.4, 0.4), emission=0.3)
    assert _shown(tmp_path) == pytest.approx(0.5 * 0.4 + 0.3, abs=PNG_LEVELS)


def test_what_is_not_baked_is_black_under_any_sun(wall, tmp_path):
    other = bpy.data.objects.new("baked", bpy.data.meshes.new("baked"))
    other.data.from_pydata([(0, 0, 5), (1, 0, 5), (0, 1, 5)], [], [(0, 1, 2)])
    other.data.color_attributes.new("Patchlight", "FLOAT_COLOR", "CORNER")
    bpy.context.scene.collection.objects.link(other)
    assert _shown(tmp_path).max() <= PNG_LEVELS


def test_a_scene_without_a_bake_is_refused(wall, tmp_path):
    with pytest.raises(picture.PictureError, match="Scene has nothing to show"):
        _shown(tmp_path)


def test_a_mix_of_shaders_inside_a_group_is_shown(wall, tmp_path):
    wall["patchlight_lightmap"] = _image(np.full((8, 8), 0.5))
    group = bpy.data.node_groups.new("two coats", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    nodes, links = group.nodes, group.links
    mix, output = nodes.new("ShaderNodeMixShader"), nodes.new("NodeGroupOutput")
    mix.inputs[0].default_value = 0.25
    for socket, value in ((1, 0.8), (2, 0.4)):
        coat = nodes.new("ShaderNodeBsdfDiffuse")
        coat.inputs["Color"].default_value = (value, value, value, 1)
        links.new(coat.outputs[0], mix.inputs[socket])
    links.new(mix.outputs[0], output.inputs[0])
    tree = wall.data.materials[0].node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    use = tree.nodes.new("ShaderNodeGroup")
    use.node_tree = group
    tree.links.new(use.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    assert _shown(tmp_path) == pytest.approx(0.5 * (0.75 * 0.8 + 0.25 * 0.4), abs=PNG_LEVELS)


def test_automatic_exposure_brings_the_median_to_grey_at_any_brightness(wall, tmp_path):
    shown = []
    for light in (0.01, 40.0):
        wall["patchlight_lightmap"] = _image(np.full((8, 8), light))
        path = tmp_path / f"{light}.png"
        picture.render(path, width=16, height=16, samples=2, view_transform="Standard")
        shown.append(_read(path))
    # Standard is the sRGB curve: 0.2 linear is 0.4845 encoded
    assert picture.MIDDLE_GREY == 0.2
    assert shown[0] == pytest.approx(0.4845, abs=PNG_LEVELS)
    assert shown[1] == pytest.approx(shown[0], abs=2 * PNG_LEVELS)


def test_a_scene_without_camera_is_refused_by_name(wall, tmp_path):
    bpy.context.scene.camera = None
    with pytest.raises(picture.PictureError, match="Scene has no camera"):
        picture.render(tmp_path / "picture.png")


@pytest.mark.parametrize("bounces", [0, 2])
def test_the_file_is_left_as_it_was(tmp_path, bounces):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    demo.build_room()
    bpy.data.objects["rug"].data.color_attributes.new("Patchlight", "FLOAT_COLOR", "CORNER")
    before = _contents()
    picture.render(tmp_path / "picture.png", width=32, height=18, samples=1, bounces=bounces)
    assert _contents() == before


def _contents():
    """Names and user counts of all data-blocks, every node with its links, what objects wear, and scene settings."""
    collections = ("objects", "meshes", "materials", "lights", "worlds", "images", "scenes", "node_groups", "cameras")
    blocks = {name: {block.name: block.users for block in getattr(bpy.data, name)} for name in collections}
    blocks["images"].pop("Render Result", None)  # Blender's own buffer, left by any render
    trees = {block.name: _tree(block.node_tree) for block in (*bpy.data.materials, *bpy.data.worlds)}
    worn = {obj.name: [slot.material.name for slot in obj.material_slots] for obj in bpy.data.objects}
    layers = {mesh.name: [layer.name for layer in mesh.uv_layers] for mesh in bpy.data.meshes}
    lights = {light.name: (light.energy, tuple(light.color)) for light in bpy.data.lights}
    scene = bpy.context.scene
    view = (scene.view_settings.exposure, scene.view_settings.view_transform, scene.render.filepath)
    render = (scene.render.resolution_x, scene.cycles.samples, scene.cycles.max_bounces, scene.world.name)
    return blocks, trees, worn, layers, lights, view, render


def _tree(tree):
    values = [(node.name, socket.name, _value(socket)) for node in tree.nodes for socket in node.inputs]
    links = [
        (link.from_node.name, link.from_socket.name, link.to_node.name, link.to_socket.name) for link in tree.links
    ]
    return values, links


def _value(socket):
    value = getattr(socket, "default_value", None)  # shader sockets have none
    return tuple(value) if hasattr(value, "__len__") else value


def test_lightmap_png_keeps_order_and_shows_light_and_dark(tmp_path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    ramp = np.geomspace(0.01, 100, 64)[None].repeat(4, axis=0)
    picture.save_lightmap_png(_image(ramp), tmp_path / "lightmap.png")
    row = _read(tmp_path / "lightmap.png")[0, :, 0]
    assert (np.diff(row) >= 0).all()
    assert len(np.unique(row)) > 50  # 64 values over four decades: few fall together, none are clipped away
    # the median shows as L / (1 + L) = 1/2, sRGB-encoded 0.7354; two neighbours of the ramp lie 0.02 around it
    assert np.median(row) == pytest.approx(0.7354, abs=0.02)
    assert [image.name for image in bpy.data.images] == ["light"]
