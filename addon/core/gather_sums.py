"""What gather rays of receivers have seen so far, as little of it as an estimate and its error need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LARGEST_VARIANCE = 1e34  # whatever shines: the sum of some remains a float32
BLOCK = 1 << 16  # receivers whose estimates are made at once: in float64 all would take more memory than the sums do


@dataclass(frozen=True, slots=True)
class GatherSums:
    """Sums over rays, of receivers whose rays are R independent randomisations of one pattern: replicates.

    Attributes
    ----------
    light : float32 (N, 3) radiosity, over the rays of all replicates [W/m^2]
    luminances : float32 (N, R) its luminance, over each replicate's
    """

    light: np.ndarray
    luminances: np.ndarray

    def __len__(self) -> int:
        return len(self.light)

    def arrays(self) -> tuple:
        """In the kernel's order."""
        return self.light, self.luminances

    def means(self, taken):
        """Irradiance float32 (N, 3) where each replicate has so many rays, one number or (N,)."""
        rays = np.float32(self.luminances.shape[1]) * np.asarray(taken, np.float32)
        return self.light / rays.reshape(-1, 1)

    def variances(self, taken):
        """What the mean's luminance is uncertain by, by the replicates' spread: its variance float32 (N,)."""
        counts = np.broadcast_to(np.asarray(taken, np.float64), len(self))
        variances, replicates = np.empty(len(self), np.float32), self.luminances.shape[1]
        for first in range(0, len(self), BLOCK):
            block = slice(first, first + BLOCK)
            means = self.luminances[block] / counts[block, None]
            variances[block] = np.minimum(means.var(axis=1, ddof=1) / replicates, LARGEST_VARIANCE)
        return variances


def no_sums(count: int, replicates: int) -> GatherSums:
    """Those of ``count`` receivers before any ray."""
    return GatherSums(np.zeros((count, 3), np.float32), np.zeros((count, replicates), np.float32))
