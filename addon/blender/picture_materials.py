"""Materials that show a bake: each shader becomes the light that it sends back, base colour x (E / pi) + emission.

Works on private copies of the materials, node by node: mixes, textures and groups stay as the artist made them. Where
rays are traced, mirrors and glass come back over it.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from .picture_nodes import chosen, dimmed, feed, make_sharp
from .picture_rays import GLASS, traced_glass, traced_glossy, traced_principled
from .read_materials import DIFFUSE, GLOSSY, PASSING, TRANSLUCENT, VELVET
from .read_mesh import LIGHTMAP_LAYER
from .shader_nodes import Unreadable, conductor_colour

MIRRORS = {"BSDF_GLOSSY", "BSDF_METALLIC"}
LIT = DIFFUSE | VELVET | GLOSSY | TRANSLUCENT  # shaders that the stored light is seen by, and their colours' names


@dataclass(frozen=True, slots=True)
class Light:
    """Where the E / pi of an object is stored: a lightmap image, or a colour attribute, or nowhere."""

    image: bpy.types.Image | None = None
    attribute: str | None = None

    @property
    def key(self):
        return (self.image.name if self.image else None, self.attribute)


class LitMaterials:
    """Copies of materials, one for each pair of material and light; ``remove()`` takes them out of the file again."""

    def __init__(self, is_traced: bool):
        self._is_traced = is_traced
        self._made = {}
        self._copies, self._groups = [], []

    def lit(self, material, light: Light):
        """The material (or None) as it looks under a light."""
        key = (material.name_full if material else None, light.key)
        if key not in self._made:
            self._made[key] = self._build(material, light)
        return self._made[key]

    def remove(self):
        for copy in self._copies:
            bpy.data.materials.remove(copy)
        for group in self._groups:
            bpy.data.node_groups.remove(group)
        self._made, self._copies, self._groups = {}, [], []

    def _build(self, material, light):
        if material is None or not material.use_nodes:
            colour = (0.8, 0.8, 0.8) if material is None else material.diffuse_color[:3]
            self._copies.append(_plain(colour, light))
            return self._copies[-1]
        copy = material.copy()
        self._copies.append(copy)
        self._convert(copy.node_tree, light)
        return copy

    def _convert(self, tree, light):
        for node in list(tree.nodes):
            if node.mute:
                continue
            if node.type == "GROUP" and node.node_tree is not None:
                node.node_tree = node.node_tree.copy()
                self._groups.append(node.node_tree)
                self._convert(node.node_tree, light)
            elif node.type == "BSDF_PRINCIPLED":
                _replace(tree, node, _principled(tree, node, light, self._is_traced))
            elif node.type in LIT:
                _make_coloured(node)
                colour = node.inputs[LIT[node.type]]
                lit = _reflected(tree, colour, light)
                if self._is_traced and node.type in MIRRORS:
                    lit = traced_glossy(tree, node, LIT[node.type], lit)
                _replace(tree, node, lit)
            elif self._is_traced and node.type in GLASS:
                make_sharp(tree, node)
            elif node.type in PASSING:
                _replace(tree, node, _transparent(tree, node.inputs["Color"]))


def _plain(colour, light):
    made = bpy.data.materials.new("plain")
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*colour, 1.0)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(_reflected(tree, shader.inputs["Color"], light), output.inputs["Surface"])
    return made


def _make_coloured(node):
    """Give a metal that has indices the colour that they make."""
    try:
        colour = conductor_colour(node)
    except Unreadable:
        colour = (0.5, 0.5, 0.5)
    if colour is not None:
        node.fresnel_type = "F82"
        for link in list(node.inputs["Base Color"].links):  # a hidden input keeps what was linked to it
            node.id_data.links.remove(link)
        node.inputs["Base Color"].default_value = (*np.minimum(colour, 1.0), 1.0)


def _replace(tree, node, shader):
    """Let everything that ``node`` feeds be fed by ``shader``."""
    for target, is_muted in [(link.to_socket, link.is_muted) for link in node.outputs[0].links]:
        tree.links.new(shader, target).is_muted = is_muted
    tree.nodes.remove(node)


def _principled(tree, node, light, is_traced):
    base = node.inputs["Base Color"]

    def solid():
        lit = dimmed(tree, _reflected(tree, base, light), node.inputs["Transmission Weight"])
        return traced_principled(tree, node, lit) if is_traced else lit

    def clear():
        return traced_glass(tree, node) if is_traced else _transparent(tree, base)

    # a pixel is a mirror image or none: glass from a transmission of 0.5 on
    reflected = chosen(tree, node.inputs["Transmission Weight"], solid, clear)
    emitted = tree.nodes.new("ShaderNodeEmission")
    feed(tree, node.inputs["Emission Color"], emitted.inputs["Color"])
    feed(tree, node.inputs["Emission Strength"], emitted.inputs["Strength"])
    both = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(reflected, both.inputs[0])
    tree.links.new(emitted.outputs[0], both.inputs[1])
    cut_out = tree.nodes.new("ShaderNodeMixShader")
    feed(tree, node.inputs["Alpha"], cut_out.inputs[0])
    tree.links.new(tree.nodes.new("ShaderNodeBsdfTransparent").outputs[0], cut_out.inputs[1])
    tree.links.new(both.outputs[0], cut_out.inputs[2])
    return cut_out.outputs[0]


def _reflected(tree, colour, light):
    """An emission of colour x light."""
    product = tree.nodes.new("ShaderNodeVectorMath")
    product.operation = "MULTIPLY"
    feed(tree, colour, product.inputs[0])
    stored = _stored_light(tree, light)
    if stored is None:
        product.inputs[1].default_value = (0.0, 0.0, 0.0)
    else:
        tree.links.new(stored, product.inputs[1])
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(product.outputs[0], emission.inputs["Color"])
    return emission.outputs[0]


def _stored_light(tree, light):
    if light.image is not None:
        uvs = tree.nodes.new("ShaderNodeUVMap")
        uvs.uv_map = LIGHTMAP_LAYER
        lookup = tree.nodes.new("ShaderNodeTexImage")
        lookup.image = light.image
        lookup.extension = "EXTEND"
        tree.links.new(uvs.outputs["UV"], lookup.inputs["Vector"])
        return lookup.outputs["Color"]
    if light.attribute is not None:
        attribute = tree.nodes.new("ShaderNodeAttribute")
        attribute.attribute_name = light.attribute
        return attribute.outputs["Color"]
    return None


def _transparent(tree, colour):
    shader = tree.nodes.new("ShaderNodeBsdfTransparent")
    feed(tree, colour, shader.inputs["Color"])
    return shader.outputs[0]
