"""What a render would show: render visibility of objects, collections and instancers, and to which rays."""

from __future__ import annotations

from functools import cache

import bpy

RENDERED_TYPES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "VOLUME", "CURVES", "LIGHT"}


class Visibility:
    """Render visibility in one view layer, of which the depsgraph has more.

    Objects are known by their pointers: a linked one may have the name of a local one.
    """

    def __init__(self, view_layer):
        self._view_layer = view_layer
        self._rendered = set()
        self._collect(view_layer.layer_collection)
        self._left_out = _in_hidden_collections()
        self._members = cache(_members)

    def shows(self, instance) -> bool:
        """Whether a render shows this entry of ``depsgraph.object_instances``."""
        blender_object = instance.object.original
        if instance.is_instance:
            return self._is_shown(instance.parent.original) and self._is_made(blender_object, instance.parent.original)
        if blender_object.is_instancer and not blender_object.show_instancer_for_render:
            return False
        return self._is_shown(blender_object)

    def hidden_names(self) -> set[str]:
        """Objects of the file in the view layer that no render shows."""
        return {o.name for o in self._view_layer.objects if o.library is None and not self._is_shown(o)}

    def missing_names(self) -> list[str]:
        """Objects that a render shows but the depsgraph does not have, as something else has hidden them."""
        return [
            o.name
            for o in self._view_layer.objects
            if o.type in RENDERED_TYPES and self._is_shown(o) and not o.visible_get(view_layer=self._view_layer)
        ]

    def _is_shown(self, blender_object):
        return not blender_object.hide_render and blender_object.as_pointer() in self._rendered

    def _is_made(self, blender_object, parent):
        """Whether a render makes the instance: what is hidden is missing in collections, but no other source is."""
        pointer = blender_object.as_pointer()
        is_hidden = blender_object.hide_render or pointer in self._left_out
        return not is_hidden or pointer not in self._members(parent)

    def _collect(self, layer_collection):
        if layer_collection.exclude or layer_collection.collection.hide_render:
            return
        self._rendered.update(o.as_pointer() for o in layer_collection.collection.objects)
        for child in layer_collection.children:
            self._collect(child)


def _in_hidden_collections():
    """Objects all of whose collections no render shows; asked of each instance that would take as long as a file has
    objects."""
    shown = {o.as_pointer() for scene in bpy.data.scenes for o in scene.collection.objects}
    hidden = set()
    for collection in bpy.data.collections:
        (hidden if collection.hide_render else shown).update(o.as_pointer() for o in collection.objects)
    return hidden - shown


def _members(instancer):
    """All objects of the collections that an object makes instances of."""
    return {o.as_pointer() for collection in _collections_of(instancer) for o in collection.all_objects}


def _collections_of(instancer):
    if instancer.instance_type == "COLLECTION" and instancer.instance_collection:
        yield instancer.instance_collection
    for system in instancer.particle_systems:
        if system.settings.instance_collection:
            yield system.settings.instance_collection
    for modifier in instancer.modifiers:
        if modifier.type == "NODES" and modifier.node_group:
            yield from (value for value in modifier.values() if isinstance(value, bpy.types.Collection))
            yield from _collections_in(modifier.node_group, set())


def _collections_in(tree, seen):
    """Those that sockets of a node tree, and of the groups in it, name."""
    if tree in seen:
        return
    seen.add(tree)
    for node in tree.nodes:
        yield from (s.default_value for s in node.inputs if s.type == "COLLECTION" and s.default_value)
        if getattr(node, "node_tree", None):
            yield from _collections_in(node.node_tree, seen)


def seen_by(instance) -> tuple[bool, bool]:
    """Whether shadow rays and light that bounces meet an entry of ``depsgraph.object_instances``, as Cycles has it."""
    shown = [instance.object, *([instance.parent] if instance.is_instance else [])]
    return all(each.visible_shadow for each in shown), all(each.visible_diffuse for each in shown)
