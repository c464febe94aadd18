"""Trees between two images and a shader, and what Cycles bakes of them."""

from __future__ import annotations

import bpy
import numpy as np

SIDE = 8
TABLES = 2e-3  # Cycles looks ramps and curves up in tables of 256 entries, in 32 bits
ROUNDING = 2e-5  # chains of 32-bit numbers of about 1
LUMINANCE = 1.5e-4  # Blender's weights of luminance have seven digits, ours the four of Rec.709: 7e-5, and powers of it


def colours(seed):
    """An image (SIDE, SIDE, 3) that has black, white and a grey in it."""
    pixels = np.random.default_rng(seed).random((SIDE, SIDE, 3)).astype(np.float32)
    pixels[0, :3] = [[0, 0, 0], [1, 1, 1], [0.5, 0.5, 0.5]]
    return pixels


def baked_by_cycles(plane, material):
    """Pixels (SIDE, SIDE, 3) of Cycles' bake of the base colour: at texel centres, where lookups do not interpolate."""
    image = bpy.data.images.new("Baked", SIDE, SIDE, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    material.node_tree.nodes.active = node
    bpy.context.scene.render.engine = "CYCLES"
    bpy.context.scene.cycles.samples = 1
    bpy.context.view_layer.objects.active = plane
    plane.select_set(True)
    bpy.ops.object.bake(type="DIFFUSE", pass_filter={"COLOR"}, margin=0)
    return np.array(image.pixels[:]).reshape(SIDE, SIDE, 4)[..., :3]


def image_node(tree, image):
    node = tree.new("TexImage")
    node.image, node.interpolation = image, "Closest"
    return node


def halved(tree, node, socket=0):
    """Half of what a node puts out: what lies above 1 shows, and whether it was clamped."""
    half = tree.new("MixRGB")
    half.blend_type = "MULTIPLY"
    half.inputs[0].default_value, half.inputs[2].default_value = 1.0, (0.5, 0.5, 0.5, 1.0)
    return tree.link(node, half, socket, 1)


def arithmetic(tree, operation, number, source, socket=0, is_clamped=False):
    node = tree.new("Math")
    node.operation, node.use_clamp = operation, is_clamped
    node.inputs[1].default_value = number
    return tree.link(source, node, socket, 0)
