"""What a denoiser makes of a bake's light, taken as far as measured probes say that it is nearer to the truth.

It knows what light looks like, not what is there: where noise and detail look alike it is wrong, and does not say how
wrong. So the two estimates are mixed by how far they are apart, for the noise that is stated there, in shares by least
squares at the probes: apart by no more than the noise, the denoiser is right; by much more, it has lost a detail.
"""

from __future__ import annotations

import numpy as np

from .gaps import fill_gaps
from .luminance import luminance_of
from .probes import Probes
from .relative import scale_of
from .smoothing import TexelGrid

DOUBTS = 8  # groups by how far the estimates are apart for their noise, of as many probes each,
LEAST_PROBES = 128  # and of no fewer; where there are twice as many, each is parted again by the noise itself
LEAST_NOISE = 1e-12  # as a relative variance: a division by 0 less
NEEDED = 0.125  # of the target: where less error is left, a filter over the whole image is time without use


def needs_denoising(rms, error) -> bool:
    """Whether light of relative error ``rms`` is to be denoised for the target ``error``."""
    return rms > NEEDED * error


def denoised(denoise, grid: TexelGrid, values, noise, direct, gathered, pooled, probes: Probes):
    """Irradiance ``values`` (N, 3) moved towards what ``denoise`` makes of raw direct plus ``gathered`` light (N, 3).

    Parameters
    ----------
    denoise : image float32 (H, W, 3) -> the same without noise, or None
    noise : float32 (N,) of ``values``, as a variance relative to their scale
    pooled : averages (N,) over neighbours: single receivers' noise is known too badly to go by
    """
    is_set = grid.receivers >= 0
    image = np.zeros((*is_set.shape, 3), np.float32)
    image[is_set] = (direct + gathered)[grid.receivers[is_set]]
    fill_gaps(image, is_set)
    result = denoise(image)
    if result is None:
        return values
    del image
    other = np.empty_like(gathered)
    other[grid.receivers[is_set]] = result[is_set]
    del result
    # where there is no gathered light, to the bit, there is none
    is_usable = np.isfinite(other) & (values != direct)
    other = np.where(is_usable, np.maximum(other, 0), values)
    return mixed(values, other, noise, pooled, probes)


def mixed(first, second, noise, pooled, probes: Probes):
    """Two estimates (N, 3) of irradiance, mixed so that the error is least at the probes: float32 (N, 3).

    ``noise`` (N,) and ``pooled`` as above.
    """
    scale, chosen = scale_of(first), probes.receivers
    apart = luminance_of(second - first) / scale
    noise = pooled(noise)
    count = max(1, min(DOUBTS, len(chosen) // LEAST_PROBES))
    group = _quantile_groups(pooled(apart**2) / np.maximum(noise, LEAST_NOISE), chosen, count)
    if len(chosen) >= 2 * count * LEAST_PROBES:
        group, count = 2 * group + _quantile_groups(noise, chosen, 2), 2 * count
    # one wrong point counts as one, however wrong
    wanted = np.clip((probes.measured.luminance - luminance_of(first[chosen])) / scale[chosen], -1, 1)
    moved = apart[chosen].astype(np.float64)
    along = np.bincount(group[chosen], wanted * moved, count)
    shares = np.clip(along / np.maximum(np.bincount(group[chosen], moved**2, count), 1e-30), 0, 1)
    return first + shares.astype(np.float32)[group, None] * (second - first)


def _quantile_groups(values, chosen, count):
    """Which of ``count`` groups each value (N,) is in, as many of the ``chosen`` in each: int8 (N,)."""
    bounds = np.quantile(values[chosen], np.linspace(0, 1, count + 1)[1:-1])
    return np.searchsorted(bounds, values).astype(np.int8)
