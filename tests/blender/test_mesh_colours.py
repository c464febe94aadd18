"""Colours that lie in a mesh: what its triangles reflect."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from addon.blender.mesh_colours import LEVELS, palette, palette_uvs
from addon.blender.read_scene import read_scene
from addon.core.textures import lookup, textured_colours

pytestmark = pytest.mark.usefixtures("empty_file")

STEP = 1 / (LEVELS - 1)  # of the square root, between levels: half of it is the most that one is off
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]


@pytest.fixture
def painted(add_mesh):
    """Make two squares side by side, with an attribute of given values."""

    def make(material, values, name="Col", kind="FLOAT_COLOR", domain="CORNER"):
        points = SQUARE + [(x + 2, y, z) for x, y, z in SQUARE]
        mesh = add_mesh("Squares", points, [(0, 1, 2, 3), (4, 5, 6, 7)], material).data
        attribute = mesh.attributes.new(name, kind, domain)
        field = "value" if kind == "FLOAT" else "vector" if kind == "FLOAT_VECTOR" else "color"
        attribute.data.foreach_set(field, np.ravel(values).astype(np.float32))
        mesh.uv_layers.new(name="UVMap")
        return mesh

    return make


def reflected():
    """What the two squares' four triangles reflect in the middle, and the warnings."""
    scene = read_scene(bpy.context.scene)
    middles = np.full((4, 3), 1 / 3, np.float32)
    return textured_colours(scene, np.arange(4), middles, "reflectance"), scene.warnings


def assert_close(found, expected):
    assert np.abs(np.sqrt(found) - np.sqrt(expected)).max() <= 0.51 * STEP


def test_the_palette_has_every_colour_where_it_says():
    colours = np.random.default_rng(0).uniform(0, 1, (500, 3))
    uvs = palette_uvs(colours)
    assert (uvs == uvs[:, :1]).all()
    assert_close(lookup(palette(), uvs[:, 0]), colours)


@pytest.mark.parametrize(("kind", "domain", "per_face"), [("FLOAT_COLOR", "CORNER", 4), ("BYTE_COLOR", "POINT", 4)])
def test_triangles_reflect_the_colour_of_their_corners(nodes, painted, kind, domain, per_face):
    material, tree = nodes()
    tree.show(tree.link(tree.new("VertexColor"), tree.new("BsdfDiffuse"), "Color", "Color"))
    colours = np.array([(0.8, 0.2, 0.1), (0.0, 0.5, 1.0)])
    mesh = painted(material, np.repeat([(*c, 1) for c in colours], per_face, axis=0), kind=kind, domain=domain)
    mesh.color_attributes.render_color_index = 0
    found, warnings = reflected()
    assert_close(found, np.repeat(colours, 2, axis=0))
    assert warnings == ()


@pytest.mark.parametrize(("kind", "values"), [("FLOAT", (0.25, 0.5)), ("FLOAT_VECTOR", ((0.2, 0.4, 0.6), (1, 0, 0)))])
def test_an_attribute_of_faces_is_a_colour_too(nodes, painted, kind, values):
    material, tree = nodes()
    node = tree.new("Attribute")
    node.attribute_name = "Wear"
    tree.show(tree.link(node, tree.new("BsdfPrincipled"), "Color", "Base Color"))
    painted(material, values, "Wear", kind, "FACE")
    found, _ = reflected()
    assert_close(found, np.repeat(np.broadcast_to(np.reshape(values, (2, -1)), (2, 3)), 2, axis=0))


@pytest.mark.parametrize("kind", ["FLOAT_COLOR", "BYTE_COLOR"])
@pytest.mark.parametrize(
    ("node", "output", "expected"),
    [
        ("Attribute", "Vector", [(0.9, 0.3, 0.0), (0.2, 0.2, 0.8)]),
        ("Attribute", "Fac", [(0.4, 0.4, 0.4), (0.4, 0.4, 0.4)]),  # the mean of the channels
        ("Attribute", "Alpha", [(0.5, 0.5, 0.5), (0.25, 0.25, 0.25)]),
        ("VertexColor", "Alpha", [(0.5, 0.5, 0.5), (0.25, 0.25, 0.25)]),
    ],
)
def test_other_outputs_of_an_attribute(nodes, painted, kind, node, output, expected):
    material, tree = nodes()
    source = tree.new(node)
    setattr(source, "attribute_name" if node == "Attribute" else "layer_name", "Col")
    tree.show(tree.link(source, tree.new("BsdfDiffuse"), output, "Color"))
    painted(material, np.repeat([(0.9, 0.3, 0.0, 0.5), (0.2, 0.2, 0.8, 0.25)], 4, axis=0), kind=kind)
    found, warnings = reflected()
    # a level off in each channel, the mean of which has no less; bytes are half of 1 / 255 of the encoded colour off
    np.testing.assert_allclose(np.sqrt(found), np.sqrt(np.repeat(expected, 2, axis=0)), atol=1.02 * STEP)
    assert warnings == ()


def test_a_number_of_no_colour_has_an_alpha_of_one_and_a_mask_of_itself(nodes, painted):
    """A mask by Geometry Nodes mixes two shaders."""
    material, tree = nodes()
    mask, mix = tree.new("Attribute"), tree.new("MixShader")
    mask.attribute_name = "Mask"
    tree.link(mask, mix, "Fac", 0)
    tree.link(tree.new("BsdfDiffuse", Color=(0.0, 0.0, 0.0, 1.0)), mix, 0, 1)
    tree.link(tree.new("BsdfDiffuse", Color=(0.8, 0.8, 0.8, 1.0)), mix, 0, 2)
    tree.show(mix)
    painted(material, [0.25, 1.0], "Mask", "FLOAT", "FACE")
    found, warnings = reflected()
    np.testing.assert_allclose(found[:, 0], [0.2, 0.2, 0.8, 0.8], atol=0.8 * 1.02 * STEP)
    assert warnings == ()


def test_nodes_change_what_lies_in_the_mesh(nodes, painted):
    material, tree = nodes()
    invert = tree.link(tree.new("VertexColor"), tree.new("Invert"), "Color", "Color")
    tree.show(tree.link(invert, tree.new("BsdfDiffuse"), 0, "Color"))
    mesh = painted(material, np.repeat([(0.9, 0.5, 0.1, 1), (0.2, 0.2, 0.2, 1)], 4, axis=0))
    mesh.color_attributes.render_color_index = 0
    found, _ = reflected()
    expected = np.repeat([(0.1, 0.5, 0.9), (0.8, 0.8, 0.8)], 2, axis=0)
    # a level is so far off before it is inverted
    assert np.abs(found - expected).max() <= 1.02 * STEP


def test_a_mesh_without_the_attribute_is_black_as_cycles_has_it(nodes, painted):
    material, tree = nodes()
    node = tree.new("VertexColor")
    node.layer_name = "Other"
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), "Color", "Color"))
    painted(material, np.ones((8, 4)))
    found, _ = reflected()
    assert (found == 0).all()


def test_beside_an_image_the_image_is_read_and_the_guess_is_said(nodes, painted, add_image):
    material, tree = nodes("Dirt")
    image = tree.new("TexImage")
    image.image = add_image(np.full((2, 2, 3), 0.5, np.float32), is_float=True, space="Non-Color")
    mix = tree.new("Mix")
    mix.data_type = "RGBA"
    mix.inputs[7].default_value = (0, 0, 0, 1)
    tree.link(tree.new("VertexColor"), mix, "Color", 0)
    tree.link(image, mix, "Color", 6)
    tree.show(tree.link(mix, tree.new("BsdfDiffuse"), 2, "Color"))
    painted(material, np.ones((8, 4)))
    found, warnings = reflected()
    np.testing.assert_allclose(found, 0.25, atol=1e-6)  # mixed evenly with black
    (warning,) = warnings
    assert "'Dirt'" in warning
    assert "Color Attribute" in warning


def test_what_was_baked_into_a_mesh_is_light_and_no_colour(nodes, painted):
    material, tree = nodes("Shown")
    material.diffuse_color = (0.5, 0.25, 0.125, 1.0)
    node = tree.new("VertexColor")
    node.layer_name = "Patchlight"
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), "Color", "Color"))
    painted(material, np.ones((8, 4)), "Patchlight")
    found, warnings = reflected()
    assert (found == np.float32([0.5, 0.25, 0.125])).all()
    assert len(warnings) == 1


@pytest.mark.parametrize(("kind", "values", "expected"), [("INT", [1, 0], [1, 0]), ("BOOLEAN", [True, False], [1, 0])])
def test_a_number_of_any_type_is_a_grey(nodes, add_mesh, kind, values, expected):
    material, tree = nodes()
    node = tree.new("Attribute")
    node.attribute_name = "Mask"
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), "Color", "Color"))
    points = SQUARE + [(x + 2, y, z) for x, y, z in SQUARE]
    mesh = add_mesh("Squares", points, [(0, 1, 2, 3), (4, 5, 6, 7)], material).data
    mesh.attributes.new("Mask", kind, "FACE").data.foreach_set("value", values)
    found, _ = reflected()
    assert_close(found, np.repeat(expected, 2)[:, None] * np.ones(3))


def test_brighter_colours_are_said_to_be_clipped(nodes, painted):
    material, tree = nodes()
    tree.show(tree.link(tree.new("VertexColor"), tree.new("Emission"), "Color", "Color"))
    mesh = painted(material, np.full((8, 4), 5.0))
    mesh.color_attributes.render_color_index = 0
    (warning,) = read_scene(bpy.context.scene).warnings
    assert "above 1" in warning


def test_the_render_colours_are_never_what_was_baked(nodes, painted):
    material, tree = nodes()
    tree.show(tree.link(tree.new("VertexColor"), tree.new("BsdfDiffuse"), "Color", "Color"))
    mesh = painted(material, np.repeat([(0.8, 0.2, 0.1, 1)], 8, axis=0))
    baked = mesh.color_attributes.new("Patchlight", "FLOAT_COLOR", "CORNER")
    baked.data.foreach_set("color", np.full(32, 0.5, np.float32))
    mesh.color_attributes.render_color_index = 1
    found, _ = reflected()
    assert_close(found, np.repeat([(0.8, 0.2, 0.1)], 4, axis=0))


def test_what_has_baked_light_only_is_said_to_be_black(nodes, painted):
    material, tree = nodes()
    tree.show(tree.link(tree.new("VertexColor"), tree.new("BsdfDiffuse"), "Color", "Color"))
    mesh = painted(material, np.ones((8, 4)), "Patchlight")
    mesh.color_attributes.render_color_index = 0
    found, (warning,) = reflected()
    assert (found == 0).all()
    assert "'Squares'" in warning
