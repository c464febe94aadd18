"""What every solver of the radiosity equation B = M + rho F B gives, and what it says of its own error.

All solvers take three channels at once and work on the residual r = M + rho F B - B, which is the radiosity that is not
shot yet. They stop when its flux, the sum of A |r| over sides and channels, is below a share of the flux that was
emitted, and state the flux balance alike: what was emitted is absorbed, escaped, or unshot, the signed sum of A r.
(Solvers that shoot add the unshot part to what they return: r is that of the radiosity less what is unshot.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .report import Energy


@dataclass(frozen=True, slots=True)
class Solution:
    """Radiosity of every side, and how the solver came to it.

    Attributes
    ----------
    radiosity : float64 (N, 3) B [W/m^2]
    residuals : flux of the residual after each step, relative to the emitted flux; of direct the last only
    energy : flux balance [W]
    rays : traced
    solver : which one ran
    error_bound : of the largest |B - B_k| that further steps could still bring [W/m^2]; inf where rho F is not known to
        contract. About the system as it was solved: it does not cover the form factors' own error
    standard_errors : float64 (N, 3) of the radiosities, by independent replicates [W/m^2], None where nothing is
        random; of so few replicates that a side's own says little, their mean square over many sides a lot
    """

    radiosity: np.ndarray
    residuals: tuple[float, ...]
    energy: Energy
    rays: int
    solver: str
    error_bound: float = np.inf
    standard_errors: np.ndarray | None = None

    def relative_standard_error(self, areas) -> float:
        """RMS of the standard errors over the scene, relative to the RMS radiosity; 0 where nothing is random."""
        if self.standard_errors is None:
            return 0.0
        noise, light = (float((areas[:, None] * x**2).sum()) for x in (self.standard_errors, self.radiosity))
        return (noise / light) ** 0.5 if light > 0 else 0.0


def flux_of(values, areas) -> float:
    """Sum of A |x| over sides and channels [W], of radiosities (N, 3)."""
    return float((areas[:, None] * np.abs(values)).sum())


def balance(emitted, arriving, rest, reflectance, areas, escaped) -> Energy:
    """The flux balance from what arrives (N, 3) [W], the residual (N, 3) [W/m^2] and what escaped [W]."""
    shot, unshot = float((areas[:, None] * emitted).sum()), float((areas[:, None] * rest).sum())
    return Energy(shot, float(((1 - reflectance) * arriving).sum()), float(escaped), unshot)


def truncation_bound(rest, reflectance, row_sums) -> float:
    """|B - B_k|_inf <= |r|_inf / (1 - max_i rho_i sum_j F_ij), the largest of the channels [W/m^2].

    ``rest`` (N, 3) is r, ``row_sums`` (N,) the sums of F; inf where a channel does not contract.
    (B - B_k = (I - rho F)^-1 r, and |(I - rho F)^-1|_inf <= 1 / (1 - |rho F|_inf).)
    """
    gains = (reflectance * np.asarray(row_sums)[:, None]).max(axis=0, initial=0.0)
    if (gains >= 1).any():
        return np.inf
    return float((np.abs(rest).max(axis=0, initial=0.0) / (1 - gains)).max(initial=0.0))
