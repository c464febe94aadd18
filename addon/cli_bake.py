"""``patchlight bake``: open, read, bake, write, save."""

from __future__ import annotations

import argparse
import contextlib
import json
import signal
import sys
import time
from pathlib import Path

from .core.settings import METHODS, SOLVERS, TARGETS, BakeSettings
from .in_blender import CommandError, is_stdout_file, on_ctrl_c, require_apart, with_blender
from .progress import ProgressBar

DEFAULTS = BakeSettings()


def add_bake(commands) -> None:
    """The command's arguments."""
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
    add(
        "--smooth-angle",
        type=float,
        metavar="DEGREES",
        help="smooth faces that meet at less share vertex colours (target vertex; default: "
        f"{DEFAULTS.smooth_angle_deg:g})",
    )
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


def bake_arguments(words: list[str]) -> argparse.Namespace:
    """What the words after ``patchlight bake`` ask for."""
    parser = argparse.ArgumentParser(prog="patchlight")
    add_bake(parser.add_subparsers())
    return parser.parse_args(["bake", *words])


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
        smooth_angle_deg=DEFAULTS.smooth_angle_deg if args.smooth_angle is None else args.smooth_angle,
        seed=args.seed,
        threads=args.threads,
    )


def run_bake(args: argparse.Namespace) -> None:
    """``patchlight bake``: open, read, bake, write, save; files appear only when all of the bake has succeeded."""
    settings = settings_from(args)
    if not args.input.name:
        raise CommandError(f"{args.input}: is a folder, not a .blend file")
    output = args.output or args.input.with_name(f"{args.input.stem}_baked.blend")
    exr = args.exr / f"{output.stem}.exr" if args.exr else None
    _require_sense(args, output, exr)
    seconds: dict[str, float] = {}
    with contextlib.ExitStack() as at_last, with_blender() as bpy, ProgressBar() as progress:
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
        with on_ctrl_c(signal.SIG_IGN):
            with _timed(seconds, "write"):
                bake_scene.write(prepared, result)
            with _timed(seconds, "save"):
                files.save_blend(output)
            # as soon as stdout is there again, and whatever becomes of the EXR
            at_last.callback(_report, args, output, result.report.with_stages(seconds))
            if exr:
                _save_exr(prepared, exr)


def _require_sense(args, output, exr):
    if args.exr and args.target != "lightmap":
        raise CommandError("--exr writes the lightmap: it needs --target lightmap")
    if args.smooth_angle is not None and args.target != "vertex":
        raise CommandError("--smooth-angle is of vertex colours: it needs --target vertex")
    if args.target != "lightmap" and (args.density is not None or args.keep_uvs):
        raise CommandError("--density and --keep-uvs are of lightmaps: they need --target lightmap")
    if args.report:
        require_apart("--report", args.report, (args.input, output, exr))


def _require_writable(output, args):
    """Fail before the work rather than after it."""
    from .blender.files import require_savable, require_writable

    require_savable(output)
    if args.report:
        require_writable(args.report)
    if args.exr and args.exr.exists():
        if not args.exr.is_dir():
            raise CommandError(f"--exr {args.exr}: is a file, not a folder")
        require_writable(args.exr / "lightmap.exr")
    elif args.exr:
        require_writable(args.exr)


def _save_exr(prepared, path):
    import bpy

    from .blender.files import save_exr
    from .blender.write_lightmap import lightmap_of

    path.parent.mkdir(exist_ok=True)
    save_exr(lightmap_of(bpy.data.objects[(target.name, None)] for target in prepared.targets), path)


def _report(args, output, report):
    """Write it, and tell what a person wants to know; of two things on stdout one would spoil the other."""
    is_stdout = args.report and is_stdout_file(args.report)
    if args.report:
        text = json.dumps(report.as_dict(), indent=2) + "\n"
        sys.stdout.write(text) if is_stdout else args.report.write_text(text)
    for warning in report.warnings:
        print(f"patchlight: warning: {warning}", file=sys.stderr)
    seconds, error = report.seconds["bake"], report.estimated_error
    summary = f"{args.input} -> {output}: baked in {seconds:.1f} s, estimated error {error:.3f}"
    print(summary, file=sys.stderr if is_stdout else sys.stdout)


@contextlib.contextmanager
def _timed(seconds, stage):
    started = time.perf_counter()
    try:
        yield
    finally:
        seconds[stage] = time.perf_counter() - started
