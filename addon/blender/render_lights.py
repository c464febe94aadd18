"""What the nodes of a lamp make of its light in each direction, as Cycles shows it: on a white ball around it."""

from __future__ import annotations

from math import pi, radians

import bmesh
import bpy
import numpy as np

from .private_render import RenderError, adapted_copy, passing_blocks, private_scene, rendered, why_not_shown

WIDTH, HEIGHT, SAMPLES = 256, 128, 4  # some 1.4 degrees a pixel: photometric files have 2.5 to 15
SEGMENTS = 128  # of the ball along its equator: its faces lie 3e-4 of its radius within it at the most
LOOKS_TO_X = (radians(90), 0, radians(-90))  # +X in the middle and +Z up, as core Environment has it
POWERS = {"Quadratic": 0.0, "Linear": 1.0, "Constant": 2.0}  # of the distance, which a Light Falloff node multiplies by


def rendered_lamp(lamp, frame: int) -> tuple[np.ndarray, float]:
    """What a point's or a spot's nodes multiply its light by, before its cone: by direction in the lamp's own space,
    float32 (HEIGHT, WIDTH, 3), pixels of an Environment, and the power of the distance that they multiply it by, too.

    Raises
    ------
    RenderError : Cycles cannot show it
    """
    with passing_blocks() as blocks, private_scene(frame) as scene:
        copy, trees = adapted_copy(lamp, blocks)
        power = _power_of_distance(trees)
        copy.type = "POINT"
        point = bpy.data.lights[copy.name]  # of another class now
        point.color, point.energy, point.shadow_soft_size = (1, 1, 1), 4 * pi, 0.0  # 1 W/sr
        for name, value in (("exposure", 0.0), ("normalize", True), ("use_temperature", False)):
            if hasattr(point, name):
                setattr(point, name, value)
        for data in (point, _white_ball(blocks)):
            placed = bpy.data.objects.new("private", data)
            blocks.append(placed)
            scene.collection.objects.link(placed)
        _look_all_round(scene)
        return pi * rendered(scene, WIDTH, HEIGHT), power  # E / pi at 1 m


def _power_of_distance(trees):
    powers = set()
    for node in [node for tree in trees for node in tree.nodes]:
        if why_not_shown(node):
            raise RenderError(why_not_shown(node))
        if node.type == "LIGHT_FALLOFF":
            powers |= {POWERS[output.name] for output in node.outputs if output.is_linked}
    if len(powers) > 1:
        raise RenderError("its Light Falloff nodes mix several powers of the distance")
    return powers.pop() if powers else 0.0


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


def _look_all_round(scene):
    camera, cycles = scene.camera.data, scene.cycles
    camera.type = "PANO"
    # the place that it has had since Blender 5.0, else Cycles' own
    (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"
    scene.camera.rotation_euler = LOOKS_TO_X
    cycles.samples, cycles.use_adaptive_sampling, cycles.max_bounces = SAMPLES, False, 0
