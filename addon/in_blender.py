"""Around a command's work: Blender's module, its talk, and Ctrl-C."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys

NO_BLENDER = (
    "Blender's Python module bpy is missing: with Python 3.11 run pip install 'patchlight[bpy]', "
    "or use blender --command patchlight"
)


class CommandError(Exception):
    """A command that cannot be carried out as given; the message is one sentence for the user."""


@contextlib.contextmanager
def with_blender():
    """Blender's module, silent on stdout (it tells every file that it opens), with Ctrl-C as Python has it."""
    with _silent_stdout():
        cancelled = []
        # raised while Blender starts, it would end in C code, which goes on or crashes
        with on_ctrl_c(lambda *_: cancelled.append(True)):
            bpy = _imported()
        if cancelled:
            raise KeyboardInterrupt
        # Blender sets its own handler, which stops nothing of ours
        with on_ctrl_c(signal.default_int_handler):
            yield bpy


def _imported():
    try:
        import bpy
    except ModuleNotFoundError as error:
        if error.name != "bpy":
            raise
        raise CommandError(NO_BLENDER) from error
    return bpy


def require_apart(option, path, others) -> None:
    """CommandError where a file to be written is one of ``others`` (paths or None): it would take that one's place."""
    if path.resolve() in {other.resolve() for other in others if other}:
        raise CommandError(f"{option} {path} is another file of this command: it needs one of its own")


def is_stdout_file(path) -> bool:
    """Whether a path is what stdout leads to, as /dev/stdout is."""
    try:
        return os.path.samestat(os.stat(path), os.fstat(1))
    except OSError:
        return False


def with_open_stdout() -> None:
    """Let stdout lead nowhere where whoever started the command has closed it: files would take its number."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w")
        os.dup2(sys.stdout.fileno(), 1)


@contextlib.contextmanager
def _silent_stdout():
    """Send to nowhere what Python writes to stdout, and what C code writes to file descriptor 1."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        os.dup2(nowhere.fileno(), 1)
        try:
            yield
        finally:
            if os.name == "posix":
                ctypes.CDLL(None).fflush(None)  # what C still holds back would come out after this
            os.dup2(kept, 1)
            os.close(kept)


@contextlib.contextmanager
def on_ctrl_c(handler):
    """Ctrl-C does what ``handler`` says while the work in here runs."""
    before = signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        # None: it was set by C code, inside Blender, and Python cannot set it again; the command is over anyway
        if before is not None:
            signal.signal(signal.SIGINT, before)
