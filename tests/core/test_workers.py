"""Ranges on threads, and the thread of progress."""

import threading
import time

import pytest

from addon.core.settings import BakeCancelled
from addon.core.workers import Progress, Workers


@pytest.mark.parametrize("threads", [1, 2, 4])
@pytest.mark.parametrize(("count", "size"), [(0, 8), (1, 8), (8, 8), (9, 8), (100, 7)])
def test_ranges_cover_a_job_once_and_results_come_in_order(threads, count, size):
    with Workers(threads) as workers:
        results = workers.each_range(count, size, lambda start, stop: list(range(start, stop)))
    assert [i for part in results for i in part] == list(range(count))
    assert all(len(part) <= size for part in results)


def test_steps_are_told_from_the_calling_thread_and_end_at_one():
    told = []
    with Workers(4) as workers:
        workers.each_range(50, 5, lambda start, stop: None, lambda done: told.append((done, threading.get_ident())))
    assert [done for done, _ in told] == pytest.approx([k / 10 for k in range(1, 11)])
    assert {thread for _, thread in told} == {threading.get_ident()}


def test_no_range_starts_after_a_step_has_raised():
    started = []

    def call(start, stop):
        started.append(start)
        time.sleep(0.001)

    def stop_at_once(done):
        raise BakeCancelled

    with Workers(2) as workers, pytest.raises(BakeCancelled):
        workers.each_range(1000, 1, call, stop_at_once)
    # the two that run, and what they take before the rest is cancelled
    assert len(started) < 500


def test_an_exception_in_a_range_comes_out():
    def fail(start, stop):
        raise ZeroDivisionError(start)

    with Workers(2) as workers, pytest.raises(ZeroDivisionError):
        workers.each_range(10, 1, fail)


def test_progress_rises_through_the_stages_by_their_shares():
    told = []
    progress = Progress(lambda stage, done: told.append((stage, round(done, 6))) or True, {"a": 0.25, "b": 0.75})
    progress.begin("a")
    progress.step(0.5)
    progress.begin("b")
    progress.step(1 / 3)
    progress.step(7.0)
    progress.end()
    assert told == [("a", 0), ("a", 0.125), ("b", 0.25), ("b", 0.5), ("b", 1)]
    assert set(progress.seconds) == {"a", "b"}
    assert min(progress.seconds.values()) >= 0


def test_a_stage_that_runs_twice_adds_up_its_seconds():
    progress = Progress(None, {})
    for stage in ("a", "b", "a"):
        progress.begin(stage)
    progress.end()
    assert list(progress.seconds) == ["a", "b"]
    assert sum(progress.seconds.values()) <= progress.elapsed


def test_a_callback_that_says_no_cancels():
    progress = Progress(lambda stage, done: done < 0.5, {"a": 1.0})
    progress.begin("a")
    progress.step(0.4)
    with pytest.raises(BakeCancelled):
        progress.step(0.6)
