"""A bake's way back into the file: what is stored is what was baked, whole or not at all."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon.blender.bake_scene import discard, prepare, write
from addon.core.lightmap import Lightmap
from addon.core.scene import SceneError
from addon.core.settings import BakeSettings, SettingsError

pytestmark = pytest.mark.usefixtures("empty_file")

LIGHTMAP = BakeSettings(target="lightmap")
VERTEX = BakeSettings(target="vertex")


def prepared_for(settings, **arguments):
    return prepare(bpy.context.scene, settings, **arguments)


def result_for(prepared, seed=0, size=(16, 32)):
    """A bake of random light, with its own UVs per corner of the mesh, as an unwrap gives them."""
    rng = np.random.default_rng(seed)
    scene = prepared.scene
    uvs, colours = (np.full((len(scene.triangles), 3, width), np.nan, np.float32) for width in (2, 3))
    for target in prepared.targets:
        uvs[target.span] = rng.random((target.corners.max() + 1, 2), dtype=np.float32)[target.corners]
        colours[target.span] = 9 * rng.random((target.corners.max() + 1, 3), dtype=np.float32)[target.corners]
    pixels = 9 * rng.random((*size, 3), dtype=np.float32)
    return SimpleNamespace(lightmap=Lightmap(pixels, uvs), corner_colours=colours)


def stored_uvs(blender_object):
    layer = blender_object.data.uv_layers["Lightmap"]
    values = np.empty(len(blender_object.data.loops) * 2, np.float32)
    layer.uv.foreach_get("vector", values)
    return values.reshape(-1, 2)


def stored_colours(blender_object):
    values = np.empty(len(blender_object.data.loops) * 4, np.float32)
    blender_object.data.color_attributes["Patchlight"].data.foreach_get("color", values)
    return values.reshape(-1, 4)


def stored_pixels(image):
    values = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)


def fingerprint():
    """All that a bake could change."""
    return [
        (
            o.name,
            o.data.name,
            len(o.data.vertices),
            [layer.name for layer in o.data.uv_layers],
            [a.name for a in o.data.color_attributes],
            list(o.keys()),
        )
        for o in bpy.data.objects
        if o.type == "MESH"
    ] + [sorted(m.name for m in bpy.data.meshes), sorted(i.name for i in bpy.data.images)]


def save_and_open(tmp_path):
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)


def test_a_lightmap_survives_saving(add_cube, tmp_path):
    add_cube("A")
    add_cube("B").scale = (-1, 2, 1)
    prepared = prepared_for(LIGHTMAP)
    result = result_for(prepared)
    write(prepared, result)
    discard(prepared)
    save_and_open(tmp_path)
    images = {bpy.data.objects[name]["patchlight_lightmap"] for name in "AB"}
    assert {image.name for image in images} == {"Patchlight Lightmap"}
    pixels = stored_pixels(images.pop())
    np.testing.assert_array_equal(pixels[..., :3], result.lightmap.pixels)  # 32-bit floats: to the bit
    assert (pixels[..., 3] == 1).all()
    for target in prepared.targets:
        uvs = stored_uvs(bpy.data.objects[target.name])
        np.testing.assert_array_equal(uvs[target.corners], result.lightmap.uvs[target.span])
        assert "patchlight_rect" not in bpy.data.objects[target.name]


def test_a_copy_of_a_baked_mesh_gets_uvs_of_its_own(add_cube):
    first = add_cube("First")
    prepared = prepared_for(LIGHTMAP)
    write(prepared, result_for(prepared))
    second = bpy.data.objects.new("Second", first.data.copy())  # as Shift D does it
    bpy.context.scene.collection.objects.link(second)
    prepared = prepared_for(LIGHTMAP)
    result = result_for(prepared, seed=1)
    write(prepared, result)
    for target in prepared.targets:
        uvs = stored_uvs(bpy.data.objects[target.name])
        np.testing.assert_array_equal(uvs[target.corners], result.lightmap.uvs[target.span])


def test_the_image_is_linear_float_data_and_packed(add_cube):
    cube = add_cube()
    prepared = prepared_for(LIGHTMAP)
    write(prepared, result_for(prepared))
    image = cube["patchlight_lightmap"]
    assert image.is_float
    assert image.colorspace_settings.name == "Non-Color"
    assert image.packed_file is not None


def test_textures_keep_their_uv_map(add_cube):
    cube = add_cube()
    cube.data.uv_layers.new(name="First")
    cube.data.uv_layers.new(name="Second")
    cube.data.uv_layers["Second"].active_render = True
    cube.data.uv_layers.active_index = 0
    prepared = prepared_for(LIGHTMAP)
    write(prepared, result_for(prepared))
    layers = cube.data.uv_layers
    assert [layer.name for layer in layers if layer.active_render] == ["Second"]
    assert layers.active.name == "First"
    assert "Lightmap" in layers


def test_a_second_bake_takes_the_place_of_the_first(add_cube, nodes):
    cube = add_cube()
    _, tree = nodes()
    shown = tree.new("TexImage")
    for seed, size in ((1, (16, 32)), (2, (8, 64))):
        prepared = prepared_for(LIGHTMAP)
        result = result_for(prepared, seed, size)
        write(prepared, result)
        np.testing.assert_array_equal(stored_pixels(cube["patchlight_lightmap"])[..., :3], result.lightmap.pixels)
        np.testing.assert_array_equal(
            stored_uvs(cube)[prepared.targets[0].corners], result.lightmap.uvs[prepared.targets[0].span]
        )
        shown.image = shown.image or cube["patchlight_lightmap"]
        assert shown.image == cube["patchlight_lightmap"]
    assert [image.name for image in bpy.data.images] == ["Patchlight Lightmap"]
    assert len(cube.data.uv_layers) == 1


def test_a_bake_of_one_object_leaves_the_lightmap_of_the_other(add_cube):
    first, second = add_cube("A"), add_cube("B")
    prepared = prepared_for(LIGHTMAP)
    result = result_for(prepared, 1)
    write(prepared, result)
    prepared = prepared_for(LIGHTMAP, object_names=["B"])
    write(prepared, result_for(prepared, 2))
    assert first["patchlight_lightmap"] != second["patchlight_lightmap"]
    np.testing.assert_array_equal(stored_pixels(first["patchlight_lightmap"])[..., :3], result.lightmap.pixels)


def test_undo_brings_an_earlier_bake_back(add_cube):
    """Its pixels, too: those of a data-block that stays are not undone."""
    add_cube()
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="built")
    results = []
    for seed in (1, 2):
        prepared = prepared_for(LIGHTMAP)
        results.append(result_for(prepared, seed))
        write(prepared, results[-1])
        bpy.ops.ed.undo_push(message="baked")
    bpy.ops.ed.undo()
    image = bpy.data.objects["Cube"]["patchlight_lightmap"]
    np.testing.assert_array_equal(stored_pixels(image)[..., :3], results[0].lightmap.pixels)


def test_what_shows_one_of_several_lightmaps_shows_the_one_of_all(add_cube, nodes):
    add_cube("A"), add_cube("B")
    _, tree = nodes()
    shown = tree.new("TexImage")
    for chosen in (None, ["B"], None):
        prepared = prepared_for(LIGHTMAP, object_names=chosen)
        write(prepared, result_for(prepared, 1))
        shown.image = shown.image or bpy.data.objects["A"]["patchlight_lightmap"]
    assert shown.image == bpy.data.objects["A"]["patchlight_lightmap"] == bpy.data.objects["B"]["patchlight_lightmap"]
    assert [image.name for image in bpy.data.images] == ["Patchlight Lightmap"]


def test_vertex_colours_survive_saving(add_cube, tmp_path):
    add_cube("A")
    add_cube("B").scale = (-1, 2, 1)
    prepared = prepared_for(VERTEX)
    result = result_for(prepared)
    write(prepared, result)
    save_and_open(tmp_path)
    for target in prepared.targets:
        mesh = bpy.data.objects[target.name].data
        attribute = mesh.color_attributes["Patchlight"]
        assert (attribute.data_type, attribute.domain) == ("FLOAT_COLOR", "CORNER")
        assert mesh.color_attributes.active_color_name == "Patchlight"
        assert mesh.color_attributes[mesh.color_attributes.render_color_index].name == "Patchlight"
        colours = stored_colours(bpy.data.objects[target.name])
        np.testing.assert_array_equal(colours[target.corners, :3], result.corner_colours[target.span])
        assert (colours[:, 3] == 1).all()


def test_an_attribute_of_another_kind_makes_way(add_cube):
    cube = add_cube()
    cube.data.color_attributes.new("Patchlight", "BYTE_COLOR", "POINT")
    prepared = prepared_for(VERTEX)
    result = result_for(prepared)
    write(prepared, result)
    target = prepared.targets[0]
    np.testing.assert_array_equal(stored_colours(cube)[target.corners, :3], result.corner_colours[target.span])


def test_a_triangle_without_area_may_stay_without_light(add_mesh):
    leaf = add_mesh("Leaf", [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)], [(0, 1, 2), (0, 1, 3)])
    prepared = prepared_for(VERTEX)
    result = result_for(prepared)
    result.corner_colours[0] = np.nan
    write(prepared, result)
    assert (stored_colours(leaf)[:3, :3] == 0).all()
    assert (stored_colours(leaf)[3:, :3] > 0).all()


def spoil_pixels(result):
    result.lightmap.pixels[3, 4, 1] = np.nan


def spoil_uvs(result):
    result.lightmap.uvs[5] = np.nan


def remove_object(result):
    bpy.data.objects.remove(bpy.data.objects["B"])


def change_mesh(result):
    bpy.data.objects["B"].data = bpy.data.meshes.new("Other")


def fill_layers(result):
    for index in range(8):
        bpy.data.objects["B"].data.uv_layers.new(name=f"Layer {index}")


@pytest.mark.parametrize("spoil", [spoil_pixels, spoil_uvs, remove_object, change_mesh, fill_layers])
def test_nothing_is_written_when_anything_is_wrong(add_cube, spoil):
    add_cube("A")
    add_cube("B")
    prepared = prepared_for(LIGHTMAP)
    result = result_for(prepared)
    spoil(result)
    before = fingerprint()
    with pytest.raises(SceneError):
        write(prepared, result)
    assert fingerprint() == before


def test_eight_uv_maps_are_named_before_the_bake(add_cube):
    cube = add_cube("Full")
    for index in range(8):
        cube.data.uv_layers.new(name=f"Layer {index}")
    with pytest.raises(SceneError, match="'Full' already has 8 UV maps"):
        prepared_for(LIGHTMAP)
    assert prepared_for(VERTEX).targets
    cube.data.uv_layers[7].name = "Lightmap"
    assert prepared_for(LIGHTMAP).targets


def test_a_name_that_something_else_has_is_told_before_the_bake(add_cube):
    cube = add_cube("Cube")
    cube.data.color_attributes.new("Lightmap", "BYTE_COLOR", "CORNER")
    with pytest.raises(SceneError, match="'Cube' has an attribute 'Lightmap' that is no UV map"):
        prepared_for(LIGHTMAP)
    cube.data.uv_layers.new(name="Patchlight")
    with pytest.raises(SceneError, match="'Cube' has an attribute 'Patchlight' that is no colour"):
        prepared_for(VERTEX)
    cube.data.uv_layers.remove(cube.data.uv_layers["Patchlight"])
    cube.vertex_groups.new(name="Patchlight")
    with pytest.raises(SceneError, match="'Cube' has a vertex group 'Patchlight'"):
        prepared_for(VERTEX)
    cube.vertex_groups.clear()
    cube.data.color_attributes.new("Patchlight", "BYTE_COLOR", "POINT")
    prepared = prepared_for(VERTEX)
    write(prepared, result_for(prepared))
    assert cube.data.attributes["Patchlight"].data_type == "FLOAT_COLOR"


def test_preparing_changes_nothing(add_cube, add_lamp):
    add_cube()
    add_lamp("POINT")
    before = fingerprint()
    for settings, subdivide in ((LIGHTMAP, None), (VERTEX, None), (VERTEX, 0.5)):
        discard(prepared_for(settings, subdivide=subdivide))
        assert fingerprint() == before


def test_subdivide_is_checked(add_cube):
    add_cube()
    with pytest.raises(SettingsError, match="target vertex"):
        prepared_for(LIGHTMAP, subdivide=0.1)
    with pytest.raises(SettingsError, match="above 0"):
        prepared_for(VERTEX, subdivide=0.0)
    with pytest.raises(SceneError, match="'Cube' would get about"):
        prepared_for(VERTEX, subdivide=1e-4)
    assert [mesh.name for mesh in bpy.data.meshes] == ["Cube"]
