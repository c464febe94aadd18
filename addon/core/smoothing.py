"""Smoothing of gathered light over texels: noise goes, what the light does stays, and the bias is measured.

Neighbouring texels see nearly the same light, so a few rays of each serve all. How far smoothing may go is decided by the
texels' own estimated noise; how wrong it makes them is estimated from two halves of the rays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .emitters import LUMINANCE
from .kernel import smooth
from .receivers import Receivers
from .texels import TexelMap
from .workers import Workers

STEPS = (1, 2, 4)  # texels between the taps of successive levels


@dataclass(frozen=True, slots=True)
class TexelGrid:
    """Which receiver each texel is.

    Attributes
    ----------
    receivers : int32 (height, width), -1 for none
    spacing : distance of neighbouring texels in space, the median [m]
    """

    receivers: np.ndarray
    spacing: float


def texel_grid(texel_map: TexelMap, receivers: Receivers) -> TexelGrid:
    """The grid that a lightmap's receivers lie in."""
    grid = np.full((texel_map.height, texel_map.width), -1, np.int32)
    grid[texel_map.rows, texel_map.columns] = np.arange(len(texel_map))
    beside = (np.diff(texel_map.rows) == 0) & (np.diff(texel_map.columns) == 1)
    apart = np.linalg.norm(np.diff(receivers.positions, axis=0)[beside], axis=1)
    apart = apart[apart > 0]
    return TexelGrid(grid, float(np.median(apart)) if len(apart) else 1.0)


@dataclass(frozen=True, slots=True)
class Smoothed:
    """Gathered light after smoothing.

    Attributes
    ----------
    values : float32 (N, 3) [W/m^2]
    variances : float32 (N,) of their luminance, from noise alone
    squared_errors : float64 (N,) of the luminance, bias included: each alone is noise, their mean is the mean square error
    """

    values: np.ndarray
    variances: np.ndarray
    squared_errors: np.ndarray


def smoothed(workers: Workers, grid: TexelGrid, receivers: Receivers, means) -> Smoothed:
    """Smooth replicate means (N, R, 3) of gathered light.

    The luminance of the first half of the replicates goes through the same weights; what it differs from the second half,
    less the noise of that half, is its error, and of that error the noise would be half with all replicates.
    """
    replicates = means.shape[1]
    luminance = means @ LUMINANCE
    first, second = luminance[:, : replicates // 2].mean(axis=1), luminance[:, replicates // 2 :].mean(axis=1)
    variances = (luminance.var(axis=1, ddof=1) / replicates).astype(np.float32)
    half_variances = 2.0 * variances

    # four replicates alone say little of one texel's noise
    pooled, _ = smooth(workers, grid, receivers, np.repeat(variances[:, None], 4, axis=1), variances, 1, False)
    noise = np.ascontiguousarray(pooled[:, 0])
    values = np.concatenate([means.mean(axis=1), first[:, None]], axis=1).astype(np.float32)
    for step in STEPS:
        values, noise = smooth(workers, grid, receivers, values, noise, step, True)
    squared_errors = (values[:, 3] - second) ** 2 - half_variances - noise
    return Smoothed(np.ascontiguousarray(values[:, :3]), noise, squared_errors)
