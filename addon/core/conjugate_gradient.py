"""Conjugate gradients on the symmetrised radiosity equation: some ten products at any reflectance.

(A / rho - A F) B = (A / rho) M has a symmetric, positive definite matrix, as A F is symmetric. Scaled from both sides
by S = (rho / A)^1/2 it becomes (I - S A F S) y = (A / rho)^1/2 M with B = S y (conjugate gradients: Hestenes & Stiefel
1952). Its eigenvalues lie close together, but for one a weakly coupled room, the mean light, which makes Jacobi slow.
"""

from __future__ import annotations

import numpy as np

from .exchange import Exchange
from .settings import SettingsError
from .solver import Solution, balance, flux_of, truncation_bound

EXCHANGE_LIMIT = 16000  # unknowns: the exchange takes 4 n^2 bytes, 1 GB
MOST_STEPS = 500  # far more than any scene that has a solution takes


def solve_conjugate_gradient(
    exchange: Exchange, reflectance, emitted, areas, unshot_limit, on_step=None, most_steps: int = MOST_STEPS
) -> Solution:
    """Iterate until the residual's flux is below ``unshot_limit`` of the emitted flux.

    Sides of reflectance 0 are known from the start, B = M: their S is 0, which takes them out of the system; what they
    send is part of the right-hand side. The channels are separate systems that share the products with A F.

    Parameters
    ----------
    reflectance, emitted : (N, 3) [1], [W/m^2]; areas : (N,) [m^2]
    """
    reflectance, emitted = (np.asarray(x, np.float64) for x in (reflectance, emitted))
    column = np.asarray(areas, np.float64)[:, None]
    is_known = (reflectance <= 0) | (column <= 0)
    scale = np.sqrt(np.where(is_known, 0.0, reflectance) / np.where(column > 0, column, 1.0))
    known = np.where(is_known, emitted, 0.0)

    def residual(radiosity):
        """r of the radiosity equation, and the flux that arrives."""
        arriving = exchange.arriving(radiosity)
        reflected = reflectance * arriving / np.where(column > 0, column, 1.0)
        return np.where(is_known, 0.0, emitted + reflected - radiosity), arriving

    # start with what is emitted, as every other solver does: r = rho F M
    radiosity = emitted.copy()
    rest, arriving = residual(radiosity)
    first = flux_of(emitted, areas)
    residuals = [flux_of(rest, areas) / first if first > 0 else 0.0]
    g = rest / np.where(scale > 0, scale, 1.0)  # residual of the scaled system: r = S g
    direction, norm = g.copy(), (g * g).sum(axis=0)
    while residuals[-1] > unshot_limit and len(residuals) <= most_steps:
        if on_step:
            on_step(min(len(residuals) / 20, 0.95))
        product = direction - scale * exchange.arriving(scale * direction)
        curvature = (direction * product).sum(axis=0)
        if (curvature[norm > 0] <= 0).any():
            break  # not positive: a closed scene that absorbs nothing has no solution
        length = norm / np.where(norm > 0, curvature, 1.0)
        radiosity = radiosity + length * scale * direction
        g = g - length * product
        norm, before = (g * g).sum(axis=0), norm
        direction = g + norm / np.where(before > 0, before, 1.0) * direction
        residuals.append(flux_of(scale * g, areas) / first)
    radiosity = np.where(is_known, known, radiosity)
    rest, arriving = residual(radiosity)
    if first > 0:
        residuals[-1] = flux_of(rest, areas) / first  # the true one, not the recurrence's
    sums = 1 - exchange.escapes / np.where(areas > 0, areas, 1.0)
    # own exchange below 0 counts by its size: the bound takes sums of |F|
    diagonal = exchange.own.copy()
    diagonal[exchange.sides] += np.diagonal(exchange.pairs)
    sums = sums + 2 * np.maximum(-diagonal, 0.0) / np.where(areas > 0, areas, 1.0)
    bound = truncation_bound(rest, reflectance, sums)
    escaped = (exchange.escapes[:, None] * radiosity).sum()
    energy = balance(emitted, arriving, rest, reflectance, areas, escaped)
    return Solution(radiosity, tuple(residuals), energy, 0, "conjugate-gradient", bound)


def require_exchange_size(unknowns: int) -> None:
    """Refuse an exchange that would not fit."""
    if unknowns > EXCHANGE_LIMIT:
        raise SettingsError(
            f"solver conjugate-gradient takes at most {EXCHANGE_LIMIT} unknowns and this scene has {unknowns}: "
            "use progressive or stochastic, or a larger patch size"
        )
