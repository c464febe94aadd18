"""Opening and saving: whole or not at all, and one clear sentence when it fails."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import bpy

FULL = 1 << 16  # bytes left on a disk, and fewer
# Plain, gzip (before 3.0) and Zstandard.
BLEND_STARTS = (b"BLENDER", b"\x1f\x8b", b"\x28\xb5\x2f\xfd")


class FileError(ValueError):
    """A file that cannot be read or written; the message names it."""


def open_blend(path) -> None:
    """Open a .blend in place of what is open."""
    path = Path(path)
    if not path.is_file():
        raise FileError(f"{path}: there is no such file")
    try:
        start = _first_bytes(path)
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror})") from error
    if not start.startswith(BLEND_STARTS):
        raise FileError(f"{path}: is not a .blend file")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.resolve()), load_ui=False)
    except RuntimeError as error:
        raise FileError(f"{path}: cannot be opened ({_reason(error)})") from error


def require_writable(path) -> None:
    """FileError unless a file can be made at ``path``; to be asked before the work is done."""
    path = Path(path)
    if path.is_dir():
        raise FileError(f"{path}: is a folder, not a file")
    if path.exists() and not path.is_file():  # a device or a pipe
        return
    folder = path.resolve().parent
    if not folder.is_dir():
        raise FileError(f"{folder}: there is no such folder")
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise FileError(f"{folder}: cannot be written to ({error.strerror})") from error


def require_savable(path) -> None:
    """The same for what is written beside ``path`` and renamed, which would take a device's place."""
    require_writable(path)
    if Path(path).exists() and not Path(path).is_file():
        raise FileError(f"{path}: is a device, not a file")


def save_blend(path) -> None:
    """Save the open file as ``path``, compressed as the file that it came from."""
    _write_whole(
        path,
        lambda part: bpy.ops.wm.save_as_mainfile(filepath=str(part), copy=True, compress=_is_source_compressed()),
    )


def save_exr(image, path) -> None:
    """Save an image as a 32-bit OpenEXR, linear, without alpha."""
    scene = bpy.data.scenes.new("Patchlight EXR")
    try:
        output = scene.render.image_settings
        output.file_format = "OPEN_EXR"
        output.color_mode, output.color_depth, output.exr_codec = "RGB", "32", "ZIP"
        _write_whole(path, lambda part: image.save_render(str(part), scene=scene))
    finally:
        bpy.data.scenes.remove(scene)


def _write_whole(path, write):
    """Write beside ``path`` under another name and rename, so that a failure leaves what was there."""
    require_savable(path)
    path = Path(path).resolve()
    part = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        write(part)
        os.replace(part, path)
    except (RuntimeError, OSError) as error:
        # Blender gives whatever reason came last
        reason = "the disk is full" if shutil.disk_usage(path.parent).free < FULL else _reason(error)
        raise FileError(f"{path}: cannot be saved ({reason})") from error
    finally:
        part.unlink(missing_ok=True)


def _is_source_compressed():
    source = Path(bpy.data.filepath)
    return source.is_file() and not _first_bytes(source).startswith(BLEND_STARTS[0])


def _first_bytes(path):
    with path.open("rb") as file:
        return file.read(8)


def _reason(error):
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1].removeprefix("Error: ") if lines else type(error).__name__
