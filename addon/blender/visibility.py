"""What a render would show: render visibility of objects, collections and instancers, and to which rays."""

from __future__ import annotations

import bpy

RENDERED_TYPES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "VOLUME", "CURVES", "LIGHT"}


class Visibility:
    """Render visibility in one view layer, of which the depsgraph has more."""

    def __init__(self, view_layer):
        self._view_layer = view_layer
        self._rendered = set()
        self._collect(view_layer.layer_collection)
        self._left_out = _names_in_hidden_collections()

    def shows(self, instance) -> bool:
        """Whether a render shows this entry of ``depsgraph.object_instances``."""
        blender_object = instance.object.original
        if blender_object.hide_render:
            return False
        if instance.is_instance:
            parent = instance.parent.original
            is_made = not parent.hide_render and parent.name in self._rendered
            return is_made and blender_object.name not in self._left_out
        if blender_object.is_instancer and not blender_object.show_instancer_for_render:
            return False
        return blender_object.name in self._rendered

    def hidden_names(self) -> set[str]:
        """Objects of the view layer that no render shows."""
        return {o.name for o in self._view_layer.objects if o.hide_render or o.name not in self._rendered}

    def missing_names(self) -> list[str]:
        """Objects that a render shows but the depsgraph does not have, as something else has hidden them."""
        return [
            o.name
            for o in self._view_layer.objects
            if o.type in RENDERED_TYPES
            and o.name in self._rendered
            and not o.hide_render
            and not o.visible_get(view_layer=self._view_layer)
        ]

    def _collect(self, layer_collection):
        if layer_collection.exclude or layer_collection.collection.hide_render:
            return
        self._rendered.update(o.name for o in layer_collection.collection.objects)
        for child in layer_collection.children:
            self._collect(child)


def _names_in_hidden_collections():
    """Objects all of whose collections no render shows; asked of each instance that would take as long as a file has
    objects."""
    shown = {o.name for scene in bpy.data.scenes for o in scene.collection.objects}
    hidden = set()
    for collection in bpy.data.collections:
        (hidden if collection.hide_render else shown).update(o.name for o in collection.objects)
    return hidden - shown


def seen_by(instance) -> tuple[bool, bool]:
    """Whether shadow rays and light that bounces meet an entry of ``depsgraph.object_instances``, as Cycles has it."""
    shown = [instance.object, *([instance.parent] if instance.is_instance else [])]
    return all(each.visible_shadow for each in shown), all(each.visible_diffuse for each in shown)
