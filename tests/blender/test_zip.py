"""The extension zip: what is in it, and that it installs, enables and bakes in a Blender that knows nothing of us."""

import importlib.util
import json
import os
import platform
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("bpy")

ROOT = Path(__file__).resolve().parents[2]
PLATFORMS = {("Linux", "x86_64"): "linux-x64", ("Darwin", "arm64"): "macos-arm64", ("Darwin", "x86_64"): "macos-x64"}

INSTALL_AND_BAKE = """
import json, os, sys
import bpy
bpy.ops.extensions.package_install_files(filepath=sys.argv[1], repo="user_default", enable_on_install=True)
sys.path.append(sys.argv[2])
from tests.cube_room import build_cube_room
room = build_cube_room()
bpy.context.scene.patchlight.size = 64
bpy.context.scene.patchlight.error = 0.1
finished = bpy.ops.patchlight.bake()
import embreex, xatlas
pixels = list(room["patchlight_lightmap"].pixels)
name = "bl_ext.user_default.patchlight"
import addon_utils
addon_utils.disable(name)
was_removed = not hasattr(bpy.types.Scene, "patchlight")
addon_utils.enable(name)
print("RESULT " + json.dumps({
    "finished": list(finished), "brightest": max(pixels), "was_removed": was_removed,
    "came_back": hasattr(bpy.types.Scene, "patchlight"),
    "module": sys.modules[name].__file__, "embreex": embreex.__file__, "xatlas": xatlas.__file__,
}))
"""


@pytest.fixture(scope="module")
def extension_zip(tmp_path_factory):
    """The zip of this machine's platform, with the kernel that the tests use."""
    here = PLATFORMS.get((platform.system(), platform.machine()))
    if here is None:
        pytest.skip(f"the extension is not made for {platform.system()} {platform.machine()}")
    spec = importlib.util.spec_from_file_location("native_build", ROOT / "native" / "build.py")
    build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    return build.build_zip(here, tmp_path_factory.mktemp("zip"), host_kernel=True)


@pytest.fixture(scope="module")
def bare_site(tmp_path_factory):
    """A site-packages folder with bpy and what it needs, but nothing of ours: no embreex, no xatlas, no patchlight."""
    site = tmp_path_factory.mktemp("site")
    ours = ("embreex", "xatlas", "patchlight", "__editable__")
    for entry in Path(sysconfig.get_path("purelib")).iterdir():
        if not entry.name.startswith(ours) and entry.suffix != ".pth":
            (site / entry.name).symlink_to(entry)
    return site


def test_holds_the_add_on_and_nothing_else(extension_zip):
    names = set(zipfile.ZipFile(extension_zip).namelist())
    assert {"blender_manifest.toml", "__init__.py", "LICENSE", "README.md", "addon/core/_kernel.abi3.so"} <= names
    sources = {path.relative_to(ROOT).as_posix() for path in (ROOT / "addon").rglob("*.py")}
    assert sources <= names
    rest = (
        names - sources - {"blender_manifest.toml", "__init__.py", "LICENSE", "README.md", "addon/core/_kernel.abi3.so"}
    )
    assert all(name.startswith("wheels/") and name.endswith(".whl") for name in rest), rest
    assert sorted(Path(name).name.split("-")[0] + Path(name).name.split("-")[2] for name in rest) == [
        *("embreexcp311", "embreexcp313", "embreexcp314", "xatlascp311", "xatlascp313"),
    ]


def test_installs_and_bakes_from_an_empty_user_folder(extension_zip, bare_site, tmp_path):
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path), "PYTHONPATH": str(bare_site)}
    # -S: no site-packages of this venv, so that what is imported can only come from the zip's wheels
    command = [sys.executable, "-S", "-c", INSTALL_AND_BAKE, str(extension_zip), str(ROOT)]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    results = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    assert done.returncode == 0, done.stderr
    assert results, done.stdout + done.stderr

    result = json.loads(results[0].removeprefix("RESULT "))
    assert result["finished"] == ["FINISHED"]
    assert result["brightest"] > 0
    assert result["was_removed"]
    assert result["came_back"]
    for name in ("module", "embreex", "xatlas"):
        assert Path(result[name]).is_relative_to(tmp_path), name
