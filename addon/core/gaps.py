"""Fill the texels between charts, so that neither a filter nor a mipmap sees black there."""

from __future__ import annotations

import numpy as np

RINGS = 2  # around the charts that are filled by the mean of their neighbours; the rest coarse to fine
NEIGHBOURS = tuple((row, column) for row in range(3) for column in range(3) if (row, column) != (1, 1))


def fill_gaps(pixels, is_set) -> None:
    """Give each texel of ``pixels`` (H, W, 3) that is not set, bool (H, W), a value of those around; in place."""
    for _ in range(RINGS):
        is_set = _dilate(pixels, is_set)
    _fill(pixels, is_set)


def _dilate(pixels, is_set):
    """Set empty texels beside set ones to the mean of these, of eight neighbours; what is set now."""
    height, width = is_set.shape
    padded = np.pad(is_set, 1)
    near = np.zeros_like(is_set)
    for row, column in NEIGHBOURS:
        near |= padded[row : row + height, column : column + width]
    rows, columns = np.nonzero(near & ~is_set)
    sums, counts = np.zeros((len(rows), 3)), np.zeros(len(rows))
    for row, column in NEIGHBOURS:
        counted = padded[rows + row, columns + column]
        beside = np.clip(rows + row - 1, 0, height - 1), np.clip(columns + column - 1, 0, width - 1)
        sums += np.where(counted[:, None], pixels[beside], 0.0)
        counts += counted
    pixels[rows, columns] = sums / counts[:, None]
    is_set = is_set.copy()
    is_set[rows, columns] = True
    return is_set


def _fill(pixels, is_set):
    """Push-pull: the mean of what is set at half the size fills what is not, from coarse to fine; in place."""
    if is_set.all() or not is_set.any():
        return
    height, width = is_set.shape
    edge = ((0, height % 2), (0, width % 2))
    weights = np.pad(is_set, edge).astype(np.float32)
    sums = _halved(np.pad(pixels, (*edge, (0, 0))) * weights[..., None])
    counts = _halved(weights)
    coarse = sums / np.maximum(counts, 1)[..., None]
    _fill(coarse, counts > 0)
    rows, columns = np.nonzero(~is_set)
    pixels[rows, columns] = coarse[rows // 2, columns // 2]


def _halved(image):
    """Sums over 2 x 2 texels."""
    return image[::2, ::2] + image[1::2, ::2] + image[::2, 1::2] + image[1::2, 1::2]
