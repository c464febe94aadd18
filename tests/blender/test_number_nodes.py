"""Nodes of numbers, vectors and channels, held against what Cycles bakes of the same material."""

from __future__ import annotations

import pytest

from addon.blender.number_nodes import MATH, VECTORS
from tests.blender.node_trees import LUMINANCE, ROUNDING, arithmetic, halved

pytestmark = pytest.mark.usefixtures("empty_file")


@pytest.mark.parametrize("is_clamped", [True, False])
@pytest.mark.parametrize("operation", ["ADD", "SUBTRACT", "MULTIPLY", "MINIMUM", "MAXIMUM", "DIVIDE", "POWER"])
def test_arithmetic(compare, operation, is_clamped):
    def node_of(tree, first, second):
        return halved(tree, arithmetic(tree, operation, 0.6, first, "Color", is_clamped))

    compare(node_of, tolerance=LUMINANCE)


def channel(tree, source, name="Green"):
    """One channel, to the bit: steps would turn luminance's rounding into a difference of 1."""
    return tree.link(source, tree.new("SeparateColor"), "Color", 0), name


@pytest.mark.parametrize("operation", sorted(set(MATH) - {"POWER", "DIVIDE"}))
def test_every_operation_on_numbers(compare, operation):
    """Of a channel from -1 to 1, with numbers that none of its values is a multiple of."""

    def node_of(tree, first, second):
        parts, name = channel(tree, first)
        wide = arithmetic(tree, "SUBTRACT", 1.0, arithmetic(tree, "MULTIPLY", 2.0, parts, name))
        node = arithmetic(tree, operation, -0.57 if operation == "WRAP" else 0.37, wide)
        node.inputs[2].default_value = 0.21
        return halved(tree, arithmetic(tree, "ADD", 1.0, node))

    compare(node_of, tolerance=10 * ROUNDING)  # differences of numbers of about 1 over .37


def test_whole_powers_of_numbers_below_zero(compare):
    def node_of(tree, first, second):
        parts, name = channel(tree, first)
        below = arithmetic(tree, "SUBTRACT", 1.0, parts, name)
        return arithmetic(tree, "ADD", 1.0, arithmetic(tree, "POWER", 3.0, below))

    compare(node_of)


@pytest.mark.parametrize("operation", sorted(VECTORS))
def test_every_operation_on_vectors(compare, operation):
    def node_of(tree, first, second):
        node = tree.link(tree.link(first, tree.new("VectorMath"), "Color", 0), tree.new("VectorMath"), 0, 0)
        node.operation = operation
        for place, values in ((1, (0.37, 0.41, 0.53)), (2, (0.23, 0.29, 0.19))):
            node.inputs[place].default_value = values
        return halved(tree, node)

    compare(node_of, tolerance=10 * ROUNDING)


def test_a_scaled_vector_as_a_number(compare):
    """Of a vector a number takes the mean, and no luminance."""

    def node_of(tree, first, second):
        scaled = tree.link(first, tree.new("VectorMath"), "Color", 0)
        scaled.operation = "SCALE"
        scaled.inputs["Scale"].default_value = 0.7
        return arithmetic(tree, "ADD", 0.1, scaled)

    compare(node_of)


@pytest.mark.parametrize("mode", ["RGB", "HSV"])
def test_channels_apart_and_together_again(compare, mode):
    def node_of(tree, first, second):
        apart, together = tree.new("SeparateColor"), tree.new("CombineColor")
        apart.mode = together.mode = mode
        tree.link(first, apart, "Color", 0)
        for one, other in ((0, 2), (1, 1), (2, 0)):
            tree.link(apart, together, one, other)
        return together

    compare(node_of, tolerance=10 * ROUNDING)  # a hue is a difference over a spread


@pytest.mark.parametrize("is_clamped", [True, False])
def test_a_range_mapped_to_another(compare, is_clamped):
    def node_of(tree, first, second):
        parts, name = channel(tree, first)
        node = tree.new("MapRange")
        node.clamp = is_clamped
        for place, value in enumerate((0.2, 0.7, 0.9, 0.3), 1):
            node.inputs[place].default_value = value
        return tree.link(parts, node, name, 0)

    compare(node_of)


@pytest.mark.parametrize("kind", ["MINMAX", "RANGE"])
def test_a_number_is_clamped(compare, kind):
    def node_of(tree, first, second):
        parts, name = channel(tree, first)
        node = tree.new("Clamp")
        node.clamp_type = kind
        node.inputs[1].default_value, node.inputs[2].default_value = 0.3, 0.6
        if kind == "RANGE":
            node.inputs[1].default_value, node.inputs[2].default_value = 0.6, 0.3
        return tree.link(parts, node, name, 0)

    compare(node_of)


def test_numbers_below_zero_count_until_the_end(compare):
    def one_less_it(tree, first, second):
        return arithmetic(tree, "ADD", 1.0, arithmetic(tree, "MULTIPLY", -1.0, first, "Color"))

    compare(one_less_it, tolerance=LUMINANCE)
