"""Solvers of the radiosity equation B = M + rho F B, three channels at once.

Direct: one dense system. Progressive refinement: shoot the largest unshot flux (Cohen, Chen, Wallace & Greenberg 1988).
Stochastic: the same flux along rays, all patches at once (stochastic Jacobi: Neumann et al. 1995, Bekaert 1999).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .report import Energy
from .settings import SettingsError

DIRECT_LIMIT = 6000  # unknowns: the dense system takes 8 n^2 bytes a channel in work
# guards for closed rooms that absorb next to nothing; what is left unshot then is in the report
MOST_SWEEPS, LEAST_SHOTS = 64, 20_000  # shots of progressive refinement: so many a side, and these at least
MOST_WORK = 128  # rays of stochastic Jacobi, in those of its first step: 0.99 everywhere takes 100
FULL = 1 << 62  # what all flux of one step comes to, in fixed point


@dataclass(frozen=True, slots=True)
class Solution:
    """Radiosity of every side, and how the solver came to it.

    Attributes
    ----------
    radiosity : float64 (2 P, 3) B [W/m^2]
    residuals : unshot flux after each step, relative to the first; of direct: the residual's largest entry
    energy : flux balance [W]
    rays : traced
    solver : which one ran
    """

    radiosity: np.ndarray
    residuals: tuple[float, ...]
    energy: Energy
    rays: int
    solver: str


def solve_direct(form_factors, reflectance, emitted, areas) -> Solution:
    """(I - rho F) B = M by LU, a channel at a time.

    Parameters
    ----------
    form_factors : (N, N); reflectance, emitted : (N, 3) [1], [W/m^2]; areas : (N,) [m^2]
    """
    form_factors = np.asarray(form_factors, np.float64)
    radiosity = np.empty_like(emitted, dtype=np.float64)
    for channel in range(emitted.shape[1]):
        system = np.eye(len(emitted)) - reflectance[:, channel, None] * form_factors
        radiosity[:, channel] = np.linalg.solve(system, emitted[:, channel])
    rest = emitted + reflectance * (form_factors @ radiosity) - radiosity
    largest = float(np.abs(rest).max(initial=0.0) / max(np.abs(emitted).max(initial=0.0), 1e-300))
    return Solution(
        radiosity, (largest,), _dense_energy(form_factors, reflectance, emitted, areas, radiosity), 0, "direct"
    )


def _dense_energy(form_factors, reflectance, emitted, areas, radiosity):
    """Balance by rows, as flux travels; ``unshot`` is what form factors that are not quite reciprocal leave open."""
    flux = areas[:, None] * radiosity
    shot = float((areas[:, None] * emitted).sum())
    absorbed = float(((1 - reflectance) * (form_factors.T @ flux)).sum())
    escaped = float((flux * (1 - form_factors.sum(axis=1))[:, None]).sum())
    return Energy(shot, absorbed, escaped, shot - absorbed - escaped)


class ProgressiveRefinement:
    """The state of progressive refinement: what every side has, and what it still has to shoot.

    ``form_factors.rows(sides)`` gives rows; rows are kept while ``row_limit`` of them fit, as a side shoots many times.
    """

    def __init__(self, form_factors, reflectance, emitted, areas, row_limit: int = 1 << 30):
        self._form_factors = form_factors
        self._reflectance = np.asarray(reflectance, np.float64)
        self._areas = np.asarray(areas, np.float64)
        self._rows: dict[int, np.ndarray] = {}
        self._row_limit = row_limit // max(4 * len(areas), 1)
        self.radiosity = np.array(emitted, np.float64)
        self.unshot = np.array(emitted, np.float64)
        self.absorbed = 0.0
        self.escaped = 0.0
        self.rows_computed = 0

    @property
    def unshot_flux(self):
        """Flux still to be shot by each side, summed over channels, (N,) [W]."""
        return self._areas * self.unshot.sum(axis=1)

    def shoot(self, side: int) -> None:
        """Distribute what one side has not shot yet: B_j += rho_j F_ij A_i / A_j dB_i."""
        row = self._row(side)
        arriving = (row * (self._areas[side] / np.maximum(self._areas, 1e-300)))[:, None] * self.unshot[side]
        reflected = self._reflectance * arriving
        landed = (self._areas[:, None] * arriving).sum()
        self.absorbed += float(landed - (self._areas[:, None] * reflected).sum())
        self.escaped += float(self._areas[side] * self.unshot[side].sum() - landed)
        self.unshot[side] = 0.0
        self.radiosity += reflected
        self.unshot += reflected

    def _row(self, side):
        if side not in self._rows:
            # the brightest shoot next: fetch their rows together, which all cores can share
            brightest = np.argsort(-self.unshot_flux, kind="stable")[:64]
            wanted = [side, *(int(s) for s in brightest if s != side and int(s) not in self._rows)]
            if len(self._rows) + len(wanted) > self._row_limit:
                self._rows.clear()
            self.rows_computed += len(wanted)
            for index, row in zip(wanted, self._form_factors.rows(np.array(wanted, np.int32))):
                self._rows[index] = row.astype(np.float64)
        return self._rows[side]


def solve_progressive(form_factors, reflectance, emitted, areas, unshot_limit, on_step=None) -> Solution:
    """Shoot the largest unshot flux until less than ``unshot_limit`` of the first flux is left."""
    state = ProgressiveRefinement(form_factors, reflectance, emitted, areas)
    first = float(state.unshot_flux.sum())
    residuals = []
    while first > 0:
        flux = state.unshot_flux
        left = float(flux.sum()) / first
        residuals.append(left)
        if left <= unshot_limit or len(residuals) > max(MOST_SWEEPS * len(areas), LEAST_SHOTS):
            break
        if on_step and len(residuals) % 16 == 0:
            on_step(np.log(max(left, 1e-300)) / np.log(unshot_limit))
        state.shoot(int(np.argmax(flux)))
    unshot = float(state.unshot_flux.sum())
    rays = state.rows_computed * getattr(form_factors, "rays_per_row", 0)
    energy = Energy(first, state.absorbed, state.escaped, unshot)
    return Solution(state.radiosity, tuple(residuals), energy, rays, "progressive")


def solve_stochastic(kernel, reflectance, emitted, areas, rays, unshot_limit, seed, on_step=None) -> Solution:
    """Stochastic Jacobi with incremental shooting.

    Each step every side shoots its unshot flux along rays in proportion to that flux; ``rays`` is for the first step,
    and later steps shoot less as there is less to shoot, so that every ray carries about the same.
    """
    areas, reflectance = areas[:, None], np.asarray(reflectance, np.float64)
    radiosity = np.array(emitted, np.float64)
    unshot = areas * radiosity
    first = unshot.sum()
    residuals, traced, absorbed, escaped = [], 0, 0.0, 0.0
    samples = np.zeros(len(areas), np.uint32)
    rng = np.random.default_rng([seed, 0x5AC0])
    while first > 0:
        left = unshot.sum() / first
        residuals.append(float(left))
        if left <= unshot_limit or traced > MOST_WORK * rays:
            break
        if on_step:
            on_step(np.log(max(left, 1e-300)) / np.log(unshot_limit))
        first_rays, flux, scale = _allot(unshot, max(int(rays * left), 1024), rng.random())
        received, gone = kernel.shoot(first_rays, samples, flux, seed)
        samples += np.diff(first_rays).astype(np.uint32)
        traced += int(first_rays[-1])
        landed = received / scale
        reflected = reflectance * landed
        # what neither landed nor left was taken by tinted glass
        shot = (flux.astype(np.float64) * np.diff(first_rays).astype(np.float64)[:, None] / scale).sum()
        absorbed += float(shot - (gone / scale).sum() - reflected.sum())
        escaped += float((gone / scale).sum())
        radiosity += reflected / np.maximum(areas, 1e-300)
        unshot = reflected
    energy = Energy(float(first), absorbed, escaped, float(unshot.sum()))
    return Solution(radiosity, tuple(residuals), energy, traced, "stochastic")


def _allot(unshot, rays, offset):
    """Rays per side in proportion to its unshot flux, by systematic sampling.

    Returns the first ray of each side, uint64 (N + 1,), the flux of one of its rays in fixed point, uint64 (N, 3), and
    the scale of that.
    """
    weights = unshot.sum(axis=1)
    expected = rays * weights / weights.sum()
    bounds = np.floor(np.concatenate([[0.0], np.cumsum(expected)]) + offset)
    first_rays = (bounds - bounds[0]).astype(np.uint64)
    per_ray = unshot / np.maximum(expected, 1e-300)[:, None]
    per_ray[expected <= 0] = 0.0
    # the counts are rounded, so what is shot can exceed the flux a little
    shot = (per_ray * np.diff(first_rays).astype(np.float64)[:, None]).sum(axis=0)
    scale = FULL / np.where(shot > 0, shot, 1.0)
    shot_sides = np.diff(first_rays) > 0
    flux = np.zeros(unshot.shape, np.uint64)
    flux[shot_sides] = (per_ray[shot_sides] * scale).astype(np.uint64)
    return first_rays, flux, scale


def require_direct_size(unknowns: int) -> None:
    """Refuse a dense system that would not fit."""
    if unknowns > DIRECT_LIMIT:
        raise SettingsError(
            f"solver direct takes at most {DIRECT_LIMIT} unknowns and this scene has {unknowns}: "
            "use progressive or stochastic, or a larger patch size"
        )
