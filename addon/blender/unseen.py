"""What a render shows and a bake does not: sentences for the report."""

from __future__ import annotations

KINDS = {"VOLUME": "a volume", "CURVES": "hair", "POINTCLOUD": "a point cloud"}


def say_what_is_unseen(evaluated, warn) -> None:
    """Of a mesh object that is read: what else of it light meets in a render, or what lights otherwise there."""
    name = evaluated.name
    warn_of_linking(evaluated, warn)
    for system in evaluated.particle_systems:
        settings = system.settings
        if settings.type == "HAIR" and settings.render_type == "PATH":
            warn(f"'{name}' has hair, '{system.name}': the bake does not see it")
        elif settings.type == "EMITTER" and settings.display_percentage < 100:
            percentage = settings.display_percentage
            warn(f"'{name}': {percentage} % of its particles '{system.name}' are read, which the viewport shows")
    for modifier in evaluated.modifiers:
        if modifier.type == "NODES" and _asks_for_viewport(modifier.node_group):
            warn(f"'{name}': {modifier.name} asks whether it is for the viewport, and is read as if it were")


def warn_of_linking(blender_object, warn) -> None:
    """Say that an object is to light, or to hide light from, a collection only."""
    linking = getattr(blender_object, "light_linking", None)  # none before Blender 4.0
    if linking and (linking.receiver_collection or linking.blocker_collection):
        warn(f"'{blender_object.name}': its light linking is not read: it lights all, and all hide it")


def _asks_for_viewport(tree, depth=0):
    if tree is None or depth > 8:
        return False
    return any(
        (node.bl_idname == "GeometryNodeIsViewport" and not node.mute and node.outputs[0].is_linked)
        or (node.bl_idname == "GeometryNodeGroup" and _asks_for_viewport(node.node_tree, depth + 1))
        for node in tree.nodes
    )
