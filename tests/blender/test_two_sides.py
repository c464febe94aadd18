"""Materials whose nodes ask which side is seen."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from addon.blender.read_scene import read_scene

pytestmark = pytest.mark.usefixtures("empty_file")

WARM, COLD = (0.7, 0.4, 0.1), (0.1, 0.3, 0.7)


@pytest.fixture
def read(nodes, add_cube):
    """Read a material that is one shader in front and another behind: (Material, what is said)."""

    def read_sides(front, back, inverted=False):
        material, tree = nodes("sides")
        mix, asked = tree.new("MixShader"), tree.new("NewGeometry")
        if inverted:
            less = tree.new("Math")
            less.operation, less.inputs[0].default_value = "SUBTRACT", 1.0
            tree.link(tree.link(asked, less, "Backfacing", 1), mix, 0, 0)
        else:
            tree.link(asked, mix, "Backfacing", 0)
        for k, make in enumerate((back, front) if inverted else (front, back)):
            tree.link(make(tree), mix, 0, k + 1)
        tree.show(mix)
        add_cube(material=material)
        scene = read_scene(bpy.context.scene)
        return scene.materials[1], scene.warnings

    return read_sides


def diffuse(colour):
    return lambda tree: tree.new("BsdfDiffuse", Color=(*colour, 1))


def glow(strength):
    return lambda tree: tree.new("Emission", Strength=strength)


def nothing(tree):
    return tree.new("BsdfTransparent")


def translucent(tree):
    return tree.new("BsdfTranslucent", Color=(0.5, 0.5, 0.5, 1))


def image(add_image, value):
    def shader(tree):
        node = tree.new("TexImage")
        node.image = add_image(np.full((2, 2, 3), value, np.float32), f"grey {value}", is_float=True, space="Non-Color")
        return tree.link(node, tree.new("BsdfDiffuse"), "Color", "Color")

    return shader


@pytest.mark.parametrize("inverted", [False, True])
def test_two_colours(read, inverted):
    found, said = read(diffuse(WARM), diffuse(COLD), inverted)
    assert found.reflectance == pytest.approx(WARM)
    assert found.back.reflectance == pytest.approx(COLD)
    assert said == ()


def test_the_same_on_both_sides_is_no_back(read):
    assert read(diffuse(WARM), diffuse(WARM))[0].back is None


def test_a_lamp_in_front(read):
    found, said = read(glow(4.0), diffuse(COLD))
    assert (found.radiance, found.reflectance) == ((4, 4, 4), (0, 0, 0))
    assert (found.back.radiance, found.back.reflectance) == ((0, 0, 0), pytest.approx(COLD))
    assert said == ()


@pytest.mark.parametrize("open_side", ["front", "back"])
def test_nothing_on_one_side(read, open_side):
    found, said = read(*((nothing, diffuse(WARM)) if open_side == "front" else (diffuse(WARM), nothing)))
    assert (found.open_side, found.transmittance) == (open_side, (0, 0, 0))
    assert found.reflectance == pytest.approx(WARM)
    assert said == ()


def test_images_on_both_sides(read, add_image):
    found, _ = read(image(add_image, 0.25), image(add_image, 0.75))
    assert found.reflectance_texture.pixels.max() == 0.25
    assert found.back.reflectance_texture.pixels.max() == 0.75


def test_what_one_material_cannot_be_is_told(read):
    found, said = read(diffuse(WARM), translucent)
    assert found.back is None
    assert said == ("material 'sides': it is translucent: its back is taken to be as its front",)


def test_a_lamp_in_front_and_nothing_behind(read):
    found, said = read(glow(4.0), nothing)
    assert (found.radiance, found.open_side) == ((4, 4, 4), "back")
    assert said == ()


def test_a_mean_that_cycles_tells_is_of_the_front(nodes, add_cube):
    """Of a mix by noise times Backfacing a tile shows the front, where the first shader is all."""
    material, tree = nodes("sides")
    mix, product = tree.new("MixShader"), tree.new("Math")
    product.operation = "MULTIPLY"
    tree.link(tree.new("TexNoise"), product, "Fac", 0)
    tree.link(tree.new("NewGeometry"), product, "Backfacing", 1)
    tree.link(product, mix, 0, 0)
    for k, colour in enumerate((WARM, COLD)):
        tree.link(diffuse(colour)(tree), mix, 0, k + 1)
    tree.show(mix)
    add_cube(material=material)
    found = read_scene(bpy.context.scene).materials[1]
    assert found.reflectance == pytest.approx(WARM, abs=1e-3)
    assert found.back.reflectance == pytest.approx((np.array(WARM) + COLD) / 2, abs=1e-3)  # mixed evenly, and said
