"""The command line: ``patchlight bake ...`` in a shell, ``blender --command patchlight bake ...`` in Blender.

Arguments in, exit code out: 0 only when the result was written, 1 after a one-line error, 130 after Ctrl-C.
Nothing heavy is imported before the arguments are known to be good, so that ``--help`` answers at once.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from .cli_bake import DEFAULTS, add_bake
from .cli_bench import add_bench
from .core.settings import BakeCancelled, SettingsError, thread_count
from .in_blender import CommandError, require_apart, with_blender, with_open_stdout

EXIT_ERROR, EXIT_CANCELLED = 1, 130


def main(argv: list[str] | None = None) -> int:
    """Run one command, return its exit code. Expected failures become one line on stderr; bugs keep their traceback."""
    with_open_stdout()
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
    add_bake(commands)
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


# ---- commands ----


def run_demo(args: argparse.Namespace) -> None:
    """``patchlight demo``: the demo scenes as .blend files."""
    with with_blender():
        from .blender import demo

        paths = demo.save_demo(args.folder)
    for path in paths:
        print(path)


def run_picture(args: argparse.Namespace) -> None:
    """``patchlight picture``: a PNG of a baked .blend in which nothing but the bake gives light."""
    require_apart("OUT.png", args.output, (args.input, args.lightmap))
    if args.lightmap:
        require_apart("--lightmap", args.lightmap, (args.input,))
    with with_blender() as bpy:
        from .blender import files, picture
        from .blender.write_lightmap import lightmap_of

        for path in (args.output, args.lightmap):
            if path:
                files.require_savable(path)
        files.open_blend(args.input)
        image = lightmap_of(bpy.context.scene.objects) if args.lightmap else None
        if args.lightmap and image is None:
            raise CommandError(f"{args.input} holds no lightmap")
        picture.render(args.output, *picture.size_of(bpy.context.scene), bounces=args.bounces)
        if image is not None:
            picture.save_lightmap_png(image, args.lightmap)
    print(args.output)


def run_verify(args: argparse.Namespace) -> None:
    """``patchlight verify``: a line per case as it is done, the report, and an error when a case is off."""
    from .core import verify
    from .core.cases import load_cases
    from .core.estimators import make_estimator
    from .core.shipped_cases import shipped_cases
    from .core.workers import Workers

    if args.report:
        require_apart("--report", args.report, (args.cases,))
    threads = thread_count(args.threads)
    cases = load_cases(args.cases) if args.cases else shipped_cases()
    if args.report:
        args.report.touch()  # fail before the work rather than after it
    print(verify.HEADER)
    with Workers(threads) as workers:
        estimator = make_estimator(args.method, workers, args.seed)
        results = verify.run_cases(cases, estimator, args.method, lambda result: print(verify.row(result), flush=True))
    print(verify.summary(results, args.method, estimator.setting))
    if args.report:
        report = verify.report(results, args.method, estimator.setting)
        args.report.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    failed = [result.id for result in results if not result.passed]
    if failed:
        raise CommandError(f"{len(failed)} of {len(results)} cases failed, the first is {failed[0]}")
