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


def linear_of(encoded):
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("is_linked", [False, True])
@pytest.mark.parametrize(
    ("mode", "space"), [("STRAIGHT", "sRGB"), ("CHANNEL_PACKED", "sRGB"), ("STRAIGHT", "Non-Color")]
)
def test_a_colour_goes_by_its_alpha_where_that_is_not_linked(nodes, read_material, is_linked, mode, space):
    """As Cycles has it: bytes are multiplied as they are stored, before they become linear."""
    image = bpy.data.images.new("Leaf", 2, 1)
    image.alpha_mode, image.colorspace_settings.name = mode, space  # each makes it anew
    image.pixels.foreach_set([0.6, 0.4, 0.2, 1.0, 0.6, 0.4, 0.2, 0.4])
    material, tree = nodes()
    picture, diffuse = image_node(tree, image), tree.new("BsdfPrincipled", **{"Specular IOR Level": 0.0})
    tree.link(picture, diffuse, 0, "Base Color")
    if is_linked:
        tree.link(picture, diffuse, 1, "Alpha")
    tree.show(diffuse)
    found, _ = read_material(material)
    goes_by_alpha = not is_linked and (mode, space) == ("STRAIGHT", "sRGB")
    stored = np.array([[0.6, 0.4, 0.2], np.array([0.6, 0.4, 0.2]) * (0.4 if goes_by_alpha else 1)])
    expected = linear_of(stored) if space == "sRGB" else stored
    # bytes: half of 1 / 255 each in colour and alpha
    np.testing.assert_allclose(found.reflectance_texture.pixels[0] * found.reflectance, expected, atol=0.006)


def test_floats_that_are_products_are_divided_where_alpha_is_linked(nodes, read_material):
    image = bpy.data.images.new("Glow", 2, 1, float_buffer=True, alpha=True)
    image.colorspace_settings.name, image.alpha_mode = "Linear Rec.709", "PREMUL"
    image.pixels.foreach_set([0.6, 0.4, 0.2, 1.0, 0.15, 0.1, 0.05, 0.25])
    for is_linked in (False, True):
        material, tree = nodes(f"{is_linked}")
        picture, emission = image_node(tree, image), tree.new("Emission")
        tree.link(picture, emission, 0, "Color")
        if is_linked:
            tree.link(picture, emission, 1, "Strength")
        tree.show(emission)
        found, _ = read_material(material)
        # by alpha, or by strength, which is alpha here: the same light
        seen = found.radiance_texture.pixels[0] * found.radiance
        np.testing.assert_allclose(seen, [(0.6, 0.4, 0.2), (0.15, 0.1, 0.05)], atol=1e-6)


def test_a_texture_mapping_of_the_image_itself_is_read(nodes, read_material, add_image):
    material, tree = nodes()
    picture = image_node(tree, add_image(checker()))
    picture.texture_mapping.translation, picture.texture_mapping.scale = (0.5, 0.25, 0), (2, 3, 1)
    tree.show(tree.link(picture, tree.new("BsdfDiffuse"), 0, "Color"))
    read_material(material)
    scene = read_scene(bpy.context.scene)
    layer = bpy.data.objects[0].data.uv_layers[0]
    loops = scene.objects[0].corners
    own = np.array([each.uv[:] for each in layer.data])[loops]
    np.testing.assert_allclose(scene.uvs, own * (2, 3) + (0.5, 0.25), atol=1e-6)  # float32
    picture.texture_mapping.mapping_x = "Y"
    _, warnings = read_material(material)
    assert "Texture Mapping" in warnings[0]


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
