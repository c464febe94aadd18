"""``patchlight bench``: speed against error on exact scenes, and on a .blend with a reference."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
import tempfile
from pathlib import Path

from .cli_bake import bake_arguments, run_bake
from .in_blender import CommandError, with_blender

SCENES = ("cube", "l-room", "spheres")
BLEND_ERRORS, QUICK_ERRORS = (0.1, 0.05, 0.02), (0.1,)
QUICK_TEXELS = 1 << 16
NO_MATPLOTLIB = "the plots need matplotlib, which is missing: pip install 'patchlight[bench]', or leave out --out"


def add_bench(commands) -> None:
    """The command's arguments."""
    bench = commands.add_parser(
        "bench",
        help="measure speed against error",
        description="Measure seconds, rays and memory against the error, for every form-factor method and every "
        "solver, on scenes with exact light; with --out write bench.json and plots.",
    )
    bench.set_defaults(run=run_bench)
    add = bench.add_argument
    add("--scenes", nargs="*", choices=SCENES, default=SCENES, help="exact scenes (default: all)")
    add("--blend", type=Path, metavar="SCENE.blend", help="bake this, too, at several errors")
    add("--reference", type=Path, metavar="REF.npz", help="and score it at the points of this reference")
    add("--out", type=Path, metavar="DIR", help="write bench.json, bench_seconds.png and bench_rays.png")
    add("--quick", action="store_true", help="few settings, small scenes")
    add("--runs", type=int, default=3, metavar="N", help="of each row, for the medians (default: %(default)s)")
    add("--seed", type=int, default=0, help="of the first run (default: %(default)s)")
    add("--threads", type=int, default=0, metavar="N", help="0 = all cores (default)")


def run_bench(args) -> None:
    """A line per row as it is done, then what was left out, then the files."""
    from .core import bench, bench_plot
    from .core.bench_row import HEADER, row

    reference = _checked(args)
    options = bench.BenchOptions(tuple(args.scenes), args.quick, args.runs, args.seed, args.threads)

    def tell(one):
        print(row(one), flush=True)

    print(HEADER)
    rows, missing = bench.run_bench(options, tell)
    if args.blend:
        rows += _blend_rows(args, reference, options, tell)
    for sentence in missing:
        print(sentence)
    if args.out:
        path = args.out / "bench.json"
        path.write_text(json.dumps(bench.report(rows, options, missing), indent=1) + "\n", encoding="utf-8")
        for written in (path, *bench_plot.save_plots(rows, args.out)):
            print(written)


def _checked(args):
    """Fail before the work rather than after it; the reference, None where none is asked for."""
    if (args.blend is None) != (args.reference is None):
        raise CommandError("--blend and --reference go together: the one is baked, the other says how it should be")
    if args.out:
        if importlib.util.find_spec("matplotlib") is None:
            raise CommandError(NO_MATPLOTLIB)
        args.out.mkdir(parents=True, exist_ok=True)
    if not args.blend:
        return None
    with with_blender():
        from .blender.score_bake import load_reference

        return load_reference(args.reference)


def _blend_rows(args, reference, options, tell):
    """The .blend baked as by ``patchlight bake``, and scored; a bake takes minutes, so each is run once."""
    from .core.bench_row import measured

    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for error in QUICK_ERRORS if options.is_quick else BLEND_ERRORS:
            names = ("blend", args.blend.stem, "auto", "auto", f"error {error:g}")
            command = [str(args.blend), "--error", str(error), "--seed", str(options.seed),
                       "--threads", str(options.threads)]  # fmt: skip
            if options.is_quick:
                command += ["--texels", str(QUICK_TEXELS)]
            one = measured(names, 1, lambda _: _baked(command, reference, Path(folder)))  # noqa: B023
            rows.append(one)
            tell(one)
    return rows


def _baked(command, reference, folder):
    """One bake into a file that is thrown away; how to judge it."""
    from .core.bench_row import Outcome

    output, told = folder / "baked.blend", folder / "report.json"
    # its line about the file, and its warnings, are not this command's
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        run_bake(bake_arguments([*command, "--output", str(output), "--report", str(told)]))

    def judge():
        with with_blender():
            from .blender.files import open_blend
            from .blender.score_bake import score

            open_blend(output)
            scored = score(reference)
        report = json.loads(told.read_text())
        return Outcome(scored.error, sum(report["rays"].values()), report["seen_error"], report["seconds"]["bake"])

    return judge
