"""Modifiers that make faces, applied by the bake: the file has them as they were until it has succeeded."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon.blender.bake_scene import discard, prepare, write
from addon.core.bake import bake
from addon.core.scene import SceneError
from addon.core.settings import BakeSettings

pytestmark = pytest.mark.usefixtures("empty_file")

LIGHTMAP = BakeSettings(texels=1 << 12, error=0.2, denoise=False)
VERTEX = BakeSettings(target="vertex", error=0.2)


@pytest.fixture
def chair(add_cube, add_lamp):
    """A cube with a Mirror that makes another one beside it, over a floor, under a lamp."""
    floor = add_cube("Floor")
    floor.scale, floor.location = (9, 9, 0.1), (0, 0, -3)
    add_lamp("POINT", location=(0, 0, 9), energy=1000)
    chair = add_cube("Chair")
    chair.location = (2, 0, 0)
    mirror = chair.modifiers.new("Mirror", "MIRROR")
    mirror.mirror_object = bpy.data.objects["Floor"]
    return chair


def prepared(settings=LIGHTMAP, **arguments):
    return prepare(bpy.context.scene, settings, apply_modifiers=True, **arguments)


def baked(settings=LIGHTMAP, **arguments):
    found = prepared(settings, **arguments)
    result = bake(found.scene, settings)
    write(found, result)
    discard(found)
    return result.report


def twin(name, blender_object):
    """A linked duplicate with the same modifiers."""
    other = blender_object.copy()
    other.name = name
    bpy.context.scene.collection.objects.link(other)
    return other


def test_the_mesh_becomes_what_the_modifiers_make(chair):
    before = prepared()
    assert len(chair.data.polygons) == 6
    assert [m.name for m in chair.modifiers] == ["Mirror"]
    discard(before)
    assert [mesh.name for mesh in bpy.data.meshes] == ["Chair", "Floor"]
    report = baked()
    assert len(chair.data.polygons) == 12
    assert chair.data.name == "Chair"
    assert not chair.modifiers
    assert sorted(mesh.name for mesh in bpy.data.meshes) == ["Chair", "Floor"]
    assert "'Chair' has had Mirror applied by the bake" in report.warnings
    uvs = np.array([loop.vector for loop in chair.data.uv_layers["Lightmap"].uv]).reshape(-1, 4, 2).mean(axis=1)
    # each face has a place of its own, also the mirrored ones
    assert len(np.unique(np.round(uvs * 64), axis=0)) == 12


def test_without_it_the_object_is_named_with_the_remedy(chair):
    scene = prepare(bpy.context.scene, LIGHTMAP).scene
    assert any(
        w == "Mirror modifier on 'Chair' makes new faces: it is not baked; apply the modifier to bake it, or bake with "
        "Apply Modifiers (--apply-modifiers)"
        for w in scene.warnings
    )


def test_vertex_colours_are_of_the_new_corners(chair):
    baked(VERTEX)
    colours = chair.data.color_attributes["Patchlight"]
    assert len(colours.data) == 48
    # those of the sides that the lamp sees are lit: 2 tops of 4 corners at the least
    assert sum(min(item.color[:3]) > 0 for item in colours.data) >= 8


def test_what_is_applied_can_be_cut(chair):
    chair.data.shape_keys or chair.shape_key_add(name="Basis")
    baked(VERTEX, subdivide=0.6)
    assert not chair.modifiers
    longest = max((chair.data.vertices[a].co - chair.data.vertices[b].co).length for a, b in _edges(chair))
    assert longest <= 0.6 * (1 + 1e-5)
    assert len(chair.data.polygons) == 12 * 16
    assert len(bpy.data.meshes) == 2


def _edges(blender_object):
    return [edge.vertices for edge in blender_object.data.edges]


def test_duplicates_that_are_modified_alike_share_their_new_mesh(chair):
    other, third = twin("Other", chair), twin("Third", chair)
    for blender_object in (chair, other, third):
        blender_object.modifiers["Mirror"].mirror_object = None
        blender_object.modifiers["Mirror"].use_axis[1] = True
    other.location, third.location = (-4, 0, 0), (-4, 5, 0)
    third.modifiers.new("Bevel", "BEVEL")
    baked()
    assert chair.data == other.data
    assert len(bpy.data.meshes) == 3
    assert third.data != chair.data
    assert tuple(chair["patchlight_rect"]) != tuple(other["patchlight_rect"])
    assert tuple(third["patchlight_rect"]) == (1, 1, 0, 0)


def test_modifiers_that_keep_faces_or_are_off_stay(chair):
    floor = bpy.data.objects["Floor"]
    floor.modifiers.new("Displace", "DISPLACE").strength = 0.0
    chair.modifiers.new("Off", "BEVEL").show_render = False
    chair.modifiers.new("Collision", "COLLISION")
    baked()
    assert [m.name for m in floor.modifiers] == ["Displace"]
    assert [m.name for m in chair.modifiers] == ["Off", "Collision"]


def test_one_that_is_left_out_after_all_keeps_its_modifiers(chair, add_cube):
    broken = add_cube("Broken")
    broken.modifiers.new("Mirror", "MIRROR")
    broken.data.vertices[0].co.x = np.nan
    report = baked()
    assert [m.name for m in broken.modifiers] == ["Mirror"]
    assert len(broken.data.polygons) == 6
    assert not chair.modifiers
    assert sorted(mesh.name for mesh in bpy.data.meshes) == ["Broken", "Chair", "Floor"]
    assert sum("'Broken'" in w for w in report.warnings) == 1


def test_modifiers_are_applied_as_a_render_has_them(chair):
    surface = chair.modifiers.new("Subdivision", "SUBSURF")
    surface.levels, surface.render_levels = 1, 3
    chair.modifiers.new("Viewport only", "BEVEL").show_render = False
    report = baked()
    assert "'Chair' has had Mirror and Subdivision applied by the bake" in report.warnings
    assert len(chair.data.polygons) == 2 * 6 * 4**3
    assert [m.name for m in chair.modifiers] == ["Viewport only"]


def test_what_a_mesh_is_told_by_its_owner_stays(chair):
    chair.data["part"] = 17
    baked()
    assert chair.data["part"] == 17


def test_duplicates_whose_modifiers_differ_in_vertices_only_have_meshes_of_their_own(chair):
    other = twin("Other", chair)
    other.location = (-3, 1, 0)
    baked()
    assert chair.data != other.data
    assert len(chair.data.polygons) == len(other.data.polygons)


def test_kept_uvs_of_duplicates_are_checked_with_modifiers_too(chair):
    chair.data.uv_layers.new(name="Lightmap")
    twin("Other", chair)
    with pytest.raises(SceneError, match="shares its mesh 'Chair' with other objects, and so its 'Lightmap' UVs"):
        prepared(BakeSettings(keep_uvs=True), object_names=["Other"])


def test_who_makes_instances_too_is_refused(chair):
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    points, join = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeJoinGeometry")
    cone = tree.nodes.new("GeometryNodeMeshCone")
    for a, b in (
        (start.outputs[0], points.inputs["Points"]),
        (cone.outputs["Mesh"], points.inputs["Instance"]),
        (start.outputs[0], join.inputs[0]),
        (points.outputs[0], join.inputs[0]),
        (join.outputs[0], end.inputs[0]),
    ):
        tree.links.new(a, b)
    chair.modifiers.new("Scatter", "NODES").node_group = tree
    with pytest.raises(SceneError, match="'Chair' makes new faces and instances: it is not baked; make its instances"):
        prepared(object_names=["Chair"])


def test_a_failed_bake_leaves_modifiers_and_meshes(chair):
    found = prepared()
    bad = SimpleNamespace(lightmap=SimpleNamespace(pixels=np.full((4, 4, 3), np.nan, np.float32)))
    with pytest.raises(SceneError, match="not finite"):
        write(found, bad)
    discard(found)
    assert [m.name for m in chair.modifiers] == ["Mirror"]
    assert sorted(mesh.name for mesh in bpy.data.meshes) == ["Chair", "Floor"]
    assert len(chair.data.polygons) == 6
