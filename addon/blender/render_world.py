"""A world that only Cycles can tell: an image of all directions, rendered in an empty scene of its own."""

from __future__ import annotations

import tempfile
from math import radians
from pathlib import Path

import bpy
import numpy as np

WIDTH, HEIGHT = 1024, 512
LEAST_SAMPLES, SAMPLES, NOISE = 8, 256, 0.02  # of a pixel: all where the sun's edge crosses it, which is .3 % of its
# light; others stop where they are as sure as this
RESULT = "Render Result"  # Blender's image of every scene's last render, which the first makes
LOOKS_TO_X = (radians(90), 0, radians(-90))  # +X in the middle and +Z up, as core Environment has it


class WorldError(RuntimeError):
    """A world that could not be rendered; the message is Blender's."""


def rendered_world(world, frame: int) -> np.ndarray:
    """Radiance by direction as a diffuse surface sees it, float32 (HEIGHT, WIDTH, 3): pixels of an Environment."""
    had_result = RESULT in bpy.data.images
    copy, camera = world.copy(), bpy.data.cameras.new("panorama")
    scene, looking = bpy.data.scenes.new("panorama"), bpy.data.objects.new("panorama", camera)
    try:
        _as_diffuse_rays_see(copy.node_tree)
        _set_up(scene, copy, looking, frame)
        return _rendered(scene)
    except (RuntimeError, TypeError) as error:  # TypeError: there is no engine of that name
        raise WorldError(str(error).strip()) from error
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(looking)
        bpy.data.cameras.remove(camera)
        bpy.data.worlds.remove(copy)
        if not had_result and RESULT in bpy.data.images:
            bpy.data.images.remove(bpy.data.images[RESULT])


def _as_diffuse_rays_see(tree):
    """Give Light Path nodes the values that they have for light on a diffuse surface, not for a camera."""
    for node in [node for node in tree.nodes if node.type == "LIGHT_PATH"]:
        for output in node.outputs:
            value = tree.nodes.new("ShaderNodeValue")
            value.outputs[0].default_value = float(output.name in {"Is Diffuse Ray", "Is Reflection Ray", "Ray Depth"})
            for link in list(output.links):
                tree.links.new(value.outputs[0], link.to_socket)


def _set_up(scene, world, looking, frame):
    scene.render.engine = "CYCLES"
    camera = looking.data
    camera.type = "PANO"
    # the place that it has had since Blender 5.0, else Cycles' own
    (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"
    looking.rotation_euler = LOOKS_TO_X
    scene.collection.objects.link(looking)
    scene.camera, scene.world = looking, world
    world.cycles.sampling_method = "NONE"  # there is nothing to be lit
    scene.frame_set(frame)
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.use_denoising = "CPU", SAMPLES, False
    cycles.use_adaptive_sampling, cycles.adaptive_threshold, cycles.adaptive_min_samples = True, NOISE, LEAST_SAMPLES
    cycles.pixel_filter_type = "BOX"  # others make the sun wider
    scene.render.use_compositing = scene.render.use_sequencer = False
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"


def _rendered(scene):
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath, scene.render.use_file_extension = str(Path(folder) / "panorama.exr"), False
        bpy.ops.render.render(write_still=True, scene=scene.name)
        image = bpy.data.images.load(scene.render.filepath)
        try:
            pixels = np.empty(WIDTH * HEIGHT * image.channels, np.float32)
            image.pixels.foreach_get(pixels)
        finally:
            bpy.data.images.remove(image)
    return pixels.reshape(HEIGHT, WIDTH, -1)[..., :3]
