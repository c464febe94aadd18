"""Nodes that hang on the view: their means against directions drawn by chance, and what materials make of them."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from addon.blender.read_scene import read_scene
from addon.blender.shader_nodes import Reached, Unreadable
from addon.blender.view_nodes import COSINES, SHARES, fresnel, mean_over_view

pytestmark = pytest.mark.usefixtures("empty_file")

DARK, LIGHT = (0.1, 0.2, 0.3), (0.8, 0.7, 0.6)
CHANCE = 2e-3  # 10^6 directions of values in [0, 1]: four standard errors at the most


@pytest.fixture
def mixed(nodes, add_cube):
    """Read a material that mixes dark and light by an output of a node; (Material, sentences)."""

    def read(kind, output, **inputs):
        material, tree = nodes()
        mix = tree.link(tree.new(kind, **inputs), tree.new("MixShader"), output, 0)
        tree.link(tree.new("BsdfDiffuse", Color=(*DARK, 1)), mix, 0, 1)
        tree.link(tree.new("BsdfDiffuse", Color=(*LIGHT, 1)), mix, 0, 2)
        tree.show(mix)
        add_cube(material=material)
        scene = read_scene(bpy.context.scene)
        return scene.materials[1], scene.warnings

    return read


def cosines_by_chance(count=1 << 20):
    """Of directions whose density is the cosine."""
    return np.sqrt(np.random.default_rng(1).uniform(0, 1, count))


def test_normal_incidence_and_the_critical_angle():
    assert fresnel(np.array([1.0]), 1.5) == pytest.approx([0.04])
    within = np.sqrt(1 - 1 / 1.5**2)  # from the dense side, beyond it all is reflected
    assert fresnel(np.array([0.99, 1.01]) * within, 1 / 1.5)[0] == 1
    assert fresnel(np.array([0.99, 1.01]) * within, 1 / 1.5)[1] < 1


def test_the_mean_is_that_of_published_tables():
    """0.0918 for glass of 1.5, as Walsh's formula gives it (Duntley 1942)."""
    assert SHARES @ fresnel(COSINES, 1.5) == pytest.approx(0.0918, abs=5e-5)


@pytest.mark.parametrize(
    ("kind", "output", "inputs", "seen"),
    [
        ("Fresnel", 0, {"IOR": 1.5}, lambda c: fresnel(c, 1.5)),
        ("Fresnel", 0, {"IOR": 1.05}, lambda c: fresnel(c, 1.05)),
        ("LayerWeight", "Fresnel", {"Blend": 0.3}, lambda c: fresnel(c, 1 / 0.7)),
        ("LayerWeight", "Facing", {"Blend": 0.3}, lambda c: 1 - c**0.6),
        ("LayerWeight", "Facing", {"Blend": 0.5}, lambda c: 1 - c),
        ("LayerWeight", "Facing", {"Blend": 0.9}, lambda c: 1 - c**5),
    ],
)
def test_a_mix_has_the_mean_over_directions(mixed, kind, output, inputs, seen):
    found, said = mixed(kind, output, **inputs)
    share = seen(cosines_by_chance()).mean()
    expected = (1 - share) * np.array(DARK) + share * np.array(LIGHT)
    np.testing.assert_allclose(found.reflectance, expected, atol=CHANCE)
    assert any("at its mean over directions" in sentence for sentence in said)


def test_one_that_varies_over_the_surface_is_not_read(nodes):
    _, tree = nodes()
    layer = tree.link(tree.new("TexNoise"), tree.new("LayerWeight"), 0, "Blend")
    with pytest.raises(Unreadable, match="Noise"):
        mean_over_view(Reached(layer.outputs[0], layer, ()))
