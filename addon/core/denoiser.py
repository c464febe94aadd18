"""Open Image Denoise by its C API, where its library is given: another estimate of the light on texels.

Blender ships the library, built without the filter for lightmaps: the one for renderings serves, told that light has no
upper bound. Which texels to believe it on is decided elsewhere, by what was measured there.
"""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Callable
from pathlib import Path

import numpy as np

from .settings import BakeSettings

CPU, FLOAT3 = 1, 3  # of OIDNDeviceType and OIDNFormat
TILE_MEGABYTES = 1024  # of memory, above which it works on tiles

_POINTER, _TEXT, _SIZE, _INT = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_int
_MONITOR = ctypes.CFUNCTYPE(ctypes.c_bool, _POINTER, ctypes.c_double)
_FUNCTIONS = {  # name: what it returns, what it takes
    "oidnNewDevice": (_POINTER, _INT),
    "oidnSetDeviceInt": (None, _POINTER, _TEXT, _INT),
    "oidnSetDeviceBool": (None, _POINTER, _TEXT, ctypes.c_bool),
    "oidnGetDeviceInt": (_INT, _POINTER, _TEXT),
    "oidnGetDeviceError": (_INT, _POINTER, ctypes.POINTER(_TEXT)),
    "oidnCommitDevice": (None, _POINTER),
    "oidnReleaseDevice": (None, _POINTER),
    "oidnNewFilter": (_POINTER, _POINTER, _TEXT),
    "oidnSetSharedFilterImage": (None, _POINTER, _TEXT, _POINTER, _INT, _SIZE, _SIZE, _SIZE, _SIZE, _SIZE),
    "oidnSetFilterBool": (None, _POINTER, _TEXT, ctypes.c_bool),
    "oidnSetFilterInt": (None, _POINTER, _TEXT, _INT),
    "oidnSetFilterProgressMonitorFunction": (None, _POINTER, _MONITOR, _POINTER),
    "oidnCommitFilter": (None, _POINTER),
    "oidnExecuteFilter": (None, _POINTER),
    "oidnReleaseFilter": (None, _POINTER),
}


class DenoiserError(Exception):
    """The library cannot be loaded: one sentence."""


class Denoiser:
    """One device of the library on the CPU; the same bytes with any number of threads.

    ``poll`` is called now and then while it works; what it raises ends the work.

    Attributes
    ----------
    name : with the version
    failure : why there was no result, "" if there always was: a long bake is not to be lost for it
    """

    def __init__(self, library: Path, threads: int, poll: Callable[[], None] | None = None):
        self._poll = poll
        try:
            self._library = _declared(ctypes.CDLL(str(library)))
        except (OSError, AttributeError) as error:
            raise DenoiserError(f"Open Image Denoise cannot be loaded from {library}: {error}") from error
        self._device = self._library.oidnNewDevice(CPU)
        self._library.oidnSetDeviceInt(self._device, b"numThreads", threads)
        # bound to cores, its threads would take those of others
        self._library.oidnSetDeviceBool(self._device, b"setAffinity", False)
        self._library.oidnCommitDevice(self._device)
        message = self._message()
        if message:
            self._library.oidnReleaseDevice(self._device)
            raise DenoiserError(f"Open Image Denoise of {library} failed: {message}")
        self.failure = ""
        version = self._library.oidnGetDeviceInt(self._device, b"version")
        self.name = f"Open Image Denoise {version // 10000}.{version // 100 % 100}.{version % 100}"

    def __enter__(self) -> Denoiser:
        return self

    def __exit__(self, *_) -> None:
        self._library.oidnReleaseDevice(self._device)

    def __call__(self, image):
        """An image of light float32 (H, W, 3), any unit, without its noise; None where the library fails."""
        image = np.ascontiguousarray(image, np.float32)
        result = np.empty_like(image)
        made = self._library.oidnNewFilter(self._device, b"RT")
        for name, pixels in ((b"color", image), (b"output", result)):
            height, width = image.shape[:2]
            self._library.oidnSetSharedFilterImage(made, name, pixels.ctypes.data, FLOAT3, width, height, 0, 0, 0)
        self._library.oidnSetFilterBool(made, b"hdr", True)
        self._library.oidnSetFilterInt(made, b"maxMemoryMB", TILE_MEGABYTES)
        raised = []
        monitor = _MONITOR(lambda _user, _done: self._may_go_on(raised))
        self._library.oidnSetFilterProgressMonitorFunction(made, monitor, None)
        self._library.oidnCommitFilter(made)
        self._library.oidnExecuteFilter(made)
        self._library.oidnReleaseFilter(made)
        if raised:
            self._message()  # that it was cancelled
            raise raised[0]
        message = self._message()
        self.failure = self.failure or message
        return None if message else result

    def _may_go_on(self, io_raised):
        """Nothing can be raised through the library: it is kept for later."""
        try:
            if self._poll:
                self._poll()
        except BaseException as error:
            io_raised.append(error)
        return not io_raised

    def _message(self):
        """What went wrong since it was last asked; "" if nothing did."""
        message = _TEXT()
        code = self._library.oidnGetDeviceError(self._device, ctypes.byref(message))
        return (message.value or b"unknown error").decode() if code else ""


def _declared(library):
    for name, (result, *arguments) in _FUNCTIONS.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


@contextlib.contextmanager
def open_denoiser(library: Path | None, settings: BakeSettings, poll: Callable[[], None]):
    """The denoiser of a bake, and why there is none: (Denoiser, "") or (None, reason)."""
    if settings.target != "lightmap" or not settings.denoise:
        yield None, "not asked for" if settings.target == "lightmap" else "vertex colours are no image"
        return
    if library is None:
        yield None, "no library of Open Image Denoise stands beside Blender"
        return
    try:
        denoiser = Denoiser(library, settings.thread_count, poll)
    except DenoiserError as error:
        yield None, str(error)
        return
    with denoiser:
        yield denoiser, ""
