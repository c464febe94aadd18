"""Geometry on its way from Blender: what is read, where it lies, which way it faces, what can be baked."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from addon.blender.read_scene import read_scene
from addon.core.scene import SceneError
from addon.core.settings import BakeSettings
from addon.core.sound_faces import sound_faces

# Blender's positions and matrices are float32: one part in 10^7, times coordinates up to 10.
FLOAT32 = 1e-5

LIGHTMAP = BakeSettings()

pytestmark = pytest.mark.usefixtures("empty_file")


def read(settings=LIGHTMAP, **arguments):
    return read_scene(bpy.context.scene, settings, **arguments)


def named(scene, name):
    return next(scene_object for scene_object in scene.objects if scene_object.name == name)


def face_normals(scene, span=slice(None)):
    corners = scene.corners[span]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def place(blender_object, matrix):
    """Move an object by any matrix; its own location, rotation and scale could not hold a shear."""
    blender_object.parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(blender_object.parent)
    blender_object.matrix_parent_inverse = matrix


TRANSFORMS = {
    "moved": Matrix.Translation((3, -2, 1)),
    "mirrored": Matrix.Diagonal((-1, 1, 1, 1)),
    "point mirrored": Matrix.Diagonal((-1, -2, -0.5, 1)),
    "uneven": Matrix.Rotation(0.7, 4, "X") @ Matrix.Diagonal((1, 3, 0.2, 1)) @ Matrix.Rotation(1.1, 4, "Y"),
}


@pytest.mark.parametrize("transform", TRANSFORMS.values(), ids=TRANSFORMS)
def test_a_cube_looks_outwards_whatever_its_transform(add_cube, transform):
    cube = add_cube()
    place(cube, transform)
    scene = read()
    outwards = scene.corners.mean(axis=1) - np.array(transform.translation)
    assert ((face_normals(scene) * outwards).sum(axis=1) > 0).all()
    expected = np.array([transform @ v.co for v in cube.data.vertices])
    np.testing.assert_allclose(scene.vertices, expected, atol=FLOAT32)


@pytest.mark.parametrize("transform", TRANSFORMS.values(), ids=TRANSFORMS)
def test_smooth_normals_follow_the_surface(transform):
    """On an ellipsoid x = M s, |s| = 1, the normal is M^-T s: known without the code under test."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16)
    ball = bpy.context.object
    ball.data.shade_smooth()
    place(ball, transform)
    scene = read()
    matrix = np.array(transform)
    unit = (scene.corners - matrix[:3, 3]) @ np.linalg.inv(matrix[:3, :3]).T
    expected = unit @ np.linalg.inv(matrix[:3, :3])
    expected /= np.linalg.norm(expected, axis=2, keepdims=True)
    # Vertex normals of a 32 x 16 sphere are means over facets 11 degrees wide: off by less than 2 degrees before the
    # transform, whose uneven scale (15 : 1) can turn that into much more at the rim; compare before it.
    back = scene.corner_normals @ matrix[:3, :3]
    back /= np.linalg.norm(back, axis=2, keepdims=True)
    assert ((back * unit).sum(axis=2) > np.cos(np.radians(2))).all()
    assert ((scene.corner_normals * expected).sum(axis=2) > 0).all()


def test_flat_faces_have_the_normal_of_their_triangle(add_mesh):
    """A bent quad is two triangles; the polygon's one normal would be neither's."""
    add_mesh("Bent", [(0, 0, 0), (1, 0, 0), (1, 1, 1), (0, 1, 0)], [(0, 1, 2, 3)])
    bpy.data.objects["Bent"].data.shade_flat()
    scene = read()
    # float32 rounding of unit vectors
    np.testing.assert_allclose(scene.corner_normals, np.repeat(face_normals(scene)[:, None], 3, axis=1), atol=1e-6)


def test_mirroring_keeps_corners_edges_and_uvs_together(add_mesh):
    quad = add_mesh("Quad", [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
    quad.data.uv_layers.new(name="Texture")
    quad.data.uv_layers.new(name="Lightmap", do_init=False)
    for loop, vertex in enumerate(v.co for v in quad.data.vertices):
        quad.data.uv_layers["Texture"].uv[loop].vector = vertex.xy / 2
        quad.data.uv_layers["Lightmap"].uv[loop].vector = vertex.yx / 2
    quad.data.shade_smooth()
    edge = next(e for e in quad.data.edges if set(e.vertices) == {0, 1})
    edge.use_edge_sharp = True
    quad.matrix_world = Matrix.Diagonal((-3, 1, 1, 1))
    scene = read()
    plane = scene.corners / (-3, 1, 1)
    np.testing.assert_allclose(scene.uvs, plane[..., :2] / 2, atol=1e-6)
    np.testing.assert_allclose(scene.objects[0].lightmap_uvs, plane[..., 1::-1] / 2, atol=1e-6)
    positions = np.array([v.co for v in quad.data.vertices])
    np.testing.assert_allclose(positions[scene.objects[0].corners], plane, atol=1e-6)
    on_sharp_edge = (plane[..., 1] == 0) & (np.roll(plane, -1, axis=1)[..., 1] == 0)
    np.testing.assert_array_equal(scene.objects[0].sharp_edges, on_sharp_edge)
    assert on_sharp_edge.sum() == 1


def test_a_flat_face_is_sharp_on_both_sides_of_its_edges(add_mesh):
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 1), (2, 1, 1)]
    pair = add_mesh("Pair", vertices, [(0, 1, 2, 3), (1, 4, 5, 2)])
    pair.data.shade_smooth()
    assert not read().objects[0].sharp_edges.any()
    pair.data.polygons[0].use_smooth = False
    scene = read()
    ends = np.stack([scene.triangles, np.roll(scene.triangles, -1, axis=1)], axis=2)
    is_shared = (np.sort(ends, axis=2) == (1, 2)).all(axis=2)
    assert is_shared.sum() == 2
    assert scene.objects[0].sharp_edges[is_shared].all()
    # no diagonal, no border
    assert scene.objects[0].sharp_edges.sum() == 2


@pytest.mark.parametrize(("degrees", "is_sharp"), [(0, False), (1, False), (3, True), (180, True)])
def test_flat_faces_of_one_plane_are_not_parted(add_mesh, degrees, is_sharp):
    """Blender's meshes are flat-shaded unless told otherwise: a wall of many faces has no seams at each."""
    x, z = 1 + np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (x, 0, z), (x, 1, z)]
    pair = add_mesh("Pair", vertices, [(0, 1, 2, 3), (1, 4, 5, 2)])
    pair.data.shade_flat()
    sharp = read().objects[0].sharp_edges
    assert sharp.sum() == (2 if is_sharp else 0)
    pair.data.edges[[set(e.vertices) for e in pair.data.edges].index({1, 2})].use_edge_sharp = True
    assert read().objects[0].sharp_edges.sum() == 2


def test_a_face_with_no_normal_takes_its_triangles_own(add_mesh):
    """Two back-to-back faces cancel in the vertex normals of a smooth-shaded mesh."""
    add_mesh("Leaf", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 1)]).data.shade_smooth()
    scene = read()
    assert np.isfinite(scene.corner_normals).all()
    np.testing.assert_allclose(np.linalg.norm(scene.corner_normals, axis=2), 1, atol=1e-6)  # float32


def test_hidden_objects_are_not_read(add_cube):
    names = {"Seen", "Object", "Collection"}
    cubes = {name: add_cube(name) for name in names}
    cubes["Object"].hide_render = True
    hidden = bpy.data.collections.new("Hidden")
    hidden.hide_render = True
    bpy.context.scene.collection.children.link(hidden)
    hidden.objects.link(cubes["Collection"])
    bpy.context.scene.collection.objects.unlink(cubes["Collection"])
    assert [o.name for o in read().objects] == ["Seen"]
    for name in ("Object", "Collection"):
        with pytest.raises(SceneError, match=f"'{name}' is hidden from renders"):
            read(object_names=[name])


def test_instances_light_the_scene_under_their_numbers(add_cube):
    add_cube("Room")
    source = bpy.data.collections.new("Furniture")
    chair = add_cube("Chair")
    source.objects.link(chair)
    bpy.context.scene.collection.objects.unlink(chair)
    for index in range(3):
        empty = bpy.data.objects.new(f"Place {index}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", source
        empty.location = (5 * index, 0, 7)
        bpy.context.scene.collection.objects.link(empty)
    scene = read()
    assert {o.name: o.is_target for o in scene.objects} == {
        "Room": True,
        "Chair#0": False,
        "Chair#1": False,
        "Chair#2": False,
    }
    centres = [scene.corners[named(scene, f"Chair#{k}").span].mean(axis=(0, 1)) for k in range(3)]
    np.testing.assert_allclose(sorted(c[0] for c in centres), [0, 5, 10], atol=FLOAT32)
    assert any("'Chair' is instanced by 'Place 0'" in warning for warning in scene.warnings)


@pytest.fixture
def add_duplicate(add_cube):
    """Add a room, and two cubes that share a mesh; the second of these."""
    add_cube("Room")
    second = bpy.data.objects.new("Second", add_cube("First").data)
    bpy.context.scene.collection.objects.link(second)
    second.location = (5, 0, 0)
    return second


def test_linked_duplicates_are_read_with_their_mesh(add_duplicate):
    scene = read()
    assert {o.name: o.mesh for o in scene.objects if o.is_target} == {
        "Room": "Room",
        "First": "First",
        "Second": "First",
    }
    assert scene.warnings == ()


def test_linked_duplicates_have_one_set_of_vertex_colours_and_are_not_baked(add_duplicate):
    scene = read(BakeSettings(target="vertex"))
    assert [o.name for o in scene.objects if o.is_target] == ["Room"]
    assert sum("shares its mesh 'First' with other objects, and so its vertex" in w for w in scene.warnings) == 2
    with pytest.raises(SceneError, match="'Second' shares its mesh"):
        read(BakeSettings(target="vertex"), object_names=["Second"])


def test_linked_duplicates_keep_uvs_only_with_a_place_each(add_duplicate):
    mesh = add_duplicate.data
    mesh.uv_layers.new(name="Lightmap", do_init=True)
    with pytest.raises(SceneError, match="'Second' shares its mesh 'First' with other objects, and so its 'Lightmap'"):
        read(BakeSettings(keep_uvs=True), object_names=["Second"])
    add_duplicate["patchlight_rect"] = (0.5, 0.25, 0.5, 0.125)
    scene = read(BakeSettings(keep_uvs=True), object_names=["Second"])
    own = named(scene, "Second").lightmap_uvs
    assert own.min(axis=(0, 1)) == pytest.approx((0.5, 0.125), abs=FLOAT32)
    assert own.max(axis=(0, 1)) == pytest.approx((1.0, 0.375), abs=FLOAT32)
    add_duplicate["patchlight_rect"] = "left"
    with pytest.raises(SceneError, match="'Second': its custom property patchlight_rect is not four numbers"):
        read(BakeSettings(keep_uvs=True), object_names=["Second"])


def test_a_duplicate_is_not_unwrapped_under_the_lightmap_of_another(add_duplicate):
    image = bpy.data.images.new("Baked", 4, 4)
    bpy.data.objects["First"]["patchlight_lightmap"] = image
    with pytest.raises(
        SceneError, match="'Second' shares its mesh 'First' with 'First', whose lightmap would no longer"
    ):
        read(object_names=["Second"])
    assert sum(o.is_target for o in read(object_names=["First", "Second"]).objects) == 2
    assert sum(o.is_target for o in read().objects) == 3


def test_a_modifier_that_makes_faces_is_named(add_cube):
    add_cube("Room")
    add_cube("Chair").modifiers.new("Mirror", "MIRROR")
    scene = read()
    assert named(scene, "Chair").is_target is False
    assert any(w.startswith("Mirror modifier on 'Chair' makes new faces") for w in scene.warnings)
    with pytest.raises(SceneError, match="Mirror modifier on 'Chair'"):
        read(object_names=["Room", "Chair"])


def test_a_modifier_that_only_moves_vertices_is_baked_where_they_are(add_cube):
    modifier = add_cube().modifiers.new("Displace", "DISPLACE")
    modifier.strength, modifier.mid_level, modifier.direction = 3.0, 0.0, "Z"
    scene = read()
    assert scene.objects[0].is_target
    np.testing.assert_allclose(scene.vertices[:, 2].max(), 4.0, atol=FLOAT32)


def test_everything_with_a_surface_arrives_as_triangles(add_cube):
    bpy.ops.surface.primitive_nurbs_surface_sphere_add(location=(0, 0, 0))
    bpy.ops.object.metaball_add(location=(5, 0, 0))
    bpy.ops.object.text_add(location=(10, 0, 0))
    bpy.context.object.data.extrude = 0.1
    bpy.ops.curve.primitive_bezier_circle_add(location=(15, 0, 0))
    bpy.context.object.data.bevel_depth = 0.1
    cut = add_cube("Boolean")
    cut.location = (20, 0, 0)
    cutter = add_cube("Cutter")
    cutter.location, cutter.hide_render = (21, 1, 1), True
    boolean = cut.modifiers.new("Boolean", "BOOLEAN")
    boolean.object, boolean.operation, boolean.solver = cutter, "DIFFERENCE", "EXACT"
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, location=(25, 0, 0))
    field = bpy.context.object
    field.name = "Field"
    displace = field.modifiers.new("Displace", "DISPLACE")
    displace.texture = bpy.data.textures.new("Clouds", "CLOUDS")
    volume = add_cube("Volume")
    volume.location = (30, 0, 0)
    volume.modifiers.new("Volume", "NODES").node_group = volume_to_mesh_group()
    scene = read()
    counts = {o.name: o.count for o in scene.objects}
    names = {"SurfSphere#0", "Mball#0", "Text#0", "BézierCircle#0", "Boolean", "Field", "Volume"}
    assert set(counts) == names
    # a cube minus a corner: 9 faces, 6 of them quads or L shapes of 2 or 4 triangles
    assert counts["Boolean"] > 12
    assert counts["Volume"] > 100  # a voxel surface, no longer the cube's 12 triangles
    assert min(counts.values()) > 12
    for scene_object in scene.objects:
        assert np.isfinite(scene.corners[scene_object.span]).all()
    assert [o.name for o in scene.objects if o.is_target] == ["Field"]


def volume_to_mesh_group():
    """Geometry nodes: a cube of fog and its surface."""
    group = bpy.data.node_groups.new("Volume to mesh", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    cube = group.nodes.new("GeometryNodeVolumeCube")
    mesh = group.nodes.new("GeometryNodeVolumeToMesh")
    output = group.nodes.new("NodeGroupOutput")
    group.links.new(cube.outputs[0], mesh.inputs[0])
    group.links.new(mesh.outputs[0], output.inputs[0])
    return group


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_mesh_that_is_not_finite_is_left_out_and_named(add_cube, bad):
    add_cube("Room")
    add_cube("Broken").data.vertices[3].co.x = bad
    scene = read()
    assert [o.name for o in scene.objects] == ["Room"]
    assert any("'Broken' has vertices that are not finite" in warning for warning in scene.warnings)
    with pytest.raises(SceneError, match="'Broken' has vertices that are not finite"):
        read(object_names=["Broken"])


def test_triangles_without_area_are_kept_for_the_bake_to_name(add_mesh):
    add_mesh("Needle", [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)], [(0, 1, 2), (0, 1, 3)])
    scene = read()
    assert len(scene.triangles) == 2
    assert np.isfinite(scene.corner_normals).all()
    assert sound_faces(scene).scene.warnings[-1].startswith("object Needle: 1 of 2 triangles have no area")


def test_nothing_to_bake_is_an_error(add_lamp, add_cube):
    with pytest.raises(SceneError, match="nothing to bake"):
        read()
    add_lamp("POINT")
    add_cube("Chair").modifiers.new("Mirror", "MIRROR")
    with pytest.raises(SceneError, match="nothing to bake: Mirror modifier on 'Chair'"):
        read()


def test_only_the_named_objects_are_targets(add_cube):
    for name in "ABC":
        add_cube(name)
    scene = read(object_names=["B"])
    assert {o.name: o.is_target for o in scene.objects} == {"A": False, "B": True, "C": False}
    with pytest.raises(SceneError, match="no object 'D'"):
        read(object_names=["B", "D"])


def test_materials_go_by_slot_and_an_index_beyond_is_the_last(add_cube):
    cube = add_cube()
    for name, colour in (("Red", (1, 0, 0, 1)), ("Green", (0, 1, 0, 1))):
        material = bpy.data.materials.new(name)
        material.diffuse_color = colour
        cube.data.materials.append(material)
    for index, slot in enumerate([0, 1, 0, 1, 1, 1]):
        cube.data.polygons[index].material_index = slot
    cube.data.attributes["material_index"].data[5].value = 7
    scene = read()
    names = [scene.materials[row].name for row in scene.triangle_materials]
    assert names == ["Red"] * 2 + ["Green"] * 2 + ["Red"] * 2 + ["Green"] * 6


def test_no_material_reflects_as_blenders_default(add_cube):
    add_cube()
    scene = read()
    assert scene.materials[scene.triangle_materials[0]].reflectance == (0.8, 0.8, 0.8)
