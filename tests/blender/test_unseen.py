"""What a render shows and a bake does not is in the report."""

from __future__ import annotations

import bpy
import pytest

from addon.blender.read_scene import read_scene

pytestmark = pytest.mark.usefixtures("empty_file")


def test_what_light_meets_in_a_render_only_is_told(add_cube):
    add_cube("Room")
    carpet = add_cube("Carpet")
    carpet.modifiers.new("Pile", "PARTICLE_SYSTEM")
    carpet.particle_systems[0].settings.type = "HAIR"
    for name, data in (("Smoke", bpy.data.volumes.new("Smoke")), ("Fur", bpy.data.hair_curves.new("Fur"))):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, data))
    assert set(read_scene(bpy.context.scene).warnings) == {
        "'Carpet' has hair, 'Pile': the bake does not see it",
        "'Smoke' is a volume: the bake does not see it",
        "'Fur' is hair: the bake does not see it",
    }


def test_what_stays_hidden_or_asks_for_the_viewport_is_told(add_cube):
    add_cube("Room")
    driven = add_cube("Driven")
    driven.driver_add("hide_viewport").driver.expression = "1"
    asking = add_cube("Asking")
    tree = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    asks, switch, out = (
        tree.nodes.new(kind) for kind in ("GeometryNodeIsViewport", "GeometryNodeSwitch", "NodeGroupOutput")
    )
    tree.links.new(asks.outputs[0], switch.inputs[0])
    tree.links.new(switch.outputs[0], out.inputs[0])
    asking.modifiers.new("Nodes", "NODES").node_group = tree
    bpy.context.view_layer.update()
    warnings = read_scene(bpy.context.scene).warnings
    assert "'Driven' stays hidden in the viewport, by what drives it: the bake does not see it" in warnings
    assert "'Asking': Nodes asks whether it is for the viewport, and is read as if it were" in warnings
