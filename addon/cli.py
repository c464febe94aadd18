"""The command line: ``patchlight bake ...`` in a shell, ``blender --command patchlight bake ...`` in Blender.

Arguments in, exit code out: 0 only when the result was written, 1 after a one-line error, 130 after Ctrl-C.
Nothing heavy is imported before the arguments are known to be good, so that ``--help`` answers at once.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import sys
import tempfile
import time
from pathlib import Path

from .core.settings import METHODS, SOLVERS, TARGETS, BakeCancelled, BakeSettings, SettingsError
from .progress import ProgressBar

NO_BLENDER = (
    "Blender's Python module bpy is missing: with Python 3.11 run pip install 'patchlight[bpy]', "
    "or use blender --command patchlight"
)
EXIT_ERROR, EXIT_CANCELLED = 1, 130
# what a bake costs once the file is open and has its UVs, to hold against other bakers
STAGES_OF_A_BAKE = ("read", "texels", "solve", "gather", "write")
DEFAULTS = BakeSettings()


class CommandError(Exception):
    """A command that cannot be carried out as given; the message is one sentence for the user."""


def main(argv: list[str] | None = None) -> int:
    """Run one command, return its exit code. Expected failures become one line on stderr; bugs keep their traceback."""
    args = parser().parse_args(argv)
    try:
        args.run(args)
    except (KeyboardInterrupt, BakeCancelled):
        print("patchlight: cancelled, nothing was written", file=sys.stderr)
        return EXIT_CANCELLED
    except MemoryError:
        print("patchlight: error: not enough memory for this bake", file=sys.stderr)
        return EXIT_ERROR
    except _expected_errors() as error:
        print(f"patchlight: error: {error}", file=sys.stderr)
        return EXIT_ERROR
    return 0


def _expected_errors():
    """Exceptions with a message for the user; looked up after a failure because their modules import NumPy and bpy."""
    from .core.scene import SceneError

    errors = (CommandError, SettingsError, SceneError, OSError)
    if "bpy" in sys.modules:
        from .blender.files import FileError

        errors += (FileError,)
    return errors


# ---- arguments ----


def parser() -> argparse.ArgumentParser:
    """Every command and option."""
    top = argparse.ArgumentParser(prog="patchlight", description="Bake the diffuse light of interiors by radiosity.")
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    _add_bake(commands)
    demo = commands.add_parser("demo", help="write a .blend with the demo scenes, ready to bake")
    demo.add_argument("output", type=Path, metavar="OUT.blend")
    demo.set_defaults(run=run_demo)
    picture = commands.add_parser("picture", help="render a baked .blend, lit by nothing but the bake")
    picture.add_argument("input", type=Path, metavar="BAKED.blend")
    picture.add_argument("output", type=Path, metavar="OUT.png")
    picture.set_defaults(run=run_picture)
    return top


def _add_bake(commands):
    bake = commands.add_parser(
        "bake",
        help="bake a .blend and save it with the result",
        description="Bake the active scene of a .blend and save the file with the result inside.",
    )
    bake.set_defaults(run=run_bake)
    add = bake.add_argument
    add("input", type=Path, metavar="IN.blend")
    add("--output", type=Path, metavar="OUT.blend", help="where to save (default: IN_baked.blend beside IN.blend)")
    add("--target", choices=TARGETS, default=DEFAULTS.target, help="what to bake into (default: %(default)s)")
    add("--method", choices=METHODS, default=DEFAULTS.method, help="form factors (default: %(default)s)")
    add("--solver", choices=SOLVERS, default=DEFAULTS.solver, help="radiosity solver (default: %(default)s)")
    add("--error", type=float, default=DEFAULTS.error, help="relative error to reach (default: %(default)s)")
    add("--time-limit", type=float, metavar="SECONDS", help="stop sampling after so long, error reached or not")
    size = bake.add_mutually_exclusive_group()
    size.add_argument("--texels", type=int, metavar="N", help=f"lightmap size, about (default: {DEFAULTS.texels})")
    size.add_argument("--density", type=float, metavar="TEXELS_PER_M", help="lightmap size by texels per metre")
    add("--keep-uvs", action="store_true", help="use the objects' own 'Lightmap' UV layers instead of unwrapping")
    add("--objects", nargs="+", metavar="NAME", help="bake only these; the others still block and reflect light")
    add("--subdivide", type=float, metavar="METRES", help="cut larger faces first (target vertex)")
    add("--patch-size", type=float, metavar="METRES", help="longest edge of a patch (default: by the scene)")
    add("--seed", type=int, default=DEFAULTS.seed, help="the same seed gives the same bytes (default: %(default)s)")
    add("--threads", type=int, default=DEFAULTS.threads, metavar="N", help="0 = all cores (default)")
    add("--report", type=Path, metavar="OUT.json", help="write seconds, rays, error and warnings as JSON")
    add("--exr", type=Path, metavar="DIR", help="write the lightmaps as OpenEXR, too")


def settings_from(args: argparse.Namespace) -> BakeSettings:
    """The arguments of ``patchlight bake`` as validated settings."""
    return BakeSettings(
        target=args.target,
        method=args.method,
        solver=args.solver,
        error=args.error,
        time_limit=args.time_limit,
        texels=DEFAULTS.texels if args.texels is None else args.texels,
        density=args.density,
        keep_uvs=args.keep_uvs,
        patch_size=args.patch_size,
        seed=args.seed,
        threads=args.threads,
    )


# ---- commands ----


def run_bake(args: argparse.Namespace) -> None:
    """``patchlight bake``: open, read, bake, write, save; files appear only when all of the bake has succeeded."""
    settings = settings_from(args)
    output = args.output or args.input.with_name(f"{args.input.stem}_baked.blend")
    _check_bake_arguments(args, output)
    seconds: dict[str, float] = {}
    with _blender() as bpy, ProgressBar() as progress:
        from .blender import bake_scene, files
        from .core.bake import bake

        progress("load", 0.0)
        with _timed(seconds, "load"):
            files.open_blend(args.input)
        progress("read", 0.0)
        with _timed(seconds, "read"):
            prepared = bake_scene.prepare(bpy.context.scene, settings, args.objects, args.subdivide)
        try:
            result = bake(prepared.scene, settings, progress)
        except BaseException:
            bake_scene.discard(prepared)
            raise
        with _uninterrupted():
            with _timed(seconds, "write"):
                bake_scene.write(prepared, result)
            report = _save(args, output, result, seconds)
    _tell(args.input, output, report)


def run_demo(args: argparse.Namespace) -> None:
    """``patchlight demo``: the demo scenes as a .blend."""
    _check_writable(args.output)
    with _blender():
        from .blender import demo, files

        demo.build_demo()
        files.save_blend(args.output)
    print(f"demo scenes -> {args.output}")


def run_picture(args: argparse.Namespace) -> None:
    """``patchlight picture``: a PNG of a baked .blend in which nothing but the bake gives light."""
    _check_readable(args.input)
    _check_writable(args.output)
    with _blender():
        from .blender import files, picture

        files.open_blend(args.input)
        picture.render(args.output)
    print(f"picture of {args.input} -> {args.output}")


def _save(args, output, result, seconds):
    """Write every file that was asked for; returns the report with all seconds in it."""
    from .blender import files

    with _timed(seconds, "save"):
        if args.exr:
            args.exr.mkdir(parents=True, exist_ok=True)
            files.save_lightmaps(args.exr)
        files.save_blend(output)
    core_seconds = result.report.seconds
    stages = {**core_seconds, **seconds}
    seconds["bake"] = sum(stages.get(stage, 0.0) for stage in STAGES_OF_A_BAKE)
    report = result.report.with_stages(seconds)
    if args.report:
        args.report.write_text(json.dumps(report.as_dict(), indent=2) + "\n")
    return report


def _tell(source, output, report):
    for warning in report.warnings:
        print(f"patchlight: warning: {warning}", file=sys.stderr)
    seconds, error = report.seconds["bake"], report.estimated_error
    print(f"{source} -> {output}: baked in {seconds:.1f} s, estimated error {error:.3f}")


# ---- checks before the work ----


def _check_bake_arguments(args, output):
    _check_readable(args.input)
    _check_writable(output)
    if args.report:
        _check_writable(args.report)
    if args.exr:
        if args.target != "lightmap":
            raise CommandError("--exr writes lightmaps: it needs --target lightmap")
        _check_folder(args.exr if args.exr.exists() else args.exr.parent)
    if args.subdivide is not None and not (args.target == "vertex" and args.subdivide > 0):
        raise CommandError("--subdivide needs --target vertex and a length above 0 m")


def _check_readable(path):
    if not path.is_file():
        raise CommandError(f"{path} {'is a folder' if path.is_dir() else 'does not exist'}")


def _check_writable(path):
    _check_folder(path.parent)
    if path.is_dir():
        raise CommandError(f"{path} is a folder")
    if path.exists() and not os.access(path, os.W_OK):
        raise CommandError(f"{path} cannot be written")


def _check_folder(folder):
    """Try it: permission bits do not tell about read-only mounts, nor what root may do."""
    if not folder.is_dir():
        raise CommandError(f"{folder} is not a folder that exists")
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise CommandError(f"folder {folder} cannot be written: {error.strerror}") from error


# ---- around the work ----


@contextlib.contextmanager
def _blender():
    """Blender's module, silent on stdout (it tells every file that it opens), with Ctrl-C as Python has it."""
    with _silent_stdout():
        try:
            import bpy
        except ModuleNotFoundError as error:
            if error.name != "bpy":
                raise
            raise CommandError(NO_BLENDER) from error
        # Blender sets its own handler, which stops nothing of ours
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            yield bpy
        finally:
            signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def _silent_stdout():
    """Send what is written to file descriptor 1, also by C code, to nowhere."""
    sys.stdout.flush()
    kept = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)


@contextlib.contextmanager
def _uninterrupted():
    """Ctrl-C waits until the files are whole; by then the bake has succeeded and its result is kept."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def _timed(seconds, stage):
    started = time.perf_counter()
    try:
        yield
    finally:
        seconds[stage] = time.perf_counter() - started
