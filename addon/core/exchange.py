"""Exchange: A_i F_ij of every pair of sides, one value for both directions, from form factors estimated row by row.

Rows from rays are reciprocal to their noise only. What a solver gains from a reciprocal matrix: flux that leaves one
side arrives at the other, so that the balance closes; and A / rho - A F is positive definite, so that conjugate
gradients work at any reflectance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BLOCK = 512  # rows handled at a time
REPAIRS = 32  # sweeps of symmetric scaling, at most; what they leave of the closure is each side's own exchange
RELAXATION = 0.7  # of a sweep: the scale's modes are changed by 1 + the eigenvalues of F, which are -0.2 ... 1
REPAIRED = 1e-6  # relative: where scaling may end
WIDEST = 2.0  # what the repair multiplies or divides a side by, at most


@dataclass(frozen=True, slots=True)
class Exchange:
    """Which share of each side's flux goes where, as areas: A_i = sum_j pairs_ij + own_i + escapes_i.

    Attributes
    ----------
    pairs : (K, K), float32 or float64 as the rows were; pairs_ij = pairs_ji to the bit [m^2]
    sides : (K,) those that exchange anything, which ``pairs`` is of; backs of walls do not
    own : float64 (N,) what closes the balance of a side, with itself: rounding and the rest of the repair [m^2]
    escapes : float64 (N,) A_i (1 - sum_j F_ij), of the side's own row; 0 in a closed scene [m^2]
    """

    pairs: np.ndarray
    sides: np.ndarray
    own: np.ndarray
    escapes: np.ndarray

    def arriving(self, radiosity):
        """Flux that arrives at each side, A_i sum_j F_ij B_j, float64 (N, C) [W], from radiosity (N, C) [W/m^2]."""
        flux, seen = self.own[:, None] * radiosity, radiosity[self.sides]
        for rows in _blocks(len(self.sides)):
            flux[self.sides[rows]] += self.pairs[rows].astype(np.float64, copy=False) @ seen
        return flux

    def form_factors(self, areas):
        """Rows of form factors, float64 (N, N), reciprocal, each with the sum that its own rays found."""
        rows = np.zeros((len(self.own), len(self.own)))
        rows[np.ix_(self.sides, self.sides)] = self.pairs
        rows[np.diag_indices(len(rows))] += self.own
        rows /= np.where(areas > 0, areas, 1.0)[:, None]
        return rows


def exchange_of(form_factors, areas, is_closed: bool = False) -> Exchange:
    """The exchange of all sides from their rows of form factors (N, N), which are overwritten, and areas (N,) [m^2].

    Both rows know of a pair, and a larger side's knows it worse (equal rays: variance of A_i F_ij as A_i), so they are
    averaged by weights 1 / A: A_i A_j (F_ij + F_ji) / (A_i + A_j). The sums of rows, which each row of rays has without
    noise in a closed scene, are lost by that: a sum 1e-3 too large is an error of 11 % at rho = 0.99, and diverges at
    0.9999. They are repaired by symmetric scaling, c_i c_j pairs_ij; scaling rows alone would lose reciprocity. What
    the sweeps leave goes to the side's own exchange. Whatever its sign, B^T (A - A F) B = sum over pairs of
    pairs_ij (B_i - B_j)^2 + sum of escapes_i B_i^2 >= 0: the matrix stays positive, and a furnace exact.

    A scene that is closed has rows that sum to 1, so nothing has to say so, unless the rows are wrong by more than
    their rounding: then ``is_closed`` says that nothing escapes. In an open scene each row keeps what its own rays saw
    escape.
    """
    areas = np.asarray(areas, np.float64)
    rows = np.asarray(form_factors)
    sums = rows.sum(axis=1, dtype=np.float64)
    escapes = np.where(is_closed, 0.0, areas * np.clip(1 - sums, 0.0, 1.0))
    escapes[1 - sums < 64 * np.finfo(rows.dtype).eps] = 0.0  # rounding, which 1 / (1 - rho) would multiply
    sides = np.flatnonzero(rows.any(axis=0) | rows.any(axis=1))
    pairs = rows if len(sides) == len(rows) else rows[np.ix_(sides, sides)]
    _average(pairs, areas[sides])
    own = areas - escapes
    _repair(pairs, own[sides])
    own[sides] -= pairs.sum(axis=1, dtype=np.float64)
    return Exchange(pairs, sides, own, escapes)


def _average(rows, areas):
    for i in _blocks(len(rows)):
        for j in _blocks(i.stop):
            total = areas[i, None] + areas[None, j]
            weights = areas[i, None] * areas[None, j] / np.where(total > 0, total, 1.0)
            # one value for both places: the same operations on the same numbers would do, but this cannot fail
            pairs = (weights * (rows[i, j].astype(np.float64) + rows[j, i].T)).astype(rows.dtype)
            if i == j:
                pairs = np.tril(pairs) + np.tril(pairs, -1).T
            rows[i, j], rows[j, i] = pairs, pairs.T


def _repair(pairs, wanted):
    """Scale pairs to c_i c_j pairs_ij so that row i sums to ``wanted``, about (symmetric Sinkhorn & Knopp 1967)."""
    scale = np.ones(len(pairs))
    for _ in range(REPAIRS if len(pairs) else 0):
        # of the rows' own precision: what that leaves goes to the side's own exchange, in float64
        sums = (pairs @ scale.astype(pairs.dtype)).astype(np.float64)
        has_any = (sums > 0) & (wanted > 0)
        change = np.where(has_any, wanted / np.where(has_any, scale * sums, 1.0), 1.0)
        if np.abs(change - 1).max(initial=0.0) < REPAIRED:
            break
        scale = np.clip(scale * change**RELAXATION, 1 / WIDEST, WIDEST)
    if (scale == 1).all():
        return
    for i in _blocks(len(pairs)):
        pairs[i] *= (scale[i, None] * scale[None, :]).astype(pairs.dtype)


def _blocks(count):
    return [slice(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK)]
