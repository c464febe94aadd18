"""Plots of a bench: error against seconds and against rays, both logarithmic, a panel for each scene of each stage."""

from __future__ import annotations

from pathlib import Path

from .bench_row import BenchRow

FLOOR = 1e-10  # errors below are drawn here: rounding is all that is left
COLUMNS = 3
AXES = {"seconds": "seconds", "rays": "rays traced"}
STAGES = {"factor": "form factor", "solve": "patches", "bake": "bake", "blend": "bake of"}
# one colour for each way in all panels (Okabe & Ito's, told apart by all eyes)
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999933")
MARKERS = "os^Dvph*"


def save_plots(rows: list[BenchRow], folder: Path) -> list[Path]:
    """bench_seconds.png and bench_rays.png in ``folder``; raises ImportError without matplotlib."""
    return [_save(rows, axis, folder / f"bench_{axis}.png") for axis in AXES]


def _save(rows, axis, path):
    from matplotlib.figure import Figure

    panels = list(dict.fromkeys((one.stage, one.scene) for one in rows))
    lines = -(-len(panels) // COLUMNS)
    figure = Figure(figsize=(5.2 * min(len(panels), COLUMNS), 4.2 * lines), layout="constrained")
    grid = figure.subplots(lines, min(len(panels), COLUMNS), squeeze=False).ravel()
    styles = _styles(rows)
    for axes, panel in zip(grid, panels):
        _draw(axes, [one for one in rows if (one.stage, one.scene) == panel], axis, styles)
        axes.set_title(f"{STAGES[panel[0]]} {panel[1]}", fontsize=11)
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    figure.savefig(path, dpi=110)
    return path


def _styles(rows):
    """Colour and marker of each way, in order of appearance within its kind of stage."""
    styles = {}
    for is_factor in (True, False):
        ways = dict.fromkeys(_way(one) for one in rows if (one.stage == "factor") == is_factor)
        styles |= {way: (COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]) for k, way in enumerate(ways)}
    return styles


def _way(one):
    return one.method if one.solver == "-" else "auto" if one.solver == "auto" else f"{one.solver}, {one.method}"


def _draw(axes, rows, axis, styles):
    for way in dict.fromkeys(map(_way, rows)):
        own = [one for one in rows if _way(one) == way]
        colour, marker = styles[way]
        errors = [max(one.error, FLOOR) for one in own]
        if getattr(own[0], axis) is None:
            # without rays there is no place on this axis, but an error to compare with
            axes.axhline(errors[0], color=colour, linestyle=":", label=f"{way}, no rays")
        else:
            axes.plot([getattr(one, axis) for one in own], errors, color=colour, marker=marker, label=way, ms=5, lw=1.4)
    axes.set(xscale="log", yscale="log", xlabel=AXES[axis], ylabel="relative RMS error")
    axes.grid(True, which="major", color="0.88")
    axes.legend(fontsize=8, framealpha=0.85)
