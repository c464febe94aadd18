"""Smoothing of gathered light over texels: noise goes, what the light does stays.

Neighbouring texels see nearly the same light, so a few rays of each serve all. How far smoothing may go is decided by
the texels' own estimated noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .charts import Charts
from .emitters import LUMINANCE
from .kernel import clamp_outliers, smooth
from .receivers import Receivers
from .relative import scale_of
from .scene import Scene
from .texels import TexelMap
from .textures import textured_colours
from .workers import Workers

LARGEST_VARIANCE = 1e34  # whatever shines: the sum of some remains a float32
STEPS = (1, 2, 4, 8)  # texels between the taps of successive levels
KEPT = 16  # texels to every side of each, over which smoothing is made to keep the light,
MOST_KEPT = 0.5  # of what it left more or less, at the most
BAND = 256  # rows of the grid at once
POOL = 5  # receivers in a row that are neighbours, where there is no grid


@dataclass(frozen=True, slots=True)
class TexelGrid:
    """Which receiver each texel is.

    Attributes
    ----------
    receivers : int32 (height, width), -1 for none
    spacing : distance of neighbouring texels in space, the median [m]
    uvs : float32 (T, 3, 2) of the scene's triangles' corners, in texels; NaN without a place
    reflectance : float32 (N, 3) of the receivers
    shown : float32 (N,) how much of the surface looks each receiver up, relative to the mean
    """

    receivers: np.ndarray
    spacing: float
    uvs: np.ndarray
    reflectance: np.ndarray
    shown: np.ndarray


def texel_grid(scene: Scene, charts: Charts, texel_map: TexelMap, receivers: Receivers) -> TexelGrid:
    """The grid that a lightmap's receivers lie in."""
    grid = np.full((texel_map.height, texel_map.width), -1, np.int32)
    grid[texel_map.rows, texel_map.columns] = np.arange(len(texel_map))
    apart = np.concatenate([_apart(grid[row : row + BAND], receivers.positions) for row in range(0, len(grid), BAND)])
    spacing = float(np.median(apart)) if len(apart) else 1.0
    colours = textured_colours(scene, texel_map.triangles, texel_map.barycentrics, "reflectance", "reflectance_texture")
    return TexelGrid(grid, spacing, charts.uvs, np.clip(colours, 0, 1), texel_map.shown)


def _apart(rows, positions):
    """Distances of receivers that lie side by side in rows of the grid, but for those at one place."""
    beside = (rows[:, :-1] >= 0) & (rows[:, 1:] >= 0)
    left, right = positions[rows[:, :-1][beside]], positions[rows[:, 1:][beside]]
    apart = np.linalg.norm(right - left, axis=1).astype(np.float32)
    return apart[apart > 0]


def blurred(workers: Workers, grid: TexelGrid, receivers: Receivers, values):
    """Gathered light float32 (N, 3), averaged over the nearest texels of the same surface: float32 (N, 3)."""
    return smooth(workers, grid, receivers, values, np.zeros(len(values), np.float32), 1, False)[0]


def pooled(workers: Workers, grid: TexelGrid | None, receivers: Receivers, of_one_ray):
    """Relative variances (N,) of one ray, averaged over the nearest receivers of the same surface: (N,).

    A few replicates alone say little of one receiver's noise.
    """
    if grid is None:
        return of_one_ray if len(of_one_ray) < POOL else np.convolve(of_one_ray, np.full(POOL, 1 / POOL), "same")
    of_one_ray = np.minimum(of_one_ray, LARGEST_VARIANCE).astype(np.float32)
    return smooth(workers, grid, receivers, np.repeat(of_one_ray[:, None], 3, axis=1), of_one_ray, 1, False)[0][:, 0]


def smoothed(workers: Workers, grid: TexelGrid, receivers: Receivers, values, variances, near, taken):
    """Gathered light (N, 3) smoothed by its variances (N,): values float32 (N, 3), variance of luminance (N,).

    ``near`` (N, 3) is the light ``blurred``, ``taken`` (N,) how many rays each is of. What is left standing alone is
    clamped, which the variance does not tell.
    """
    variances = np.minimum(variances, LARGEST_VARIANCE).astype(np.float32)
    # pooled relative to the light there, as the noise of what is bright says nothing of the calm beside it
    scales = scale_of(near)
    relative = pooled(workers, grid, receivers, variances / scales**2 * taken) / taken
    noise = np.minimum(relative * scales**2, LARGEST_VARIANCE).astype(np.float32)
    del scales, relative
    smooth_values, left = values, noise
    for step in STEPS:
        smooth_values, left = smooth(workers, grid, receivers, smooth_values, left, step, True)
    # by their own noise: pooled, what is far off by chance is as certain as its neighbours
    smooth_values = clamp_outliers(workers, grid, receivers, smooth_values, variances)
    return kept(grid, values, smooth_values, np.sqrt(noise)), left


def kept(grid: TexelGrid, values, smooth_values, deviations):
    """Smoothed light (N, 3), scaled so that around every texel there is about as much as there was in ``values``.

    Most rays see less than the mean and few see much more. Smoothing that minds values takes these few for something
    else, and the light for less than it is, by the more the noisier it was: ``deviations`` (N,) say where to put it.
    What noise is common to both falls out of their difference. Charts that lie side by side share what they lost: calm
    ones get little of it.
    """
    luminance = (smooth_values @ LUMINANCE).astype(np.float32)
    given, noise = _around(grid, values @ LUMINANCE - luminance), np.maximum(_around(grid, deviations), deviations)
    given *= deviations / np.where(noise > 0, noise, 1)
    # what is dimmer than rounding beside what is bright has no share that means something
    given = np.clip(given, -MOST_KEPT * luminance, MOST_KEPT * luminance)
    return (1 + given / np.where(luminance > 0, luminance, 1))[:, None] * smooth_values


def _around(grid: TexelGrid, luminance):
    """Sums float32 (N,) of luminance (N,) over the square of texels around each receiver, KEPT to every side."""
    is_set = grid.receivers >= 0
    order = grid.receivers[is_set]
    image = np.zeros(is_set.shape)
    image[is_set] = luminance[order]
    for axis in (0, 1):
        until = np.insert(np.cumsum(image, axis), 0, 0.0, axis)
        at = np.arange(image.shape[axis])
        first, last = np.maximum(at - KEPT, 0), np.minimum(at + KEPT + 1, len(at))
        image = until.take(last, axis)
        image -= until.take(first, axis)
    sums = np.zeros(len(luminance), np.float32)
    sums[order] = image[is_set]
    return sums
