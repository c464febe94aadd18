"""Which rays meet an object: Cycles' switches, of itself and of what makes instances of it."""

from __future__ import annotations

import bpy
import pytest

from addon.blender.read_scene import read_scene

pytestmark = pytest.mark.usefixtures("empty_file")


def test_what_some_rays_miss_has_materials_of_its_own(add_cube, nodes):
    """One material on four objects: all of it, hiding no lamp, seen by no light that bounces, and neither."""
    material, tree = nodes()
    tree.show(tree.link(tree.new("TexNoise"), tree.new("BsdfDiffuse"), "Color", "Color"))
    seen = {"Cube": (True, True), "Bare": (False, True), "Unseen": (True, False), "Neither": (False, False)}
    for name, (shadow, diffuse) in seen.items():
        cube = add_cube(name, material)
        cube.visible_shadow, cube.visible_diffuse = shadow, diffuse
    scene = read_scene(bpy.context.scene)
    found = {o.name: scene.materials[scene.triangle_materials[o.first]] for o in scene.objects}
    assert {name: (m.meets_shadow_rays, m.meets_light) for name, m in found.items()} == seen
    assert found["Bare"].reflectance == found["Cube"].reflectance != (0.8, 0.8, 0.8)  # as Cycles tells, at the end
    assert found["Unseen"].reflectance == (0, 0, 0)
    assert len(scene.materials) == 5


def test_instances_are_seen_as_far_as_what_makes_them(add_cube):
    add_cube("Room")
    source = bpy.data.collections.new("Furniture")
    chair = add_cube("Chair")
    source.objects.link(chair)
    bpy.context.scene.collection.objects.unlink(chair)
    place = bpy.data.objects.new("Place", None)
    place.instance_type, place.instance_collection, place.visible_shadow = "COLLECTION", source, False
    bpy.context.scene.collection.objects.link(place)
    scene = read_scene(bpy.context.scene)
    (chair,) = (o for o in scene.objects if o.name.startswith("Chair"))
    assert not scene.materials[scene.triangle_materials[chair.first]].meets_shadow_rays


def test_what_is_hidden_is_instanced_but_by_collections(add_cube):
    """As Cycles has it: sources of scatters are hidden as a rule; what is hidden in a collection has no instances."""
    add_cube("Room")
    for name in ("Leaf", "Pebble", "Ghost"):
        add_cube(name).hide_render = True
    scatter, faces, place = add_cube("Scatter"), add_cube("Faces"), bpy.data.objects.new("Place", None)
    scatter.modifiers.new("Nodes", "NODES").node_group = nodes_that_instance(bpy.data.objects["Leaf"])
    faces.instance_type, bpy.data.objects["Pebble"].parent = "FACES", faces
    furniture = bpy.data.collections.new("Furniture")
    for name in ("Ghost", "Room"):
        furniture.objects.link(bpy.data.objects[name])
    place.instance_type, place.instance_collection = "COLLECTION", furniture
    bpy.context.scene.collection.objects.link(place)
    names = [o.name.split("#")[0] for o in read_scene(bpy.context.scene).objects]
    # the scatter's mesh goes where its nodes make another geometry; six faces make a pebble each
    assert {name: names.count(name) for name in set(names)} == {"Room": 2, "Leaf": 1, "Faces": 1, "Pebble": 6}


def test_what_is_hidden_in_what_is_instanced(add_cube):
    """An asset, as they are laid out: a scatter and its hidden source in one collection, and one within another."""
    asset, outer = bpy.data.collections.new("Asset"), bpy.data.collections.new("Outer")
    scatter, hidden = add_cube("Scatter"), [add_cube(name) for name in ("Leaf", "Ghost")]
    scatter.modifiers.new("Nodes", "NODES").node_group = nodes_that_instance(hidden[0])
    for cube in (scatter, *hidden):
        asset.objects.link(cube)
        bpy.context.scene.collection.objects.unlink(cube)
    for cube in hidden:
        cube.hide_render = True
    places = [bpy.data.objects.new(name, None) for name in ("Inner place", "Outer place")]
    for place, collection, home in zip(places, (asset, outer), (outer, bpy.context.scene.collection)):
        place.instance_type, place.instance_collection = "COLLECTION", collection
        home.objects.link(place)
    add_cube("Room")
    names = sorted(o.name.split("#")[0] for o in read_scene(bpy.context.scene).objects)
    assert names == ["Leaf", "Room"]


def test_reading_leaves_what_was_selected_and_hidden(add_cube):
    cubes = [add_cube(name) for name in ("Room", "Hidden", "Away")]
    cubes[1].hide_render = cubes[2].hide_viewport = True
    cubes[1].select_set(True)
    bpy.context.view_layer.objects.active = cubes[1]
    read_scene(bpy.context.scene)
    assert [cube.select_get() for cube in cubes[:2]] == [False, True]
    assert bpy.context.view_layer.objects.active == cubes[1]
    assert [cube.hide_viewport for cube in cubes] == [False, False, True]


def nodes_that_instance(blender_object):
    """Geometry nodes that give nothing but one instance of an object."""
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    source, output = tree.nodes.new("GeometryNodeObjectInfo"), tree.nodes.new("NodeGroupOutput")
    source.inputs["Object"].default_value, source.inputs["As Instance"].default_value = blender_object, True
    tree.links.new(source.outputs["Geometry"], output.inputs[0])
    return tree


def test_a_hidden_object_is_not_a_linked_one_of_its_name(add_cube, tmp_path):
    linked = add_cube("Slab")
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {linked})
    bpy.data.objects.remove(linked)
    add_cube("Room")
    add_cube("Slab").hide_render = True
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, into):
        into.objects = ["Slab"]
    bpy.context.scene.collection.objects.link(into.objects[0])
    into.objects[0].hide_render = False
    hidden = bpy.data.collections.new("Hidden")
    hidden.hide_render = True
    bpy.context.scene.collection.children.link(hidden)
    local = bpy.data.objects[("Slab", None)]
    local.hide_render = False
    hidden.objects.link(local)
    bpy.context.scene.collection.objects.unlink(local)
    assert sorted(o.name for o in read_scene(bpy.context.scene).objects) == ["Room", "Slab"]
