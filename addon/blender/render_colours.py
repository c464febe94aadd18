"""Colours that only Cycles can tell, of noise and other textures that no image holds: their means on a square metre.

Each is shown as it is, without light, by a tile of its own, and one render shows all tiles. A tile cuts through the
texture's space at a slant, so that what varies along one axis only varies there, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, sqrt

import bpy
import numpy as np
from mathutils import Matrix

from ..core.scene import BRIGHTEST
from .private_render import adapted_copy, passing_blocks, private_scene, rendered, why_not_shown

PIXELS, SAMPLES = 48, 4  # of a tile along a side, of a pixel
# nodes that say what lies in a mesh, or differs by object, which a tile cannot know
OF_OBJECTS = {"ATTRIBUTE", "VERTEX_COLOR", "OBJECT_INFO", "PARTICLE_INFO", "HAIR_INFO", "POINT_INFO", "VOLUME_INFO"}
OF_ISLANDS = "Random Per Island"  # an output of another node
ALONG, ACROSS, UP = np.array([1, -1, 0]) / sqrt(2), np.array([1, 1, -2]) / sqrt(6), np.array([1, 1, 1]) / sqrt(3)


@dataclass(frozen=True, slots=True)
class ShaderInput:
    """An input of a shader in a material's own tree, by the names that copies share; ``is_share``: of [0, 1]."""

    material: object
    node: str
    socket: str
    is_share: bool


def rendered_means(inputs: list[ShaderInput], frame: int) -> list[np.ndarray | None]:
    """The mean linear colour (3,) of each input; None of those that a tile cannot show.

    Raises
    ------
    RenderError : there is no Cycles, or it is at work
    """
    means = [None] * len(inputs)
    with passing_blocks() as blocks, private_scene(frame) as scene:
        shown = {}
        for place, which in enumerate(inputs):
            material, trees = adapted_copy(which.material, blocks)
            if _show(material, trees, which):
                shown[place] = material
        side = ceil(sqrt(len(shown)))
        for tile, material in enumerate(shown.values()):
            _add_tile(scene, material, tile % side, tile // side, blocks)
        if shown:
            _look_down(scene, side)
            pixels = rendered(scene, PIXELS * side, PIXELS * side)
            tiles = pixels.reshape(side, PIXELS, side, PIXELS, 3).mean(axis=(1, 3), dtype=np.float64).reshape(-1, 3)
            for tile, place in enumerate(shown):
                means[place] = np.clip(np.nan_to_num(tiles[tile], posinf=0.0), 0.0, BRIGHTEST)
    return means


def _show(material, trees, which) -> bool:
    """Let a material glow by what feeds an input; whether that can be shown."""
    tree = material.node_tree
    (wanted,) = (socket for socket in tree.nodes[which.node].inputs if socket.identifier == which.socket)
    link = next((link for link in wanted.links if link.is_valid and not link.is_muted), None)
    if link is None or not all(_can_be_shown(node) for node in feeding(link.from_node)):
        return False
    for node in [node for tree in trees for node in tree.nodes]:
        if node.type == "UVMAP":
            node.uv_map = ""  # a tile has one only
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    shown = _as_number(tree, link.from_socket, which.is_share) if wanted.type == "VALUE" else link.from_socket
    tree.links.new(shown, emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    output.target, output.is_active_output = "CYCLES", True  # before others, of all engines
    return True


def _as_number(tree, source, is_share):
    """What an input for a number makes of an output: a grey, a share of [0, 1] at every point."""
    number = tree.nodes.new("ShaderNodeMath")
    number.operation, number.use_clamp = "ADD", is_share
    number.inputs[1].default_value = 0.0
    tree.links.new(source, number.inputs[0])
    return number.outputs[0]


def _can_be_shown(node):
    differs = node.type in OF_OBJECTS or any(o.name == OF_ISLANDS and o.is_linked for o in node.outputs)
    return not differs and not why_not_shown(node)


def feeding(node):
    """The node and all that feed it, those in groups too."""
    found, waiting = {}, [node]
    while waiting:
        node = waiting.pop()
        if node.as_pointer() in found:
            continue
        found[node.as_pointer()] = node
        waiting += [link.from_node for socket in node.inputs for link in socket.links]
        if node.type == "GROUP" and node.node_tree is not None:
            waiting += node.node_tree.nodes
    return found.values()


def _add_tile(scene, material, column, row, io_blocks):
    """A square metre of a material in a scene's grid."""
    corners = [0.5 * (a * ALONG + b * ACROSS) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    mesh = bpy.data.meshes.new("tile")
    mesh.from_pydata([tuple(corner) for corner in corners], [], [(0, 1, 2, 3)])
    mesh.uv_layers.new().uv.foreach_set("vector", [0, 0, 1, 0, 1, 1, 0, 1])
    mesh.materials.append(material)
    tile = bpy.data.objects.new("tile", mesh)
    io_blocks += [mesh, tile]
    turn = Matrix([ALONG, ACROSS, UP]).to_4x4()
    tile.matrix_world = Matrix.Translation((column + 0.5, row + 0.5, 0)) @ turn
    scene.collection.objects.link(tile)


def _look_down(scene, side):
    camera = scene.camera.data
    camera.type, camera.ortho_scale = "ORTHO", side
    scene.camera.location = (side / 2, side / 2, 2)
    scene.cycles.samples, scene.cycles.use_adaptive_sampling = SAMPLES, False
    scene.cycles.max_bounces = 0
