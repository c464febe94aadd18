"""Colours that only Cycles can tell, of noise and other textures that no image holds: their means on a square metre.

Each is shown as it is, without light, by a tile of its own, and one render shows all tiles. A tile cuts through the
texture's space at a slant, so that what varies along one axis only varies there, too.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from math import ceil, sqrt

import bpy
import numpy as np
from mathutils import Matrix

from ..core.scene import BRIGHTEST
from .private_render import copy_of, private_scene, rendered, why_not_shown

PIXELS, SAMPLES = 48, 4  # of a tile along a side, of a pixel
OF_MESHES = {"ATTRIBUTE", "VERTEX_COLOR"}  # nodes whose colours lie in meshes, which a tile has not
ALONG, ACROSS, UP = np.array([1, -1, 0]) / sqrt(2), np.array([1, 1, -2]) / sqrt(6), np.array([1, 1, 1]) / sqrt(3)


@dataclass(frozen=True, slots=True)
class ShaderInput:
    """An input of a shader in a material's own tree, by the names that copies share."""

    material: object
    node: str
    socket: str


def rendered_means(inputs: list[ShaderInput], frame: int) -> list[np.ndarray | None]:
    """The mean linear colour (3,) of each input; None of those that a tile cannot show.

    Raises
    ------
    RenderError : there is no Cycles, or it is at work
    """
    means = [None] * len(inputs)
    with ExitStack() as stack:
        scene = stack.enter_context(private_scene(frame))
        shown = {}
        for place, which in enumerate(inputs):
            material, trees = stack.enter_context(copy_of(which.material, bpy.data.materials))
            if _show(material, trees, which):
                shown[place] = material
        side = ceil(sqrt(len(shown)))
        for tile, material in enumerate(shown.values()):
            stack.enter_context(_Tile(scene, material, tile % side, tile // side))
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
    inputs = tree.nodes[which.node].inputs
    link = next((link for socket in inputs if socket.identifier == which.socket for link in socket.links), None)
    if link is None or not all(_can_be_shown(node) for node in _feeding(link.from_node)):
        return False
    for node in [node for tree in trees for node in tree.nodes]:
        if node.type == "UVMAP":
            node.uv_map = ""  # a tile has one only
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(link.from_socket, emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    output.is_active_output = True
    return True


def _can_be_shown(node):
    return node.type not in OF_MESHES and not why_not_shown(node)


def _feeding(node):
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


class _Tile:
    """A square metre of a material in a scene's grid; gone afterwards."""

    def __init__(self, scene, material, column, row):
        corners = [0.5 * (a * ALONG + b * ACROSS) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        self._mesh = bpy.data.meshes.new("tile")
        self._mesh.from_pydata([tuple(corner) for corner in corners], [], [(0, 1, 2, 3)])
        self._mesh.uv_layers.new().uv.foreach_set("vector", [0, 0, 1, 0, 1, 1, 0, 1])
        self._mesh.materials.append(material)
        self._object = bpy.data.objects.new("tile", self._mesh)
        turn = Matrix([ALONG, ACROSS, UP]).to_4x4()
        self._object.matrix_world = Matrix.Translation((column + 0.5, row + 0.5, 0)) @ turn
        scene.collection.objects.link(self._object)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        bpy.data.objects.remove(self._object)
        bpy.data.meshes.remove(self._mesh)


def _look_down(scene, side):
    camera = scene.camera.data
    camera.type, camera.ortho_scale = "ORTHO", side
    scene.camera.location = (side / 2, side / 2, 2)
    scene.cycles.samples, scene.cycles.use_adaptive_sampling = SAMPLES, False
    scene.cycles.max_bounces = 0
