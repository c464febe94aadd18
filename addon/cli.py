"""The command line: ``patchlight bake ...`` in a shell, ``blender --command patchlight bake ...`` in Blender.

Arguments in, exit code out: 0 only when the result was written, 1 after a one-line error, 130 after Ctrl-C.
Nothing heavy is imported before the arguments are known to be good, so that ``--help`` answers at once.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import json
import os
import signal
import sys
import time
from pathlib import Path

from .cli_bench import add_bench
from .core.settings import METHODS, SOLVERS, TARGETS, BakeCancelled, BakeSettings, SettingsError
from .progress import ProgressBar

NO_BLENDER = (
    "Blender's Python module bpy is missing: with Python 3.11 run pip install 'patchlight[bpy]', "
    "or use blender --command patchlight"
)
EXIT_ERROR, EXIT_CANCELLED = 1, 130
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
    from .core.cases import CaseError
    from .core.scene import SceneError

    errors = (CommandError, SettingsError, SceneError, CaseError, OSError)
    if "bpy" in sys.modules:
        from .blender.files import FileError
        from .blender.picture import PictureError

        errors += (FileError, PictureError)
    return errors


# ---- arguments ----


def parser() -> argparse.ArgumentParser:
    """Every command and option."""
    top = argparse.ArgumentParser(prog="patchlight", description="Bake the diffuse light of interiors by radiosity.")
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    _add_bake(commands)
    demo = commands.add_parser("demo", help="write the demo scenes, cornell.blend and room.blend, ready to bake")
    demo.add_argument("folder", type=Path, metavar="DIR")
    demo.set_defaults(run=run_demo)
    picture = commands.add_parser("picture", help="render a baked .blend, lit by nothing but the bake")
    picture.add_argument("input", type=Path, metavar="BAKED.blend")
    picture.add_argument("output", type=Path, metavar="OUT.png")
    picture.add_argument("--lightmap", type=Path, metavar="OUT.png", help="the lightmap itself, too, to look at")
    picture.add_argument(
        "--bounces",
        type=int,
        default=0,
        metavar="N",
        help="trace so many bounces of sharp rays from mirrors, and glass; 0 = the bake alone (default)",
    )
    picture.set_defaults(run=run_picture)
    _add_verify(commands)
    add_bench(commands)
    return top


def _add_verify(commands):
    verify = commands.add_parser(
        "verify",
        help="compute exact cases and hold them against their values",
        description="Compute exact cases and hold them against their values; exit code 1 when one is off.",
    )
    verify.set_defaults(run=run_verify)
    add = verify.add_argument
    add("cases", type=Path, nargs="?", metavar="CASES.json", help="the cases (default: a set from closed forms)")
    add("--method", choices=("analytic", "hemicube", "monte-carlo"), default="analytic", help="form factors")
    add("--report", type=Path, metavar="OUT.json", help="write the results as JSON")
    add("--seed", type=int, default=DEFAULTS.seed, help="of the sampled methods (default: %(default)s)")
    add("--threads", type=int, default=DEFAULTS.threads, metavar="N", help="0 = all cores (default)")


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
    add("--apply-modifiers", action="store_true", help="bake objects whose modifiers make faces, and apply these")
    add("--subdivide", type=float, metavar="METRES", help="cut larger faces first (target vertex)")
    add("--patch-size", type=float, metavar="METRES", help="longest edge of a patch (default: by the scene)")
    add("--no-denoise", action="store_true", help="keep Blender's denoiser out of lightmaps")
    add(
        "--seed",
        type=int,
        default=DEFAULTS.seed,
        help="the same seed gives the same bytes, denoised on the same machine (default: %(default)s)",
    )
    add("--threads", type=int, default=DEFAULTS.threads, metavar="N", help="0 = all cores (default)")
    add("--report", type=Path, metavar="OUT.json", help="write seconds, rays, error and warnings as JSON")
    add("--exr", type=Path, metavar="DIR", help="write the lightmap as DIR/OUT.exr, too")


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
        denoise=not args.no_denoise,
        seed=args.seed,
        threads=args.threads,
    )


# ---- commands ----


def run_bake(args: argparse.Namespace) -> None:
    """``patchlight bake``: open, read, bake, write, save; files appear only when all of the bake has succeeded."""
    settings = settings_from(args)
    if args.exr and args.target != "lightmap":
        raise CommandError("--exr writes the lightmap: it needs --target lightmap")
    output = args.output or args.input.with_name(f"{args.input.stem}_baked.blend")
    seconds: dict[str, float] = {}
    with with_blender() as bpy, ProgressBar() as progress:
        from .blender import bake_scene, files
        from .blender.denoiser_library import denoiser_library
        from .core.bake import bake

        _require_writable(output, args)
        progress("load", 0.0)
        with _timed(seconds, "load"):
            files.open_blend(args.input)
        progress("read", 0.0)
        with _timed(seconds, "read"):
            prepared = bake_scene.prepare(
                bpy.context.scene, settings, args.objects, args.subdivide, args.apply_modifiers
            )
        result = bake(prepared.scene, settings, progress, denoiser_library())
        # from here on Ctrl-C waits until the files are whole: the bake has succeeded and its result is kept
        with _on_ctrl_c(signal.SIG_IGN):
            with _timed(seconds, "write"):
                bake_scene.write(prepared, result)
            with _timed(seconds, "save"):
                if args.exr:
                    _save_exr(prepared, args.exr / f"{output.stem}.exr")
                files.save_blend(output)
            report = result.report.with_stages(seconds)
            if args.report:
                args.report.write_text(json.dumps(report.as_dict(), indent=2) + "\n")
    _tell(args.input, output, report)


def run_demo(args: argparse.Namespace) -> None:
    """``patchlight demo``: the demo scenes as .blend files."""
    with with_blender():
        from .blender import demo

        paths = demo.save_demo(args.folder)
    for path in paths:
        print(path)


def run_picture(args: argparse.Namespace) -> None:
    """``patchlight picture``: a PNG of a baked .blend in which nothing but the bake gives light."""
    with with_blender() as bpy:
        from .blender import files, picture

        for path in (args.output, args.lightmap):
            if path:
                files.require_writable(path)
        files.open_blend(args.input)
        picture.render(args.output, *picture.size_of(bpy.context.scene), bounces=args.bounces)
        if args.lightmap:
            image = _lightmap(bpy.context.scene.objects)
            if image is None:
                raise CommandError(f"{args.input} holds no lightmap")
            picture.save_lightmap_png(image, args.lightmap)
    print(args.output)


def run_verify(args: argparse.Namespace) -> None:
    """``patchlight verify``: a line per case as it is done, the report, and an error when a case is off."""
    from .core import verify
    from .core.cases import load_cases
    from .core.estimators import make_estimator
    from .core.shipped_cases import shipped_cases
    from .core.workers import Workers

    cases = load_cases(args.cases) if args.cases else shipped_cases()
    if args.report:
        args.report.touch()  # fail before the work rather than after it
    print(verify.HEADER)
    with Workers(args.threads or os.cpu_count() or 1) as workers:
        estimator = make_estimator(args.method, workers, args.seed)
        results = verify.run_cases(cases, estimator, args.method, lambda result: print(verify.row(result), flush=True))
    print(verify.summary(results, args.method, estimator.setting))
    if args.report:
        report = verify.report(results, args.method, estimator.setting)
        args.report.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    failed = [result.id for result in results if not result.passed]
    if failed:
        raise CommandError(f"{len(failed)} of {len(results)} cases failed, the first is {failed[0]}")


def _require_writable(output, args):
    """Fail before the work rather than after it."""
    from .blender.files import require_writable

    require_writable(output)
    if args.report:
        require_writable(args.report)
    if args.exr:
        require_writable(args.exr / "lightmap.exr" if args.exr.is_dir() else args.exr)


def _save_exr(prepared, path):
    import bpy

    from .blender.files import save_exr

    path.parent.mkdir(exist_ok=True)
    save_exr(_lightmap(bpy.data.objects[(target.name, None)] for target in prepared.targets), path)


def _lightmap(objects):
    """The image that these objects are baked into: all targets of a bake share one; None without a bake."""
    from .blender.write_lightmap import IMAGE_PROPERTY

    return next((ob[IMAGE_PROPERTY] for ob in objects if ob.get(IMAGE_PROPERTY) is not None), None)


def _tell(source, output, report):
    for warning in report.warnings:
        print(f"patchlight: warning: {warning}", file=sys.stderr)
    seconds, error = report.seconds["bake"], report.estimated_error
    print(f"{source} -> {output}: baked in {seconds:.1f} s, estimated error {error:.3f}")


# ---- around the work ----


@contextlib.contextmanager
def with_blender():
    """Blender's module, silent on stdout (it tells every file that it opens), with Ctrl-C as Python has it."""
    with _silent_stdout():
        try:
            import bpy
        except ModuleNotFoundError as error:
            if error.name != "bpy":
                raise
            raise CommandError(NO_BLENDER) from error
        # Blender sets its own handler, which stops nothing of ours
        with _on_ctrl_c(signal.default_int_handler):
            yield bpy


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
def _on_ctrl_c(handler):
    before = signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        # None: it was set by C code, inside Blender, and Python cannot set it again; the command is over anyway
        if before is not None:
            signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def _timed(seconds, stage):
    started = time.perf_counter()
    try:
        yield
    finally:
        seconds[stage] = time.perf_counter() - started
