"""Points of a grid along a Z-shaped curve, on which neighbours are near."""

from __future__ import annotations

import numpy as np


def z_order(*axes):
    """Place on the curve of points whose whole coordinates are ``axes``, each (N,): uint64 (N,) (Morton 1966)."""
    axes = [np.asarray(axis, np.uint64) for axis in axes]
    places = np.zeros(len(axes[0]), np.uint64)
    for bit in range(max(int(axis.max(initial=0)) for axis in axes).bit_length()):
        for k, axis in enumerate(axes):
            places |= (axis >> np.uint64(bit) & np.uint64(1)) << np.uint64(bit * len(axes) + k)
    return places
