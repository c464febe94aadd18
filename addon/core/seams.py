"""Seams: where a surface goes on and its place in the lightmap does not.

Both sides are looked up between texels of their own, whose noise differs and of which those on the rim stand for points
a little inside. What is seen is a line along the seam. The texels there are changed by as little as makes both sides
show the same, by least squares: Iwanicki 2013, "Lighting technology of The Last of Us".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .luminance import luminance_of

STAY = 0.05  # is what a texel's change costs beside a difference between the sides, both by the light there. So a
# thirtieth of differences is left; were it less, texels would swing to and fro along the seam
UNLIKE = 3.0  # times as much light on one side is no noise: a shadow ends there, and light that is right would go
LEAST_LIGHT = 1e-3  # of the median: what is darker is as easily changed
MOST_STEPS, PRECISE = 100, 1e-3  # of conjugate gradients: these end at so much of what there was to do


@dataclass(frozen=True, slots=True)
class Seams:
    """Points on seams, each looked up from both sides.

    Attributes
    ----------
    receivers : int32 (M, 8) four texels of one side and four of the other
    shares : float32 (M, 8) of them in what is seen, of the other side less than 0: they sum to 0
    """

    receivers: np.ndarray
    shares: np.ndarray

    def _alike(self, values):
        """The receivers and shares of those points whose two sides show about as much of values (N, 3)."""
        seen = self.shares * luminance_of(values[self.receivers])
        here, there = seen[:, :4].sum(axis=1), -seen[:, 4:].sum(axis=1)
        is_alike = (here <= UNLIKE * there) & (there <= UNLIKE * here)
        return self.receivers[is_alike], self.shares[is_alike]

    def stitched(self, values, poll: Callable[[], None] = lambda: None):
        """Irradiance (N, 3) with the least change after which both sides show nearly the same, float32 (N, 3).

        ``poll()`` is called between steps; what it raises ends the work.
        """
        receivers, shares = self._alike(values)
        if not len(receivers):
            return values
        texels, unknowns = np.unique(receivers, return_inverse=True)
        unknowns = unknowns.reshape(receivers.shape).astype(np.int32)
        light = luminance_of(values[texels])
        unit = float(np.median(light[light > 0])) if (light > 0).any() else 1.0
        before = (values[texels] / np.float64(unit)).astype(np.float32)
        light = np.maximum(luminance_of(before), LEAST_LIGHT)
        # twice the light may change by the root of two more: by as much, what is dark would hardly, and pull down
        easy = np.sqrt(light)
        typical = np.sqrt(np.einsum("mk,mk->m", np.abs(shares) / 2, light[unknowns]))
        jumps = np.einsum("mk,mkc->mc", shares, before[unknowns]) / typical[:, None]
        changes = _least_changes(unknowns, shares * easy[unknowns] / typical[:, None], jumps, len(texels), poll)
        out = values.copy()
        out[texels] = np.maximum(before + easy[:, None] * changes, 0.0) * np.float64(unit)
        return out


NO_SEAMS = Seams(np.zeros((0, 8), np.int32), np.zeros((0, 8), np.float32))


def _least_changes(unknowns, shares, jumps, count, poll):
    """Changes x (count, C) that minimise |shares x + jumps|^2 + STAY |x|^2, by conjugate gradients, all channels in
    one: shares (M, 8) of the unknowns (M, 8)."""
    order = np.argsort(unknowns, axis=None, kind="stable")
    rows = (order // unknowns.shape[1]).astype(np.int32)
    sorted_shares = shares.ravel()[order][:, None]
    starts = np.searchsorted(unknowns.ravel()[order], np.arange(count))

    def back(differences):
        return np.add.reduceat(sorted_shares * differences[rows], starts, axis=0)

    def product(x):
        return back(np.einsum("mk,mkc->mc", shares, x[unknowns])) + np.float32(STAY) * x

    diagonal = np.add.reduceat(sorted_shares**2, starts, axis=0) + np.float32(STAY)
    x, left = np.zeros((count, jumps.shape[1]), np.float32), -back(jumps)
    ahead = left / diagonal
    size = first = float((left * ahead).sum(dtype=np.float64))
    for _ in range(MOST_STEPS):
        poll()
        if size <= PRECISE**2 * first:
            break
        image = product(ahead)
        length = np.float32(size / float((ahead * image).sum(dtype=np.float64)))
        x += length * ahead
        left -= length * image
        scaled = left / diagonal
        size, before = float((left * scaled).sum(dtype=np.float64)), size
        ahead = scaled + np.float32(size / before) * ahead
    return x
