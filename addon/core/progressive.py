"""Progressive refinement: shoot the largest unshot flux first (Cohen, Chen, Wallace & Greenberg 1988).

In numerical terms Southwell's relaxation (Gortler, Cohen & Slusallek 1993), which is slow where little is absorbed: one
mode, the mean light, falls by 1 - rho in a sweep over all sides. It is overshot here (Feda & Purgathofer 1992): after a
sweep the ambient estimate is shot at once, and what is too much is taken back by shooting negative flux.
"""

from __future__ import annotations

import numpy as np

from .report import Energy
from .solver import Solution, flux_of, truncation_bound

MEMORY = 2  # sweeps that one overshoot combines
MOST_SWEEPS = 200  # some ten will do
LEAST_SWEEP = 16  # shots


class ProgressiveRefinement:
    """The state of progressive refinement: what every side has, and what it still has to shoot.

    ``form_factors.rows(sides)`` gives rows; rows are kept while ``row_limit`` bytes hold them, as a side shoots often.
    """

    def __init__(self, form_factors, reflectance, emitted, areas, row_limit: int = 1 << 30):
        self._form_factors = form_factors
        self._reflectance = np.asarray(reflectance, np.float64)
        self.areas = np.asarray(areas, np.float64)
        self._rows: dict[int, tuple] = {}  # of a side: those that it sees, and its form factors to them
        self._free = self._row_limit = row_limit
        self._has_row = np.zeros(len(areas), bool)
        self._row_sums = np.zeros(len(areas))
        self._arrivals = np.zeros(len(areas))  # sum over the rows known of A_i F_ij [m^2]
        self._echo = np.zeros(self._reflectance.shape)  # the same of A_i rho_i F_ij: ambient light, shot once
        self.radiosity = np.array(emitted, np.float64)
        self.unshot = np.array(emitted, np.float64)
        self.absorbed = np.zeros(self.unshot.shape[1])  # [W], a channel each
        self.escaped = np.zeros(self.unshot.shape[1])
        self.is_reached = (self.unshot != 0).any(axis=1)
        self.unshot_flux = self._sizes()
        self.rows_computed = 0

    @property
    def ambient(self):
        """What the unshot light will come to as irradiance, were it spread evenly, (3,) [W/m^2].

        Mean unshot radiosity over 1 - mean rho (Cohen et al. 1988, eqs. 10-12), the means over the sides that light has
        reached: backs of walls are not part of the room. Exact in a sphere.
        """
        areas = (self.areas * self.is_reached)[:, None]
        total = max(areas.sum(), 1e-300)
        reflected = (areas * self._reflectance).sum(axis=0) / total
        return (areas * self.unshot).sum(axis=0) / total / np.maximum(1 - reflected, 1e-300)

    @property
    def displayed(self):
        """Radiosity with the ambient estimate, for pictures before the end, (N, 3) [W/m^2]."""
        return self.radiosity + self._reflectance * self.ambient * self.is_reached[:, None]

    def shoot(self, side: int) -> None:
        """Distribute what one side has not shot yet: B_j += rho_j F_ij A_i / A_j dB_i."""
        seen, shares = self._row(side)
        flux = self.areas[side] * self.unshot[side]
        landed = shares[:, None] * flux
        reflected = self._reflectance[seen] * landed
        self.absorbed += (landed - reflected).sum(axis=0)
        self.escaped += flux - landed.sum(axis=0)
        self.unshot[side] = 0.0
        added = reflected / np.maximum(self.areas[seen], 1e-300)[:, None]
        self.radiosity[seen] += added
        unshot = self.unshot[seen] + added
        self.unshot[seen] = unshot
        self.unshot_flux[side] = 0.0
        self.unshot_flux[seen] = self.areas[seen] * np.abs(unshot).sum(axis=1)
        self.is_reached[seen] = True

    def amounts(self) -> tuple:
        """Copies of what changes: radiosity, unshot, and the flux absorbed and escaped."""
        return self.radiosity.copy(), self.unshot.copy(), self.absorbed.copy(), self.escaped.copy()

    def ambient_amounts(self) -> tuple:
        """What shooting rho from all sides whose rows are known would change, and the share (3,) taken from it."""
        shot = self.areas[:, None] * self._reflectance * self._has_row[:, None]
        reflected = self._reflectance * self._echo / np.maximum(self.areas, 1e-300)[:, None]
        absorbed = ((1 - self._reflectance) * self._echo).sum(axis=0)
        escaped = (shot * (1 - self._row_sums)[:, None]).sum(axis=0)
        changes = reflected, reflected - self._reflectance * self._has_row[:, None], absorbed, escaped
        return changes, (absorbed + escaped) / np.maximum(shot.sum(axis=0), 1e-300)

    def add(self, multiple, changes, channel) -> None:
        """Change one channel by a multiple of changes."""
        radiosity, unshot, absorbed, escaped = changes
        self.radiosity[:, channel] += multiple * radiosity[:, channel]
        self.unshot[:, channel] += multiple * unshot[:, channel]
        self.absorbed[channel] += multiple * absorbed[channel]
        self.escaped[channel] += multiple * escaped[channel]
        self.unshot_flux = self._sizes()

    def error_bound(self) -> float:
        """Of |B - B_k| for the form factors as they were shot [W/m^2]; two norms, the smaller bound.

        By rows, |r|_inf / (1 - max rho sum F), where all rows that matter are known; and by columns, which sum over
        what a side shoots, |A r|_1 / (1 - max sum_j F_ij rho_j) for the flux, so for B by the least area.
        """
        matters = (self.radiosity != 0).any(axis=1)
        if (matters & ~self._has_row).any():
            by_rows = np.inf
        else:
            sums = self._arrivals / np.maximum(self.areas, 1e-300)
            by_rows = truncation_bound(self.unshot, self._reflectance, sums)
        # rows that are not known are shares of what leaves: they sum to 1 at most, but for rounding
        gain = float(self._reflectance.max(initial=0.0)) * max(self._row_sums.max(initial=0.0), 1.0)
        least = self.areas[self.areas > 0].min(initial=np.inf)
        by_columns = flux_of(self.unshot, self.areas) / ((1 - gain) * least) if gain < 1 else np.inf
        return min(by_rows, by_columns)

    def _sizes(self):
        """Size of the flux still to be shot by each side, summed over channels, (N,) [W]."""
        return self.areas * np.abs(self.unshot).sum(axis=1)

    def _row(self, side):
        if side not in self._rows:
            # the brightest shoot next: fetch their rows together, which all cores can share
            flux = self.unshot_flux
            brightest = np.argsort(-flux, kind="stable")[: min(64, np.count_nonzero(flux))]
            wanted = [side, *(int(s) for s in brightest if s != side and int(s) not in self._rows)]
            if self._free < 0:
                self._rows.clear()
                self._free = self._row_limit
            self.rows_computed += len(wanted)
            for index, row in zip(wanted, self._form_factors.rows(np.array(wanted, np.int32))):
                seen = np.flatnonzero(row)
                self._rows[index] = seen, row[seen].astype(np.float64)
                self._free -= 16 * len(seen)
                self._note(index, *self._rows[index])
        return self._rows[side]

    def _note(self, side, seen, shares):
        if not self._has_row[side]:
            self._has_row[side] = True
            self._row_sums[side] = shares.sum()
            arrivals = self.areas[side] * shares
            self._arrivals[seen] += arrivals
            self._echo[seen] += arrivals[:, None] * self._reflectance[side]


class Overshooting:
    """Shoots, after a sweep, what later sweeps would come to, as far as the estimated error falls by it.

    What may be shot at once, without a single form factor more, as its residual is known: multiples of the last sweeps
    (Anderson 1965), and of the ambient light, which is rho on all sides whose rows are known. The multiples minimise
    sum A r^2 + (sum A r / q)^2 / sum A, with q the share of ambient light that is taken on its way: the mean unshot
    light counts by what it will come to, however near 1 the reflectance is. (Measured: plain least squares stall at
    0.99; an ambient estimate shot with each shot, as Feda & Purgathofer have it, is slower than none at 0.9.)
    Doing nothing is among the choices, so the estimate never grows by it: Gortler et al.'s safety.
    """

    def __init__(self, state: ProgressiveRefinement):
        self._state = state
        self._before = state.amounts()
        self._sweeps: list[tuple] = []

    def after_sweep(self) -> None:
        """Note what the sweep changed; overshoot, a channel at a time."""
        changes = tuple(now - before for now, before in zip(self._state.amounts(), self._before))
        self._sweeps = [*self._sweeps[-MEMORY + 1 :], changes]
        ambient, taken = self._state.ambient_amounts()
        for channel in range(len(taken)):
            if taken[channel] > 0:
                self._overshoot([*self._sweeps, ambient], taken[channel], channel)
        self._before = self._state.amounts()

    def _overshoot(self, choices, taken, channel):
        areas, rest = self._state.areas, self._state.unshot[:, channel]
        steps = np.stack([unshot[:, channel] for _, unshot, _, _ in choices], axis=1)
        columns = np.column_stack([steps, rest])
        mean = areas / (taken * np.sqrt(areas.sum()))
        weighted = np.concatenate([np.sqrt(areas)[:, None] * columns, mean[None] @ columns])
        sizes = np.linalg.norm(weighted, axis=0)
        weighted /= np.where(sizes > 0, sizes, 1.0)  # so that twice the light is overshot twice as far, to the bit
        multiples = np.linalg.lstsq(weighted[:, :-1], -weighted[:, -1], rcond=1e-12)[0]
        multiples *= sizes[-1] / np.where(sizes[:-1] > 0, sizes[:-1], 1.0)
        for multiple, changes in zip(multiples, choices):
            self._state.add(multiple, changes, channel)


def solve_progressive(
    form_factors, reflectance, emitted, areas, unshot_limit, on_step=None, overshoots=True, most_sweeps=MOST_SWEEPS
) -> Solution:
    """Shoot the largest unshot flux until less than ``unshot_limit`` of the first flux is left.

    Parameters
    ----------
    form_factors : has ``rows(sides)``, as transport.MonteCarloFormFactors
    reflectance, emitted : (N, 3) [1], [W/m^2]; areas : (N,) [m^2]
    overshoots : False is the plain order of Cohen et al.
    most_sweeps : as many shots as there are sides that light has reached, each
    """
    state = ProgressiveRefinement(form_factors, reflectance, emitted, areas)
    overshooting = Overshooting(state)
    first = float(state.unshot_flux.sum())
    residuals, in_sweep, sweeps, done = [], 0, 0, 0.0
    while first > 0:
        flux = state.unshot_flux
        left = float(flux.sum()) / first
        residuals.append(left)
        if left <= unshot_limit or sweeps >= most_sweeps:
            break
        if on_step and len(residuals) % 16 == 0:
            done = max(done, np.log(max(left, 1e-300)) / np.log(unshot_limit))
            on_step(done)
        state.shoot(int(np.argmax(flux)))
        in_sweep += 1
        if in_sweep >= max(np.count_nonzero(state.is_reached), LEAST_SWEEP):
            in_sweep, sweeps = 0, sweeps + 1
            if overshoots:
                overshooting.after_sweep()
    rays = state.rows_computed * getattr(form_factors, "rays_per_row", 0)
    unshot = float((state.areas[:, None] * state.unshot).sum())
    energy = Energy(first, float(state.absorbed.sum()), float(state.escaped.sum()), unshot)
    return Solution(state.radiosity, tuple(residuals), energy, rays, "progressive", state.error_bound())
