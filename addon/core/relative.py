"""What an error of irradiance is relative to."""

from __future__ import annotations

import numpy as np

from .luminance import luminance_of

DARK = 0.3  # of the median irradiance: what is added to a point's own before its error is called relative


def scale_of(irradiance):
    """The luminance, and a share of its median where that is dark: irradiance (N, 3) -> (N,) [W/m^2]."""
    return scale_of_luminance(luminance_of(irradiance))


def scale_of_luminance(luminance):
    """The same of luminance (N,)."""
    lit = luminance[luminance > 1e-4 * max(luminance.mean(), 1e-30)]
    return luminance + DARK * (np.median(lit) if len(lit) else 1.0)
