"""Seams: where a surface goes on and its place in the lightmap does not.

Both sides are looked up between texels of their own, whose noise differs and of which those on the rim stand for points
a little inside. What is seen is a line along the seam. The texels there are changed by as little as makes both sides
show the same, by least squares: Iwanicki 2013, "Lighting technology of The Last of Us".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .emitters import luminance_of

STAY = 0.05  # what a texel's change costs, beside a difference between the sides, both by the light there: with this
# a fortieth is left of differences; with less, texels swing to and fro along the seam
LEAST_LIGHT = 1e-3  # of the median: what is darker is as easily changed
MOST_STEPS, PRECISE = 100, 1e-4  # of conjugate gradients: these end at so much of what there was to do


@dataclass(frozen=True, slots=True)
class Seams:
    """Points on seams, each looked up from both sides.

    Attributes
    ----------
    receivers : int64 (M, 8) four texels of one side and four of the other
    shares : float64 (M, 8) of them in what is seen, of the other side less than 0: they sum to 0
    """

    receivers: np.ndarray
    shares: np.ndarray

    def jumps(self, values):
        """What is seen on one side more than on the other, of values (N, C): (M, C)."""
        return np.einsum("mk,mkc->mc", self.shares, values[self.receivers])

    def stitched(self, values):
        """Irradiance (N, 3) with the least change after which both sides show the same, float32 (N, 3)."""
        if not len(self.receivers):
            return values
        texels, unknowns = np.unique(self.receivers, return_inverse=True)
        unknowns = unknowns.reshape(self.receivers.shape)
        before = values[texels].astype(np.float64)
        light = luminance_of(before)
        least = LEAST_LIGHT * np.median(light[light > 0]) if (light > 0).any() else 1.0
        # twice the light may change by the root of two more: by as much, what is dark would hardly, and pull down
        easy = np.sqrt(np.maximum(light, least))
        typical = np.sqrt(np.maximum(np.einsum("mk,mk->m", np.abs(self.shares) / 2, light[unknowns]), least))
        shares = self.shares * easy[unknowns] / typical[:, None]
        changes = _least_changes(unknowns, shares, self.jumps(values) / typical[:, None], len(texels))
        out = values.copy()
        out[texels] = np.maximum(before + easy[:, None] * changes, 0.0)
        return out


NO_SEAMS = Seams(np.zeros((0, 8), np.int64), np.zeros((0, 8)))


def _least_changes(unknowns, shares, jumps, count):
    """Changes x (count, C) that minimise |shares x + jumps|^2 + STAY |x|^2, by conjugate gradients, all channels in
    one: shares (M, 8) of the unknowns (M, 8)."""
    order = np.argsort(unknowns, axis=None, kind="stable")
    rows = order // unknowns.shape[1]
    sorted_shares = shares.ravel()[order][:, None]
    starts = np.searchsorted(unknowns.ravel()[order], np.arange(count))

    def back(differences):
        return np.add.reduceat(sorted_shares * differences[rows], starts, axis=0)

    def product(x):
        return back(np.einsum("mk,mkc->mc", shares, x[unknowns])) + STAY * x

    diagonal = np.add.reduceat(sorted_shares**2, starts, axis=0) + STAY
    x, left = np.zeros((count, jumps.shape[1])), -back(jumps)
    ahead = left / diagonal
    size = first = float((left * ahead).sum())
    for _ in range(MOST_STEPS):
        if size <= PRECISE**2 * first:
            break
        image = product(ahead)
        length = size / float((ahead * image).sum())
        x += length * ahead
        left -= length * image
        scaled = left / diagonal
        size, before = float((left * scaled).sum()), size
        ahead = scaled + size / before * ahead
    return x
