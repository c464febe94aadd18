"""Points of a grid along a Z-shaped curve, on which neighbours are near."""

from __future__ import annotations

import numpy as np


def z_order(*axes):
    """Place on the curve of points with whole coordinates ``axes`` from 0 on, each (N,): uint64 (N,) (Morton 1966).

    Tables of as many numbers as the largest coordinate are made for it.
    """
    places = np.zeros(len(axes[0]), np.uint64)
    for k, axis in enumerate(axes):
        places |= _spread(int(axis.max(initial=0)) + 1, len(axes), k)[axis]
    return places


def _spread(count, step, first):
    """Numbers 0 .. count - 1 whose bits stand ``step`` apart from the ``first`` on: uint64 (count,)."""
    numbers, spread = np.arange(count, dtype=np.uint64), np.zeros(count, np.uint64)
    for bit in range((count - 1).bit_length()):
        spread |= (numbers >> np.uint64(bit) & np.uint64(1)) << np.uint64(bit * step + first)
    return spread
