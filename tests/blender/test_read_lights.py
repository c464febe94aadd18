"""Lamps: each one's radiometry against Cycles' formulas."""

from __future__ import annotations

from math import cos, pi, radians, sin, tan

import bpy
import numpy as np
import pytest

from addon.blender import lamp_nodes
from addon.blender.read_scene import read_scene
from addon.blender.render_lights import rendered_lamp
from addon.core.scene import AreaLight, PointLight, SunLight

pytestmark = pytest.mark.usefixtures("empty_file")

COLOUR = (1.0, 0.5, 0.25)  # exact in float32
FLOAT32 = 1e-6


@pytest.fixture
def read(add_cube):
    """Read the lamps of a scene with a cube in it."""

    def read_lamps():
        add_cube()
        scene = read_scene(bpy.context.scene)
        return scene.lights, scene

    return read_lamps


def test_point(add_lamp, read):
    add_lamp("POINT", location=(1, 2, 3), energy=100, color=COLOUR, shadow_soft_size=0.25, use_soft_falloff=True)
    (light,), _ = read()
    assert isinstance(light, PointLight)
    assert light.position == (1, 2, 3)
    np.testing.assert_allclose(light.intensity, np.array(COLOUR) * 100 / (4 * pi), rtol=FLOAT32)
    assert light.radius == 0.25
    assert light.soft_falloff is True
    assert light.cone_cosines[1] < -1  # no cone


def test_exposure_and_temperature_multiply(add_lamp, read):
    lamp = add_lamp("POINT", energy=8.0, exposure=-2.0, use_temperature=True, temperature=3000.0).data
    (light,), _ = read()
    np.testing.assert_allclose(light.intensity, 2 * np.array(lamp.temperature_color) / (4 * pi), rtol=FLOAT32)


def test_a_point_that_is_not_normalised_is_a_sphere_of_p_over_pi(add_lamp, read):
    """Measured in Cycles 4.5: E = P r^2 / d^2 of a sphere, P / (pi d^2) of a point."""
    add_lamp("POINT", "Sphere", energy=8.0, normalize=False, shadow_soft_size=0.5)
    add_lamp("POINT", "Point", energy=8.0, normalize=False, shadow_soft_size=0.0)
    (sphere, point), _ = read()
    assert sphere.intensity[0] / (pi * 0.5**2) == pytest.approx(8.0 / pi, rel=FLOAT32)
    assert point.intensity[0] == pytest.approx(8.0 / pi, rel=FLOAT32)


def test_spot_is_a_point_with_a_cone(add_lamp, read):
    add_lamp("SPOT", rotation=(0, pi / 2, 0), energy=4 * pi, spot_size=radians(60), spot_blend=0.5)
    (light,), _ = read()
    np.testing.assert_allclose(light.direction, (-1, 0, 0), atol=FLOAT32)
    np.testing.assert_allclose(light.intensity, 1.0, rtol=FLOAT32)
    outer = cos(radians(30))
    np.testing.assert_allclose(light.cone_cosines, (outer, outer + 0.5 * (1 - outer)), rtol=FLOAT32)


def test_a_hard_spot_has_an_edge_of_some_width(add_lamp, read):
    add_lamp("SPOT", spot_blend=0.0)
    (light,), _ = read()
    assert light.cone_cosines[0] < light.cone_cosines[1] < light.cone_cosines[0] + 1e-5


@pytest.mark.parametrize(
    ("shape", "area"),
    [("SQUARE", 2 * 2), ("RECTANGLE", 2 * 3), ("DISK", pi / 4 * 2 * 2), ("ELLIPSE", pi / 4 * 2 * 3)],
)
@pytest.mark.parametrize("mirror", [1, -1])
def test_area_radiance_counts_the_scaled_area(add_lamp, read, shape, area, mirror):
    lamp = add_lamp("AREA", location=(0, 0, 5), energy=10, shape=shape, size=2, size_y=3)
    lamp.scale = (3 * mirror, 0.5, 1)
    (light,), _ = read()
    assert isinstance(light, AreaLight)
    np.testing.assert_allclose(light.radiance, 10 / (pi * area * 1.5), rtol=FLOAT32)
    sides = np.linalg.norm(light.axis_u), np.linalg.norm(light.axis_v)
    np.testing.assert_allclose(sides, (3.0, 0.75 if shape in {"RECTANGLE", "ELLIPSE"} else 0.5), rtol=FLOAT32)
    facing = np.cross(light.axis_u, light.axis_v)
    np.testing.assert_allclose(facing / np.linalg.norm(facing), (0, 0, -1), atol=FLOAT32)
    assert light.is_ellipse == (shape in {"DISK", "ELLIPSE"})
    assert light.spread == pytest.approx(pi)


def test_area_not_normalised_and_spread(add_lamp, read):
    add_lamp("AREA", energy=10, size=2, normalize=False, spread=radians(60))
    (light,), _ = read()
    np.testing.assert_allclose(light.radiance, 10 / pi, rtol=FLOAT32)
    assert light.spread == pytest.approx(radians(60))
    # what the contract makes of it on the axis, as measured in Cycles: 10.4 times the unspread light
    assert tan(light.spread / 2) / (tan(light.spread / 2) - light.spread / 2) == pytest.approx(10.7, rel=0.05)


def test_sun(add_lamp, read):
    add_lamp("SUN", rotation=(0, pi / 2, 0), energy=3, color=COLOUR, angle=radians(2))
    (light,), _ = read()
    assert isinstance(light, SunLight)
    np.testing.assert_allclose(light.direction, (-1, 0, 0), atol=FLOAT32)
    np.testing.assert_allclose(light.irradiance, np.array(COLOUR) * 3, rtol=FLOAT32)
    assert light.angle == pytest.approx(radians(2))


def test_a_sun_that_is_not_normalised_is_a_disc_of_that_radiance(add_lamp, read):
    add_lamp("SUN", energy=1000, normalize=False, angle=radians(2))
    (light,), _ = read()
    np.testing.assert_allclose(light.irradiance, 1000 * pi * sin(radians(1)) ** 2, rtol=1e-5)  # float32 angle


def test_a_lamp_below_zero_is_told(add_lamp, add_cube):
    add_cube()
    add_lamp("POINT", "Thief").data.energy = -20
    scene = read_scene(bpy.context.scene)
    assert scene.lights == ()
    assert "light 'Thief' is below 0: none is taken" in scene.warnings


def test_hidden_and_dark_lamps_are_left_out_and_instances_counted(add_lamp, read):
    add_lamp("POINT", "Hidden").hide_render = True
    add_lamp("POINT", "Off", energy=0)
    source = bpy.data.collections.new("Fitting")
    lamp = add_lamp("POINT", "Bulb")
    source.objects.link(lamp)
    bpy.context.scene.collection.objects.unlink(lamp)
    for index in range(2):
        empty = bpy.data.objects.new("Place", None)
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", source, (index, 0, 0)
        bpy.context.scene.collection.objects.link(empty)
    lights, _ = read()
    assert sorted(light.position[0] for light in lights) == [0, 1]


def test_emission_nodes_of_a_lamp_multiply(add_lamp, read):
    lamp = add_lamp("POINT", energy=4 * pi).data
    lamp.use_nodes = True
    emission = next(n for n in lamp.node_tree.nodes if n.type == "EMISSION")
    emission.inputs["Color"].default_value = (*COLOUR, 1)
    emission.inputs["Strength"].default_value = 2
    (light,), _ = read()
    np.testing.assert_allclose(light.intensity, np.array(COLOUR) * 2, rtol=FLOAT32)


def test_a_black_body_gives_a_lamp_its_colour_and_not_its_power(add_lamp, read):
    lamp = add_lamp("POINT", energy=4 * pi).data
    lamp.use_nodes = True
    emission = next(n for n in lamp.node_tree.nodes if n.type == "EMISSION")
    kelvin = lamp.node_tree.nodes.new("ShaderNodeBlackbody")
    kelvin.inputs["Temperature"].default_value = 2700
    lamp.node_tree.links.new(kelvin.outputs["Color"], emission.inputs["Color"])
    (light,), scene = read()
    # luminance is 1 by definition, to the four digits of the matrix; 2700 K is red first and blue last
    np.testing.assert_allclose(np.array(light.intensity) @ (0.2126, 0.7152, 0.0722), 1.0, rtol=1e-3)
    assert light.intensity[0] > light.intensity[1] > light.intensity[2] > 0
    assert scene.warnings == ()


def nodes_of(lamp):
    """The node tree of a lamp, and its Emission node."""
    lamp.data.use_nodes = True
    tree = lamp.data.node_tree
    return tree, next(n for n in tree.nodes if n.type == "EMISSION")


def with_profile(lamp, measured="1000 800 500 100 0"):
    """Give a lamp the nodes of a photometric file: candela at 0, 30, 60, 90 and 180 degrees from straight down."""
    tree, emission = nodes_of(lamp)
    text = bpy.data.texts.new("lamp.ies")
    header = "IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 5 1 1 2 0 0 0\n1 1 100\n"
    text.write(f"{header}0 30 60 90 180\n0\n{measured}\n")
    node = tree.nodes.new("ShaderNodeTexIES")
    node.mode, node.ies = "INTERNAL", text
    tree.links.new(node.outputs[0], emission.inputs["Strength"])
    return emission


def test_unreadable_nodes_of_a_sun_are_named(add_lamp, read):
    tree, emission = nodes_of(add_lamp("SUN", "Candle", energy=1.0))
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs["Color"], emission.inputs["Color"])
    (light,), scene = read()
    np.testing.assert_allclose(light.irradiance, 1.0, rtol=FLOAT32)
    assert "light 'Candle': its Noise Texture node cannot be read: its own colour and power are used" in scene.warnings


@pytest.mark.parametrize("kind", ["POINT", "SPOT"])
def test_a_photometric_file_gives_a_lamp_its_profile(add_lamp, read, kind):
    """In the lamp's own space: one that is turned to look along +X sends most there."""
    emission = with_profile(add_lamp(kind, rotation=(0, -pi / 2, 0), energy=4 * pi))
    emission.inputs["Color"].default_value = (*COLOUR, 1)
    (light,), scene = read()
    angles = np.radians([0, 30, 60, 90, 180])
    towards = np.stack([np.cos(angles), np.sin(angles) * 0.6, np.sin(angles) * 0.8], axis=1)
    found = light.profile.seen(towards)[:, 0]
    # a pixel is 1.4 degrees wide, along which the largest slope changes what it is by 2 %; Cycles' cubics between the
    # angles overshoot, so that the largest is not at 0
    np.testing.assert_allclose(found / found[0], [1, 0.8, 0.5, 0.1, 0], atol=0.02)
    np.testing.assert_allclose(np.array(light.intensity) / light.intensity[0], np.array(COLOUR), rtol=1e-3)
    assert light.distance_power == 0
    assert not scene.warnings
    assert [len(blocks) for blocks in (bpy.data.scenes, bpy.data.lights, bpy.data.cameras)] == [1, 1, 0]


def test_lamps_of_one_data_block_are_rendered_once(add_lamp, read, monkeypatch):
    lamp = add_lamp("POINT", energy=4 * pi)
    with_profile(lamp)
    for k in range(3):
        other = lamp.copy()
        other.rotation_euler = (k, 0, 0)
        bpy.context.scene.collection.objects.link(other)
    calls = []
    monkeypatch.setattr(lamp_nodes, "rendered_lamp", lambda *which: calls.append(which) or rendered_lamp(*which))
    lights, _ = read()
    assert len(calls) == 1
    assert len({light.profile.to_image for light in lights}) == 3  # one is not turned, and one by 0


@pytest.mark.parametrize(("output", "power"), [("Quadratic", 0), ("Linear", 1), ("Constant", 2)])
def test_light_falloff_is_a_power_of_the_distance(add_lamp, read, output, power):
    tree, emission = nodes_of(add_lamp("POINT", energy=4 * pi))
    falloff = tree.nodes.new("ShaderNodeLightFalloff")
    falloff.inputs["Strength"].default_value = 3.0
    tree.links.new(falloff.outputs[output], emission.inputs["Strength"])
    (light,), scene = read()
    np.testing.assert_allclose(light.intensity, 3.0, rtol=1e-3)  # the ball's faces are flat
    assert (light.profile, light.distance_power) == (None, power)
    assert not scene.warnings


@pytest.mark.parametrize("how", ["two powers", "smooth", "a minimum"])
def test_what_is_no_power_of_the_distance_is_told(add_lamp, read, how):
    tree, emission = nodes_of(add_lamp("POINT", "Both", energy=4 * pi))
    falloff, made = tree.nodes.new("ShaderNodeLightFalloff"), tree.nodes.new("ShaderNodeMath")
    made.operation = "MINIMUM" if how == "a minimum" else "ADD"
    falloff.inputs["Strength"].default_value = 1.0
    falloff.inputs["Smooth"].default_value = 1.0 if how == "smooth" else 0.0
    made.inputs[1].default_value = 1.5 if how == "a minimum" else 0.0  # which it has from 1.5 m on
    tree.links.new(falloff.outputs["Linear"], made.inputs[0])
    if how == "two powers":
        tree.links.new(falloff.outputs["Constant"], made.inputs[1])
    tree.links.new(made.outputs[0], emission.inputs["Strength"])
    (light,), scene = read()
    np.testing.assert_allclose(light.intensity, 1.0, rtol=FLOAT32)
    assert any("'Both'" in said and "does not go by a power of the distance" in said for said in scene.warnings)


def test_a_falloff_that_leads_nowhere_is_none(add_lamp, read):
    tree, emission = nodes_of(add_lamp("POINT", energy=4 * pi))
    falloff, nowhere = tree.nodes.new("ShaderNodeLightFalloff"), tree.nodes.new("ShaderNodeMath")
    tree.links.new(falloff.outputs["Constant"], nowhere.inputs[0])
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs["Fac"], emission.inputs["Strength"])
    (light,), _ = read()
    assert light.distance_power == 0


def test_the_length_of_a_ray_is_a_power_of_the_distance(add_lamp, read):
    tree, emission = nodes_of(add_lamp("POINT", energy=4 * pi))
    path = tree.nodes.new("ShaderNodeLightPath")
    tree.links.new(path.outputs["Ray Length"], emission.inputs["Strength"])
    (light,), scene = read()
    np.testing.assert_allclose(light.intensity, 1.0, rtol=1e-3)
    assert light.distance_power == 1
    assert not scene.warnings


def test_what_animates_a_lamp_counts_once(add_lamp, read):
    """Its energy and colour are read as the frame has them; the ball is lit by a lamp that nothing animates."""
    lamp = add_lamp("POINT", energy=4 * pi, color=COLOUR)
    with_profile(lamp)
    for path in ("energy", "color"):
        lamp.data.keyframe_insert(path, frame=1)
    (light,), _ = read()
    lamp.data.animation_data_clear()
    (still,), _ = read()
    np.testing.assert_allclose(light.intensity, still.intensity, rtol=1e-3)


@pytest.mark.parametrize(("kind", "output"), [("ShaderNodeNewGeometry", "Normal"), ("ShaderNodeObjectInfo", "Random")])
def test_nodes_that_ask_where_a_lamp_stands_are_told(add_lamp, read, kind, output):
    tree, emission = nodes_of(add_lamp("POINT", "There", energy=4 * pi))
    tree.links.new(tree.nodes.new(kind).outputs[output], emission.inputs["Color"])
    (light,), scene = read()
    np.testing.assert_allclose(light.intensity, 1.0, rtol=FLOAT32)
    assert any("'There'" in said and "asks where it stands" in said for said in scene.warnings)


def test_a_photometric_file_that_is_missing_is_told(add_lamp, read):
    tree, emission = nodes_of(add_lamp("POINT", "Lost", energy=4 * pi))
    node = tree.nodes.new("ShaderNodeTexIES")
    node.mode, node.filepath = "EXTERNAL", "//nowhere.ies"
    tree.links.new(node.outputs[0], emission.inputs["Strength"])
    (light,), scene = read()
    np.testing.assert_allclose(light.intensity, 1.0, rtol=FLOAT32)
    assert any("'Lost'" in said and "has no file" in said for said in scene.warnings)


def test_a_spot_that_is_scaled_unevenly_has_a_stretched_cone(add_lamp, read):
    """In its own space the cone is round: directions (x, y, z) there are (x / sx, y / sy, z / sz)."""
    add_lamp("SPOT", rotation=(0.4, 0.3, 0.2), spot_size=radians(60)).scale = (2.0, 1.0, 0.5)
    (light,), _ = read()
    lamp = bpy.data.objects["Lamp"]
    matrix = np.array(lamp.matrix_world)[:3, :3]
    towards = np.random.default_rng(0).normal(size=(20, 3))
    xx, yy, zz, xy, xz, yz = light.cone_metric
    metric = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    own = np.linalg.solve(matrix, towards.T).T
    expected = -own[:, 2] / np.linalg.norm(own, axis=1)
    found = towards @ light.direction / np.sqrt(np.einsum("ni,ij,nj->n", towards, metric, towards))
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert light.profile is None


def test_a_spot_that_is_flat_is_left_out(add_lamp, read):
    add_lamp("SPOT", "Flat").scale = (1.0, 1.0, 0.0)
    lights, scene = read()
    assert lights == ()
    assert "light 'Flat' is scaled to nothing along an axis: it is left out" in scene.warnings


def test_a_colour_that_differs_by_direction_is_told(add_lamp, read):
    tree, emission = nodes_of(add_lamp("POINT", "Disco", energy=4 * pi))
    place = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(place.outputs["Normal"], emission.inputs["Color"])
    lights, scene = read()
    assert len(lights) == 1
    assert any("'Disco': its colour differs by direction" in said for said in scene.warnings)


def test_lamps_that_cast_no_shadows(add_lamp, read):
    for name, casts in (("with", True), ("without", False)):
        add_lamp("POINT", name, use_shadow=casts)
    lights, _ = read()
    assert [(light.name, light.casts_shadow) for light in lights] == [("with", True), ("without", False)]


def test_lamps_that_diffuse_surfaces_do_not_see_are_left_out(add_lamp, read):
    add_lamp("POINT", "Seen")
    add_lamp("POINT", "Unseen").visible_diffuse = False
    add_lamp("AREA", "Portal").data.cycles.is_portal = True
    lights, scene = read()
    assert [light.name for light in lights] == ["Seen"]
    assert not scene.warnings


def test_what_is_not_read_of_lamps_is_told(add_lamp, read):
    add_lamp("POINT", "Few").data.cycles.max_bounces = 2
    linked = add_lamp("POINT", "Linked")
    linked.light_linking.receiver_collection = bpy.data.collections.new("Some")
    lights, scene = read()
    assert len(lights) == 2
    assert set(scene.warnings) == {
        "light 'Few': its limit of 2 bounces is not read",
        "'Linked': its light linking is not read: it lights all, and all hide it",
    }
