"""The direct solver: one dense system, for small scenes and as the reference of the others."""

from __future__ import annotations

import numpy as np

from .settings import SettingsError
from .solver import Solution, balance, flux_of, truncation_bound

DIRECT_LIMIT = 6000  # unknowns: the dense system takes 8 n^2 bytes in work


def solve_direct(form_factors, reflectance, emitted, areas) -> Solution:
    """(I - rho F) B = M by LU, channels of one reflectance together.

    The balance is that of the fluxes as rows shoot them, A_j F_ji B_j; with form factors that are reciprocal to their
    noise only it closes to that noise, and what is left open counts as unshot.

    Parameters
    ----------
    form_factors : (N, N); reflectance, emitted : (N, 3) [1], [W/m^2]; areas : (N,) [m^2]
    """
    form_factors = np.asarray(form_factors, np.float64)
    reflectance, emitted = (np.asarray(x, np.float64) for x in (reflectance, emitted))
    radiosity = np.empty_like(emitted)
    for channels in _alike(reflectance):
        system = -reflectance[:, channels[0], None] * form_factors
        system[np.diag_indices(len(emitted))] += 1.0
        radiosity[:, channels] = np.linalg.solve(system, emitted[:, channels])
    rest = emitted + reflectance * (form_factors @ radiosity) - radiosity
    first = flux_of(emitted, areas)
    residual = flux_of(rest, areas) / first if first > 0 else 0.0
    sums = form_factors.sum(axis=1)
    bound = truncation_bound(rest, reflectance, sums)
    energy = _energy(form_factors, sums, reflectance, emitted, areas, radiosity)
    return Solution(radiosity, (residual,), energy, 0, "direct", bound)


def _alike(reflectance):
    """Channels in groups of one reflectance: one factorisation serves a group."""
    groups = []
    for channel in range(reflectance.shape[1]):
        for group in groups:
            if (reflectance[:, channel] == reflectance[:, group[0]]).all():
                group.append(channel)
                break
        else:
            groups.append([channel])
    return groups


def _energy(form_factors, sums, reflectance, emitted, areas, radiosity):
    flux = areas[:, None] * radiosity
    arriving = form_factors.T @ flux
    rest = emitted + (reflectance * arriving - flux) / np.where(areas > 0, areas, 1.0)[:, None]
    return balance(emitted, arriving, rest, reflectance, areas, (flux * (1 - sums)[:, None]).sum())


def require_direct_size(unknowns: int) -> None:
    """Refuse a dense system that would not fit."""
    if unknowns > DIRECT_LIMIT:
        raise SettingsError(
            f"solver direct takes at most {DIRECT_LIMIT} unknowns and this scene has {unknowns}: "
            "use conjugate-gradient, progressive or stochastic, or a larger patch size"
        )
