"""Nodes between an image and a shader, held against what Cycles bakes of the same material."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from addon.blender.colour_nodes import blackbody
from addon.blender.private_render import RenderError
from addon.blender.read_scene import read_scene
from tests.blender.node_trees import (
    LUMINANCE,
    ROUNDING,
    SIDE,
    TABLES,
    arithmetic,
    baked_by_cycles,
    colours,
    halved,
    image_node,
)

pytestmark = pytest.mark.usefixtures("empty_file")

BLENDS = ["MIX", "ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "SCREEN", "OVERLAY", "SOFT_LIGHT", "LINEAR_LIGHT"]
BLENDS += ["DIFFERENCE", "EXCLUSION", "DARKEN", "LIGHTEN"]


@pytest.mark.parametrize("blend", BLENDS)
def test_a_mix_of_two_images(compare, blend):
    def mix(tree, first, second):
        node = tree.new("Mix")
        node.data_type, node.blend_type = "RGBA", blend
        node.inputs[0].default_value = 0.375
        tree.link(first, node, "Color", 6)
        return tree.link(second, node, "Color", 7)

    compare(mix, socket=2)


@pytest.mark.parametrize("is_clamped", [True, False])
def test_a_mix_by_an_image_is_clamped_where_it_says_so(compare, is_clamped):
    def mix(tree, first, second):
        node = tree.new("Mix")
        node.data_type, node.blend_type, node.clamp_result = "RGBA", "ADD", is_clamped
        node.inputs[6].default_value, node.inputs[7].default_value = (0.1, 0.5, 0.9, 1), (0.8, 0.2, 0.4, 1)
        return halved(tree, tree.link(first, node, "Color", 0), 2)

    compare(mix, tolerance=LUMINANCE)


@pytest.mark.parametrize("is_clamped", [True, False])
def test_a_mix_of_numbers_by_a_factor_above_one(compare, is_clamped):
    def mix(tree, first, second):
        node = tree.new("Mix")
        node.data_type, node.clamp_factor = "FLOAT", is_clamped
        node.inputs[0].default_value, node.inputs[3].default_value = 1.5, 0.6
        return tree.link(first, node, "Color", 2)

    # clamped, the image has no share in it
    compare(mix, tolerance=2 * LUMINANCE, is_flat=is_clamped)


def test_a_mix_of_the_old_kind(compare):
    def mix(tree, first, second):
        node = tree.new("MixRGB")
        node.blend_type = "MULTIPLY"
        node.inputs[0].default_value = 0.75
        tree.link(first, node, "Color", 1)
        return tree.link(second, node, "Color", 2)

    compare(mix)


@pytest.mark.parametrize("interpolation", ["LINEAR", "EASE", "CONSTANT"])
def test_a_ramp(compare, interpolation):
    def ramp(tree, first, second):
        node = tree.new("ValToRGB")
        node.color_ramp.interpolation = interpolation
        node.color_ramp.elements[0].color = (0.9, 0.1, 0.2, 1)
        node.color_ramp.elements.new(0.4).color = (0.1, 0.8, 0.3, 1)
        return tree.link(first, node, "Color", 0)

    compare(ramp, tolerance=TABLES)


def test_curves(compare):
    def curves(tree, first, second):
        node = tree.new("RGBCurve")
        node.mapping.curves[3].points.new(0.3, 0.6)
        node.mapping.curves[0].points.new(0.5, 0.2)
        node.mapping.update()
        node.inputs[0].default_value = 0.8
        return tree.link(first, node, "Color", 1)

    compare(curves, tolerance=TABLES)


@pytest.mark.parametrize(
    ("kind", "numbers", "at"),
    [
        ("HueSaturation", {0: 0.7, 1: 0.6, 2: 0.9, 3: 0.8}, 4),
        ("HueSaturation", {0: 0.2, 1: 1.8, 2: 1.0, 3: 1.0}, 4),
        ("Gamma", {1: 2.2}, 0),
        ("Gamma", {1: 0.4}, 0),
        ("Invert", {0: 0.75}, 1),
        ("BrightContrast", {1: 0.1, 2: 0.4}, 0),
        ("BrightContrast", {1: -0.2, 2: 0.0}, 0),
        ("BrightContrast", {1: 0.1, 2: -0.5}, 0),
        ("RGBToBW", {}, 0),
    ],
)
def test_what_changes_a_colour(compare, kind, numbers, at):
    def node_of(tree, first, second):
        node = tree.new(kind)
        for k, number in numbers.items():
            node.inputs[k].default_value = number
        return tree.link(first, node, "Color", at)

    compare(node_of, tolerance=LUMINANCE if kind == "RGBToBW" else ROUNDING)


def test_curves_go_on_beyond_one(compare):
    def curves(tree, first, second):
        node = tree.new("RGBCurve")
        node.mapping.curves[3].points.new(0.5, 0.25)
        node.mapping.update()
        node.mapping.extend = "EXTRAPOLATED"
        double = tree.new("MixRGB")
        double.blend_type = "ADD"
        double.inputs[0].default_value = 1.0
        for k in (1, 2):
            tree.link(first, double, "Color", k)
        return halved(tree, halved(tree, tree.link(double, node, 0, 1)))

    compare(curves, tolerance=1e-2)  # the last slope of two tables, carried on to twice their range


def test_the_alpha_of_a_ramp(compare):
    def ramp(tree, first, second):
        node = tree.new("ValToRGB")
        node.color_ramp.elements[0].color, node.color_ramp.elements[1].color = (1, 1, 1, 0.2), (0, 0, 0, 0.9)
        return tree.link(first, node, "Color", 0)

    compare(ramp, socket="Alpha", tolerance=TABLES)


@pytest.mark.parametrize("kelvin", [1900, 2700, 4000, 6500, 9000, 20000])
def test_a_black_body(nodes, plane, kelvin):
    material, tree = nodes()
    diffuse = tree.new("BsdfDiffuse")
    tree.show(tree.link(tree.new("Blackbody", Temperature=kelvin), diffuse, 0, "Color"))
    expected = baked_by_cycles(plane_of(plane, material), material)[0, 0]
    # Cycles' colours are fits of their own: within 2 % of each channel, or of the luminance where there is little
    np.testing.assert_allclose(blackbody(kelvin), np.maximum(expected, 0), rtol=0.02, atol=0.02)


def plane_of(plane, material):
    plane.data.materials.append(material)
    return plane


def test_images_of_two_sizes_are_mixed_at_the_finer_one(nodes, add_image, plane):
    material, tree = nodes()
    coarse = np.array([[[0.2] * 3, [0.8] * 3]], np.float32)
    node = tree.new("Mix")
    node.data_type = "RGBA"
    node.inputs[0].default_value = 0.5
    tree.link(image_node(tree, add_image(colours(0), is_float=True, space="Non-Color")), node, "Color", 6)
    tree.link(image_node(tree, add_image(coarse, is_float=True, space="Non-Color")), node, "Color", 7)
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), 2, "Color"))
    plane.data.materials.append(material)
    scene = read_scene(bpy.context.scene)
    found = scene.materials[scene.triangle_materials[0]].reflectance_texture.pixels
    expected = colours(0) / 2
    expected[:, : SIDE // 2] += 0.1
    expected[:, SIDE // 2 :] += 0.4
    np.testing.assert_allclose(found, expected, atol=1e-6)  # float32


def read_with_warnings(plane, material):
    plane.data.materials.append(material)
    scene = read_scene(bpy.context.scene)
    return scene.materials[scene.triangle_materials[0]], scene.warnings


@pytest.fixture
def without_renders(monkeypatch):
    """Have every render fail that would tell what cannot be read."""

    def fail(*_):
        raise RenderError("a render is running")

    monkeypatch.setattr("addon.blender.materials.rendered_means", fail)


def test_colours_mixed_by_noise_are_mixed_evenly_where_nothing_tells_and_it_is_said(nodes, plane, without_renders):
    material, tree = nodes("Wall")
    node = tree.new("Mix")
    node.data_type = "RGBA"
    node.inputs[6].default_value, node.inputs[7].default_value = (0.25, 0.5, 0.25, 1), (0.75, 0.5, 0.25, 1)
    tree.link(tree.new("TexNoise"), node, 0, 0)
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), 2, "Color"))
    found, warnings = read_with_warnings(plane, material)
    np.testing.assert_allclose(found.reflectance, (0.5, 0.5, 0.25), atol=1e-6)  # luminance weights, in 64 bits
    assert len(warnings) == 2
    assert "a render is running" in warnings[0]
    assert "'Wall'" in warnings[1]
    assert "Noise Texture" in warnings[1]


def test_a_ramp_of_noise_is_its_mean_where_nothing_tells_and_it_is_said(nodes, plane, without_renders):
    material, tree = nodes("Wood")
    ramp = tree.link(tree.new("TexNoise"), tree.new("ValToRGB"), 0, 0)
    tree.show(tree.link(ramp, tree.new("BsdfDiffuse"), 0, "Color"))
    found, warnings = read_with_warnings(plane, material)
    np.testing.assert_allclose(found.reflectance, [0.5] * 3, atol=1e-6)  # black to white
    assert len(warnings) == 2
    assert "'Wood'" in warnings[1]


def test_an_alpha_image_cuts_out_what_it_says(nodes, plane):
    """Where nothing is left, the colour is that of what is: a mean over both must not see the holes as black."""
    image = bpy.data.images.new("Leaf", 2, 2, alpha=True, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.array([0.5, 0.5, 0.5, 1.0] + 3 * [0.5, 0.5, 0.5, 0.0], np.float32))
    material, tree = nodes("Leaf")
    node, principled = image_node(tree, image), tree.new("BsdfPrincipled")
    tree.link(node, principled, "Color", "Base Color")
    tree.show(tree.link(node, principled, "Alpha", "Alpha"))
    found, warnings = read_with_warnings(plane, material)
    passing = found.transmittance_texture.pixels * found.transmittance
    np.testing.assert_array_equal(passing[..., 0], [[0, 1], [1, 1]])
    np.testing.assert_allclose(found.reflectance_texture.pixels * found.reflectance, 0.5)
    assert warnings == ()


def test_what_passes_in_part_reflects_the_rest(nodes, plane):
    """A quarter passes, three quarters meet a surface of the colour that it has."""
    material, tree = nodes("Curtain")
    tree.show(tree.new("BsdfPrincipled", **{"Base Color": (0.8, 0.6, 0.4, 1.0), "Alpha": 0.75}))
    found, warnings = read_with_warnings(plane, material)
    np.testing.assert_allclose(found.transmittance, 0.25, atol=1e-6)
    np.testing.assert_allclose(found.reflectance, (0.8, 0.6, 0.4), atol=1e-6)
    assert warnings == ()


def test_shaders_are_mixed_by_an_image_texel_by_texel(nodes, add_image, plane):
    pixels = np.repeat(np.float32([[[0.0], [0.25]], [[0.75], [1.0]]]), 3, axis=2)
    material, tree = nodes("Inlay")
    mix = tree.new("MixShader")
    tree.link(image_node(tree, add_image(pixels, is_float=True, space="Non-Color")), mix, 0, 0)
    tree.link(tree.new("BsdfDiffuse", Color=(0.2, 0.4, 0.6, 1.0)), mix, 0, 1)
    tree.link(tree.new("BsdfDiffuse", Color=(0.6, 0.4, 0.2, 1.0)), mix, 0, 2)
    tree.show(mix)
    found, warnings = read_with_warnings(plane, material)
    colours = found.reflectance_texture.pixels * found.reflectance
    np.testing.assert_allclose(colours, pixels * [0.6, 0.4, 0.2] + (1 - pixels) * [0.2, 0.4, 0.6], atol=1e-6)
    assert not found.transmits
    assert warnings == ()


def test_what_passes_in_another_colour_than_it_reflects_is_said_to_lose_some(nodes, plane):
    """All yellow passes and all blue is reflected: a third of all rays meet it, which is not enough for blue."""
    material, tree = nodes("Film")
    add = tree.new("AddShader")
    tree.link(tree.new("BsdfTransparent", Color=(1.0, 1.0, 0.0, 1.0)), add, 0, 0)
    tree.link(tree.new("BsdfDiffuse", Color=(0.0, 0.0, 1.0, 1.0)), add, 0, 1)
    tree.show(add)
    found, warnings = read_with_warnings(plane, material)
    assert found.transmittance == (1, 1, 0)
    assert found.reflectance == (0, 0, 1)
    assert len(warnings) == 1
    assert "'Film'" in warnings[0]


def test_an_image_whose_alpha_is_one_is_opaque_without_a_word(nodes, add_image, plane):
    material, tree = nodes()
    node, principled = image_node(tree, add_image(colours(0))), tree.new("BsdfPrincipled")
    tree.show(tree.link(node, principled, "Alpha", "Alpha"))
    found, warnings = read_with_warnings(plane, material)
    assert found.transmittance == (0, 0, 0)
    assert warnings == ()


def test_what_alpha_an_image_has_is_clamped(nodes, add_image, plane):
    """Texels of .5 and 0, times 4, let through none and all."""
    pixels = np.array([[[0.5] * 3, [0.0] * 3]], np.float32)
    material, tree = nodes()
    alpha = arithmetic(tree, "MULTIPLY", 4.0, image_node(tree, add_image(pixels, is_float=True, space="Non-Color")))
    tree.show(tree.link(alpha, tree.new("BsdfPrincipled"), 0, "Alpha"))
    found, _ = read_with_warnings(plane, material)
    passing = found.transmittance_texture.pixels * found.transmittance
    np.testing.assert_array_equal(passing[0, :, 0], [0, 1])


def test_a_number_that_no_image_has_a_part_in_is_read_without_a_word(nodes, plane):
    material, tree = nodes()
    number = tree.new("Value")
    number.outputs[0].default_value = 0.75
    tree.show(tree.link(number, tree.new("BsdfPrincipled"), 0, "Alpha"))
    found, warnings = read_with_warnings(plane, material)
    assert found.transmittance == (0.25, 0.25, 0.25)
    assert warnings == ()


def test_what_a_muted_node_lets_through_is_a_number_where_one_is_asked_for(nodes, plane):
    material, tree = nodes()
    colour, node = tree.new("RGB"), tree.new("HueSaturation")
    colour.outputs[0].default_value, node.mute = (0.5, 0.5, 0.5, 1.0), True
    tree.link(colour, node, 0, "Color")
    tree.show(tree.link(node, tree.new("BsdfPrincipled"), 0, "Alpha"))
    found, warnings = read_with_warnings(plane, material)
    np.testing.assert_allclose(found.transmittance, 0.5, atol=1e-6)  # a mean is rounded so
    assert warnings == ()


@pytest.mark.parametrize("kind", ["HueSaturation", "Gamma"])
def test_a_muted_node_lets_no_number_of_its_own_through(nodes, plane, kind):
    """Cycles has black there, and so has it behind a reroute that nothing feeds."""
    material, tree = nodes()
    node, reroute = tree.new(kind, Color=(0.5, 0.4, 0.3, 1.0)), tree.new("Reroute")
    node.mute = True
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), 0, "Color"))
    found, warnings = read_with_warnings(plane, material)
    assert found.reflectance == (0, 0, 0)
    tree.show(tree.link(reroute, tree.new("BsdfDiffuse"), 0, "Color"))
    found, more = read_with_warnings(plane, material)
    assert found.reflectance == (0, 0, 0)
    assert warnings == more == ()


def test_an_image_that_nobody_looks_at_moves_no_other(nodes, add_image, plane):
    """A mask with a Mapping is multiplied by noise, which cannot be read: the base colour's image stays in place."""
    material, tree = nodes()
    mask = image_node(tree, add_image(colours(1), is_float=True, space="Non-Color"))
    tree.link(
        tree.link(tree.new("TexCoord"), tree.new("Mapping", Scale=(20, 20, 1)), "UV", "Vector"), mask, 0, "Vector"
    )
    dirt = arithmetic(tree, "MULTIPLY", 0.5, mask)
    tree.link(tree.new("TexNoise"), dirt, 0, 1)
    mix, diffuse = tree.new("MixShader"), tree.new("BsdfDiffuse")
    base = image_node(tree, add_image(colours(0), is_float=True, space="Non-Color"))
    tree.link(tree.link(base, diffuse, "Color", "Color"), mix, 0, 1)
    tree.link(dirt, mix, 0, 0)
    tree.show(mix)
    plane.data.materials.append(material)
    scene = read_scene(bpy.context.scene)
    assert scene.uvs.max() == 1.0
    assert not any("coordinates" in warning for warning in scene.warnings)


def test_the_side_of_a_mix_that_has_no_share_need_not_be_readable(nodes, plane):
    material, tree = nodes()
    node = tree.new("Mix")
    node.data_type = "RGBA"
    node.inputs[0].default_value, node.inputs[6].default_value = 0.0, (0.25, 0.5, 0.75, 1)
    tree.link(tree.new("TexNoise"), node, "Color", 7)
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), 2, "Color"))
    found, warnings = read_with_warnings(plane, material)
    assert found.reflectance == (0.25, 0.5, 0.75)
    assert warnings == ()


def test_a_node_that_is_used_twice_is_read_once(nodes, add_image, plane):
    """Forty nodes, each taking the one before it twice: 2^40 readings if each use were one."""
    material, tree = nodes()
    last, socket = image_node(tree, add_image(colours(0))), 0
    for _ in range(40):
        node = tree.new("Mix")
        node.data_type = "RGBA"
        tree.link(last, node, socket, 6)
        last, socket = tree.link(last, node, socket, 7), 2
    tree.show(tree.link(last, tree.new("BsdfDiffuse"), 2, "Color"))
    found, _ = read_with_warnings(plane, material)
    assert found.reflectance_texture.pixels.shape == (SIDE, SIDE, 3)
