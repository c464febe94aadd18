"""Mirrors and glass in the picture of a bake: laws of reflection and refraction with one answer each."""

import bpy
import numpy as np
import pytest

from addon.blender import picture, picture_rays

# Levels of an 8-bit PNG: half a one is rounding, one is the reach of Blender's triangular dither
PNG_LEVELS = 1.5 / 255
LIGHT = 0.5  # E / pi on the wall behind the camera


@pytest.fixture
def facing():
    """Two walls, the camera between them: it looks at one whose base colour is white and that no light reaches, with
    its back to one of base colour .8 that has LIGHT."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    ahead, behind = _wall("ahead", -1.0, 0.0), _wall("behind", 1.0, LIGHT)
    behind.data.materials.append(_principled(0.8, roughness=1.0))
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(scene.camera)
    scene.camera.data.angle = np.radians(2)  # all of it along the walls' normals: what is reflected is F(0)
    return ahead


def _wall(name, z, light, size=100.0):
    mesh = bpy.data.meshes.new(name)
    x = size / 2
    mesh.from_pydata([(-x, -x, 0), (x, -x, 0), (x, x, 0), (-x, x, 0)], [], [(0, 1, 2, 3)])
    attribute = mesh.color_attributes.new("Patchlight", "FLOAT_COLOR", "CORNER")
    attribute.data.foreach_set("color", np.tile(np.array([light, light, light, 1], np.float32), 4))
    obj = bpy.data.objects.new(name, mesh)
    obj.location.z = z
    bpy.context.scene.collection.objects.link(obj)
    return obj


def _principled(colour=1.0, **inputs):
    material = bpy.data.materials.new("made")
    material.use_nodes = True
    node = material.node_tree.nodes["Principled BSDF"]
    node.inputs["Base Color"].default_value = (colour, colour, colour, 1)
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ").title().replace("Ior", "IOR")].default_value = value
    return material


def _wear(obj, material):
    obj.data.materials.clear()
    obj.data.materials.append(material)


def _seen(tmp_path, bounces=4, scale=1.0, samples=4):
    """The mean of what the camera sees, times ``scale`` to use the PNG's range."""
    path = tmp_path / "picture.png"
    exposure = float(np.log2(scale))
    picture.render(path, 16, 16, samples, view_transform="Raw", exposure=exposure, bounces=bounces)
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    bpy.data.images.remove(image)
    return pixels.mean() / scale


def test_a_mirror_shows_what_it_faces_times_its_colour(facing, tmp_path):
    _wear(facing, _principled(0.9, metallic=1.0, roughness=0.0))
    assert _seen(tmp_path) == pytest.approx(0.9 * 0.8 * LIGHT, abs=PNG_LEVELS)


def test_without_bounces_a_mirror_is_as_the_bake_lights_it(facing, tmp_path):
    _wear(facing, _principled(0.9, metallic=1.0, roughness=0.0))
    assert _seen(tmp_path, bounces=0) <= PNG_LEVELS


def fresnel(ior, degrees):
    """What a smooth dielectric reflects of unpolarised light; Born & Wolf, 1.5 (32)."""
    incident = np.radians(degrees)
    refracted = np.arcsin(np.sin(incident) / ior)
    if degrees == 0:
        return ((ior - 1) / (ior + 1)) ** 2
    across = np.sin(incident - refracted) / np.sin(incident + refracted)
    along = np.tan(incident - refracted) / np.tan(incident + refracted)
    return (across**2 + along**2) / 2


@pytest.mark.parametrize("is_flipped", [False, True])
@pytest.mark.parametrize(("ior", "degrees"), [(1.33, 0), (1.5, 0), (2.0, 0), (1.5, 30), (1.5, 60)])
def test_a_smooth_dielectric_reflects_as_fresnel_says(facing, tmp_path, ior, degrees, is_flipped):
    """On its back, too, which is not the inside of a solid; what it faces, tilted, is a wall around all of it."""
    bpy.data.objects["behind"].hide_render = True
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=500.0)
    around = bpy.context.object
    attribute = around.data.color_attributes.new("Patchlight", "FLOAT_COLOR", "CORNER")
    attribute.data.foreach_set("color", np.full(4 * len(around.data.loops), LIGHT, np.float32))
    _wear(around, _principled(0.8, roughness=1.0))
    bpy.context.scene.camera.data.clip_end = 2000.0
    _wear(facing, _principled(roughness=0.0, ior=ior))
    facing.rotation_euler.y = np.radians(degrees + (180 if is_flipped else 0))
    # the camera sees 2 degrees of angles
    expected = fresnel(ior, degrees) * 0.8 * LIGHT
    assert _seen(tmp_path, scale=8) == pytest.approx(expected, abs=PNG_LEVELS / 8, rel=0.01)


def test_what_a_dielectric_reflects_is_missing_from_what_the_bake_shows(facing, tmp_path):
    _wear(facing, _principled(roughness=0.0, ior=2.0))
    facing.data.color_attributes["Patchlight"].data.foreach_set("color", np.full(16, 0.9, np.float32))
    share = 1 / 9  # ((2 - 1) / (2 + 1))^2
    assert _seen(tmp_path) == pytest.approx(share * 0.8 * LIGHT + (1 - share) * 0.9, abs=PNG_LEVELS)


def test_a_coat_is_a_mirror_of_its_own(facing, tmp_path):
    _wear(facing, _principled(roughness=1.0, coat_weight=0.5, coat_ior=2.0, coat_roughness=0.0))
    assert _seen(tmp_path, scale=16) == pytest.approx(0.5 / 9 * 0.8 * LIGHT, abs=PNG_LEVELS / 16)


@pytest.mark.parametrize("level", [0.25, 1.0])
def test_a_level_that_is_linked_is_as_one_that_is_not(facing, tmp_path, level):
    """Twice the neutral level reflects twice as much; a muted link is none."""
    material = _principled(roughness=0.0, ior=2.0, metallic=0.0)
    tree = material.node_tree
    inputs = tree.nodes["Principled BSDF"].inputs
    for name, value in (("Specular IOR Level", level), ("Metallic", 1.0)):
        source = tree.nodes.new("ShaderNodeValue")
        source.outputs[0].default_value = value
        tree.links.new(source.outputs[0], inputs[name]).is_muted = name == "Metallic"
    _wear(facing, material)
    assert _seen(tmp_path, scale=4) == pytest.approx(2 * level / 9 * 0.8 * LIGHT, abs=PNG_LEVELS / 4)


def test_a_transmission_that_is_linked_makes_glass(facing, tmp_path):
    """Two planes of it, which a ray enters and leaves: black is behind, and 1 / 9 is reflected by each."""
    material = _principled(roughness=0.0, ior=2.0)
    tree = material.node_tree
    source = tree.nodes.new("ShaderNodeValue")
    source.outputs[0].default_value = 1.0
    tree.links.new(source.outputs[0], tree.nodes["Principled BSDF"].inputs["Transmission Weight"])
    _wear(facing, material)
    facing.data.color_attributes["Patchlight"].data.foreach_set("color", np.full(16, 0.9, np.float32))
    # by chance: 256 pixels of 64 rays know a mean to .4 * sqrt(1/9 * 8/9) / 128 = .001
    assert _seen(tmp_path, samples=64) == pytest.approx(0.8 * LIGHT / 9, abs=PNG_LEVELS + 0.003)


def test_clear_glass_of_a_colour_reflects_white(facing, tmp_path):
    material = _principled(roughness=0.0, ior=2.0, transmission_weight=1.0)
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0, 0, 0, 1)
    _wear(facing, material)
    assert _seen(tmp_path, scale=4, samples=256) == pytest.approx(0.8 * LIGHT / 9, abs=PNG_LEVELS / 4 + 0.003)


@pytest.mark.parametrize("bounces", [0, 2])
def test_a_transmission_below_a_half_takes_its_share_of_the_light(facing, tmp_path, bounces):
    facing.data.color_attributes["Patchlight"].data.foreach_set("color", np.full(16, 0.5, np.float32))
    _wear(facing, _principled(roughness=1.0, transmission_weight=0.4))
    assert _seen(tmp_path, bounces=bounces) == pytest.approx(0.6 * 0.5, abs=PNG_LEVELS)


def test_a_muted_link_and_a_muted_node_show_nothing(facing, tmp_path):
    facing.data.color_attributes["Patchlight"].data.foreach_set("color", np.full(16, 0.5, np.float32))
    material = _principled(roughness=1.0)
    material.node_tree.links[0].is_muted = True
    _wear(facing, material)
    assert _seen(tmp_path, bounces=0) <= PNG_LEVELS


def test_a_material_sees_what_its_object_has(facing, tmp_path):
    """Its colour and its properties, as Object Info and Attribute nodes read them."""
    facing.data.color_attributes["Patchlight"].data.foreach_set("color", np.full(16, 1.0, np.float32))
    facing.color, facing["share"] = (0.5, 0.5, 0.5, 1.0), 0.5
    material = _principled(roughness=1.0)
    tree = material.node_tree
    info, attribute = tree.nodes.new("ShaderNodeObjectInfo"), tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_type, attribute.attribute_name = "OBJECT", "share"
    product = tree.nodes.new("ShaderNodeVectorMath")
    product.operation = "MULTIPLY"
    tree.links.new(info.outputs["Color"], product.inputs[0])
    tree.links.new(attribute.outputs["Fac"], product.inputs[1])
    tree.links.new(product.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    _wear(facing, material)
    assert _seen(tmp_path, bounces=0) == pytest.approx(0.25, abs=PNG_LEVELS)


def test_a_sheared_object_keeps_its_shape(facing, tmp_path):
    """A square of 4, turned 45 degrees, below a parent that is stretched three times: a rhomb of 12."""
    bpy.data.objects["behind"].hide_render = True
    facing.scale = (0.02, 0.02, 1.0)  # 2 x 2
    facing.rotation_euler.z = np.radians(45)
    parent = bpy.data.objects.new("parent", None)
    parent.scale = (3.0, 1.0, 1.0)
    bpy.context.scene.collection.objects.link(parent)
    facing.parent = parent
    facing.location.z = -10.0
    camera = bpy.context.scene.camera.data
    camera.type, camera.ortho_scale = "ORTHO", 10.0
    facing.data.color_attributes["Patchlight"].data.foreach_set("color", np.full(16, 1.0, np.float32))
    _wear(facing, _principled(1.0, roughness=1.0))
    # area of the square, times 3, of 100; edges of 16 x 16 pixels of 64 points: a hundredth
    assert _seen(tmp_path, bounces=0, samples=64) == pytest.approx(0.12, abs=0.01)


def test_a_metal_has_no_mirror_of_a_dielectric_over_its_own(facing, tmp_path):
    _wear(facing, _principled(0.2, metallic=1.0, roughness=picture_rays.ROUGH / 2, ior=3.0))
    assert _seen(tmp_path, scale=8) == pytest.approx(0.2 * 0.5 * 0.8 * LIGHT, abs=PNG_LEVELS / 8)


def test_a_conductor_is_a_mirror_of_its_indices(facing, tmp_path):
    material = _principled()
    tree = material.node_tree
    metal = tree.nodes.new("ShaderNodeBsdfMetallic")
    metal.fresnel_type = "PHYSICAL_CONDUCTOR"
    metal.inputs["IOR"].default_value, metal.inputs["Extinction"].default_value = (0.5,) * 3, (2.0,) * 3
    metal.inputs["Roughness"].default_value = 0.0
    tree.links.new(metal.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    _wear(facing, material)
    assert _seen(tmp_path) == pytest.approx((0.5**2 + 4) / (1.5**2 + 4) * 0.8 * LIGHT, abs=PNG_LEVELS)


def test_what_cannot_be_shown_leaves_nothing_behind(facing, tmp_path):
    facing["patchlight_lightmap"] = "no image"
    before = len(bpy.data.scenes), len(bpy.data.meshes), len(bpy.data.materials), len(bpy.data.objects)
    with pytest.raises(picture.PictureError, match="object ahead: its property patchlight_lightmap is no image"):
        _seen(tmp_path)
    assert before == (len(bpy.data.scenes), len(bpy.data.meshes), len(bpy.data.materials), len(bpy.data.objects))


@pytest.mark.parametrize("is_linked", [False, True])
@pytest.mark.parametrize(("roughness", "left"), [(0.0, 1.0), (picture_rays.ROUGH / 4, 0.75), (picture_rays.ROUGH, 0.0)])
def test_a_mirror_fades_with_roughness(facing, tmp_path, roughness, left, is_linked):
    material = _principled(metallic=1.0, roughness=roughness)
    if is_linked:
        tree = material.node_tree
        value = tree.nodes.new("ShaderNodeValue")
        value.outputs[0].default_value = roughness
        tree.links.new(value.outputs[0], tree.nodes["Principled BSDF"].inputs["Roughness"])
    _wear(facing, material)
    assert _seen(tmp_path) == pytest.approx(left * 0.8 * LIGHT, abs=PNG_LEVELS)


@pytest.mark.parametrize("name", ["ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfMetallic"])
def test_glossy_shaders_are_mirrors(facing, tmp_path, name):
    material = _principled()
    tree = material.node_tree
    shader = tree.nodes.new(name)
    shader.inputs[0].default_value = (0.9, 0.9, 0.9, 1)
    shader.inputs["Roughness"].default_value = 0.0
    tree.links.new(shader.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    _wear(facing, material)
    assert _seen(tmp_path) == pytest.approx(0.9 * 0.8 * LIGHT, abs=PNG_LEVELS)


def test_two_mirrors_take_two_bounces(facing, tmp_path):
    """A valley of two mirrors at right angles sends a ray back where it came from, by way of both."""
    for mirror, turn in ((facing, -45), (_wall("other", 0.0, 0.0), 45)):
        _wear(mirror, _principled(metallic=1.0, roughness=0.0))
        mirror.rotation_euler.y = np.radians(turn)
        mirror.location = (-np.sign(turn) * 35.3, 0.0, -20.0)  # 100 / sqrt(8): they meet below the camera
    assert _seen(tmp_path, bounces=2) == pytest.approx(0.8 * LIGHT, abs=PNG_LEVELS)
    assert _seen(tmp_path, bounces=1) <= PNG_LEVELS


@pytest.mark.parametrize("kind", ["principled", "glass"])
def test_a_pane_lets_through_what_all_its_reflections_leave(facing, tmp_path, kind):
    """Of a slab, (1 - R) / (1 + R) by the sum over the paths within it, R = ((n - 1) / (n + 1))^2; Born & Wolf 7.6."""
    facing.data.color_attributes["Patchlight"].data.foreach_set("color", np.full(16, 0.9, np.float32))
    _wear(facing, _principled(1.0, roughness=1.0))
    bpy.data.objects["behind"].data.color_attributes["Patchlight"].data.foreach_set("color", np.zeros(16, np.float32))
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0, 0, -0.5))
    pane = bpy.context.object
    pane.scale = (50.0, 50.0, 0.1)
    pane.data.color_attributes.new("Patchlight", "FLOAT_COLOR", "CORNER")
    material = _principled(1.0, roughness=0.3, ior=2.0, transmission_weight=1.0)
    if kind == "glass":
        tree = material.node_tree
        glass = tree.nodes.new("ShaderNodeBsdfGlass")
        glass.inputs["IOR"].default_value, glass.inputs["Roughness"].default_value = 2.0, 0.3
        tree.links.new(glass.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    _wear(pane, material)
    reflected = 1 / 9
    # a ray is reflected or goes on by chance: 256 pixels of 64 such rays know a mean to .9 * .4 / 128 = .003
    expected = 0.9 * (1 - reflected) / (1 + reflected)
    assert _seen(tmp_path, bounces=1, samples=64) == pytest.approx(expected, abs=PNG_LEVELS + 0.006)


def test_what_the_camera_does_not_see_is_seen_in_mirrors(facing, tmp_path):
    _wear(facing, _principled(metallic=1.0, roughness=0.0))
    screen = _wall("screen", -0.5, 0.0)
    screen.visible_camera = screen.visible_glossy = False
    assert _seen(tmp_path) == pytest.approx(0.8 * LIGHT, abs=PNG_LEVELS)
    screen.visible_glossy = True
    assert _seen(tmp_path) <= PNG_LEVELS


def test_bounces_out_of_range_are_refused(facing, tmp_path):
    with pytest.raises(picture.PictureError, match="bounces is -1"):
        _seen(tmp_path, bounces=-1)
