"""Builds the Blender extension: `python native/build.py [PLATFORM ...]`, one validated zip per platform in dist/.

The kernels are cross-compiled by Zig's C compiler, so that one machine makes all of them and the Linux one runs on
every glibc that Blender runs on. With `--host-kernel` the kernel that is already in addon/core is packed instead.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SHIPPED = ("__init__.py", "blender_manifest.toml", "README.md", "LICENSE", "addon")
EXTENSION_TOOL = "bpy/4.5/scripts/addons_core/bl_pkg/cli/blender_ext.py"
# platform of Blender -> (Zig's target, kernel's file name, wheel tags to ask pip for)
PLATFORMS = {
    "linux-x64": (
        "x86_64-linux-gnu.2.28",
        "_kernel.abi3.so",
        ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64"),
    ),
    "windows-x64": ("x86_64-windows-gnu", "_kernel.pyd", ("win_amd64",)),
    "macos-arm64": ("aarch64-macos.11.0", "_kernel.abi3.so", ("macosx_13_0_arm64", "macosx_11_0_arm64")),
    "macos-x64": ("x86_64-macos.11.0", "_kernel.abi3.so", ("macosx_13_0_x86_64", "macosx_10_14_x86_64")),
}
# What the limited API needs to know about 64-bit Windows.
WINDOWS_PYCONFIG = """
#define MS_WINDOWS
#define Py_ENABLE_SHARED 1
#define HAVE_DECLSPEC_DLL 1
#define HAVE_STDDEF_H 1
#define HAVE_STDINT_H 1
#define SIZEOF_VOID_P 8
#define SIZEOF_SIZE_T 8
#define SIZEOF_INT 4
#define SIZEOF_LONG 4
#define SIZEOF_LONG_LONG 8
#define SIZEOF_WCHAR_T 2
#define PY_SSIZE_T_MAX 9223372036854775807LL
typedef long long Py_ssize_t;
"""


def main() -> None:
    parser = argparse.ArgumentParser(description="Build the Blender extension.")
    parser.add_argument("platforms", nargs="*", metavar="PLATFORM", help=", ".join(PLATFORMS))
    parser.add_argument("--host-kernel", action="store_true", help="pack addon/core/_kernel.* as it is")
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder of the zips (default: dist)")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    for platform in args.platforms or PLATFORMS:
        print(build_zip(platform, args.output, args.host_kernel))


def build_zip(platform: str, output: Path, host_kernel: bool) -> Path:
    """Stage, build and validate the zip of one platform; returns its path."""
    stage = ROOT / "build" / f"extension-{platform}"
    shutil.rmtree(stage, ignore_errors=True)
    stage.mkdir(parents=True)
    for name in SHIPPED:
        _copy(ROOT / name, stage / name)
    kernel = PLATFORMS[platform][1]
    if host_kernel:
        shutil.copy(ROOT / "addon" / "core" / kernel, stage / "addon" / "core" / kernel)
    else:
        built = compile_kernel(platform, ROOT / "build" / f"kernel-{platform}" / kernel)
        shutil.copy(built, stage / "addon" / "core" / kernel)
    version = _keep_wheels_of(platform, stage / "blender_manifest.toml")
    _extension_tool("build", "--source-dir", stage, "--output-dir", output, "--split-platforms")
    path = output / f"patchlight-{version}-{platform.replace('-', '_')}.zip"
    _extension_tool("validate", path)
    return path


def compile_kernel(platform: str, output: Path) -> Path:
    """Cross-compile the kernel with the flags and sources of pyproject.toml, in a folder of its own."""
    shutil.rmtree(output.parent, ignore_errors=True)
    output.parent.mkdir(parents=True)
    target = PLATFORMS[platform][0]
    extension = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["ext-modules"][0]
    command = _zig("cc", "-target", target, "-shared", "-s", "-o", output, *extension["extra-compile-args"])
    command += [f"-D{name}={value}" for name, value in extension["define-macros"]]
    command += [f"-I{ROOT / folder}" for folder in extension["include-dirs"]]
    command += [ROOT / source for source in extension["sources"]]
    # the host's Python headers: the limited API is the same in all of them, but not pyconfig.h
    headers = sysconfig.get_path("include")
    if platform.startswith("windows"):
        command += _windows_python(output.parent / "python", headers)
    elif platform.startswith("macos"):
        command += ["-isystem", headers, "-undefined", "dynamic_lookup"]
    else:
        command += ["-isystem", headers, "-fPIC", "-lm", "-ldl"]
    subprocess.run([str(word) for word in command], check=True)
    return output


def _windows_python(folder, headers):
    """Arguments to compile and link against python3.dll: a pyconfig.h and an import library made here."""
    shutil.copytree(headers, folder, ignore=shutil.ignore_patterns("internal"))
    (folder / "pyconfig.h").write_text(WINDOWS_PYCONFIG)
    names = set()
    for header in folder.rglob("*.h"):
        names |= set(re.findall(r"\b_?Py\w+", header.read_text(errors="replace")))
    is_data = re.compile(r"PyExc_\w+|Py\w+_Type|_Py_\w+Struct")
    exports = "\n".join(f"  {name}{' DATA' if is_data.fullmatch(name) else ''}" for name in sorted(names))
    definition, library = folder / "python3.def", folder / "python3.lib"
    definition.write_text(f"LIBRARY python3.dll\nEXPORTS\n{exports}\n")
    subprocess.run(
        _zig("dlltool", "-m", "i386:x86-64", "-D", "python3.dll", "-d", definition, "-l", library), check=True
    )
    return ["-isystem", folder, library]


def _keep_wheels_of(platform, manifest):
    """Cut the staged manifest down to one platform and fetch its wheels; returns the extension's version."""
    text = manifest.read_text()
    tags = PLATFORMS[platform][2]
    wheels = tomllib.loads(text)["wheels"]
    kept = [wheel for wheel in wheels if any(tag in wheel for tag in tags)]
    for wheel in set(wheels) - set(kept):
        text = text.replace(f'    "{wheel}",\n', "")
    manifest.write_text(re.sub(r"^platforms = .*$", f'platforms = ["{platform}"]', text, flags=re.M))
    for wheel in kept:
        _copy(_fetched(Path(wheel).name, tags), manifest.parent / wheel)
    return tomllib.loads(text)["version"]


def _fetched(name, tags):
    """The wheel of that name in wheels/, downloaded once."""
    path = ROOT / "wheels" / name
    if not path.exists():
        project, version, python = name.split("-")[:3]
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
        command += ["--only-binary=:all:", "--python-version", python.removeprefix("cp"), "--abi", python]
        command += [word for tag in tags for word in ("--platform", tag)]
        subprocess.run([*command, "--dest", str(path.parent), f"{project}=={version}"], check=True)
    return path


def _copy(source, target):
    if source.is_dir():
        shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__", "_kernel.*"))
    else:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(source, target)


def _extension_tool(*words):
    """Blender's own script, which needs no Blender."""
    tool = Path(sysconfig.get_path("purelib")) / EXTENSION_TOOL
    subprocess.run([sys.executable, str(tool), *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def _zig(*words):
    return [sys.executable, "-m", "ziglang", *map(str, words)]


if __name__ == "__main__":
    main()
