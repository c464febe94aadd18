"""Parts of a picture's materials: what feeds an input, and arithmetic on numbers and sockets alike."""

from __future__ import annotations

from .shader_nodes import live_link


def chosen(tree, share, otherwise, shader):
    """``shader`` where ``share``, an input, is a half or more, else ``otherwise``: both make a shader's socket."""
    share = source_of(share)
    if isinstance(share, float):
        return shader() if share >= 0.5 else otherwise()
    mix = tree.nodes.new("ShaderNodeMixShader")
    set_input(tree, math_node(tree, "GREATER_THAN", share, 0.4999), mix.inputs[0])
    tree.links.new(otherwise(), mix.inputs[1])
    tree.links.new(shader(), mix.inputs[2])
    return mix.outputs[0]


def dimmed(tree, emission, share):
    """The socket of an Emission node, less by ``share``, an input."""
    set_input(tree, rest_of(tree, source_of(share)), emission.node.inputs["Strength"])
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


def rest_of(tree, share):
    """What a share leaves of 1."""
    return 1 - share if isinstance(share, float) else math_node(tree, "SUBTRACT", 1.0, share)


def product_of(tree, *factors):
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
        product = math_node(tree, "MULTIPLY", product, socket)
    return clamped(product)


def source_of(target):
    """What an input has: the socket of a node, or a number."""
    link = live_link(target)
    return float(target.default_value) if link is None else link.from_socket


def math_node(tree, operation, *values):
    """The socket of a Math node over numbers and sockets."""
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    for value, target in zip(values, node.inputs):
        set_input(tree, value, target)
    return node.outputs[0]


def clamped(socket):
    """The same socket of a Math node, kept in 0..1."""
    socket.node.use_clamp = True
    return socket


def set_input(tree, value, target):
    """Give an input a number, or the value of a node's socket."""
    if isinstance(value, float):
        target.default_value = value
    else:
        tree.links.new(value, target)
