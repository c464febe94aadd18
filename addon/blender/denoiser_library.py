"""Where Blender keeps Open Image Denoise."""

from __future__ import annotations

import ctypes.util
import sys
from pathlib import Path

import bpy

PATTERNS = {  # from the folder that holds the one of Blender's version
    "linux": "lib/libOpenImageDenoise.so*",
    "win32": "blender.shared/OpenImageDenoise.dll",
    "darwin": "lib/libOpenImageDenoise*.dylib",
}


def denoiser_library() -> Path | None:
    """The library that this Blender denoises with, else the system's, as distributions have it; None: there is none."""
    folder = Path(bpy.utils.resource_path("LOCAL")).parent
    # not its parts, whose names go on: _core, _device_cpu
    found = [path for path in folder.glob(PATTERNS.get(sys.platform, "none")) if "_" not in path.name]
    if found:
        return min(found)
    name = ctypes.util.find_library("OpenImageDenoise")
    return Path(name) if name else None
