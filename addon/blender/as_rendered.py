"""A depsgraph as a render has it: Blender's Python is given the viewport's only, so the viewport is set to show what a
render would, and set back."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager, suppress

import bpy

# what of each kind of modifier the viewport has another number of than a render: (viewport's, render's)
LEVELS = {
    "SUBSURF": ("levels", "render_levels"),
    "MULTIRES": ("levels", "render_levels"),
    "SCREW": ("steps", "render_steps"),
    "OCEAN": ("viewport_resolution", "resolution"),
}
SIMPLIFIED = {
    "simplify_subdivision": "simplify_subdivision_render",
    "simplify_child_particles": "simplify_child_particles_render",
}


@contextmanager
def as_rendered(bpy_scene, view_layer):
    """While it lasts, the view layer's depsgraph has what a render shows: hidden objects, render levels of modifiers.

    What no render shows is not there, nor are its instances by collections, but those that name it alone, as Cycles
    has it. Afterwards all is as it was.
    """
    selected = [o for o in view_layer.objects if o.select_get(view_layer=view_layer)]
    active = view_layer.objects.active
    hidden = [o for o in view_layer.objects if not o.hide_render and o.hide_get(view_layer=view_layer)]
    with ExitStack() as back:
        back.callback(view_layer.update)
        back.callback(_select, selected, active, view_layer)
        for owner, name, value in _differences(bpy_scene, view_layer):
            back.callback(_set, owner, name, getattr(owner, name))
            setattr(owner, name, value)
        for blender_object in hidden:
            back.callback(_hide, blender_object, view_layer)
            blender_object.hide_set(False, view_layer=view_layer)
        view_layer.update()
        yield


def _set(owner, name, value):
    with suppress(ReferenceError):  # where it is gone
        setattr(owner, name, value)


def _select(objects, active, view_layer):
    """As before: what was hidden for a while is selected no longer."""
    for blender_object in objects:
        with suppress(ReferenceError, RuntimeError):
            blender_object.select_set(True, view_layer=view_layer)
    with suppress(ReferenceError, RuntimeError):
        if view_layer.objects.active != active:
            view_layer.objects.active = active


def _hide(blender_object, view_layer):
    with suppress(ReferenceError, RuntimeError):  # where it is gone, or no longer in the layer
        blender_object.hide_set(True, view_layer=view_layer)


def _differences(bpy_scene, view_layer):
    """(owner, attribute, value) of all that the viewport has otherwise than a render."""
    wanted = [*_simplified(bpy_scene.render), *_of_collections(view_layer)]
    for blender_object in bpy.data.objects:
        # what is instanced on vertices or faces would have no instances where it is hidden; in a render it has
        on_faces = blender_object.parent and blender_object.parent.instance_type in {"VERTS", "FACES"}
        if not (blender_object.hide_render and on_faces):
            wanted.append((blender_object, "hide_viewport", blender_object.hide_render))
        shows_itself = blender_object.show_instancer_for_render
        wanted.append((blender_object, "show_instancer_for_viewport", shows_itself))
        for modifier in blender_object.modifiers:
            wanted += _of_modifier(modifier)
    for curve in bpy.data.curves:
        wanted += [
            (curve, f"resolution_{axis}", getattr(curve, f"render_resolution_{axis}"))
            for axis in "uv"
            if getattr(curve, f"render_resolution_{axis}") > 0  # 0: as the viewport
        ]
    wanted += [(ball, "resolution", ball.render_resolution) for ball in bpy.data.metaballs]
    for particles in bpy.data.particles:
        if particles.type == "HAIR":  # others would be simulated anew, in one leap
            wanted.append((particles, "display_percentage", 100))
        wanted.append((particles, "display_method", "RENDER"))
        wanted.append((particles, "child_percent", particles.rendered_child_count))
    return [(owner, name, value) for owner, name, value in wanted if getattr(owner, name) != value]


def _simplified(render):
    if not render.use_simplify:
        return []
    return [(render, viewport, getattr(render, rendered)) for viewport, rendered in SIMPLIFIED.items()]


def _of_collections(view_layer):
    """The viewport's switches of a collection and of its place in the layer; a render knows only one."""
    own = [(collection, "hide_viewport", collection.hide_render) for collection in bpy.data.collections]
    layers = _below(view_layer.layer_collection)
    return own + [(layer, "hide_viewport", False) for layer in layers]


def _below(layer_collection):
    for child in layer_collection.children:
        if not child.exclude:
            yield child
            yield from _below(child)


def _of_modifier(modifier):
    yield modifier, "show_viewport", modifier.show_render
    if modifier.type in LEVELS:
        viewport, rendered = LEVELS[modifier.type]
        yield modifier, viewport, getattr(modifier, rendered)
