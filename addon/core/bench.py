"""Speed against error: every form-factor method and every solver over a range of settings, on scenes with exact light.

Seconds, rays, memory and error stand together in every row: speed without error is not a result.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from .bench_factors import factor_rows
from .bench_light import bake_rows, solver_rows
from .bench_peers import installed_peers
from .bench_row import BenchRow
from .bench_scenes import SCENES, exact_scene
from .settings import SettingsError, require_threads, thread_count
from .workers import Workers

PACKAGES = ("patchlight", "numpy", "embreex", "xatlas", "bpy", "pyviewfactor", "raystrack", "matplotlib")


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """What a bench measures.

    Attributes
    ----------
    scenes : names of exact scenes, of SCENES; the form factors are always measured
    is_quick : few settings and small scenes, to see that all works
    runs : of each row, each with a seed of its own
    seed : of the first run
    threads : 0 = all cores
    """

    scenes: tuple[str, ...] = tuple(SCENES)
    is_quick: bool = False
    runs: int = 3
    seed: int = 0
    threads: int = 0

    def __post_init__(self):
        for name in self.scenes:
            if name not in SCENES:
                raise SettingsError(f"scene is {name}: allowed is {', '.join(SCENES)}")
        if self.runs < 1:
            raise SettingsError(f"runs is {self.runs}: allowed is 1 and above")
        require_threads(self.threads)

    @property
    def thread_count(self) -> int:
        """Threads to run, at least 1."""
        return thread_count(self.threads)


def run_bench(options: BenchOptions, on_row: Callable[[BenchRow], None] | None = None) -> tuple[list[BenchRow], list]:
    """All rows, and a sentence for each thing that was left out; ``on_row`` is told of each row as it is done."""
    peers, missing = installed_peers(options.thread_count)
    rows = []
    with Workers(options.thread_count) as workers:
        for one in _rows(options, peers, workers):
            rows.append(one)
            if on_row:
                on_row(one)
    return rows, missing


def _rows(options, peers, workers) -> Iterator[BenchRow]:
    common = options.is_quick, options.runs, options.seed
    yield from factor_rows(workers, peers, *common)
    for name in options.scenes:
        exact = exact_scene(name)
        yield from solver_rows(exact, workers, *common)
        yield from bake_rows(exact, options.thread_count, *common)


def report(rows: list[BenchRow], options: BenchOptions, missing: list[str]) -> dict:
    """What a bench found, and on what, for JSON."""
    return {
        "schema": "patchlight_bench/1",
        "machine": {"cpu": _cpu(), "system": platform.platform(), "cores": os.cpu_count()},
        "commit": _commit(),
        "versions": {"python": platform.python_version(), **_versions()},
        "threads": options.thread_count,
        "quick": options.is_quick,
        "rows": [one.as_dict() for one in rows],
        "missing": missing,
    }


def _versions():
    found = {}
    for name in PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def _cpu():
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "")


def _commit():
    """Of the source tree that this file is in, with "+" where it has changed since; None outside of one."""
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--abbrev=12", "--dirty=+", "--exclude=*"],
            cwd=Path(__file__).parent, capture_output=True, text=True, check=True, timeout=10,
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
