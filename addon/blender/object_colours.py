"""What an Object Info node says of each object, as a colour that lies in its mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .mesh_colours import palette_uvs

WORD = 0xFFFFFFFF


@dataclass(frozen=True, slots=True)
class ObjectColours:
    """In place of UVs: the palette's texel of an output of Object Info, "Color", "Alpha" or "Random"."""

    output: str
    extends: bool = False  # no place is beyond the palette's edges

    def uvs_of(self, mesh, chosen, instance) -> np.ndarray:
        """UVs of chosen triangles (K,), float32 (K, 3, 2): those of the ``instance`` of the depsgraph that they are."""
        return palette_uvs(np.repeat([self.of(instance)], len(chosen), axis=0))

    def of(self, instance) -> np.ndarray:
        """The colour (3,), a grey of what is a number."""
        if self.output == "Random":
            return np.full(3, random_of(instance))
        colour = np.array(instance.object.color, float)
        return colour[:3] if self.output == "Color" else np.full(3, colour[3])


def random_of(instance) -> float:
    """The number of [0, 1] that Cycles takes for an object by its name; instances have one each."""
    number = instance.random_id & WORD if instance.is_instance else _mixed(_name_hash(instance.object.name))
    return number / WORD


def _name_hash(name):
    number = 0
    for byte in name.encode():
        number = (number * 37 + byte) & WORD
    return number


def _mixed(key):
    """Bob Jenkins's final() of lookup3.c over (key, 0), as Cycles' hash_uint2 is."""
    a = b = c = (0xDEADBEEF + (2 << 2) + 13) & WORD
    a = (a + key) & WORD
    for turns in ((14, 11, 25), (16, 4, 14)):
        c = ((c ^ b) - _turned(b, turns[0])) & WORD
        a = ((a ^ c) - _turned(c, turns[1])) & WORD
        b = ((b ^ a) - _turned(a, turns[2])) & WORD
    return ((c ^ b) - _turned(b, 24)) & WORD


def _turned(word, bits):
    return (word << bits | word >> (32 - bits)) & WORD
