"""What the nodes between an image and a shader make of its colour, texel by texel.

The formulas are those of Cycles' nodes; tests hold each against what Cycles bakes.
"""

from __future__ import annotations

import numpy as np

from . import number_nodes
from .hsv import hsv_of, rgb_of
from .number_nodes import clamped, input_number
from .shader_nodes import Reached, Unreadable, constant
from .surfaces import Colour, pointwise

TABLE = 256  # entries of a ramp or a curve, as many as Cycles has
BLENDS = {
    "MIX": lambda a, b: b,
    "ADD": lambda a, b: a + b,
    "SUBTRACT": lambda a, b: a - b,
    "MULTIPLY": lambda a, b: a * b,
    "DIVIDE": lambda a, b: np.where(b != 0, a / np.where(b != 0, b, 1), a),
    "SCREEN": lambda a, b: 1 - (1 - a) * (1 - b),
    "OVERLAY": lambda a, b: np.where(a < 0.5, 2 * a * b, 1 - 2 * (1 - a) * (1 - b)),
    "SOFT_LIGHT": lambda a, b: a * ((1 - a) * b + 1 - (1 - a) * (1 - b)),
    "LINEAR_LIGHT": lambda a, b: a + 2 * b - 1,
    "DIFFERENCE": lambda a, b: np.abs(a - b),
    "EXCLUSION": lambda a, b: np.maximum(a + b - 2 * a * b, 0),
    "DARKEN": np.minimum,
    "LIGHTEN": np.maximum,
}

OBSERVER = (  # of x, y, z: (weight, (middle, width below, width above [nm]))
    ((1.056, (599.8, 37.9, 31.0)), (0.362, (442.0, 16.0, 26.7)), (-0.065, (501.1, 20.4, 26.2))),
    ((0.821, (568.8, 46.9, 40.5)), (0.286, (530.9, 16.3, 31.1))),
    ((1.217, (437.0, 11.8, 36.0)), (0.681, (459.0, 26.0, 13.8))),
)
REC709_OF_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def read_colour_node(reached: Reached, reading) -> Colour:
    """The colour that a node puts out; Unreadable where it, or one that feeds it, is not known.

    ``reading`` is the MaterialReading: its ``readable_colour`` and ``readable_number`` are asked for what feeds the
    node, its ``factor`` for numbers that it guesses where they are unreadable.
    """
    if reached.node.type not in READERS:
        raise Unreadable(f"{reached.node.bl_label} node")
    return READERS[reached.node.type](reached, reading)


def _mix(reached, reading):
    node = reached.node
    if node.type == "MIX_RGB":
        inputs, blend, clamps_factor, clamps = (0, 1, 2), node.blend_type, True, node.use_clamp
    elif node.data_type == "RGBA":
        inputs, blend, clamps_factor, clamps = (0, 6, 7), node.blend_type, node.clamp_factor, node.clamp_result
    elif node.data_type == "FLOAT":
        inputs, blend, clamps_factor, clamps = (0, 2, 3), "MIX", node.clamp_factor, False
    else:
        raise Unreadable(f"{node.bl_label} node of vectors")
    if blend not in BLENDS:
        raise Unreadable(f"{node.bl_label} node that blends by {blend.replace('_', ' ').lower()}")
    is_of_numbers = node.type == "MIX" and node.data_type == "FLOAT"

    def read(number):
        return (reading.readable_number if is_of_numbers else reading.readable_colour)(reached.feeding(number))

    def mixed(t, a, b):
        return a + (np.clip(t, 0, 1) if clamps_factor else t) * (BLENDS[blend](a, b) - a)

    factor = reading.factor(reached.feeding(inputs[0]))
    if factor.is_black:  # the other side need not be readable
        return clamped(read(inputs[1]), clamps)
    return clamped(pointwise(mixed, factor, read(inputs[1]), read(inputs[2])), clamps)


def _ramp(reached, reading):
    ramp = reached.node.color_ramp
    table = np.array([ramp.evaluate(x) for x in np.linspace(0, 1, TABLE)])
    table = np.repeat(table[:, 3:], 3, axis=1) if reached.socket.identifier == "Alpha" else table[:, :3]
    try:
        factor = reading.readable_number(reached.feeding(0))
    except Unreadable as error:
        reading.guess(f"a Color Ramp of its colours hangs on a {error}, which cannot be read: the ramp's mean is used")
        return Colour(table.mean(axis=0))
    if ramp.interpolation == "CONSTANT":
        return pointwise(lambda c: table[(np.clip(c[..., 0], 0, 1) * (TABLE - 1)).astype(int)], factor)
    return pointwise(lambda c: _looked_up(table.T, c), factor)


def _curves(reached, reading):
    mapping = reached.node.mapping
    mapping.initialize()
    combined = [mapping.evaluate(mapping.curves[3], x) for x in np.linspace(0, 1, TABLE)]
    tables = np.array([[mapping.evaluate(mapping.curves[k], x) for x in combined] for k in range(3)])
    goes_on = mapping.extend == "EXTRAPOLATED"

    def curved(c):
        # beyond the table as at its end
        below, above = np.minimum(c, 0), np.maximum(c - 1, 0)
        slopes = (tables[:, 1] - tables[:, 0]) * (TABLE - 1), (tables[:, -1] - tables[:, -2]) * (TABLE - 1)
        return _looked_up(tables, c) + goes_on * (below * slopes[0] + above * slopes[1])

    return _partly(curved, reached, reading)


def _looked_up(tables, colours):
    """Each channel (..., 3) by its table over [0, 1]."""
    at = np.linspace(0, 1, TABLE)
    return np.stack([np.interp(colours[..., k], at, tables[k]) for k in range(3)], axis=-1)


def _hue_saturation(reached, reading):
    hue, saturation, value = (input_number(reached, reading, k) for k in range(3))

    def changed(c, hue, saturation, value):
        h, s, v = hsv_of(c)
        h, s = (h + hue[..., 0] + 0.5) % 1.0, np.clip(s * saturation[..., 0], 0, 1)
        return rgb_of(h, s, v * value[..., 0])

    factor, colour = reading.factor(reached.feeding(3)), reading.readable_colour(reached.feeding(4))
    other = pointwise(changed, colour, hue, saturation, value)
    return pointwise(lambda t, a, b: np.maximum(a + t * (b - a), 0), factor, colour, other)


def blackbody(kelvin) -> np.ndarray:
    """Linear Rec.709 of a luminance of 1, (3,): Planck's law seen by the CIE's observer, between 800 and 12000 K.

    The observer's curves are the fits of Wyman, Sloan and Shirley 2013, "Simple analytic approximations to the CIE XYZ
    color matching functions", table 1: within 2 % of Cycles' node from a candle's 1900 K on, 10 % at 800 K, which
    only the curves' far end sees.
    """
    wavelengths = np.arange(360.0, 831.0, 5.0)  # [nm]
    temperature = min(max(float(kelvin), 800.0), 12000.0)  # the Blackbody node's own range
    light = wavelengths**-5 / np.expm1(1.4387769e7 / (wavelengths * temperature))  # c2 [nm K]
    xyz = np.array([light @ sum(w * _lobe(wavelengths, *at) for w, at in lobes) for lobes in OBSERVER])
    return np.maximum(REC709_OF_XYZ @ (xyz / xyz[1]), 0.0)


def _lobe(wavelengths, middle, below, above):
    return np.exp(-0.5 * ((wavelengths - middle) / np.where(wavelengths < middle, below, above)) ** 2)


def _gamma(reached, reading):
    def raised(c, exponent):
        return np.where(c > 0, np.power(np.where(c > 0, c, 1), exponent), c)

    return pointwise(raised, reading.readable_colour(reached.feeding(0)), input_number(reached, reading, 1))


def _invert(reached, reading):
    return _partly(lambda c: 1 - c, reached, reading)


def _partly(function, reached, reading):
    """A function of the second input, as far as the first one says."""
    factor, colour = reading.factor(reached.feeding(0)), reading.readable_colour(reached.feeding(1))
    return pointwise(lambda t, c: c + t * (function(c) - c), factor, colour)


def _brightness_contrast(reached, reading):
    def changed(c, bright, contrast):
        return np.maximum((1 + contrast) * c + bright - contrast / 2, 0)

    numbers = (input_number(reached, reading, k) for k in (1, 2))
    return pointwise(changed, reading.readable_colour(reached.feeding(0)), *numbers)


READERS = {
    **number_nodes.READERS,
    "MIX": _mix,
    "MIX_RGB": _mix,
    "VALTORGB": _ramp,
    "CURVE_RGB": _curves,
    "HUE_SAT": _hue_saturation,
    "GAMMA": _gamma,
    "INVERT": _invert,
    "BRIGHTCONTRAST": _brightness_contrast,
    "RGBTOBW": lambda reached, reading: reading.readable_number(reached.feeding(0)),
    "BLACKBODY": lambda reached, reading: Colour(blackbody(constant(reached.feeding(0)))),
}
