"""Peak memory of a piece of work, NumPy's and the kernel's together."""

from __future__ import annotations

import contextlib
import ctypes
from pathlib import Path

STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


class PeakMemory:
    """Context manager; ``bytes`` is how much the process grew at the most, None where the system does not tell.

    Linux keeps the peak of a process's resident memory and lets a process reset its own.
    """

    def __init__(self):
        self.bytes: int | None = None
        self._before: int | None = None

    def __enter__(self) -> PeakMemory:
        with contextlib.suppress(OSError, AttributeError):
            # what was freed goes back to the system first: taken again it would not count
            ctypes.CDLL(None).malloc_trim(0)
            RESET.write_text("5")  # the peak becomes what there is now
            self._before = _resident("VmRSS")
        return self

    def __exit__(self, *_) -> None:
        if self._before is not None:
            self.bytes = max(_resident("VmHWM") - self._before, 0)


def _resident(name) -> int:
    for line in STATUS.read_text().splitlines():
        if line.startswith(name + ":"):
            return 1024 * int(line.split()[1])
    raise OSError(f"{STATUS} has no {name}")
