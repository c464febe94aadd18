"""Transport: form factors between patch sides, by hemicube or by Monte Carlo, behind one interface.

F[i, j] is the share of the power leaving side i that lands on side j; a row sums to 1 less what escapes.
"""

from __future__ import annotations

from dataclasses import dataclass

from .kernel import KernelScene


@dataclass(frozen=True, slots=True)
class MonteCarloFormFactors:
    """Cosine rays, stratified over position and direction together."""

    kernel: KernelScene
    rays: int
    seed: int

    def rows(self, sides):
        """Form factors from sides (K,) to all sides, float32 (K, 2 P)."""
        return self.kernel.form_factors_monte_carlo(sides, self.rays, self.seed)

    @property
    def rays_per_row(self) -> int:
        """Rays that one row costs."""
        return self.rays


@dataclass(frozen=True, slots=True)
class HemicubeFormFactors:
    """Hemicubes at several positions of a patch, each turned by an angle of its own, delta factors normalised."""

    kernel: KernelScene
    resolution: int
    positions: int
    seed: int

    def rows(self, sides):
        """Form factors from sides (K,) to all sides, float32 (K, 2 P)."""
        return self.kernel.form_factors_hemicube(sides, self.resolution, self.positions, self.seed)

    @property
    def rays_per_row(self) -> int:
        """Rays that one row costs."""
        return 3 * self.resolution**2 * self.positions


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
