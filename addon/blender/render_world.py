"""A world that only Cycles can tell: an image of all directions, rendered in an empty scene of its own."""

from __future__ import annotations

from math import radians

import numpy as np

from .private_render import (
    RenderError,
    adapted_copy,
    look_all_round,
    passing_blocks,
    private_scene,
    rendered,
    why_not_shown,
)

WIDTH, HEIGHT = 1024, 512
LEAST_SAMPLES, SAMPLES, NOISE = 8, 256, 0.02  # of a pixel: all where the sun's edge crosses it, which is .3 % of its
# light; others stop where they are as sure as this,
LEAST_SUN = radians(0.5)  # and would miss a smaller one


def rendered_world(world, frame: int) -> np.ndarray:
    """Radiance by direction as a diffuse surface sees it, float32 (HEIGHT, WIDTH, 3): pixels of an Environment."""
    if not hasattr(world, "cycles"):
        raise RenderError("Cycles is not enabled")
    with passing_blocks() as blocks, private_scene(frame) as scene:
        copy, trees = adapted_copy(world, blocks)
        _adapt(copy, trees)
        look_all_round(scene)
        _sample_as_needed(scene.cycles)
        scene.world = copy
        return rendered(scene, WIDTH, HEIGHT)


def _adapt(world, trees):
    """Let a camera see it, without a volume or a sun too small for its pixels."""
    world.cycles_visibility.camera = True
    world.cycles.sampling_method = "NONE"  # there is nothing to be lit
    for node in [node for tree in trees for node in tree.nodes]:
        if why_not_shown(node):
            raise RenderError(why_not_shown(node))
        if node.type == "TEX_SKY":
            node.sun_size = max(node.sun_size, LEAST_SUN)  # its light is the same
        elif node.type == "OUTPUT_WORLD":
            for link in list(node.inputs["Volume"].links):
                node.id_data.links.remove(link)


def _sample_as_needed(cycles):
    cycles.samples = SAMPLES
    cycles.use_adaptive_sampling, cycles.adaptive_threshold, cycles.adaptive_min_samples = True, NOISE, LEAST_SAMPLES
