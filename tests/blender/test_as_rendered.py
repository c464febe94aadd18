"""What is read is what a render shows, whatever the viewport shows; and that stays as it was."""

from __future__ import annotations

import bpy
import pytest

from addon.blender.as_rendered import as_rendered
from addon.blender.read_scene import read_scene
from addon.core.settings import BakeSettings

pytestmark = pytest.mark.usefixtures("empty_file")


@pytest.fixture
def read(add_cube):
    """Faces by object; a cube, which can be baked, is always there."""
    add_cube("Room")

    def triangle_counts():
        scene = read_scene(bpy.context.scene, BakeSettings())
        return {o.name: o.count for o in scene.objects if o.name != "Room"}

    return triangle_counts


@pytest.fixture
def collection():
    made = bpy.data.collections.new("Furniture")
    bpy.context.scene.collection.children.link(made)
    return made


def linked(name, data):
    blender_object = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(blender_object)
    return blender_object


def test_objects_that_only_the_viewport_hides_are_read(read, add_cube, collection):
    switched, closed, inside, below = (add_cube(name) for name in ("Switched", "Closed", "Inside", "Below"))
    switched.hide_viewport = True
    closed.hide_set(True)
    for cube in (inside, below):
        bpy.context.scene.collection.objects.unlink(cube)
    collection.objects.link(inside)
    collection.hide_viewport = True
    child = bpy.data.collections.new("Chairs")
    collection.children.link(child)
    child.objects.link(below)
    layer = bpy.context.view_layer.layer_collection.children["Furniture"]
    layer.children["Chairs"].hide_viewport = True
    assert read() == dict.fromkeys(["Switched", "Closed", "Inside", "Below"], 12)
    assert switched.hide_viewport
    assert closed.hide_get()
    assert collection.hide_viewport
    assert not layer.hide_viewport
    assert layer.children["Chairs"].hide_viewport
    assert not child.hide_viewport


def test_collections_that_are_not_rendered_are_missing_from_instances_too(read, add_cube, collection):
    for name, is_hidden in (("Shown", False), ("Hidden", True)):
        part = bpy.data.collections.new(name)
        collection.children.link(part)
        part.hide_render = is_hidden
        cube = add_cube(f"{name} cube")
        bpy.context.scene.collection.objects.unlink(cube)
        part.objects.link(cube)
    empty = linked("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    assert sorted(read()) == ["Shown cube", "Shown cube#1"]


def test_modifiers_have_their_render_levels(read, add_cube):
    cube = add_cube()
    surface = cube.modifiers.new("Subdivision", "SUBSURF")
    surface.levels, surface.render_levels = 0, 2
    array = cube.modifiers.new("Array", "ARRAY")
    array.count, array.show_viewport = 3, False
    cube.modifiers.new("Bevel", "BEVEL").show_render = False
    assert read() == {"Cube": 3 * 12 * 16}
    assert (surface.levels, array.show_viewport, cube.modifiers["Bevel"].show_viewport) == (0, False, True)


def test_a_scene_that_is_simplified_is_so_as_a_render_is(read, add_cube):
    render = bpy.context.scene.render
    render.use_simplify, render.simplify_subdivision, render.simplify_subdivision_render = True, 0, 1
    add_cube().modifiers.new("Subdivision", "SUBSURF").render_levels = 3
    assert read() == {"Cube": 12 * 4}
    assert render.simplify_subdivision == 0


def test_curves_and_metaballs_have_their_render_resolution(read):
    curve = bpy.data.curves.new("Pipe", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.resolution_u, curve.render_resolution_u = "3D", 0.1, 1, 6
    spline = curve.splines.new("BEZIER")
    spline.bezier_points.add(1)
    spline.bezier_points[1].co.x = 2
    linked("Pipe", curve)
    few = read()["Pipe#0"]
    curve.render_resolution_u = 12
    assert read()["Pipe#0"] == 2 * few
    ball = bpy.data.metaballs.new("Ball")
    ball.elements.new().radius = 0.6
    ball.resolution, ball.render_resolution = 5.0, 0.1
    linked("Ball", ball)
    assert read()["Ball#0"] > 100
    assert (curve.resolution_u, ball.resolution) == (1, 5.0)


def test_all_is_set_back_where_reading_fails(add_cube):
    cube = add_cube()
    cube.hide_viewport = True

    def fail():
        with as_rendered(bpy.context.scene, bpy.context.view_layer):
            assert not cube.hide_viewport
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert cube.hide_viewport


def test_all_that_is_still_there_is_set_back(add_cube):
    """Handlers of others run while a scene is read, and may remove what was to be set back."""
    gone, kept, closed = (add_cube(name) for name in ("Gone", "Kept", "Closed"))
    gone.hide_viewport = kept.hide_viewport = True
    closed.hide_set(True)
    with as_rendered(bpy.context.scene, bpy.context.view_layer):
        bpy.data.objects.remove(gone)
    assert kept.hide_viewport
    assert closed.hide_get()


def test_what_was_selected_still_is(add_cube, collection):
    cube = add_cube()
    collection.objects.link(cube)
    collection.hide_render = True
    cube.select_set(True)
    with as_rendered(bpy.context.scene, bpy.context.view_layer):
        pass
    assert cube.select_get()
