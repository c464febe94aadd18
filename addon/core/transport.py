"""Transport: form factors between patch sides, by hemicube or by Monte Carlo, behind one interface.

F[i, j] is the share of the power leaving side i that lands on side j; a row sums to 1 less what escapes.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from .kernel import KernelScene


@dataclass(frozen=True, slots=True)
class MonteCarloFormFactors:
    """Cosine rays, stratified over position and direction together."""

    kernel: KernelScene
    rays: int
    seed: int

    def rows(self, sides, on_step=None):
        """Form factors from sides (K,) to all sides, float32 (K, 2 P)."""
        return self.kernel.form_factors_monte_carlo(sides, self.rays, self.seed, on_step)

    @property
    def rays_per_row(self) -> int:
        """Rays that one row costs."""
        return self.rays

    @property
    def equal_rays_per_row(self) -> int:
        """As many rays as stand for equal shares of the row and tell as much where nothing is hit."""
        return self.rays


@dataclass(frozen=True, slots=True)
class HemicubeFormFactors:
    """Hemicubes at several positions of a patch, each turned by an angle of its own, delta factors normalised."""

    kernel: KernelScene
    resolution: int
    positions: int
    seed: int

    def rows(self, sides, on_step=None):
        """Form factors from sides (K,) to all sides, float32 (K, 2 P)."""
        return self.kernel.form_factors_hemicube(sides, self.resolution, self.positions, self.seed, on_step)

    @property
    def rays_per_row(self) -> int:
        """Rays that one row costs."""
        return 3 * self.resolution**2 * self.positions

    @property
    def equal_rays_per_row(self) -> int:
        """As many rays as stand for equal shares of the row and tell as much where nothing is hit.

        A pixel in the middle of the top stands for 4 / (pi resolution^2) [Cohen & Greenberg 1985, eq. 12].
        """
        return max(1, int(np.pi / 4 * self.resolution**2)) * self.positions


# ---- how wrong they may be ----

REPLICATES = 16
STUDENT_99 = 2.947  # two-sided 99 % quantile of Student's t with 15 degrees of freedom
RULE_OF_THREE = 3.0  # nothing in N rays: the share is below 3 / N with 95 % (Hanley & Lippman-Hand 1983)


@dataclass(frozen=True, slots=True)
class Estimate:
    """Means over independent randomised replicates, and how wrong they may be.

    Attributes
    ----------
    value : float64, any shape
    standard_error : the same shape; from the spread of the replicates
    bound : the same shape; what |value - truth| stays below with 99 %, never 0: 3 / N where all replicates agree, as
        they do where no ray, or every ray, has hit
    """

    value: np.ndarray
    standard_error: np.ndarray
    bound: np.ndarray


def estimate(replicates, rays: int, bias: float = 0.0) -> Estimate:
    """From replicates (REPLICATES, ...) that took ``rays`` rays of equal shares in all; ``bias``: a known share of the
    value."""
    value = np.mean(replicates, axis=0)
    standard_error = np.std(replicates, axis=0, ddof=1) / np.sqrt(len(replicates))
    bound = np.maximum(STUDENT_99 * standard_error, RULE_OF_THREE / rays) + bias * np.abs(value)
    return Estimate(value, np.maximum(standard_error, 1 / rays), bound)


def replicated(estimator, sides, reduce, first: int = 0):
    """``reduce(rows)`` of REPLICATES independent estimates of the rows of ``sides`` (K,): float64 (REPLICATES, ...).

    ``rows`` are float32 (K, 2 P); the randomisations are the estimator's seed + first, seed + first + 1, ...
    """
    seeds = range(estimator.seed + first, estimator.seed + first + REPLICATES)
    # each waits for the kernel's own workers: together they keep all of these busy, few sides alone do not
    with ThreadPoolExecutor(REPLICATES) as pool:
        return np.stack(list(pool.map(lambda seed: reduce(replace(estimator, seed=seed).rows(sides)), seeds)))


def form_factors(kernel: KernelScene, method: str, error: float, seed: int):
    """The estimator that ``method`` names, fine enough for a relative ``error`` of the solution.

    A patch's radiosity averages over many rows, so the rows may be coarser than the result: 0.5 / error^1.5 rays give
    rows about as wrong as the result may be.
    """
    rays = min(max(int(0.5 / error**1.5), 256), 1 << 15)
    if method == "hemicube":
        positions = 8
        resolution = max(2, 2 * round(0.5 * (rays / (3 * positions)) ** 0.5))
        return HemicubeFormFactors(kernel, resolution, positions, seed)
    return MonteCarloFormFactors(kernel, 1 << (rays - 1).bit_length(), seed)
