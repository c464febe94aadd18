"""What the nodes between an image and a shader make of its channels, as numbers and vectors, texel by texel.

The formulas are those of Cycles' nodes; tests hold each against what Cycles bakes.
"""

from __future__ import annotations

import numpy as np

from .hsv import hsv_of, rgb_of
from .shader_nodes import Unreadable
from .surfaces import Colour, pointwise

LEAST = np.finfo(np.float32).eps


def _divided(a, b):
    return np.where(b != 0, a / np.where(b != 0, b, 1), 0)


def _power(a, b):
    """0 of what is below 0, but for whole exponents."""
    sign = np.where((a < 0) & (b % 2 != 0), -1, 1)
    return np.where((a >= 0) | (b == np.rint(b)), sign * np.power(np.abs(a), b), 0)


def _wrapped(a, most, least):
    return np.where(most != least, a - (most - least) * np.floor(_divided(a - least, most - least)), least)


def _ping_pong(a, b):
    turn = _divided(a - b, 2 * b)
    return np.where(b != 0, np.abs((turn - np.floor(turn)) * b * 2 - b), 0)


# how many of a node's inputs each takes, and what it makes of them
MATH = {
    "ADD": (2, np.add),
    "SUBTRACT": (2, np.subtract),
    "MULTIPLY": (2, np.multiply),
    "DIVIDE": (2, _divided),
    "MULTIPLY_ADD": (3, lambda a, b, c: a * b + c),
    "POWER": (2, _power),
    "SQRT": (1, lambda a: np.sqrt(np.maximum(a, 0))),
    "EXPONENT": (1, np.exp),
    "ABSOLUTE": (1, np.abs),
    "MINIMUM": (2, np.minimum),
    "MAXIMUM": (2, np.maximum),
    "LESS_THAN": (2, lambda a, b: 1.0 * (a < b)),
    "GREATER_THAN": (2, lambda a, b: 1.0 * (a > b)),
    "SIGN": (1, np.sign),
    "COMPARE": (3, lambda a, b, c: 1.0 * (np.abs(a - b) <= np.maximum(c, LEAST))),
    "ROUND": (1, lambda a: np.floor(a + 0.5)),
    "FLOOR": (1, np.floor),
    "CEIL": (1, np.ceil),
    "TRUNC": (1, np.trunc),
    "FRACT": (1, lambda a: a - np.floor(a)),
    "MODULO": (2, lambda a, b: np.where(b != 0, np.fmod(a, np.where(b != 0, b, 1)), 0)),
    "FLOORED_MODULO": (2, lambda a, b: a - np.floor(_divided(a, b)) * b),
    "WRAP": (3, _wrapped),
    "SNAP": (2, lambda a, b: np.floor(_divided(a, b)) * b),
    "PINGPONG": (2, _ping_pong),
    "SINE": (1, np.sin),
    "COSINE": (1, np.cos),
}
VECTORS = {
    **{name: MATH[name] for name in ("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "MINIMUM", "MAXIMUM")},
    **{name: MATH[name] for name in ("FLOOR", "CEIL", "MODULO", "WRAP", "SNAP", "SINE", "COSINE", "ABSOLUTE")},
    "FRACTION": MATH["FRACT"],
}


def clamped(colour: Colour, clamps=True) -> Colour:
    """Clipped to [0, 1], where a node says so."""
    return pointwise(lambda c: np.clip(c, 0, 1), colour) if clamps else colour


def input_number(reached, reading, key) -> Colour:
    """An input of a node that is a number; what its field says where it is linked to what cannot be read."""
    return reading.factor(reached.feeding(key), reached.node.inputs[key].default_value)


def _math(reached, reading):
    node = reached.node
    if node.operation not in MATH:
        raise Unreadable(f"{node.bl_label} node ({node.operation.replace('_', ' ').lower()})")
    count, function = MATH[node.operation]
    inputs = [reading.readable_number(reached.feeding(k)) for k in range(count)]
    return clamped(pointwise(function, *inputs), node.use_clamp)


def _vector_math(reached, reading):
    node = reached.node
    if node.operation == "SCALE":
        vector, scale = reading.readable_colour(reached.feeding(0)), reading.readable_number(reached.feeding("Scale"))
        return vector.times(scale)
    if node.operation not in VECTORS:
        raise Unreadable(f"{node.bl_label} node ({node.operation.replace('_', ' ').lower()})")
    count, function = VECTORS[node.operation]
    return pointwise(function, *(reading.readable_colour(reached.feeding(k)) for k in range(count)))


def _map_range(reached, reading):
    node = reached.node
    if node.data_type != "FLOAT" or node.interpolation_type != "LINEAR":
        raise Unreadable(f"{node.bl_label} node ({node.interpolation_type.lower()}, {node.data_type.lower()})")

    def mapped(value, from_min, from_max, to_min, to_max):
        found = to_min + _divided(value - from_min, from_max - from_min) * (to_max - to_min)
        return np.clip(found, np.minimum(to_min, to_max), np.maximum(to_min, to_max)) if node.clamp else found

    return pointwise(mapped, *(reading.readable_number(reached.feeding(k)) for k in range(5)))


def _clamp(reached, reading):
    def within(value, least, most):
        if reached.node.clamp_type == "RANGE":
            least, most = np.minimum(least, most), np.maximum(least, most)
        return np.minimum(np.maximum(value, least), most)

    return pointwise(within, *(reading.readable_number(reached.feeding(k)) for k in range(3)))


def _separate(reached, reading):
    """One of three numbers of a colour or vector, as a grey."""
    place = [output.identifier for output in reached.node.outputs].index(reached.socket.identifier)
    mode = getattr(reached.node, "mode", "RGB")
    if mode == "HSL":
        raise Unreadable(f"{reached.node.bl_label} node by HSL")

    def one_of(c):
        parts = np.moveaxis(c, -1, 0) if mode == "RGB" else hsv_of(c)
        return np.repeat(parts[place][..., None], 3, axis=-1)

    return pointwise(one_of, reading.readable_colour(reached.feeding(0)))


def _combine(reached, reading):
    mode = getattr(reached.node, "mode", "RGB")
    if mode == "HSL":
        raise Unreadable(f"{reached.node.bl_label} node by HSL")

    def joined(*greys):
        parts = [each[..., 0] for each in greys]
        return np.stack(parts, axis=-1) if mode == "RGB" else rgb_of(*parts)

    return pointwise(joined, *(reading.readable_number(reached.feeding(k)) for k in range(3)))


READERS = {
    "MATH": _math,
    "VECT_MATH": _vector_math,
    "MAP_RANGE": _map_range,
    "CLAMP": _clamp,
    **dict.fromkeys(("SEPARATE_COLOR", "SEPRGB", "SEPXYZ"), _separate),
    **dict.fromkeys(("COMBINE_COLOR", "COMBRGB", "COMBXYZ"), _combine),
}
