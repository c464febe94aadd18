"""Stochastic Jacobi: all sides shoot their flux at once, along rays in proportion to it (Neumann 1995, Bekaert 1999).

No form factors are kept, so any number of sides will do. First each step shoots what the one before has left
(incremental shooting), with as many rays less: steps without end where little is absorbed. There regular iterations go
on: each shoots all light, scaled so that what is taken from it is what is emitted; the results of many are averaged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .report import Energy
from .solver import Solution

FULL = 1 << 62  # what all flux of one step comes to, in fixed point
REPLICATES = 2  # independent runs that share the rays: every step costs as many passes over all sides
BLOCK = 1 << 16  # sides that are worked on at once where all would need more copies of their flux
LEAST_RAYS = 1024  # of a step
LEAST_STEPS = 4  # before the reflectance of the whole is known well enough to choose how to go on
REGULAR_COST = 40  # first steps' rays: where incremental shooting would take more, regular iterations go on
WINDOW, LONGEST = 10, 80  # regular iterations averaged, at first and at most


@dataclass(frozen=True, slots=True)
class _Run:
    """What one replicate found: flux (N, 3) [W], a bound of its truncation [W/m^2]; whether it gave up as too slow."""

    flux: np.ndarray
    residuals: tuple[float, ...]
    energy: Energy
    rays: int
    error_bound: float
    is_slow: bool = False


def solve_stochastic(
    kernel,
    reflectance,
    emitted,
    areas,
    rays,
    unshot_limit,
    seed,
    on_step=None,
    translucence=None,
    replicates: int = REPLICATES,
) -> Solution:
    """The mean of ``replicates`` independent runs that share ``rays``, those of the first step.

    The residual is the flux that is not accounted for, |emitted - absorbed - escaped| over emitted: of incremental
    shooting, what is unshot; of regular iterations also how far the light's shape still moves. It stops both kinds of
    steps; noise is not in it but in the standard errors.

    Parameters
    ----------
    kernel : has ``shoot``, as kernel.KernelScene
    reflectance, emitted : (N, 3) [1], [W/m^2]; areas : (N,) [m^2]
    translucence : (N / 2, 3) of patches, or None: what arrives at one side of them leaves at the other [1]
    """
    column, reflectance = np.asarray(areas, np.float64)[:, None], np.asarray(reflectance)
    emitted_flux = column * np.asarray(emitted, np.float64)
    runs, told = [], 0.0

    def on_part(done):
        nonlocal told
        told = max(told, (len(runs) + min(max(done, 0.0), 1.0)) / replicates)
        if on_step:
            on_step(told)

    rays = max(rays // replicates, 1)
    scattering = _Scattering(reflectance, translucence)
    shootings = [_Shooting(kernel, scattering, column, seed, replicate) for replicate in range(replicates)]
    for shooting in shootings:
        runs.append(_incremental(shooting, emitted_flux, rays, unshot_limit, on_part))
        if runs[-1].is_slow:
            break
    residuals = _mean_residuals(runs)
    if runs[-1].is_slow:
        runs, more = _regular(shootings, emitted_flux, runs[-1].flux, rays, unshot_limit, on_part)
        residuals += more
    mean, errors = _mean_and_error([run.flux for run in runs], np.maximum(column, 1e-300))
    energy = Energy(*(float(np.mean([getattr(run.energy, name) for run in runs])) for name in Energy.__slots__))
    return Solution(
        radiosity=mean,
        residuals=residuals,
        energy=energy,
        rays=sum(run.rays for run in runs),
        solver="stochastic",
        error_bound=float(np.mean([run.error_bound for run in runs])),
        standard_errors=errors,
    )


def _mean_and_error(fluxes, areas):
    """Radiosity (N, 3), and its standard error, which one run alone does not have."""
    if len(fluxes) == 1:
        return fluxes[0] / areas, None
    mean, error = np.empty_like(fluxes[0]), np.empty_like(fluxes[0])
    for first in range(0, len(mean), BLOCK):
        block = slice(first, first + BLOCK)
        runs = np.stack([flux[block] for flux in fluxes]) / areas[block]
        mean[block], error[block] = runs.mean(axis=0), runs.std(axis=0, ddof=1) / len(runs) ** 0.5
    return mean, error


def _mean_residuals(runs):
    """Step by step the runs' mean; one that has ended keeps its last."""
    steps = max(len(run.residuals) for run in runs)
    padded = [run.residuals + run.residuals[-1:] * (steps - len(run.residuals)) for run in runs]
    return tuple(np.mean(padded, axis=0).tolist())


class _Scattering:
    """What sides send on of the flux that lands on them."""

    def __init__(self, reflectance, translucence):
        self._reflectance = reflectance
        self._translucence = None if translucence is None or not translucence.any() else translucence
        self.gain = float(reflectance.max(initial=0.0))  # the largest share that is sent on
        if self._translucence is not None:
            self.gain = float((reflectance[::2] + translucence).max(initial=0.0))

    def sent_on(self, received, scale):
        """Sides (L,) that get something to send on of what each received (N, 3), and that, divided by ``scale``."""
        sending = np.flatnonzero(received[:, 0] | received[:, 1] | received[:, 2])
        if self._translucence is not None:
            sending = np.union1d(sending, sending[self._translucence[sending // 2].any(axis=1)] ^ 1)
        flux = np.empty((len(sending), 3))
        for first in range(0, len(sending), BLOCK):
            part = sending[first : first + BLOCK]
            flux[first : first + BLOCK] = self._reflectance[part] * (received[part] / scale)
            if self._translucence is not None:
                flux[first : first + BLOCK] += self._translucence[part // 2] * (received[part ^ 1] / scale)
        return sending, flux


class _Shooting:
    """One replicate's rays: shoots flux, keeps count of what each side's sequence has used."""

    def __init__(self, kernel, scattering, areas, seed, replicate):
        self._kernel = kernel
        self._seed = (seed + 0x9E3779B9 * replicate) & 0xFFFFFFFF  # of the first replicate the scene's own
        self._samples = np.zeros(len(areas), np.uint32)
        self._rng = np.random.default_rng([seed, 0x5AC0, replicate])
        self._scattering, self.areas = scattering, areas
        self.rays = 0

    def shoot(self, sides, flux, rays):
        """Shoot flux (K, 3) [W] of sides (K,) along rays: the sides that send some on (L,), what these send on at once
        (L, 3), and what leaves the scene, (3,)."""
        shoots, first_rays, per_ray, scale = _allot(flux, rays, self._rng.random())
        shooting = sides[shoots]
        received, gone = self._kernel.shoot(
            shooting.astype(np.int32), self._samples[shooting], per_ray, first_rays, self._seed
        )
        self._samples[shooting] += np.diff(first_rays).astype(np.uint32)
        self.rays += int(first_rays[-1])
        return *self._scattering.sent_on(received, scale), gone / scale

    def shoot_all(self, flux, rays):
        """The same for flux of all sides (N, 3): what is reflected at once (N, 3), and what leaves the scene, (3,)."""
        sides = np.flatnonzero(flux.any(axis=1))
        landed, reflected, gone = self.shoot(sides, flux[sides], rays)
        of_all = np.zeros_like(flux)
        of_all[landed] = reflected
        return of_all, gone

    def bound(self, sides, rest):
        """Of what ``rest`` (K, 3) [W] of sides may still come to, |r|_inf / (1 - max rho): a row of form factors sums
        to 1 at most."""
        gain = self._scattering.gain
        largest = float(np.abs(rest / np.maximum(self.areas[sides], 1e-300)).max(initial=0.0))
        return largest / (1 - gain) if gain < 1 else np.inf


def _incremental(shooting, emitted, rays, unshot_limit, on_step) -> _Run:
    """Shoot what is unshot until little is left, or it is clear that this would take too many rays.

    What is unshot is kept for the sides that have some: soon these are no more than there were rays.
    """
    total, sides = emitted.copy(), np.flatnonzero(emitted.any(axis=1))
    unshot = emitted[sides]
    first = float(unshot.sum())
    residuals, escaped, absorbed, is_slow = [], 0.0, 0.0, False
    while first > 0:
        left = float(unshot.sum()) / first
        residuals.append(left)
        if left <= unshot_limit:
            break
        on_step(np.log(max(left, 1e-300)) / np.log(unshot_limit))
        kept = min(left / residuals[-2], 1.0) if len(residuals) > 1 else 0.0
        is_slow = len(residuals) > LEAST_STEPS and left > REGULAR_COST * (1 - kept)
        if is_slow:
            break
        landed, reflected, gone = shooting.shoot(sides, unshot, max(int(rays * left), LEAST_RAYS))
        # what neither was reflected nor left was taken by surfaces, or by tinted glass
        absorbed += float(unshot.sum() - gone.sum() - reflected.sum())
        escaped += float(gone.sum())
        total[landed] += reflected
        sides, unshot = landed, reflected
    energy = Energy(first, absorbed, escaped, float(unshot.sum()))
    return _Run(total, tuple(residuals), energy, shooting.rays, shooting.bound(sides, unshot), is_slow)


def _regular(shootings, emitted, flux, rays, unshot_limit, on_step):
    """Iterate on all flux from ``flux``, in windows of twice the length until light has its shape; average the last.

    Scaling ends at once the mode that is always slow, the mean light (aggregation, with the light itself as the
    aggregate's shape). Other modes may be slow as well: what two rooms with a small door differ by. While they still
    move, replicates change alike from window to window, and by chance only when they do not.

    Returns the runs, and the residuals after each window: imbalance of fluxes, or the change of shape where larger.
    """
    fluxes, before, residuals, length, done = [flux] * len(shootings), None, (), WINDOW, 0
    while True:
        runs = []
        for replicate, shooting in enumerate(shootings):
            run, fluxes[replicate] = _window(shooting, emitted, fluxes[replicate], rays, length)
            runs.append(run)
            on_step((done + length * (replicate + 1) / len(shootings)) / (4 * LONGEST))
        done += length
        drift = _drift(before, [run.flux for run in runs]) if before else 1.0
        residuals += (max(drift, float(np.mean([run.residuals[0] for run in runs]))),)
        if before and (residuals[-1] <= unshot_limit or length >= LONGEST):
            return runs, residuals
        length = 2 * length if before else length
        before = [run.flux for run in runs]


def _window(shooting, emitted, flux, rays, length):
    """The mean of some iterations Phi <- M + rho F^T Phi, scaled in each channel to keep the balance; and the last."""
    shot = emitted.sum(axis=0)
    sum_shot, sum_reflected, sum_escaped = np.zeros_like(emitted), np.zeros_like(emitted), np.zeros(len(shot))
    for _ in range(length):
        reflected, gone = shooting.shoot_all(flux, rays)
        sum_shot, sum_reflected, sum_escaped = sum_shot + flux, sum_reflected + reflected, sum_escaped + gone
        flux = emitted + _scale(shot, flux, reflected) * reflected
    imbalance = np.abs(shot - (sum_shot.sum(axis=0) - sum_reflected.sum(axis=0)) / length).sum() / shot.sum()
    scale = _scale(shot, sum_shot, sum_reflected)
    total, escaped = emitted + scale * sum_reflected, float((scale * sum_escaped).sum())
    energy = Energy(float(shot.sum()), float(shot.sum()) - escaped, escaped, 0.0)
    bound = shooting.bound(slice(None), total - scale * sum_shot)
    return _Run(total, (float(imbalance),), energy, shooting.rays, bound), flux


def _drift(before, after):
    """Relative change that replicates have in common, 0 where it is no more than chance; of one alone, all of it."""
    changes = [now - then for then, now in zip(before, after)]
    first, other = changes[0], changes[-1]
    common, size = float((first * other).sum()), float((after[0] * after[-1]).sum())
    if len(changes) > 1:
        chance = min(3 / max(np.count_nonzero(after[0].any(axis=1)), 1) ** 0.5, 0.5)
        if common <= chance * np.linalg.norm(first) * np.linalg.norm(other):
            return 0.0
    return (common / max(size, 1e-300)) ** 0.5


def _scale(shot, flux, reflected):
    """What to multiply flux with so that as much is taken from it as is emitted, a channel each."""
    taken = flux.sum(axis=0) - reflected.sum(axis=0)
    # a channel without light stays dark; one in which nothing is taken has no balance and must not overflow
    return np.where(shot > 0, shot / np.maximum(taken, 1e-9 * np.maximum(flux.sum(axis=0), 1e-300)), 0.0)


def _allot(unshot, rays, offset):
    """Rays per side in proportion to its unshot flux (K, 3), by systematic sampling.

    Returns which of the sides shoot (S,), the first ray of each, uint64 (S + 1,), the flux of one of its rays in fixed
    point, uint64 (S, 3), and the scale of that. Counts are rounded up or down at random, so the rays would carry a
    little more or less than there is; each channel is scaled to carry exactly that, as a balance kept over
    1 / (1 - rho) steps needs.
    """
    weights = unshot @ np.ones(unshot.shape[1])
    expected = weights * (rays / weights.sum())
    bounds = np.floor(np.concatenate([[0.0], np.cumsum(expected)]) + offset)
    counts = np.diff(bounds)
    shoots = np.flatnonzero(counts)
    counts = counts[shoots]
    first_rays = np.concatenate([[0], np.cumsum(counts)]).astype(np.uint64)
    per_ray = unshot[shoots] / expected[shoots, None]
    carried = counts @ per_ray
    per_ray = (per_ray * (FULL / np.where(carried > 0, carried, 1.0))).astype(np.uint64)
    carried = counts @ per_ray.astype(np.float64)
    return shoots, first_rays, per_ray, np.where(carried > 0, carried / np.maximum(unshot.sum(axis=0), 1e-300), 1.0)
