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
