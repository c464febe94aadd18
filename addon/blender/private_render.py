"""Renders by Cycles in scenes of their own: what they show is all that they leave behind."""

from __future__ import annotations

import tempfile
from contextlib import contextmanager
from math import radians
from pathlib import Path

import bpy
import numpy as np

from .image_pixels import read_pixels

RESULT = "Render Result"  # Blender's image of every scene's last render, which the first makes
ON_DIFFUSE_SURFACES = {"Is Diffuse Ray": 1.0, "Is Reflection Ray": 1.0, "Ray Depth": 1.0, "Diffuse Depth": 1.0}


LOOKS_TO_X = (radians(90), 0, radians(-90))  # +X in the middle and +Z up


class RenderError(RuntimeError):
    """What could not be rendered; the message says why."""


@contextmanager
def private_scene(frame):
    """An empty scene that Cycles renders on the CPU, with a camera; both are gone afterwards."""
    if bpy.app.is_job_running("RENDER"):
        raise RenderError("a render is running")
    had_result = RESULT in bpy.data.images
    camera, scene = bpy.data.cameras.new("private"), bpy.data.scenes.new("private")
    looking = bpy.data.objects.new("private", camera)
    try:
        _set_up(scene)
        scene.collection.objects.link(looking)
        scene.camera = looking
        scene.frame_set(frame)
        yield scene
    except (RuntimeError, TypeError) as error:  # TypeError: there is no engine of that name
        raise RenderError(str(error).strip()) from error
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(looking)
        bpy.data.cameras.remove(camera)
        if not had_result and RESULT in bpy.data.images:
            bpy.data.images.remove(bpy.data.images[RESULT])


def _set_up(scene):
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.use_denoising = "CPU", False
    scene.cycles.pixel_filter_type = "BOX"  # others mix what lies side by side
    scene.render.use_compositing = scene.render.use_sequencer = False
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"


def look_all_round(scene) -> None:
    """Let the scene's camera see all directions from the origin, as the pixels of a core Environment are laid out."""
    camera = scene.camera.data
    camera.type = "PANO"
    # the place that it has had since Blender 5.0, else Cycles' own
    (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"
    scene.camera.rotation_euler = LOOKS_TO_X


def rendered(scene, width, height) -> np.ndarray:
    """What the scene's camera sees, linear, float32 (height, width, 3), row 0 at the bottom."""
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    # of the user's context nothing may count: its scene would be evaluated anew, its 3D View has a camera of its own
    own = bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0], area=None, region=None)
    with tempfile.TemporaryDirectory() as folder, own:
        render.filepath, render.use_file_extension = str(Path(folder) / "private.exr"), False
        bpy.ops.render.render(write_still=True, scene=scene.name)
        image = bpy.data.images.load(render.filepath)
        try:
            return read_pixels(image)[..., :3]
        finally:
            bpy.data.images.remove(image)


@contextmanager
def passing_blocks():
    """A list for data-blocks that are gone afterwards, all at once: one by one each takes longer the more there are."""
    blocks = []
    try:
        yield blocks
    finally:
        bpy.data.batch_remove(blocks)


def adapted_copy(block, io_blocks, kept=frozenset()):
    """A copy of a material, a world or a lamp, and of its node groups, as rays from diffuse surfaces meet it.

    Returns the copy and its trees. ``kept`` are outputs of Light Path nodes that stay as they are.
    """
    copy = block.copy()
    io_blocks.append(copy)
    trees = [copy.node_tree]
    _adapt(copy.node_tree, trees, kept)
    io_blocks += trees[1:]
    return copy, trees


def _adapt(tree, io_trees, kept):
    for node in list(tree.nodes):
        if node.type == "GROUP" and node.node_tree is not None:
            node.node_tree = node.node_tree.copy()
            io_trees.append(node.node_tree)
            _adapt(node.node_tree, io_trees, kept)
        elif node.type == "LIGHT_PATH" and not node.mute:
            _fix_outputs(tree, node, kept)


def _fix_outputs(tree, light_path, kept):
    for output in [output for output in light_path.outputs if output.name not in kept]:
        value = tree.nodes.new("ShaderNodeValue")
        value.outputs[0].default_value = ON_DIFFUSE_SURFACES.get(output.name, 0.0)
        for link in list(output.links):
            if not link.is_muted:
                tree.links.new(value.outputs[0], link.to_socket)


def why_not_shown(node) -> str:
    """Why Cycles would not show what a node is meant to be, "" where it would: without its image it shows pink."""
    if node.type in {"TEX_ENVIRONMENT", "TEX_IMAGE"} and any(output.is_linked for output in node.outputs):
        if node.image is None:
            return f"the {node.bl_label} node has no image"
        if not all(node.image.size):
            return f"image '{node.image.name}' cannot be loaded"
    return ""
