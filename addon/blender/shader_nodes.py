"""Following links through a shader node tree: reroutes, muted nodes and groups are walked through, never read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.luminance import LUMINANCE

GROUP_DEPTH = 8  # a tree that nests deeper is not read; Blender forbids true recursion


class Unreadable(ValueError):
    """A node set-up without a constant meaning; the message says which node."""


@dataclass(frozen=True, slots=True)
class Nothing:
    """Stands for an input that nothing feeds, not even a number of its own."""

    default_value: tuple = (0.0, 0.0, 0.0)


NOTHING = Nothing()


@dataclass(frozen=True, slots=True)
class Reached:
    """What feeds an input: the output ``socket`` of ``node``, or the unlinked input ``socket`` itself (node None).

    ``groups`` are the group nodes around it, outermost first: the way back out of a Group Input.
    """

    socket: object
    node: object | None
    groups: tuple

    @property
    def is_constant(self) -> bool:
        return self.node is None

    def feeding(self, name) -> Reached:
        """What feeds this node's input of that name, or of that position."""
        return follow(self.node.inputs[name], self.groups)


def follow(socket, groups=()) -> Reached:
    """Walk from an input back to the node that feeds it."""
    is_passed = False
    while True:
        link = live_link(socket)
        if link is None:
            # what a muted node or a reroute lets through is what is linked to it: its own numbers Cycles never has
            return Reached(NOTHING if is_passed and socket.type != "SHADER" else socket, None, groups)
        node = link.from_node
        is_passed = node.mute or node.type == "REROUTE"
        if node.mute:
            socket = _passed_through(link)
        elif node.type == "REROUTE":
            socket = node.inputs[0]
        elif node.type == "GROUP":
            socket, groups = _into_group(node, link.from_socket, groups)
        elif node.type == "GROUP_INPUT" and groups:
            socket, groups = _same_socket(groups[-1].inputs, link.from_socket), groups[:-1]
        else:
            return Reached(link.from_socket, node, groups)


def surface_shader(node_tree, output_type="OUTPUT_MATERIAL") -> Reached | None:
    """The shader that Cycles renders, or None where nothing is linked to the Surface."""
    return output_input(node_tree, "Surface", output_type)


def output_input(node_tree, name, output_type="OUTPUT_MATERIAL") -> Reached | None:
    """What is linked to an input of the output that Cycles renders, or None where nothing is."""
    outputs = [node for node in node_tree.nodes if node.type == output_type and node.target in {"ALL", "CYCLES"}]
    output = next((node for node in outputs if node.is_active_output), outputs[0] if outputs else None)
    if output is None:
        return None
    reached = follow(output.inputs[name])
    return None if reached.is_constant else reached


def own_mapping(node) -> tuple | None:
    """Location, rotation and scale of an image ``node``'s own Texture Mapping (3, 3), None where it does nothing."""
    mapping = node.texture_mapping
    if (mapping.mapping_x, mapping.mapping_y, mapping.mapping_z) != ("X", "Y", "Z") or mapping.mapping != "FLAT":
        raise Unreadable("a Texture Mapping of swapped axes")
    if mapping.use_min or mapping.use_max:
        raise Unreadable("a Texture Mapping with limits")
    numbers = tuple(mapping.translation), tuple(mapping.rotation), tuple(mapping.scale)
    if numbers == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)):
        return None
    return numbers


def constant(reached: Reached) -> float:
    """A number that does not vary over the surface; of a colour, which a muted node may let through, its luminance."""
    value = _constant_value(reached)
    return float(np.array(value[:3]) @ LUMINANCE) if hasattr(value, "__len__") else float(value)


def constant_colour(reached: Reached) -> np.ndarray:
    """A colour (3,) that does not vary over the surface; of a number, that grey."""
    value = _constant_value(reached)
    return np.array(value[:3], float) if hasattr(value, "__len__") else np.full(3, float(value))


def _constant_value(reached):
    if reached.is_constant:
        return reached.socket.default_value
    if reached.node.type in {"VALUE", "RGB"}:
        return reached.node.outputs[0].default_value
    raise Unreadable(f"{reached.node.bl_label} node")


def conductor_colour(node) -> np.ndarray | None:
    """What a Metallic ``node`` that has indices instead of a colour reflects head-on (3,); None of one with a colour.

    Born & Wolf, 14.2 (32): ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2).
    """
    if getattr(node, "fresnel_type", "F82") != "PHYSICAL_CONDUCTOR":
        return None
    if any(live_link(node.inputs[name]) for name in ("IOR", "Extinction")):
        raise Unreadable(f"{node.bl_label} node whose indices are linked")
    n, k = (np.array(node.inputs[name].default_value) for name in ("IOR", "Extinction"))
    return ((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2)


def constant_vector(mapping: Reached, name) -> tuple[float, float, float]:
    """An input of a Mapping node that does not vary."""
    if name not in mapping.node.inputs:  # a Vector mapping has no location
        return (0.0, 0.0, 0.0)
    reached = mapping.feeding(name)
    if not reached.is_constant:
        raise Unreadable(f"Mapping node whose {name} is linked")
    return tuple(reached.socket.default_value)


def live_link(socket):
    """The link that feeds an input, None where none does."""
    return next((link for link in socket.links if link.is_valid and not link.is_muted), None)


def _passed_through(link):
    for inner in link.from_node.internal_links:
        if inner.to_socket == link.from_socket:
            return inner.from_socket
    raise Unreadable(f"muted {link.from_node.bl_label} node")


def _into_group(node, from_socket, groups):
    if node.node_tree is None or len(groups) >= GROUP_DEPTH:
        raise Unreadable(f"group '{node.name}'")
    inner = [n for n in node.node_tree.nodes if n.type == "GROUP_OUTPUT"]
    output = next((n for n in inner if n.is_active_output), None)
    if output is None:
        raise Unreadable(f"group '{node.name}'")
    return _same_socket(output.inputs, from_socket), (*groups, node)


def _same_socket(sockets, wanted):
    return next(socket for socket in sockets if socket.identifier == wanted.identifier)
