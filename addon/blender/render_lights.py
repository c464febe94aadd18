"""What the nodes of a lamp make of its light in each direction, as Cycles shows it: on a white ball around it."""

from __future__ import annotations

from math import pi
from pathlib import Path

import bmesh
import bpy
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

WIDTH, HEIGHT, SAMPLES = 256, 128, 4  # some 1.4 degrees a pixel: photometric files have 2.5 to 15
COARSER = 8  # pixels along a side that are one where only the distance is asked about
SEGMENTS = 128  # of the ball along its equator: its faces lie 3e-4 of its radius within it at the most
BY_DISTANCE = {"LIGHT_FALLOFF", "LIGHT_PATH"}  # nodes that may know how far the light goes
OF_THE_WORLD = {"NEW_GEOMETRY", "OBJECT_INFO", "VECT_TRANSFORM"}  # and how a lamp stands there, which a ball does not
OF_THE_LAMP = {"Normal", "Generated", "UV"}  # outputs of Texture Coordinate
SAME = 0.02  # apart: light at a distance, of the largest


def rendered_lamp(lamp, frame: int) -> tuple[np.ndarray, float]:
    """What a point's or a spot's nodes multiply its light by, before its cone: by direction in the lamp's own space,
    float32 (HEIGHT, WIDTH, 3), pixels of an Environment, and the power of the distance that they multiply it by, too.

    Raises
    ------
    RenderError : Cycles cannot show it, or it is no such product
    """
    with passing_blocks() as blocks, private_scene(frame) as scene:
        copy, trees = adapted_copy(lamp, blocks, kept={"Ray Length"})
        nodes = [node for tree in trees for node in tree.nodes]
        for node in nodes:
            _require_shown(node)
        point = _bare_point(copy)
        ball = _placed(scene, _white_ball(blocks), blocks)
        _placed(scene, point, blocks)
        look_all_round(scene)
        scene.cycles.samples, scene.cycles.use_adaptive_sampling, scene.cycles.max_bounces = SAMPLES, False, 0
        shown = pi * rendered(scene, WIDTH, HEIGHT)  # E / pi at 1 m
        if not any(node.type in BY_DISTANCE for node in nodes):
            return shown, 0.0
        size = WIDTH // COARSER, HEIGHT // COARSER
        at = {1.0: shown.reshape(size[1], COARSER, size[0], COARSER, 3).mean(axis=(1, 3))}
        for radius in (0.5, 2.0):
            ball.scale = (radius,) * 3
            at[radius] = pi * radius**2 * rendered(scene, *size)
        return shown, _power_of_distance(at)


def _bare_point(copy):
    """The lamp as a point of 1 W/sr that nothing animates, but for its nodes."""
    copy.animation_data_clear()
    copy.type = "POINT"
    point = bpy.data.lights[(copy.name, None)]  # of another class now
    point.color, point.energy, point.shadow_soft_size = (1, 1, 1), 4 * pi, 0.0
    for name, value in (("exposure", 0.0), ("normalize", True), ("use_temperature", False)):
        if hasattr(point, name):
            setattr(point, name, value)
    return point


def _placed(scene, data, io_blocks):
    placed = bpy.data.objects.new("private", data)
    io_blocks.append(placed)
    scene.collection.objects.link(placed)
    return placed


def _require_shown(node):
    """RenderError where a lamp at the middle of a ball would not show what a node makes of it where it stands."""
    if why_not_shown(node):
        raise RenderError(why_not_shown(node))
    if node.mute:
        return
    linked = {output.name for output in node.outputs if output.is_linked}
    if linked and (node.type in OF_THE_WORLD or (node.type == "TEX_COORD" and linked - OF_THE_LAMP)):
        raise RenderError(f"its {node.bl_label} node asks where it stands")
    if node.type == "TEX_IES" and linked:
        has_file = node.ies is not None if node.mode == "INTERNAL" else Path(bpy.path.abspath(node.filepath)).is_file()
        if not has_file:
            raise RenderError(f"its {node.bl_label} node has no file")


def _power_of_distance(at):
    """The power p of light (rows, columns, 3) times the square of the distance that it has at 0.5, 1 and 2 m."""
    near, middle, far = (at[radius] for radius in (0.5, 1.0, 2.0))
    if not middle.max() > 0:
        return 0.0
    power = float(np.log2(max(far.sum(), 1e-30) / middle.sum()))
    most = max(middle.max(), 1e-30)
    is_power = abs(near * 2**power - middle).max() <= SAME * most and abs(far / 2**power - middle).max() <= SAME * most
    if not is_power or not -SAME <= power <= 2 + SAME:
        raise RenderError("its light does not go by a power of the distance")
    return min(max(round(power, 2), 0.0), 2.0)


def _white_ball(io_blocks):
    mesh, ball = bpy.data.meshes.new("private"), bmesh.new()
    bmesh.ops.create_uvsphere(ball, u_segments=SEGMENTS, v_segments=SEGMENTS // 2, radius=1.0)
    ball.to_mesh(mesh)
    ball.free()
    white = bpy.data.materials.new("private")
    white.use_nodes = True
    tree = white.node_tree
    tree.nodes.clear()
    diffuse, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (1, 1, 1, 1)
    tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    mesh.materials.append(white)
    io_blocks += [mesh, white]
    return mesh
