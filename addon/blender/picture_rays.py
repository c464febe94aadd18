"""What smooth surfaces reflect and let through, as Whitted traced it (1980): sharp rays, weighted by Fresnel's law.

Shader nodes for a picture's private materials, over what the bake shows. Nothing is blurred: as a surface gets rougher
its mirror fades into what the bake shows there, and from ``ROUGH`` on nothing of it is left. Glass is always clear.
"""

from __future__ import annotations

from .shader_nodes import live_link

ROUGH = 0.4
NEUTRAL_LEVEL = 0.5  # a Principled shader's specular level that leaves the reflection as its IOR has it
GLASS = {"BSDF_GLASS", "BSDF_REFRACTION"}


def traced_principled(tree, node, lit):
    """The shader of a Principled ``node`` that does not transmit: ``lit`` below its mirrors, of metal and of a coat."""
    smooth, metallic = _smoothness(tree, node.inputs["Roughness"]), _source(node.inputs["Metallic"])
    fresnel, level = _fresnel(tree, node, "IOR", "Normal"), _source(node.inputs["Specular IOR Level"])
    share = _product(tree, 1 / NEUTRAL_LEVEL, level, fresnel, smooth, _rest(tree, metallic))
    lit = _mixed(tree, share, lit, node, "Specular Tint", "Normal")
    lit = _mixed(tree, _product(tree, metallic, smooth), lit, node, "Base Color", "Normal")
    smooth, fresnel = _smoothness(tree, node.inputs["Coat Roughness"]), _fresnel(tree, node, "Coat IOR", "Coat Normal")
    share = _product(tree, _source(node.inputs["Coat Weight"]), fresnel, smooth)
    return _mixed(tree, share, lit, node, None, "Coat Normal")


def traced_glossy(tree, node, colour, lit):
    """The shader of a glossy ``node``, whose colour is its input named ``colour``."""
    return _mixed(tree, _smoothness(tree, node.inputs["Roughness"]), lit, node, colour, "Normal")


def chosen(tree, share, otherwise, shader):
    """``shader`` where ``share``, an input, is a half or more, else ``otherwise``: both make a shader's socket."""
    share = _source(share)
    if isinstance(share, float):
        return shader() if share >= 0.5 else otherwise()
    mix = tree.nodes.new("ShaderNodeMixShader")
    _set(tree, _math(tree, "GREATER_THAN", share, 0.4999), mix.inputs[0])
    tree.links.new(otherwise(), mix.inputs[1])
    tree.links.new(shader(), mix.inputs[2])
    return mix.outputs[0]


def traced_glass(tree, node):
    """The shader of a Principled ``node`` that transmits: its colour is of what passes, not of what is reflected."""
    inside, fresnel = tree.nodes.new("ShaderNodeBsdfRefraction"), tree.nodes.new("ShaderNodeFresnel")
    feed(tree, node.inputs["Base Color"], inside.inputs["Color"])
    for shader in (inside, fresnel):
        feed(tree, node.inputs["IOR"], shader.inputs["IOR"])
        feed(tree, node.inputs["Normal"], shader.inputs["Normal"])
    make_sharp(tree, inside)
    return _mixed(tree, fresnel.outputs[0], inside.outputs[0], node, None, "Normal")


def dimmed(tree, emission, share):
    """The socket of an Emission node, less by ``share``, an input."""
    _set(tree, _rest(tree, _source(share)), emission.node.inputs["Strength"])
    return emission


def make_sharp(tree, node):
    """Take the roughness from a shader node."""
    roughness = node.inputs["Roughness"]
    for link in list(roughness.links):
        tree.links.remove(link)
    roughness.default_value = 0.0


def feed(tree, source, target):
    """Give the input ``target`` the link or the value of the input ``source``."""
    link = live_link(source)
    if link is not None:
        tree.links.new(link.from_socket, target)
    elif target.hide_value:
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
    """What a smooth dielectric reflects of the light along the ray, on both sides as on its front.

    Blender's node takes the back for the inside of a solid, from where all light is reflected beyond some angle: it
    gets the inverse there.
    """
    back = tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"]
    exponent = _math(tree, "MULTIPLY_ADD", back, -2.0, 1.0)
    fresnel = tree.nodes.new("ShaderNodeFresnel")
    tree.links.new(_math(tree, "POWER", _source(node.inputs[ior]), exponent), fresnel.inputs["IOR"])
    feed(tree, node.inputs[normal], fresnel.inputs["Normal"])
    return fresnel.outputs[0]


def _smoothness(tree, roughness):
    """1 where the input ``roughness`` is 0, falling to 0 at ``ROUGH``."""
    value = _source(roughness)
    if isinstance(value, float):
        return max(1 - value / ROUGH, 0.0)
    return _clamped(_math(tree, "MULTIPLY_ADD", value, -1 / ROUGH, 1.0))


def _rest(tree, share):
    """What a share leaves of 1."""
    return 1 - share if isinstance(share, float) else _math(tree, "SUBTRACT", 1.0, share)


def _product(tree, *factors):
    """Of numbers and sockets of nodes, at most 1: a number where all are known, else the socket of a node."""
    known, sockets = 1.0, []
    for factor in factors:
        if isinstance(factor, float):
            known *= factor
        else:
            sockets.append(factor)
    if known == 0.0 or not sockets:
        return min(known, 1.0)
    product = known
    for socket in sockets:
        product = _math(tree, "MULTIPLY", product, socket)
    return _clamped(product)


def _source(target):
    """What an input has: the socket of a node, or a number."""
    link = live_link(target)
    return float(target.default_value) if link is None else link.from_socket


def _math(tree, operation, *values):
    """The socket of a Math node over numbers and sockets."""
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    for value, target in zip(values, node.inputs):
        _set(tree, value, target)
    return node.outputs[0]


def _clamped(socket):
    """The same socket of a Math node, kept in 0..1."""
    socket.node.use_clamp = True
    return socket


def _set(tree, value, target):
    """Give an input a number, or the value of a node's socket."""
    if isinstance(value, float):
        target.default_value = value
    else:
        tree.links.new(value, target)
