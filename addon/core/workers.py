"""Threads for the kernel's ranges, and the thread of progress through a bake.

The kernel starts no threads: a job is cut into ranges, the kernel runs one range a call with the GIL released, and
between ranges the caller is told how far it is and may stop the bake.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from .settings import BakeCancelled

OnProgress = Callable[[str, float], bool]


def within(on_step: Callable[[float], None], begin: float, width: float) -> Callable[[float], None]:
    """Tells how far a part is (0..1) as how far the whole is, of which the part is the stretch from ``begin`` on."""
    return lambda done: on_step(begin + width * done)


class Progress:
    """Where a bake is: stages that each take a share of the whole, told to a callback, and timed."""

    def __init__(self, on_progress: OnProgress | None, shares: dict[str, float]):
        self.seconds: dict[str, float] = {}
        self._on_progress = on_progress
        self._shares = shares
        self._stage, self._done = "", 0.0
        self._started = time.perf_counter()
        self._stage_started = self._started

    def begin(self, stage: str) -> None:
        """End the stage that runs and begin another; raises BakeCancelled when the callback says so."""
        self.end()
        self._stage = stage
        self._stage_started = time.perf_counter()
        self.step(0.0)

    def step(self, done: float) -> None:
        """Tell that so much (0..1) of the stage is done."""
        self._done = done
        if self._on_progress is None:
            return
        before = sum(self._shares[name] for name in self.seconds if name in self._shares)
        whole = before + self._shares.get(self._stage, 0.0) * min(max(done, 0.0), 1.0)
        if self._on_progress(self._stage, min(whole, 1.0)) is False:
            raise BakeCancelled("the bake was cancelled")

    def poll(self) -> None:
        """Give the callback its say where nothing more is done yet; raises BakeCancelled as ``begin`` does."""
        self.step(self._done)

    def end(self) -> None:
        """Close the stage that runs and note its seconds."""
        if self._stage:
            spent = time.perf_counter() - self._stage_started
            self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + spent
            self._stage = ""

    @property
    def elapsed(self) -> float:
        """Seconds since the bake began."""
        return time.perf_counter() - self._started


class Workers:
    """A pool of threads that runs ``call(start, stop)`` over ranges of a job, in order of the ranges."""

    def __init__(self, threads: int):
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="patchlight")

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_) -> None:
        self._pool.shutdown(wait=True, cancel_futures=True)

    def each(self, items: Sequence, call: Callable) -> list:
        """Run ``call(item)`` on each; their results in order."""
        return self.each_range(len(items), 1, lambda start, _: call(items[start]))

    def each_range(self, count: int, size: int, call: Callable, on_step: Callable[[float], None] | None = None) -> list:
        """Run ``call(start, stop)`` on ranges of ``size`` up to ``count``; their results in order.

        ``on_step(done)`` is told after each range, from the calling thread; if it raises, no further range starts.
        """
        ranges = [(start, min(start + size, count)) for start in range(0, count, size)]
        futures = [self._pool.submit(call, start, stop) for start, stop in ranges]
        try:
            results = []
            for done, future in enumerate(futures, 1):
                results.append(future.result())
                if on_step:
                    on_step(done / len(futures))
            return results
        finally:
            for future in futures:
                future.cancel()
