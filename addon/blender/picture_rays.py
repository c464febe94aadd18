"""What smooth surfaces reflect and let through, as Whitted traced it (1980): sharp rays, weighted by Fresnel's law.

Shader nodes for a picture's private materials, over what the bake shows. Nothing is blurred: as a surface gets rougher
its mirror fades into what the bake shows there, and from ``ROUGH`` on nothing of it is left.
"""

from __future__ import annotations

ROUGH = 0.4
NEUTRAL_LEVEL = 0.5  # a Principled shader's specular level that leaves the reflection as its IOR has it
GLASS = {"BSDF_GLASS", "BSDF_REFRACTION"}


def traced_principled(tree, node, lit):
    """The shader of a Principled ``node`` that does not transmit: ``lit`` below its mirrors, of metal and of a coat."""
    level = node.inputs["Specular IOR Level"]
    twice = _product(tree, 1 / NEUTRAL_LEVEL, level)
    share = _product(tree, twice, _fresnel(tree, node, "IOR", "Normal"), _smoothness(tree, node.inputs["Roughness"]))
    lit = _mixed(tree, share, lit, node, "Specular Tint", "Normal")
    share = _product(tree, node.inputs["Metallic"], _smoothness(tree, node.inputs["Roughness"]))
    lit = _mixed(tree, share, lit, node, "Base Color", "Normal")
    share = _product(
        tree,
        node.inputs["Coat Weight"],
        _fresnel(tree, node, "Coat IOR", "Coat Normal"),
        _smoothness(tree, node.inputs["Coat Roughness"]),
    )
    return _mixed(tree, share, lit, node, None, "Coat Normal")


def traced_glossy(tree, node, colour, lit):
    """The shader of a glossy ``node``, whose colour is its input named ``colour``."""
    return _mixed(tree, _smoothness(tree, node.inputs["Roughness"]), lit, node, colour, "Normal")


def traced_glass(tree, node):
    """The shader of a Principled ``node`` that transmits."""
    glass = tree.nodes.new("ShaderNodeBsdfGlass")
    for name, own in (("Base Color", "Color"), ("IOR", "IOR"), ("Normal", "Normal")):
        feed(tree, node.inputs[name], glass.inputs[own])
    make_sharp(tree, glass)
    return glass.outputs[0]


def make_sharp(tree, node):
    """Take the roughness from a shader node."""
    roughness = node.inputs["Roughness"]
    for link in list(roughness.links):
        tree.links.remove(link)
    roughness.default_value = 0.0


def feed(tree, source, target):
    """Give the input ``target`` the link or the value of the input ``source``."""
    if source.is_linked:
        tree.links.new(source.links[0].from_socket, target)
    elif not hasattr(target, "default_value") or target.hide_value:
        return  # a normal that nothing is linked to
    elif hasattr(target.default_value, "__len__"):
        target.default_value = tuple(source.default_value)[: len(target.default_value)]
    else:
        target.default_value = source.default_value


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
    _set(tree, share, mix.inputs[0])
    tree.links.new(lit, mix.inputs[1])
    tree.links.new(mirror.outputs[0], mix.inputs[2])
    return mix.outputs[0]


def _fresnel(tree, node, ior, normal):
    """What a smooth dielectric reflects of the light along the ray."""
    fresnel = tree.nodes.new("ShaderNodeFresnel")
    feed(tree, node.inputs[ior], fresnel.inputs["IOR"])
    feed(tree, node.inputs[normal], fresnel.inputs["Normal"])
    return fresnel.outputs[0]


def _smoothness(tree, roughness):
    """1 where the input ``roughness`` is 0, falling to 0 at ``ROUGH``: a number, or the socket of a node."""
    if not roughness.is_linked:
        return max(1 - roughness.default_value / ROUGH, 0.0)
    fade = tree.nodes.new("ShaderNodeMapRange")  # clamps
    tree.links.new(roughness.links[0].from_socket, fade.inputs["Value"])
    for name, value in (("From Min", 0.0), ("From Max", ROUGH), ("To Min", 1.0), ("To Max", 0.0)):
        fade.inputs[name].default_value = value
    return fade.outputs[0]


def _product(tree, *factors):
    """Of numbers, inputs and sockets of nodes: a number where all are known, else the socket of a node; at most 1."""
    known, sockets = 1.0, []
    for factor in factors:
        if isinstance(factor, float):
            known *= factor
        elif factor.is_output:
            sockets.append(factor)
        elif factor.is_linked:
            sockets.append(factor.links[0].from_socket)
        else:
            known *= factor.default_value
    if known == 0.0 or not sockets:
        return known
    product = known
    for socket in sockets:
        multiply = tree.nodes.new("ShaderNodeMath")
        multiply.operation = "MULTIPLY"
        _set(tree, product, multiply.inputs[0])
        tree.links.new(socket, multiply.inputs[1])
        product = multiply.outputs[0]
    product.node.use_clamp = True
    return product


def _set(tree, value, target):
    """Give an input a number, or the value of a node's socket."""
    if isinstance(value, float):
        target.default_value = value
    else:
        tree.links.new(value, target)
