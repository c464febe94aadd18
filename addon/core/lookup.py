"""What a lightmap shows at places in it: texels and their shares, bilinearly, as any viewer looks it up."""

from __future__ import annotations

import numpy as np


def bilinear(cells: np.ndarray, places: np.ndarray):
    """Receivers int64 (N, 4) and their shares float64 (N, 4), which sum to 1, of places (N, 2) in texels.

    ``cells`` int32 (H, W) is the receiver that each texel is, -1 for none: these take no part.
    """
    height, width = cells.shape
    low = np.floor(places - 0.5).astype(np.int64)
    beyond = places - 0.5 - low
    receivers, shares = np.empty((len(places), 4), np.int64), np.empty((len(places), 4))
    for corner, (row, column) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        cell = cells[np.clip(low[:, 1] + row, 0, height - 1), np.clip(low[:, 0] + column, 0, width - 1)]
        along = [beyond[:, axis] if step else 1 - beyond[:, axis] for axis, step in enumerate((column, row))]
        receivers[:, corner] = np.maximum(cell, 0)
        shares[:, corner] = np.where(cell >= 0, along[0] * along[1], 0.0)
    return receivers, shares / np.maximum(shares.sum(axis=1, keepdims=True), 1e-12)
