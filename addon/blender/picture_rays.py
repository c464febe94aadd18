"""What smooth surfaces reflect and let through, as Whitted traced it (1980): sharp rays, weighted by Fresnel's law.

Shader nodes for a picture's private materials, over what the bake shows. Nothing is blurred: as a surface gets rougher
its mirror fades into what the bake shows there, and from ``ROUGH`` on nothing of it is left. Glass is always clear.
"""

from __future__ import annotations

from .picture_nodes import clamped, feed, make_sharp, math_node, product_of, rest_of, set_input, source_of

ROUGH = 0.4
NEUTRAL_LEVEL = 0.5  # a Principled shader's specular level that leaves the reflection as its IOR has it
GLASS = {"BSDF_GLASS", "BSDF_REFRACTION"}


def traced_principled(tree, node, lit):
    """The shader of a Principled ``node`` that does not transmit: ``lit`` below its mirrors, of metal and of a coat."""
    smooth, metallic = _smoothness(tree, node.inputs["Roughness"]), source_of(node.inputs["Metallic"])
    fresnel, level = _fresnel(tree, node, "IOR", "Normal"), source_of(node.inputs["Specular IOR Level"])
    share = product_of(tree, 1 / NEUTRAL_LEVEL, level, fresnel, smooth, rest_of(tree, metallic))
    lit = _mixed(tree, share, lit, node, "Specular Tint", "Normal")
    lit = _mixed(tree, product_of(tree, metallic, smooth), lit, node, "Base Color", "Normal")
    smooth, fresnel = _smoothness(tree, node.inputs["Coat Roughness"]), _fresnel(tree, node, "Coat IOR", "Coat Normal")
    share = product_of(tree, source_of(node.inputs["Coat Weight"]), fresnel, smooth)
    return _mixed(tree, share, lit, node, None, "Coat Normal")


def traced_glossy(tree, node, colour, lit):
    """The shader of a glossy ``node``, whose colour is its input named ``colour``."""
    return _mixed(tree, _smoothness(tree, node.inputs["Roughness"]), lit, node, colour, "Normal")


def traced_glass(tree, node):
    """The shader of a Principled ``node`` that transmits: its colour is of what passes, not of what is reflected."""
    inside, fresnel = tree.nodes.new("ShaderNodeBsdfRefraction"), tree.nodes.new("ShaderNodeFresnel")
    feed(tree, node.inputs["Base Color"], inside.inputs["Color"])
    for shader in (inside, fresnel):
        feed(tree, node.inputs["IOR"], shader.inputs["IOR"])
        feed(tree, node.inputs["Normal"], shader.inputs["Normal"])
    make_sharp(tree, inside)
    return _mixed(tree, fresnel.outputs[0], inside.outputs[0], node, None, "Normal")


def _mixed(tree, share, lit, node, colour, normal):
    """``lit`` and, by ``share`` (0..1), a mirror with the colour and the normal of these inputs of ``node``."""
    if share == 0.0:
        return lit
    mirror = tree.nodes.new("ShaderNodeBsdfAnisotropic")
    mirror.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    if colour is not None:
        feed(tree, node.inputs[colour], mirror.inputs["Color"])
    feed(tree, node.inputs[normal], mirror.inputs["Normal"])
    make_sharp(tree, mirror)
    mix = tree.nodes.new("ShaderNodeMixShader")
    set_input(tree, share, mix.inputs[0])
    tree.links.new(lit, mix.inputs[1])
    tree.links.new(mirror.outputs[0], mix.inputs[2])
    return mix.outputs[0]


def _fresnel(tree, node, ior, normal):
    """What a smooth dielectric reflects of the light along the ray, on both sides as on its front.

    Blender's node takes the back for the inside of a solid, from where all light is reflected beyond some angle: it
    gets the inverse there.
    """
    back = tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"]
    exponent = math_node(tree, "MULTIPLY_ADD", back, -2.0, 1.0)
    fresnel = tree.nodes.new("ShaderNodeFresnel")
    tree.links.new(math_node(tree, "POWER", source_of(node.inputs[ior]), exponent), fresnel.inputs["IOR"])
    feed(tree, node.inputs[normal], fresnel.inputs["Normal"])
    return fresnel.outputs[0]


def _smoothness(tree, roughness):
    """1 where the input ``roughness`` is 0, falling to 0 at ``ROUGH``."""
    value = source_of(roughness)
    if isinstance(value, float):
        return max(1 - value / ROUGH, 0.0)
    return clamped(math_node(tree, "MULTIPLY_ADD", value, -1 / ROUGH, 1.0))
