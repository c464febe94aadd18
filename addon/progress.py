"""A progress bar on a terminal, with an estimate of what is left."""

from __future__ import annotations

import shutil
import sys
import time

BAR_CELLS = 30
SECONDS_BETWEEN_DRAWS = 0.1
# below this share of the work an estimate of the rest is noise
ESTIMATE_FROM = 0.03


class ProgressBar:
    """Draws on ``stream`` while it is a terminal and stays silent otherwise; use it as a context manager."""

    def __init__(self, stream=None, clock=time.monotonic):
        self._stream = sys.stderr if stream is None else stream
        self._clock = clock
        self._is_terminal = self._stream.isatty()
        self._started = clock()
        self._last_draw = None

    def __enter__(self):
        return self

    def __exit__(self, *_exception):
        if self._last_draw is not None:
            self._stream.write("\r\x1b[K")
            self._stream.flush()

    def __call__(self, stage: str, fraction: float) -> bool:
        """Show how far the bake is, ``fraction`` in 0..1 of the whole; always True: a terminal cancels by Ctrl-C."""
        now = self._clock()
        if self._is_terminal and (self._last_draw is None or now - self._last_draw >= SECONDS_BETWEEN_DRAWS):
            self._last_draw = now
            columns = shutil.get_terminal_size().columns
            self._stream.write("\r" + line(stage, fraction, now - self._started)[: columns - 1] + "\x1b[K")
            self._stream.flush()
        return True


def line(stage: str, fraction: float, elapsed: float) -> str:
    """One line such as ``[#####.....]  50 %  gather, about 0:12 left``."""
    filled = round(BAR_CELLS * min(max(fraction, 0.0), 1.0))
    bar = "#" * filled + "." * (BAR_CELLS - filled)
    left = seconds_left(fraction, elapsed)
    estimate = "" if left is None else f", about {clock_text(left)} left"
    return f"[{bar}] {fraction:4.0%}  {stage}{estimate}"


def seconds_left(fraction: float, elapsed: float) -> float | None:
    """What is left if the rest goes as fast as what is done [s]; None while too little is done to say."""
    if fraction < ESTIMATE_FROM:
        return None
    return elapsed * (1.0 - fraction) / fraction


def clock_text(seconds: float) -> str:
    """``m:ss``, or ``h:mm:ss`` from an hour on."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
