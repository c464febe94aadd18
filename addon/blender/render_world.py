"""A world that only Cycles can tell: an image of all directions, rendered in an empty scene of its own."""

from __future__ import annotations

import tempfile
from contextlib import contextmanager
from math import radians
from pathlib import Path

import bpy
import numpy as np

WIDTH, HEIGHT = 1024, 512
LEAST_SAMPLES, SAMPLES, NOISE = 8, 256, 0.02  # of a pixel: all where the sun's edge crosses it, which is .3 % of its
# light; others stop where they are as sure as this,
LEAST_SUN = radians(0.5)  # and would miss a smaller one
RESULT = "Render Result"  # Blender's image of every scene's last render, which the first makes
LOOKS_TO_X = (radians(90), 0, radians(-90))  # +X in the middle and +Z up, as core Environment has it
ON_DIFFUSE_SURFACES = {"Is Diffuse Ray": 1.0, "Is Reflection Ray": 1.0, "Ray Depth": 1.0, "Diffuse Depth": 1.0}


class WorldError(RuntimeError):
    """A world that could not be rendered; the message says why."""


def rendered_world(world, frame: int) -> np.ndarray:
    """Radiance by direction as a diffuse surface sees it, float32 (HEIGHT, WIDTH, 3): pixels of an Environment."""
    if not hasattr(world, "cycles"):
        raise WorldError("Cycles is not enabled")
    if bpy.app.is_job_running("RENDER"):
        raise WorldError("a render is running")
    try:
        with _world_copy(world) as copy, _panorama(copy, frame) as scene:
            return _rendered(scene)
    except (RuntimeError, TypeError) as error:  # TypeError: there is no engine of that name
        raise WorldError(str(error).strip()) from error


@contextmanager
def _world_copy(world):
    """The world as a camera is to see it; the copy and those of its groups are gone afterwards."""
    copy, groups = world.copy(), []
    try:
        copy.cycles_visibility.camera = True
        copy.cycles.sampling_method = "NONE"  # there is nothing to be lit
        _adapt(copy.node_tree, groups)
        yield copy
    finally:
        bpy.data.worlds.remove(copy)
        for group in groups:
            bpy.data.node_groups.remove(group)


def _adapt(tree, groups):
    """Give a tree, and copies of its groups, what light on diffuse surfaces has: no camera, no volume, no tiny sun."""
    for node in list(tree.nodes):
        if node.type == "GROUP" and node.node_tree is not None:
            node.node_tree = node.node_tree.copy()
            groups.append(node.node_tree)
            _adapt(node.node_tree, groups)
        elif node.type == "LIGHT_PATH" and not node.mute:
            _fix_outputs(tree, node)
        elif node.type == "TEX_SKY":
            node.sun_size = max(node.sun_size, LEAST_SUN)  # its light is the same
        elif node.type in {"TEX_ENVIRONMENT", "TEX_IMAGE"}:
            _require_image(node)
        elif node.type == "OUTPUT_WORLD":
            for link in list(node.inputs["Volume"].links):
                tree.links.remove(link)


def _fix_outputs(tree, light_path):
    for output in light_path.outputs:
        value = tree.nodes.new("ShaderNodeValue")
        value.outputs[0].default_value = ON_DIFFUSE_SURFACES.get(output.name, 0.0)
        for link in list(output.links):
            if not link.is_muted:
                tree.links.new(value.outputs[0], link.to_socket)


def _require_image(node):
    """Cycles shows pink for an image that it has not."""
    if any(output.is_linked for output in node.outputs):
        if node.image is None:
            raise WorldError(f"the {node.bl_label} node has no image")
        if not all(node.image.size):
            raise WorldError(f"image '{node.image.name}' cannot be loaded")


@contextmanager
def _panorama(world, frame):
    """A scene of nothing but the world and a camera that looks all round; gone afterwards."""
    had_result = RESULT in bpy.data.images
    camera, scene = bpy.data.cameras.new("panorama"), bpy.data.scenes.new("panorama")
    looking = bpy.data.objects.new("panorama", camera)
    try:
        scene.render.engine = "CYCLES"
        camera.type = "PANO"
        # the place that it has had since Blender 5.0, else Cycles' own
        (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"
        looking.rotation_euler = LOOKS_TO_X
        scene.collection.objects.link(looking)
        scene.camera, scene.world = looking, world
        scene.frame_set(frame)
        _set_up(scene)
        yield scene
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(looking)
        bpy.data.cameras.remove(camera)
        if not had_result and RESULT in bpy.data.images:
            bpy.data.images.remove(bpy.data.images[RESULT])


def _set_up(scene):
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.use_denoising = "CPU", SAMPLES, False
    cycles.use_adaptive_sampling, cycles.adaptive_threshold, cycles.adaptive_min_samples = True, NOISE, LEAST_SAMPLES
    cycles.pixel_filter_type = "BOX"  # others make the sun wider
    scene.render.use_compositing = scene.render.use_sequencer = False
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"


def _rendered(scene):
    # of the user's context nothing may count: its scene would be evaluated anew, its 3D View has a camera of its own
    own = bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0], area=None, region=None)
    with tempfile.TemporaryDirectory() as folder, own:
        scene.render.filepath, scene.render.use_file_extension = str(Path(folder) / "panorama.exr"), False
        bpy.ops.render.render(write_still=True, scene=scene.name)
        image = bpy.data.images.load(scene.render.filepath)
        try:
            pixels = np.empty(WIDTH * HEIGHT * image.channels, np.float32)
            image.pixels.foreach_get(pixels)
        finally:
            bpy.data.images.remove(image)
    return pixels.reshape(HEIGHT, WIDTH, -1)[..., :3]
