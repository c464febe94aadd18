"""What of a depsgraph as rendered a render shows: objects, collections and instancers, and to which rays."""

from __future__ import annotations

RENDERED_TYPES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "VOLUME", "CURVES", "LIGHT"}


class Visibility:
    """Render visibility in one view layer, of which the depsgraph has more even while it is as rendered.

    Objects are known by their pointers: a linked one may have the name of a local one.
    """

    def __init__(self, view_layer):
        self._view_layer = view_layer
        self._present = {each.original.as_pointer() for each in view_layer.depsgraph.objects}
        self._rendered = set()
        self._collect(view_layer.layer_collection)

    def shows(self, instance) -> bool:
        """Whether a render shows this entry of ``depsgraph.object_instances``."""
        blender_object = instance.object.original
        if instance.is_instance:
            return self._is_shown(instance.parent.original)
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
            if o.type in RENDERED_TYPES and self._is_shown(o) and o.as_pointer() not in self._present
        ]

    def _is_shown(self, blender_object):
        return not blender_object.hide_render and blender_object.as_pointer() in self._rendered

    def _collect(self, layer_collection):
        if layer_collection.exclude or layer_collection.collection.hide_render:
            return
        self._rendered.update(o.as_pointer() for o in layer_collection.collection.objects)
        for child in layer_collection.children:
            self._collect(child)


def seen_by(instance) -> tuple[bool, bool]:
    """Whether shadow rays and light that bounces meet an entry of ``depsgraph.object_instances``, as Cycles has it."""
    shown = [instance.object, *([instance.parent] if instance.is_instance else [])]
    return all(each.visible_shadow for each in shown), all(each.visible_diffuse for each in shown)
