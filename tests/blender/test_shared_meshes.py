"""Linked duplicates have light of their own, found as a viewer finds it: mesh UVs, object's rectangle, image."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from addon.blender.bake_scene import discard, prepare, write
from addon.core.bake import bake
from addon.core.lightmap import bilinear
from addon.core.scene import SceneError
from addon.core.settings import BakeSettings

pytestmark = pytest.mark.usefixtures("empty_file")

SETTINGS = BakeSettings(texels=1 << 14, error=0.05, denoise=False)


@pytest.fixture
def duplicates(add_cube, add_lamp):
    """A floor, a lamp over its middle, and four cubes of one mesh around it: two alike, one mirrored, one small."""
    floor = add_cube("Floor")
    floor.scale, floor.location = (6, 6, 0.1), (0, 0, -0.1)
    add_lamp("POINT", location=(0, 0, 4), energy=500)
    mesh = add_cube("Cube +x").data
    places = {
        "Cube +x": ((3, 0, 1), (1, 1, 1)),
        "Cube -x": ((-3, 0, 1), (1, 1, 1)),
        "Mirrored +y": ((0, 3, 1), (1, -1, 1)),
        "Small -y": ((0, -3, 0.3), (0.3, 0.3, 0.3)),
    }
    objects = {}
    for name, (location, scale) in places.items():
        objects[name] = bpy.data.objects.get(name) or bpy.data.objects.new(name, mesh)
        objects[name].location, objects[name].scale = location, scale
        if name not in bpy.context.scene.collection.objects:
            bpy.context.scene.collection.objects.link(objects[name])
    return objects


def baked(settings=SETTINGS, **arguments):
    prepared = prepare(bpy.context.scene, settings, **arguments)
    write(prepared, bake(prepared.scene, settings))
    discard(prepared)


def pixels_of(blender_object):
    image = blender_object["patchlight_lightmap"]
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)[..., :3]


def three_deviations(value, error, mean):
    """Between two bakes of an error each, which is an RMS over the scene: the dark is known to a part of the mean."""
    return 3 * 2**0.5 * error * (value + 0.3 * mean)


def light_on_faces(blender_object):
    """E / pi in the middle of each quad, by the face's normal in world space, as a material looks it up."""
    mesh, pixels = blender_object.data, pixels_of(blender_object)
    rect = np.array(blender_object.get("patchlight_rect", (1, 1, 0, 0)))
    found = {}
    for polygon in mesh.polygons:
        uvs = np.array([mesh.uv_layers["Lightmap"].uv[loop].vector for loop in polygon.loop_indices])
        normal = np.array(blender_object.matrix_world.to_3x3()) @ np.array(polygon.normal)
        value = bilinear(pixels, (uvs * rect[:2] + rect[2:]).mean(axis=0, keepdims=True))[0].mean()
        found[tuple(int(n) for n in np.round(normal / np.linalg.norm(normal)))] = float(value)
    return found


def towards_the_lamp(blender_object):
    """E / pi in the middles of the top and of the side that faces the lamp, by the inverse square law; that side."""
    height = blender_object.location.z + blender_object.scale.z
    along = np.array(blender_object.location[:2])
    distance = np.linalg.norm(along)
    side = (*(int(n) for n in np.round(-along / distance)), 0)
    intensity = 500 / (4 * np.pi)
    top = intensity * (4 - height) / (distance**2 + (4 - height) ** 2) ** 1.5 / np.pi
    near, drop = distance - blender_object.scale.x, 4 - blender_object.location.z
    return top, intensity * near / (near**2 + drop**2) ** 1.5 / np.pi, side


def test_each_duplicate_has_its_own_light(duplicates):
    black = bpy.data.materials.new("Black")
    black.use_nodes = True
    black.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0, 0, 0, 1)
    bpy.data.objects["Floor"].data.materials.append(black)
    duplicates["Cube +x"].data.materials.append(black)
    baked()
    rects = {name: tuple(blender_object["patchlight_rect"]) for name, blender_object in duplicates.items()}
    assert len(set(rects.values())) == 4
    # a material that all share reads the same of the floor
    assert tuple(bpy.data.objects["Floor"]["patchlight_rect"]) == (1, 1, 0, 0)
    for blender_object in duplicates.values():
        found = light_on_faces(blender_object)
        top, near, side = towards_the_lamp(blender_object)
        # between texels a tenth of a face wide light is read off straight lines: a few thousandths of it
        assert found[0, 0, 1] == pytest.approx(top, rel=0.02)
        assert found[side] == pytest.approx(near, rel=0.02)
        assert found[tuple(-n for n in side)] == 0


def test_the_light_is_that_of_single_users(duplicates):
    fine = BakeSettings(texels=1 << 16, error=0.02, denoise=False)
    baked(fine)
    shared = {name: light_on_faces(blender_object) for name, blender_object in duplicates.items()}
    for blender_object in duplicates.values():
        blender_object.data = blender_object.data.copy()
    baked(fine)
    for name, blender_object in duplicates.items():
        assert "patchlight_rect" not in blender_object
        alone = light_on_faces(blender_object)
        mean = np.mean(list(alone.values()))
        for normal, value in shared[name].items():
            assert value == pytest.approx(alone[normal], abs=three_deviations(value, fine.error, mean))


def test_it_can_be_baked_again_in_its_places(duplicates):
    baked()
    before = {name: light_on_faces(blender_object) for name, blender_object in duplicates.items()}
    uvs = [tuple(loop.vector) for loop in duplicates["Cube +x"].data.uv_layers["Lightmap"].uv]
    rects = {name: tuple(blender_object["patchlight_rect"]) for name, blender_object in duplicates.items()}
    baked(BakeSettings(texels=1 << 16, error=0.05, denoise=False, keep_uvs=True))
    assert [tuple(loop.vector) for loop in duplicates["Cube +x"].data.uv_layers["Lightmap"].uv] == uvs
    for name, blender_object in duplicates.items():
        assert tuple(blender_object["patchlight_rect"]) == rects[name]
        mean = np.mean(list(before[name].values()))
        for normal, value in light_on_faces(blender_object).items():
            assert value == pytest.approx(before[name][normal], abs=three_deviations(value, SETTINGS.error, mean))


def test_a_duplicate_of_no_size_takes_nothing_from_the_others(duplicates):
    for name in ("Cube -x", "Mirrored +y", "Small -y"):
        duplicates[name].scale = (0, 0, 0)
    baked()
    assert max(light_on_faces(duplicates["Cube +x"]).values()) > 0
    assert "patchlight_rect" not in duplicates["Cube +x"]


def test_who_changes_meshes_with_another_since_it_was_read_is_refused(duplicates, add_cube):
    pair = add_cube("Pair 1"), bpy.data.objects.new("Pair 2", bpy.data.meshes["Pair 1"])
    bpy.context.scene.collection.objects.link(pair[1])
    prepared = prepare(bpy.context.scene, SETTINGS)
    result = bake(prepared.scene, SETTINGS)
    duplicates["Cube -x"].data = pair[0].data
    with pytest.raises(SceneError, match="came to share its mesh during the bake: nothing has been written"):
        write(prepared, result)


def test_a_duplicate_that_is_not_baked_now_keeps_its_light(duplicates):
    baked()
    other = duplicates["Cube -x"]
    before, image = light_on_faces(other), other["patchlight_lightmap"]
    other.modifiers.new("Bevel", "BEVEL")
    report = prepare(bpy.context.scene, SETTINGS).scene
    assert [o.name for o in report.objects if o.is_target] == ["Floor"]
    said = "with 'Cube -x', whose lightmap would no longer fit and which is not baked now: it is not baked; bake both"
    assert sum(said in warning for warning in report.warnings) == 3
    other.modifiers.clear()
    other.hide_render = True
    assert [o.name for o in prepare(bpy.context.scene, SETTINGS).scene.objects if o.is_target] == ["Floor"]
    assert (light_on_faces(other), other["patchlight_lightmap"]) == (before, image)
    # who has no lightmap any more, or is in no scene, has none to lose
    del other["patchlight_lightmap"]
    duplicates["Small -y"].users_collection[0].objects.unlink(duplicates["Small -y"])
    assert sum(o.is_target for o in prepare(bpy.context.scene, SETTINGS).scene.objects) == 3


def test_a_copy_that_took_the_rectangle_along_does_not_keep_uvs(duplicates):
    baked()
    copy = duplicates["Cube -x"].copy()
    copy.name = "Copy"
    copy.location = (5, 5, 1)
    bpy.context.scene.collection.objects.link(copy)
    scene = prepare(bpy.context.scene, BakeSettings(keep_uvs=True)).scene
    assert sum("and so its place in the lightmap (patchlight_rect)" in w for w in scene.warnings) == 2
    assert {o.name for o in scene.objects if o.is_target} == {"Floor", "Cube +x", "Mirrored +y", "Small -y"}


def test_who_shares_a_mesh_since_it_was_read_is_refused(duplicates, add_cube):
    other = add_cube("Other")
    prepared = prepare(bpy.context.scene, SETTINGS)
    result = bake(prepared.scene, SETTINGS)
    other.data = duplicates["Cube +x"].data
    with pytest.raises(SceneError, match="'Other' came to share its mesh during the bake: nothing has been written"):
        write(prepared, result)
    assert "patchlight_lightmap" not in other
