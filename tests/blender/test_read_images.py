"""Images as textures: colour spaces, sizes, and what lies beyond their edges."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from addon.blender.read_scene import read_scene
from addon.core.textures import lookup
from tests.blender.test_read_materials import RED, checker, image_node

pytestmark = pytest.mark.usefixtures("empty_file")


def test_srgb_bytes_become_linear_and_data_and_floats_stay(nodes, read_material, add_image):
    pixels = checker()
    linear = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
    for is_float, space, expected in (
        (False, "sRGB", linear),
        (False, "Non-Color", pixels),
        (True, "Non-Color", pixels),
    ):
        material, tree = nodes(f"{space} {is_float}")
        diffuse = tree.new("BsdfDiffuse")
        tree.link(image_node(tree, add_image(pixels, is_float=is_float, space=space)), diffuse, 0, "Color")
        tree.show(diffuse)
        found, warnings = read_material(material)
        np.testing.assert_allclose(found.reflectance_texture.pixels, expected, atol=1e-6)  # float32
        assert warnings == ()


def test_an_image_that_two_materials_use_is_one_texture(nodes, add_cube, add_image):
    image = add_image(checker())
    for name in "AB":
        material, tree = nodes(name)
        tree.show(tree.link(image_node(tree, image), tree.new("BsdfDiffuse"), 0, "Color"))
        add_cube(name, material).data.uv_layers.new(name="UVMap")
    first, second = read_scene(bpy.context.scene).materials[1:]
    assert first.reflectance_texture is second.reflectance_texture is not None


def test_an_image_that_cannot_be_loaded_is_named(nodes, read_material):
    material, tree = nodes("Poster")
    material.diffuse_color = RED
    image = bpy.data.images.new("Lost", 1, 1)
    image.source, image.filepath = "FILE", "//no such picture.png"
    tree.show(tree.link(image_node(tree, image), tree.new("BsdfDiffuse"), 0, "Color"))
    found, warnings = read_material(material)
    assert found.reflectance == RED[:3]
    assert "'Poster'" in warnings[0]
    assert "'Lost'" in warnings[0]


def test_a_large_image_is_shrunk_without_changing_its_mean(nodes, read_material, add_image):
    material, tree = nodes()
    pixels = np.random.default_rng(1).random((4, 4100, 3), dtype=np.float32)
    tree.show(
        tree.link(
            image_node(tree, add_image(pixels, is_float=True, space="Non-Color")), tree.new("BsdfDiffuse"), 0, "Color"
        )
    )
    texture = read_material(material)[0].reflectance_texture.pixels
    assert texture.shape == (4, 1366, 3)
    # 4100 = 3 x 1366 + 2 columns: the last two are left out
    np.testing.assert_allclose(texture.mean(axis=(0, 1)), pixels[:, :4098].mean(axis=(0, 1)), rtol=1e-5)


@pytest.mark.parametrize("size", [(4, 2048), (8, 100), (300, 300), (1, 1)])
def test_a_clipped_image_is_all_there_however_thin(nodes, read_material, add_image, size):
    """White within, through a node that shrinks it; black from a texel beyond its edges on."""
    material, tree = nodes()
    image = image_node(tree, add_image(np.ones((*size, 3), np.float32), is_float=True, space="Non-Color"))
    image.extension = "CLIP"
    gamma = tree.link(image, tree.new("Gamma", Gamma=1.0), "Color", "Color")
    tree.show(tree.link(gamma, tree.new("BsdfDiffuse"), 0, "Color"))
    found, _ = read_material(material)
    assert found.textures_extend
    texel = 1 / np.minimum(np.maximum(size[::-1], 16), 256)  # which nodes leave
    within = np.array([(0.5, 0.5), 1.5 * texel, 1 - 1.5 * texel])
    beyond = np.array([(0.5, -1.5 * texel[1]), (1 + 1.5 * texel[0], 0.5), (5.0, 0.5)])
    for places, value in ((within, 1.0), (beyond, 0.0)):
        places = (1 / 18 + places * 16 / 18) * found.reflectance[0]
        np.testing.assert_allclose(lookup(found.reflectance_texture, places, True), value, atol=1e-6)


def test_images_that_end_in_several_ways_share_their_coordinates(nodes, read_material, add_image):
    material, tree = nodes("decal")
    colour = image_node(tree, add_image(checker(), "a", is_float=True, space="Non-Color"))
    share = image_node(tree, add_image(checker(), "b", is_float=True, space="Non-Color"))
    share.extension = "CLIP"
    mix = tree.link(share, tree.new("MixShader"), "Color", 0)
    tree.link(tree.new("BsdfTransparent"), mix, 0, 1)
    tree.show(tree.link(tree.link(colour, tree.new("BsdfDiffuse"), "Color", "Color"), mix, 0, 2))
    found, warnings = read_material(material)
    assert not found.textures_extend
    assert found.transmittance_texture.pixels.shape == checker().shape
    assert warnings == (
        "material 'decal': its images go on in several ways beyond their edges: all are repeated there",
    )
