"""Shader nodes -> reflectance, radiance, transmittance: the table, the images, and what cannot be read."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from addon.blender.read_scene import read_scene
from addon.core.scene import SceneError

pytestmark = pytest.mark.usefixtures("empty_file")

RED = (0.5, 0.25, 0.125, 1.0)  # exact in float32
GREY = (0.75, 0.75, 0.75, 1.0)
DARK = (0.25, 0.25, 0.25, 1.0)


def image_node(tree, image):
    node = tree.new("TexImage")
    node.image = image
    return node


def checker():
    """2 x 3 pixels of bytes, exact as value / 255."""
    return (np.arange(18).reshape(2, 3, 3) * 13 + 5).astype(np.float32) / 255


@pytest.mark.parametrize(
    ("kind", "inputs", "reflectance", "radiance", "transmittance"),
    [
        ("BsdfPrincipled", {"Base_Color": RED}, RED, 0, 0),
        ("BsdfPrincipled", {"Base_Color": RED, "Transmission_Weight": 0.0}, RED, 0, 0),
        ("BsdfPrincipled", {"Base_Color": DARK, "Transmission_Weight": 0.25}, 0.1875 / 0.875, 0, 0.125),
        ("BsdfPrincipled", {"Base_Color": DARK, "Transmission_Weight": 1.0}, 0, 0, 0.5),
        ("BsdfPrincipled", {"Base_Color": GREY, "Alpha": 0.25}, GREY, 0, 0.75),
        (
            "BsdfPrincipled",
            {"Base_Color": GREY, "Emission_Color": RED, "Emission_Strength": 3.0},
            GREY,
            np.array(RED) * 3,
            0,
        ),
        ("BsdfDiffuse", {"Color": RED}, RED, 0, 0),
        ("Emission", {"Color": RED, "Strength": 3.0}, 0, np.array(RED) * 3, 0),
        ("BsdfTransparent", {"Color": RED}, 0, 0, RED),
        ("BsdfGlass", {"Color": RED}, 0, 0, RED),
        ("BsdfRefraction", {"Color": RED}, 0, 0, RED),
    ],
)
def test_the_table(nodes, read_material, kind, inputs, reflectance, radiance, transmittance):
    material, tree = nodes()
    tree.show(tree.new(kind, **inputs))
    found, warnings = read_material(material)
    for value, expected in (
        (found.reflectance, reflectance),
        (found.radiance, radiance),
        (found.transmittance, transmittance),
    ):
        # Blender stores floats: inputs are exact in binary, products of them too
        np.testing.assert_allclose(value, np.broadcast_to(expected, 4 if np.ndim(expected) else 3)[:3], atol=1e-7)
    assert warnings == ()


@pytest.mark.parametrize(("output", "radiance"), [("Is Camera Ray", 0.0), ("Is Diffuse Ray", 6.0), ("Ray Depth", 6.0)])
def test_light_is_what_rays_from_diffuse_surfaces_see(nodes, read_material, output, radiance):
    """A strength that hangs on the kind of ray, by way of a product."""
    material, tree = nodes()
    product = tree.new("Math")
    product.operation = "MULTIPLY"
    product.inputs[1].default_value = 6.0
    tree.link(tree.new("LightPath"), product, output, 0)
    tree.show(tree.link(product, tree.new("Emission", Color=(1, 1, 1, 1)), 0, "Strength"))
    found, warnings = read_material(material)
    np.testing.assert_allclose(found.radiance, radiance, rtol=1e-6)
    assert warnings == ()


@pytest.mark.parametrize(("kind", "meets"), [("Is Shadow Ray", (False, True)), ("Is Diffuse Ray", (True, False))])
def test_nodes_that_let_one_kind_of_rays_pass(nodes, read_material, kind, meets):
    material, tree = nodes("Fake")
    mix = tree.link(tree.new("LightPath"), tree.new("MixShader"), kind, 0)
    tree.link(tree.new("BsdfDiffuse", Color=GREY), mix, 0, 1)
    tree.link(tree.new("BsdfTransparent"), mix, 0, 2)
    tree.show(mix)
    found, warnings = read_material(material)
    assert (found.meets_shadow_rays, found.meets_light) == meets
    assert found.reflectance == (GREY[:3] if found.meets_light else (0, 0, 0))
    assert found.transmittance == (0, 0, 0)
    assert warnings == ()


def test_a_tint_of_shadow_rays_alone_is_told(nodes, read_material):
    material, tree = nodes("Fake")
    mix = tree.link(tree.new("LightPath"), tree.new("MixShader"), "Is Shadow Ray", 0)
    tree.link(tree.new("BsdfDiffuse", Color=GREY), mix, 0, 1)
    tree.link(tree.new("BsdfTransparent", Color=GREY), mix, 0, 2)
    tree.show(mix)
    found, warnings = read_material(material)
    assert found.is_opaque
    assert warnings == ("material 'Fake': shadow rays pass it as light that bounces does",)


def test_what_an_object_hides_of_a_material_adds_to_what_its_nodes_do(nodes, add_cube):
    material, tree = nodes("Fake")
    mix = tree.link(tree.new("LightPath"), tree.new("MixShader"), "Is Shadow Ray", 0)
    tree.link(tree.new("BsdfDiffuse", Color=GREY), mix, 0, 1)
    tree.show(tree.link(tree.new("BsdfTransparent"), mix, 0, 2))
    add_cube("Cube", material).visible_diffuse = False
    scene = read_scene(bpy.context.scene)
    found = scene.materials[scene.triangle_materials[0]]
    assert (found.meets_shadow_rays, found.meets_light) == (False, False)


def test_a_strength_may_be_an_image(nodes, read_material, add_image):
    material, tree = nodes()
    image = image_node(tree, add_image(checker(), is_float=True, space="Non-Color"))
    tree.show(tree.link(image, tree.new("Emission", Color=RED), "Color", "Strength"))
    found, warnings = read_material(material)
    luminance = checker() @ (0.2126, 0.7152, 0.0722)
    np.testing.assert_allclose(
        found.radiance_texture.pixels * found.radiance, luminance[..., None] * RED[:3], rtol=1e-4
    )
    assert warnings == ()


def test_a_translucent_shader_scatters_to_the_other_side(nodes, read_material):
    material, tree = nodes()
    mix = tree.new("MixShader", Fac=0.25)
    tree.link(tree.new("BsdfDiffuse", Color=GREY), mix, 0, 1)
    tree.link(tree.new("BsdfTranslucent", Color=RED), mix, 0, 2)
    tree.show(mix)
    found, warnings = read_material(material)
    np.testing.assert_allclose(found.translucence, np.array(RED[:3]) * 0.25)
    np.testing.assert_allclose(found.reflectance, np.array(GREY[:3]) * 0.75)
    assert not found.transmits
    assert warnings == ()


def test_a_mix_is_the_weighted_sum_and_an_add_the_sum(nodes, read_material):
    material, tree = nodes()
    mix, add = tree.new("MixShader", Fac=0.25), tree.new("AddShader")
    tree.link(tree.new("BsdfDiffuse", Color=GREY), mix, 0, 1)
    tree.link(tree.new("BsdfTransparent", Color=(1, 1, 1, 1)), mix, 0, 2)
    tree.link(mix, add, 0, 0)
    tree.link(tree.new("Emission", Color=RED, Strength=2.0), add, 0, 1)
    tree.show(add)
    found, warnings = read_material(material)
    np.testing.assert_allclose(found.reflectance, GREY[:3])
    np.testing.assert_allclose(found.transmittance, [0.25] * 3)
    np.testing.assert_allclose(found.radiance, np.array(RED[:3]) * 2)
    assert warnings == ()


def test_a_sum_that_gives_more_than_it_gets_is_dimmed_and_said(nodes, read_material):
    """Eight tenths of red are reflected, and as many pass: of a light of 1 there are 1, a half each."""
    material, tree = nodes("Sum")
    add = tree.new("AddShader")
    tree.link(tree.new("BsdfDiffuse", Color=(0.8, 0, 0, 1)), add, 0, 0)
    tree.link(tree.new("BsdfTransparent", Color=(0.8, 0, 0, 1)), add, 0, 1)
    tree.show(add)
    found, warnings = read_material(material)
    np.testing.assert_allclose(found.transmittance, (0.5, 0, 0), rtol=1e-6)
    met = 1 - np.mean(found.transmittance)
    np.testing.assert_allclose(met * np.array(found.reflectance), (0.5, 0, 0), rtol=1e-6)
    assert any("'Sum'" in warning and "dimmed" in warning for warning in warnings)


def test_a_mix_of_image_and_colour_is_one_texture(nodes, read_material, add_image):
    material, tree = nodes()
    pixels = checker()
    mix, diffuse = tree.new("MixShader", Fac=0.5), tree.new("BsdfDiffuse")
    tree.link(image_node(tree, add_image(pixels, space="Non-Color")), diffuse, 0, "Color")
    tree.link(diffuse, mix, 0, 1)
    tree.link(tree.new("BsdfDiffuse", Color=RED), mix, 0, 2)
    tree.show(mix)
    found, _ = read_material(material)
    shown = found.reflectance_texture.pixels * found.reflectance
    np.testing.assert_allclose(shown, pixels / 2 + np.array(RED[:3]) / 2, atol=1e-6)  # float32 sums


def test_links_go_through_reroutes_groups_and_muted_nodes(nodes, read_material):
    group = bpy.data.node_groups.new("Paint", "ShaderNodeTree")
    group.interface.new_socket("Paint", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    diffuse = group.nodes.new("ShaderNodeBsdfDiffuse")
    group.links.new(start.outputs["Paint"], diffuse.inputs["Color"])
    group.links.new(diffuse.outputs[0], end.inputs["Shader"])
    material, tree = nodes()
    use, reroute = tree.new("Group"), tree.new("Reroute")
    use.node_tree = group
    colour, gamma = tree.new("RGB"), tree.new("Gamma", Gamma=9.0)
    colour.outputs[0].default_value, gamma.mute = RED, True
    tree.link(colour, gamma, 0, "Color")
    tree.link(gamma, reroute)
    tree.link(reroute, use, 0, "Paint")
    tree.show(use)
    found, warnings = read_material(material)
    assert found.reflectance == RED[:3]
    assert warnings == ()


def test_what_an_emission_or_a_shadow_is_not_read_as_is_told(nodes, read_material):
    material, tree = nodes()
    tree.show(tree.new("Emission", Strength=-2.0))
    found, warnings = read_material(material)
    assert found.radiance == (0, 0, 0)
    assert "its emission is below 0" in warnings[0]
    glass, tree = nodes("Glass")
    tree.show(tree.new("BsdfTransparent"))
    glass.use_transparent_shadow = False
    _, warnings = read_material(glass)
    assert "Transparent Shadows" in warnings[0]


def test_an_emission_texture_is_scaled_by_the_strength(nodes, read_material, add_image):
    material, tree = nodes()
    tree.show(
        tree.link(
            image_node(tree, add_image(checker(), space="Non-Color")), tree.new("Emission", Strength=4.0), 0, "Color"
        )
    )
    found, _ = read_material(material)
    np.testing.assert_allclose(found.radiance_texture.pixels * found.radiance, checker() * 4, atol=1e-6)  # float32


def test_reflectance_above_one_is_clipped(nodes, read_material, add_image):
    material, tree = nodes("Value")
    tree.show(tree.new("BsdfDiffuse", Color=(2.0, 0.5, -1.0, 1.0)))
    assert read_material(material)[0].reflectance == (1.0, 0.5, 0.0)
    material, tree = nodes("Texture")
    pixels = checker() * 3
    tree.show(tree.link(image_node(tree, add_image(pixels, is_float=True, space="Non-Color")), tree.new("BsdfDiffuse")))
    found, _ = read_material(material)
    shown = found.reflectance_texture.pixels * found.reflectance
    np.testing.assert_allclose(shown, np.clip(pixels, 0, 1), atol=1e-6)  # float32


@pytest.mark.parametrize("alpha", [0.03, 0.1, 0.2, 0.46, 0.66])
def test_an_image_that_lets_some_light_through_is_no_brighter_for_it(nodes, read_material, add_image, alpha):
    """Divided by what is left of 1 in floats, these are 1 + 2^-52 of it."""
    material, tree = nodes()
    shader = tree.new("BsdfPrincipled", Alpha=alpha)
    tree.show(
        tree.link(image_node(tree, add_image(checker(), is_float=True, space="Non-Color")), shader, 0, "Base Color")
    )
    found, warnings = read_material(material)
    assert max(found.reflectance) <= 1
    seen = found.reflectance_texture.pixels * found.reflectance
    np.testing.assert_allclose(seen, checker(), atol=1e-6)  # float32
    assert warnings == ()


def test_an_image_times_the_colours_of_a_mesh_is_the_image(nodes, read_material, add_image):
    """As importers of glTF make it: a triangle has one place in textures."""
    material, tree = nodes()
    product = tree.new("MixRGB")
    product.blend_type = "MULTIPLY"
    product.inputs[0].default_value = 1.0
    tree.link(image_node(tree, add_image(checker(), is_float=True, space="Non-Color")), product, "Color", 1)
    tree.link(tree.new("VertexColor"), product, "Color", 2)
    tree.show(tree.link(product, tree.new("BsdfDiffuse"), 0, "Color"))
    found, (warning,) = read_material(material)
    np.testing.assert_allclose(found.reflectance_texture.pixels * found.reflectance, checker(), atol=1e-6)
    assert "white" in warning


def test_what_a_coat_and_a_sheen_leave(nodes, read_material):
    """A tint to the power of the mean way through the coat; a sheen over what it does not reflect."""
    material, tree = nodes()
    coated = tree.new("BsdfPrincipled", Base_Color=GREY, Coat_Weight=0.5, Coat_Tint=DARK)
    tree.show(coated)
    found, _ = read_material(material)
    np.testing.assert_allclose(found.reflectance, 0.75 * (0.5 + 0.5 * 0.25**1.15), rtol=1e-5)
    material, tree = nodes()
    tree.show(tree.new("BsdfPrincipled", Base_Color=GREY, Sheen_Weight=1.0, Sheen_Roughness=0.5, Sheen_Tint=RED))
    found, _ = read_material(material)
    np.testing.assert_allclose(found.reflectance, 0.118 * np.array(RED[:3]) + 0.882 * 0.75, rtol=1e-5)


def test_metal_is_named(nodes, read_material):
    material, tree = nodes()
    tree.show(tree.new("BsdfPrincipled", Base_Color=RED, Metallic=1.0))
    found, (warning,) = read_material(material)
    assert found.reflectance == RED[:3]
    assert "metal" in warning


def test_a_mapping_moves_the_uvs(nodes, add_mesh, add_image):
    """POINT: turned(scaled(uv)) + location."""
    material, tree = nodes()
    mapping = tree.new("Mapping", Location=(0.5, 0.25, 0), Rotation=(0, 0, np.pi / 2), Scale=(2, 4, 1))
    node = image_node(tree, add_image(checker()))
    tree.link(tree.new("TexCoord"), mapping, "UV", "Vector")
    tree.link(mapping, node, 0, "Vector")
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), 0, "Color"))
    quad = add_mesh("Quad", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)], material)
    quad.data.uv_layers.new(name="UVMap")
    for loop, uv in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        quad.data.uv_layers[0].uv[loop].vector = uv
    scene = read_scene(bpy.context.scene)
    uvs = scene.corners[..., :2]
    expected = np.stack([-4 * uvs[..., 1] + 0.5, 2 * uvs[..., 0] + 0.25], axis=-1)
    np.testing.assert_allclose(scene.uvs, expected, atol=1e-5)  # a float32 quarter turn
    assert scene.warnings == ()


def test_a_uv_map_node_chooses_its_layer(nodes, add_mesh, add_image):
    material, tree = nodes()
    chosen, node = tree.new("UVMap"), image_node(tree, add_image(checker()))
    chosen.uv_map = "Second"
    tree.link(chosen, node, 0, "Vector")
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), 0, "Color"))
    triangle = add_mesh("Triangle", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], material)
    for layer, name in enumerate(("First", "Second")):
        triangle.data.uv_layers.new(name=name)
        triangle.data.uv_layers[name].uv.foreach_set("vector", [layer + 0.5] * 6)
    assert triangle.data.uv_layers["First"].active_render
    assert (read_scene(bpy.context.scene).uvs == 1.5).all()


@pytest.mark.parametrize("kind", ["UVMap", "Attribute"])
@pytest.mark.parametrize(
    ("stored", "domain"), [("FLOAT_VECTOR", "POINT"), ("FLOAT_VECTOR", "FACE"), ("FLOAT2", "CORNER")]
)
def test_uvs_are_an_attribute_too(nodes, add_mesh, add_image, kind, stored, domain):
    """As geometry nodes leave them."""
    material, tree = nodes()
    chosen, node = tree.new(kind), image_node(tree, add_image(checker()))
    setattr(chosen, "uv_map" if kind == "UVMap" else "attribute_name", "made")
    tree.link(chosen, node, "UV" if kind == "UVMap" else "Vector", "Vector")
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), 0, "Color"))
    triangle = add_mesh("Triangle", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], material)
    made = triangle.data.attributes.new("made", stored, domain)
    numbers = np.random.default_rng(0).random((len(made.data), 3 if stored == "FLOAT_VECTOR" else 2))
    made.data.foreach_set("vector", numbers.ravel())
    scene = read_scene(bpy.context.scene)
    np.testing.assert_allclose(scene.uvs[0], np.broadcast_to(numbers[:, :2], (3, 2)), rtol=1e-6)  # float32
    assert scene.warnings == ()


def test_unreadable_colours_take_the_viewport_colour_and_are_named(nodes, read_material):
    material, tree = nodes("Marble")
    material.diffuse_color = RED
    # each object has a colour of its own: a tile has another
    node = tree.new("Attribute")
    node.attribute_type, node.attribute_name = "OBJECT", "color"
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), "Color", "Color"))
    found, warnings = read_material(material)
    assert found.reflectance == RED[:3]
    assert len(warnings) == 1
    assert "'Marble'" in warnings[0]
    assert "Attribute node" in warnings[0]


def test_an_unreadable_shader_takes_the_viewport_colour_and_is_named(nodes, read_material):
    material, tree = nodes("Fur")
    material.diffuse_color = RED
    tree.show(tree.new("BsdfHair"))
    found, warnings = read_material(material)
    assert found.reflectance == RED[:3]
    assert "'Fur'" in warnings[0]


def test_generated_coordinates_use_the_mean_colour(nodes, read_material, add_image):
    material, tree = nodes("Box")
    node = image_node(tree, add_image(checker(), space="Non-Color"))
    tree.link(tree.new("TexCoord"), node, "Generated", "Vector")
    tree.show(tree.link(node, tree.new("BsdfDiffuse"), 0, "Color"))
    found, warnings = read_material(material)
    assert found.reflectance_texture is None
    np.testing.assert_allclose(found.reflectance, checker().mean(axis=(0, 1)), atol=1e-6)  # float32
    assert "'Box'" in warnings[0]


def test_nothing_linked_is_black_and_no_nodes_is_the_viewport_colour(nodes, read_material):
    material, tree = nodes()
    tree.new("OutputMaterial")
    assert read_material(material)[0].reflectance == (0, 0, 0)
    plain = bpy.data.materials.new("Plain")
    plain.use_nodes = False
    plain.diffuse_color = RED
    assert read_material(plain)[0].reflectance == RED[:3]


def test_a_glossy_shader_is_baked_as_diffuse_and_said_so(nodes, read_material):
    material, tree = nodes("Chrome")
    tree.show(tree.new("BsdfAnisotropic", Color=RED))
    found, warnings = read_material(material)
    assert found.reflectance == RED[:3]
    assert "'Chrome'" in warnings[0]


def test_a_metal_of_indices_is_baked_with_the_colour_that_they_make(nodes, read_material):
    """Its Base Color is out of reach then, and asking for it raised."""
    material, tree = nodes()
    metal = tree.new("BsdfMetallic")
    metal.fresnel_type = "PHYSICAL_CONDUCTOR"
    metal.inputs["IOR"].default_value, metal.inputs["Extinction"].default_value = (0.5, 1.0, 2.0), (2.0, 1.0, 0.0)
    tree.show(metal)
    found, warnings = read_material(material)
    # ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2)
    assert found.reflectance == pytest.approx([4.25 / 6.25, 1 / 5, 1 / 9], rel=1e-6)
    assert len(warnings) == 1
    assert "Metallic BSDF is baked as diffuse" in warnings[0]


def test_a_volume_alone_lets_all_light_pass_and_is_not_baked(nodes, add_cube):
    material, tree = nodes("fog")
    tree.tree.links.new(tree.new("VolumeScatter").outputs[0], tree.new("OutputMaterial").inputs["Volume"])
    add_cube("Fog", material)
    add_cube("Room")
    scene = read_scene(bpy.context.scene)
    assert [o.name for o in scene.objects] == ["Room"]
    assert "'Fog' has a volume and no surface: it is not baked" in scene.warnings
    with pytest.raises(SceneError, match="'Fog' has a volume and no surface"):
        read_scene(bpy.context.scene, object_names=["Fog"])


def test_a_volume_and_displacement_of_a_surface_are_told(nodes, read_material):
    material, tree = nodes("stuff")
    output = tree.link(tree.new("BsdfDiffuse"), tree.new("OutputMaterial"), 0, "Surface")
    for kind, name in (("VolumeScatter", "Volume"), ("Displacement", "Displacement")):
        tree.tree.links.new(tree.new(kind).outputs[0], output.inputs[name])
    material.displacement_method = "BUMP"
    _, warnings = read_material(material)
    assert warnings == ("material 'stuff': its volume is not baked: light passes as if there were none",)
    material.displacement_method = "DISPLACEMENT"
    _, warnings = read_material(material)
    assert "material 'stuff': its displacement is not baked" in warnings


def test_a_material_override_takes_the_place_of_all(nodes, add_cube):
    clay, tree = nodes("clay")
    tree.show(tree.new("BsdfDiffuse", Color=(0.4, 0.4, 0.4, 1)))
    add_cube(material=nodes("own")[0])
    bpy.context.view_layer.material_override = clay
    scene = read_scene(bpy.context.scene)
    (used,) = np.unique(scene.triangle_materials)
    assert scene.materials[used].name == "clay"
