"""Colours of textures that no image holds: what Cycles shows of them, as means."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from addon.blender.read_scene import read_scene

pytestmark = pytest.mark.usefixtures("empty_file")

DARK, LIGHT = (0.25, 0.125, 0.5), (0.75, 0.375, 0.25)
EDGES = 0.03  # of a mean: tiles are wider than a whole number of a texture's periods


@pytest.fixture
def read(add_cube):
    """Read materials, each on a cube: (core materials, warnings)."""

    def read_materials(*materials):
        for material in materials:
            add_cube().data.materials.append(material)
        scene = read_scene(bpy.context.scene)
        return [scene.materials[row] for row in scene.triangle_materials[::12]], scene.warnings

    return read_materials


def checker(tree, scale=20.0):
    return tree.new("TexChecker", Color1=(*DARK, 1), Color2=(*LIGHT, 1), Scale=scale)


def means(colour):
    return np.array(colour[:3], float)


def test_a_checker_has_its_mean_and_it_is_said(nodes, read):
    material, tree = nodes("Tiles")
    tree.show(tree.link(checker(tree), tree.new("BsdfPrincipled"), "Color", "Base Color"))
    (found,), warnings = read(material)
    np.testing.assert_allclose(found.reflectance, (means(DARK) + LIGHT) / 2, rtol=EDGES)
    (warning,) = warnings
    assert warning == "material 'Tiles': its Base Color is what Cycles shows of it, on the mean of a square metre"


@pytest.mark.parametrize("axis", range(3))
def test_what_varies_along_one_axis_varies_on_a_tile(nodes, read, axis):
    """Generated coordinates run from 0 to 1 along each."""
    material, tree = nodes()
    separate = tree.link(tree.new("TexCoord"), tree.new("SeparateXYZ"), "Generated", 0)
    tree.show(tree.link(separate, tree.new("BsdfDiffuse"), axis, "Color"))
    (found,), _ = read(material)
    np.testing.assert_allclose(found.reflectance, 0.5, atol=0.01)


def test_many_are_told_by_one_render_each_its_own(nodes, read, monkeypatch):
    rendered = []
    monkeypatch.setattr("addon.blender.render_colours.rendered", counting(rendered))
    made = [nodes(f"M{k}") for k in range(7)]
    for k, (_, tree) in enumerate(made):
        scaled = tree.new("VectorMath")
        scaled.operation = "SCALE"
        scaled.inputs["Scale"].default_value = k / 8
        tree.link(checker(tree), scaled, "Color", 0)
        tree.show(tree.link(scaled, tree.new("BsdfDiffuse"), 0, "Color"))
    found, _ = read(*(material for material, _ in made))
    assert len(rendered) == 1
    for k, material in enumerate(found):
        np.testing.assert_allclose(material.reflectance, k / 8 * (means(DARK) + LIGHT) / 2, rtol=EDGES)


def counting(io_calls):
    from addon.blender.private_render import rendered

    def call(*arguments):
        io_calls.append(arguments)
        return rendered(*arguments)

    return call


def test_shaders_mixed_and_cut_out_by_a_checker(nodes, read):
    material, tree = nodes()
    mix, shader = tree.new("MixShader"), tree.new("BsdfPrincipled", Base_Color=(*LIGHT, 1))
    tree.link(tree.new("TexChecker", Scale=20.0, Color1=(1, 1, 1, 1), Color2=(0, 0, 0, 1)), mix, "Color", 0)
    tree.link(tree.new("BsdfTransparent", Color=(1, 1, 1, 1)), mix, 0, 1)
    tree.show(tree.link(shader, mix, 0, 2))
    (found,), _ = read(material)
    np.testing.assert_allclose(found.transmittance, 0.5, rtol=EDGES)
    np.testing.assert_allclose(found.reflectance, LIGHT, atol=1e-6)


def test_light_of_a_texture_has_the_mean_of_its_colour(nodes, read):
    material, tree = nodes()
    tree.show(tree.link(checker(tree), tree.new("Emission", Strength=10.0), "Color", "Color"))
    (found,), _ = read(material)
    np.testing.assert_allclose(found.radiance, 5 * (means(DARK) + LIGHT), rtol=EDGES)


def test_an_image_that_a_texture_dims_keeps_its_picture(nodes, read, add_image):
    """Halves of 0.5 and 1, times a checker of 0.25 and 0.75: the same halves, half as bright."""
    material, tree = nodes()
    image, product = tree.new("TexImage"), tree.new("Mix", Factor=1.0)
    image.image = add_image(np.float32([[[0.5] * 3, [1.0] * 3]]), is_float=True, space="Non-Color")
    product.data_type, product.blend_type = "RGBA", "MULTIPLY"
    product.inputs[0].default_value = 1.0
    tree.link(image, product, "Color", 6)
    dim = tree.new("Mix")
    dim.data_type = "RGBA"
    dim.inputs[6].default_value, dim.inputs[7].default_value = (0.25, 0.25, 0.25, 1), (0.75, 0.75, 0.75, 1)
    tree.link(tree.new("TexChecker", Scale=20.0, Color1=(1, 1, 1, 1), Color2=(0, 0, 0, 1)), dim, "Color", 0)
    tree.link(dim, product, 2, 7)
    tree.show(tree.link(product, tree.new("BsdfDiffuse"), 2, "Color"))
    (found,), _ = read(material)
    pixels = found.reflectance_texture.pixels * found.reflectance
    np.testing.assert_allclose(pixels[0, 1] / pixels[0, 0], 2, rtol=1e-5)
    np.testing.assert_allclose(pixels.mean(axis=(0, 1)), 0.75 * 0.5, rtol=EDGES)


def test_a_group_is_looked_into_and_the_file_stays_as_it_is(nodes, read):
    group = bpy.data.node_groups.new("Pattern", "ShaderNodeTree")
    group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
    texture = group.nodes.new("ShaderNodeTexChecker")
    texture.inputs["Color1"].default_value, texture.inputs["Color2"].default_value = (*DARK, 1), (*LIGHT, 1)
    texture.inputs["Scale"].default_value = 20
    group.links.new(texture.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    material, tree = nodes()
    node = tree.new("Group")
    node.node_tree = group
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), 0, "Color"))
    kinds = ("scenes", "objects", "meshes", "cameras", "images", "materials", "node_groups")
    before = {kind: len(getattr(bpy.data, kind)) for kind in kinds}
    (found,), _ = read(material)
    np.testing.assert_allclose(found.reflectance, (means(DARK) + LIGHT) / 2, rtol=EDGES)
    after = {kind: len(getattr(bpy.data, kind)) for kind in kinds}
    assert after == {**before, "objects": before["objects"] + 1, "meshes": before["meshes"] + 1}  # the cube


def test_what_the_view_decides_is_not_rendered(nodes, read, monkeypatch):
    monkeypatch.setattr("addon.blender.materials.rendered_means", None)  # calling it fails
    material, tree = nodes()
    mix = tree.link(tree.new("NewGeometry"), tree.new("MixShader"), "Backfacing", 0)
    tree.link(tree.new("BsdfDiffuse", Color=(*LIGHT, 1)), mix, 0, 1)
    tree.show(mix)
    (found,), _ = read(material)
    assert found.reflectance == LIGHT


def test_a_share_is_one_at_every_point(nodes, read):
    """Of a wave of -4 to 4 Cycles takes 0 and 1, of a half each; its mean, 0 here, would say nothing of that."""
    material, tree = nodes()
    scaled, mix = tree.new("Math"), tree.new("MixShader")
    scaled.operation = "MULTIPLY_ADD"
    scaled.inputs[1].default_value, scaled.inputs[2].default_value = 8.0, -4.0
    tree.link(tree.new("TexChecker", Scale=20.0, Color1=(1, 1, 1, 1), Color2=(0, 0, 0, 1)), scaled, "Color", 0)
    tree.link(scaled, mix, 0, 0)
    tree.link(tree.new("BsdfDiffuse", Color=(*DARK, 1)), mix, 0, 1)
    tree.link(tree.new("BsdfDiffuse", Color=(*LIGHT, 1)), mix, 0, 2)
    tree.show(mix)
    (found,), _ = read(material)
    np.testing.assert_allclose(found.reflectance, (means(DARK) + LIGHT) / 2, rtol=EDGES)


def test_a_colour_is_a_grey_where_a_number_is_asked_for(nodes, read):
    material, tree = nodes()
    red = tree.new("TexChecker", Scale=20.0, Color1=(1, 0, 0, 1), Color2=(1, 0, 0, 1))
    tree.show(tree.link(red, tree.new("Emission", Color=(1, 1, 1, 1)), "Color", "Strength"))
    (found,), _ = read(material)
    np.testing.assert_allclose(found.radiance, 0.2126, rtol=1e-3)


def test_the_output_of_cycles_is_the_one_that_is_shown(nodes, read):
    material, tree = nodes()
    output = tree.new("OutputMaterial")
    output.target = "CYCLES"
    tree.link(tree.link(checker(tree), tree.new("BsdfDiffuse"), "Color", "Color"), output, 0, "Surface")
    (found,), _ = read(material)
    np.testing.assert_allclose(found.reflectance, (means(DARK) + LIGHT) / 2, rtol=EDGES)


def test_what_differs_by_object_is_not_told_by_a_tile(nodes, read):
    material, tree = nodes()
    material.diffuse_color = (*DARK, 1)
    tree.show(tree.link(tree.new("ObjectInfo"), tree.new("BsdfDiffuse"), "Location", "Color"))
    (found,), (warning,) = read(material)
    assert found.reflectance == DARK
    assert "Object Info" in warning
