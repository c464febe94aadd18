"""What Object Info says of each object, against Cycles."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from addon.blender.mesh_colours import LEVELS
from addon.blender.object_colours import random_of
from addon.blender.read_scene import read_scene
from addon.core.textures import textured_colours

pytestmark = pytest.mark.usefixtures("empty_file")

STEP = 1 / (LEVELS - 1)  # of the square root, between the palette's levels: half of it is the most that one is off
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
COLOURS = {"Cube.001": (0.8, 0.2, 0.1, 0.25), "Stühle": (0.0, 0.5, 1.0, 1.0), "a" * 60: (0.3, 0.3, 0.6, 0.5)}
SINGLE = 1e-6  # Cycles divides by 2^32 in float32


@pytest.fixture
def by_object(nodes, add_mesh):
    """Squares of other colours that share a material, which reflects an output of Object Info."""

    def make(output, through=None):
        material, tree = nodes()
        shown, name = tree.new("ObjectInfo"), output
        if through:
            shown, name = tree.link(shown, tree.new(through), output, 0), 0
        tree.show(tree.link(shown, tree.new("BsdfDiffuse"), name, "Color"))
        material.pass_index = 1
        squares = [add_mesh(name, SQUARE, [(0, 1, 2, 3)], material) for name in COLOURS]
        for square, colour in zip(squares, COLOURS.values()):
            square.color = colour
        return squares

    return make


def reflected():
    """What each object reflects, by name (3,), and the warnings."""
    scene = read_scene(bpy.context.scene)
    middles = np.full((len(scene.triangles), 3), 1 / 3, np.float32)
    colours = textured_colours(scene, np.arange(len(middles)), middles, "reflectance")
    return {each.name: colours[each.first] for each in scene.objects}, scene.warnings


def baked_by_cycles(squares):
    """The base colour of each, by name (3,)."""
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.render.bake.target = "CYCLES", 1, "VERTEX_COLORS"
    for square in squares:
        square.data.color_attributes.new("Baked", "FLOAT_COLOR", "CORNER")
        square.select_set(True)
    bpy.context.view_layer.objects.active = squares[0]
    bpy.ops.object.bake(type="DIFFUSE", pass_filter={"COLOR"}, target="VERTEX_COLORS")
    return {square.name: np.array(square.data.color_attributes["Baked"].data[0].color[:3]) for square in squares}


@pytest.mark.parametrize(
    ("output", "through"), [("Color", None), ("Alpha", None), ("Random", None), ("Random", "Invert")]
)
def test_each_object_reflects_what_it_does_in_cycles(by_object, output, through):
    squares = by_object(output, through)
    found, warnings = reflected()
    expected = baked_by_cycles(squares)
    assert not warnings
    for name, colour in expected.items():
        assert np.abs(np.sqrt(found[name]) - np.sqrt(colour)).max() <= (0.51 if through is None else 1.5) * STEP


def test_the_random_number_is_the_one_of_cycles(by_object):
    squares = by_object("Random")
    bpy.context.view_layer.update()
    numbers = {each.object.name: random_of(each) for each in bpy.context.evaluated_depsgraph_get().object_instances}
    assert len(set(numbers.values())) == len(squares)
    for name, colour in baked_by_cycles(squares).items():
        assert colour == pytest.approx(numbers[name], abs=SINGLE)


def test_instances_have_a_number_each(by_object):
    source = by_object("Random")[0]
    collection = bpy.data.collections.new("Chairs")
    collection.objects.link(source)
    for place in range(2):
        empty = bpy.data.objects.new("Chair", None)
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, (0, 2 + place, 0)
        bpy.context.scene.collection.objects.link(empty)
    found, _ = reflected()
    greys = [colour[0] for name, colour in found.items() if name.startswith(source.name)]
    assert len(greys) == len(set(greys)) == 3


def test_the_index_of_the_material_is_one_number(by_object):
    by_object("Material Index")
    found, warnings = reflected()
    assert not warnings
    assert all((colour == 1).all() for colour in found.values())


def test_colours_of_objects_above_one_are_told(by_object):
    by_object("Color")[0].color = (2.0, 0.5, 0.5, 1.0)
    found, (warning,) = reflected()
    assert "'Cube.001'" in warning
    assert found["Cube.001"][0] == 1
