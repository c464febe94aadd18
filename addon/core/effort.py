"""What a gather is to reach, and what it may take for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .workers import within


@dataclass(frozen=True, slots=True)
class Effort:
    """The target, and the limits of the way to it.

    Attributes
    ----------
    error : target of the relative error [1]
    seed : of all its random numbers
    denoise : a denoiser.Denoiser, or None
    seconds_left : () -> float, until the time limit [s]; the first pass is always finished
    on_step : (0..1) -> None, how much is done; what it raises ends the work
    """

    error: float
    seed: int = 0
    denoise: Callable | None = None
    seconds_left: Callable[[], float] = lambda: np.inf
    on_step: Callable[[float], None] = lambda done: None

    def stage(self, begin, width) -> Effort:
        """The same, told of as a part of the whole."""
        return replace(self, on_step=within(self.on_step, begin, width))
