"""Attributes of meshes as arrays: what Blender calls their numbers, of which type and how many they are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Kind(NamedTuple):
    """How foreach_get calls an attribute's values, how many there are of which type, and whether a mean of them means
    anything."""

    name: str
    width: int
    dtype: type
    is_linear: bool


KINDS_OF_VALUES = {
    "FLOAT": Kind("value", 1, np.float32, True),
    "FLOAT2": Kind("vector", 2, np.float32, True),
    "FLOAT_VECTOR": Kind("vector", 3, np.float32, True),
    "FLOAT_COLOR": Kind("color", 4, np.float32, True),
    "BYTE_COLOR": Kind("color", 4, np.float32, True),
    "INT": Kind("value", 1, np.int32, False),
    "INT8": Kind("value", 1, np.int32, False),
    "BOOLEAN": Kind("value", 1, bool, False),
}


def read_values(items, name, dtype, width=1) -> np.ndarray:
    """One property of all ``items`` of a collection: (N,), or (N, width) of several numbers each."""
    values = np.empty(len(items) * width, dtype)
    items.foreach_get(name, values)
    return values if width == 1 else values.reshape(-1, width)
