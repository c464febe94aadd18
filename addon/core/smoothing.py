"""Smoothing of gathered light over texels: noise goes, what the light does stays.

Neighbouring texels see nearly the same light, so a few rays of each serve all. How far smoothing may go is decided by
the texels' own estimated noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .charts import Charts
from .gather_sums import LARGEST_VARIANCE
from .kernel import clamp_outliers, smooth
from .luminance import luminance_of
from .receivers import Receivers
from .scene import Scene
from .seams import NO_SEAMS, Seams
from .texels import TexelMap
from .textures import scattered_shares
from .workers import Workers

STEPS = (1, 2, 4, 8)  # texels between the taps of successive levels
KEPT = 16  # texels to every side of each, over which smoothing is made to keep the light,
MOST_KEPT = 0.5  # of what it left more or less, at the most
BAND = 256  # rows of the grid at once


@dataclass(frozen=True, slots=True)
class TexelGrid:
    """Which receiver each texel is.

    Attributes
    ----------
    receivers : int32 (height, width), -1 for none
    spacing : distance of neighbouring texels in space, the median [m]
    uvs : float32 (T, 3, 2) of the scene's triangles' corners, in texels; NaN without a place
    reflectance : float32 (N, 3) of the receivers
    translucence : float32 (N, 3) of the receivers, None where it is 0 everywhere
    shown : float32 (N,) how much of the surface looks each receiver up, relative to the mean
    seams : over which the surface goes on
    """

    is_image: ClassVar[bool] = True
    receivers: np.ndarray
    spacing: float
    uvs: np.ndarray
    reflectance: np.ndarray
    translucence: np.ndarray | None
    shown: np.ndarray
    seams: Seams = NO_SEAMS

    @property
    def value_count(self) -> int:
        """How many values are stored."""
        return len(self.shown)

    def part(self, chosen) -> TexelGrid:
        """The same of some of the receivers (M,), without seams."""
        places = np.full(len(self.shown) + 1, -1, np.int32)  # of none, -1, the last
        places[chosen] = np.arange(len(chosen))
        shown = self.shown[chosen] / max(self.shown[chosen].mean(), 1e-30)
        translucence = None if self.translucence is None else self.translucence[chosen]
        cells = places[self.receivers]
        return TexelGrid(cells, self.spacing, self.uvs, self.reflectance[chosen], translucence, shown)

    def stored(self, receiver_values):
        """Values per receiver (N, C) as they are stored: each texel has its own."""
        return receiver_values

    def stitched(self, values, poll=lambda: None):
        """Irradiance (N, 3) as it is shown: the same on both sides of seams; ``poll()`` is called between steps."""
        return self.seams.stitched(values, poll)

    def members(self, chosen):
        """Receivers of chosen values (M,), where each value's start among them (M,), and their shares in it (M,)."""
        return chosen, np.arange(len(chosen)), np.ones(len(chosen))

    def blurred(self, workers: Workers, receivers: Receivers, values):
        """Gathered light float32 (N, 3), averaged over the nearest texels of the same surface: float32 (N, 3)."""
        return smooth(workers, self, receivers, values, np.zeros(len(values), np.float32), 1, False)[0]

    def pooled(self, workers: Workers, receivers: Receivers, of_one_ray):
        """Relative variances (N,) of one ray, averaged over the nearest receivers of the same surface: (N,).

        A few replicates alone say little of one receiver's noise.
        """
        of_one_ray = np.minimum(of_one_ray, LARGEST_VARIANCE).astype(np.float32)
        in_channels = np.repeat(of_one_ray[:, None], 3, axis=1)
        return smooth(workers, self, receivers, in_channels, of_one_ray, 1, False)[0][:, 0]

    def smoothed(self, workers: Workers, receivers: Receivers, values, variances, scales, taken):
        """Gathered light (N, 3) smoothed by its variances (N,): values float32 (N, 3), variance of luminance (N,).

        ``scales`` (N,) are those of the light ``blurred``, ``taken`` (N,) how many rays each is of. What is left
        standing alone is clamped, which the variance does not tell.
        """
        # pooled relative to the light there, as the noise of what is bright says nothing of the calm beside it
        relative = self.pooled(workers, receivers, variances / np.square(scales, dtype=np.float64) * taken) / taken
        noise = np.minimum(relative * np.square(scales, dtype=np.float64), LARGEST_VARIANCE).astype(np.float32)
        del relative
        before, left = luminance_of(values), noise
        for step in STEPS:
            values, left = smooth(workers, self, receivers, values, left, step, True)
        # by their own noise: pooled, what is far off by chance is as certain as its neighbours
        values = clamp_outliers(workers, self, receivers, values, variances)
        values *= restoring(self, before, luminance_of(values), np.sqrt(noise))[:, None]
        return values, left


def texel_grid(scene: Scene, charts: Charts, texel_map: TexelMap, receivers: Receivers) -> TexelGrid:
    """The grid that a lightmap's receivers lie in."""
    cells = texel_map.cells
    apart = np.concatenate([_apart(cells[row : row + BAND], receivers.positions) for row in range(0, len(cells), BAND)])
    spacing = float(np.median(apart)) if len(apart) else 1.0
    reflectance, translucence = scattered_shares(scene, texel_map.triangles, texel_map.barycentrics)
    if translucence is not None and not translucence.any():
        translucence = None
    return TexelGrid(cells, spacing, charts.uvs, reflectance, translucence, texel_map.shown)


def _apart(rows, positions):
    """Distances of receivers that lie side by side in rows of the grid, but for those at one place."""
    beside = (rows[:, :-1] >= 0) & (rows[:, 1:] >= 0)
    left, right = positions[rows[:, :-1][beside]], positions[rows[:, 1:][beside]]
    apart = np.linalg.norm(right - left, axis=1).astype(np.float32)
    return apart[apart > 0]


def restoring(grid: TexelGrid, before, luminance, deviations):
    """What smoothed luminance (N,) is to be multiplied with (N,), so that around every texel is as much as ``before``.

    Most rays see less than the mean and few see much more. Smoothing that minds values takes these few for something
    else, and the light for less than it is, by the more the noisier it was: ``deviations`` (N,) say where to put it.
    What noise is common to both falls out of their difference. Charts that lie side by side share what they lost: calm
    ones get little of it.
    """
    given, shares = sums_around(grid, before - luminance), np.maximum(sums_around(grid, deviations), deviations)
    np.divide(deviations, shares, out=shares, where=shares > 0)
    given *= shares
    # what is dimmer than rounding beside what is bright has no share that means something
    most = MOST_KEPT * luminance
    np.clip(given, -most, most, out=given)
    np.divide(given, luminance, out=given, where=luminance > 0)
    return 1 + given


def sums_around(grid: TexelGrid, luminance):
    """Sums float32 (N,) of luminance (N,) over the square of texels around each receiver, KEPT to every side."""
    sums, height = np.zeros(len(luminance), np.float32), len(grid.receivers)
    for top in range(0, height if len(sums) else 0, BAND):
        band = slice(top, min(top + BAND, height))
        above, below = min(KEPT, top), min(KEPT, height - band.stop)
        cells = grid.receivers[top - above : band.stop + below]
        image = np.where(cells >= 0, luminance[cells], 0.0)
        for axis in (0, 1):
            image = _over_window(image, axis)
        rows, image = grid.receivers[band], image[above : len(image) - below]
        sums[rows[rows >= 0]] = image[rows >= 0]
    return sums


def _over_window(image, axis):
    """Sums float64 over each pixel of an image and the KEPT to either side of it, along an axis."""
    until = np.insert(np.cumsum(image, axis, np.float64), 0, 0.0, axis)
    at = np.arange(image.shape[axis])
    first, last = np.maximum(at - KEPT, 0), np.minimum(at + KEPT + 1, len(at))
    sums = until.take(last, axis)
    sums -= until.take(first, axis)
    return sums
