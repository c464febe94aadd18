"""A row of a bench: what was asked of what, and the numbers that belong together, time, rays, memory and error."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from .peak_memory import PeakMemory
from .relative import DARK

LONG = 2.0  # a run that takes longer is not repeated [s]
HEADER = (
    f"{'stage':<8}{'scene':<16}{'method':<20}{'solver':<20}{'setting':<14}"
    f"{'seconds':>10}{'rays':>11}{'MB':>8}{'error':>10}{'stated':>10}"
)


@dataclass(frozen=True, slots=True)
class BenchRow:
    """Medians over some runs, each with a seed of its own; the error is the RMS over all of them.

    Attributes
    ----------
    stage : "factor" (one form factor), "solve" (a system of patches), "bake" (from triangles to texels), "blend"
    scene, method, solver : names; "-" where there is none
    setting : what was turned, "rays 1024", "error 0.02"; "-" where nothing can be
    seconds : median
    rays : median; None where none are traced
    memory : how much the process grew at the most [bytes]; None where the system does not tell
    error : RMS relative error against the truth [1]
    stated_error : what the method says of its own error, the median [1]; None where it says nothing
    runs : how many
    spread : largest less smallest of the runs' seconds, over the median [1]
    """

    stage: str
    scene: str
    method: str
    solver: str
    setting: str
    seconds: float
    rays: int | None
    memory: int | None
    error: float
    stated_error: float | None
    runs: int
    spread: float

    def as_dict(self) -> dict:
        """For a report in JSON."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Outcome:
    """One run's error against the truth [1], its rays, what it says of its own error [1], and its own seconds where
    the work was timed from within."""

    error: float
    rays: int | None = None
    stated_error: float | None = None
    seconds: float | None = None


def measured(names: tuple[str, str, str, str, str], runs: int, run: Callable[[int], Callable | Outcome]) -> BenchRow:
    """The row of ``names`` (stage, scene, method, solver, setting) from ``run(0)``, ``run(1)``, ...; if long, from one.

    ``run`` may return an Outcome, or a function that makes it from what was computed: judging takes no time of the row.
    """
    outcomes, seconds, memory = [], [], []
    for seed in range(runs):
        gc.collect()
        with PeakMemory() as peak:
            started = time.perf_counter()
            outcome = run(seed)
            elapsed = time.perf_counter() - started
        outcome = outcome() if callable(outcome) else outcome
        outcomes.append(outcome)
        seconds.append(elapsed if outcome.seconds is None else outcome.seconds)
        memory.append(peak.bytes)
        if elapsed > LONG:
            break
    rays, stated = _median([o.rays for o in outcomes]), _median([o.stated_error for o in outcomes])
    # a repeated run finds the memory that the first one took: that one says what the work needs
    middle = float(np.median(seconds))
    return BenchRow(
        *names, middle, None if rays is None else int(rays), memory[0],
        float(np.sqrt(np.mean([o.error**2 for o in outcomes]))), stated, len(seconds), float(np.ptp(seconds)) / middle,
    )  # fmt: skip


def _median(values):
    return None if any(v is None for v in values) else float(np.median(values))


def relative_error(values, truth, weights=None) -> float:
    """RMS of (value - truth) / (truth + 0.3 median truth), as a bake measures its own error."""
    relative = (np.asarray(values) - truth) / (truth + DARK * np.median(truth))
    return float(np.sqrt(np.average(np.minimum(relative**2, 1.0), weights=weights)))


def row(one: BenchRow) -> str:
    """The table's line."""
    rays = "-" if one.rays is None else f"{one.rays:.3g}"
    memory = "-" if one.memory is None else f"{one.memory / 2**20:.1f}"
    stated = "-" if one.stated_error is None else f"{one.stated_error:.1e}"
    return (
        f"{one.stage:<8}{one.scene:<16}{one.method:<20}{one.solver:<20}{one.setting:<14}"
        f"{one.seconds:>10.4f}{rays:>11}{memory:>8}{one.error:>10.1e}{stated:>10}"
    )
