"""Plots of a bench: error against seconds and against rays, both logarithmic, a panel for each scene of each stage."""

from __future__ import annotations

import math
from pathlib import Path

from .bench_row import BenchRow

FLOOR = 1e-10  # errors below are drawn here: rounding is all that is left
AXES = {"seconds": "seconds", "rays": "rays traced"}
STAGES = {"factor": "form factor", "solve": "solver on patches", "bake": "bake", "blend": "bake of a file"}
# one colour for each way in all panels of a row (Okabe & Ito's, told apart by all eyes)
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999933")
MARKERS = "os^Dvph*"


def save_plots(rows: list[BenchRow], folder: Path) -> list[Path]:
    """bench_seconds.png and bench_rays.png in ``folder``; raises ImportError without matplotlib."""
    return [_save(rows, axis, folder / f"bench_{axis}.png") for axis in AXES]


def _save(rows, axis, path):
    """A row of panels for each stage, its legend at the end."""
    from matplotlib.figure import Figure

    stages = {stage: [one for one in rows if one.stage == stage] for stage in STAGES}
    stages = {stage: own for stage, own in stages.items() if own}
    columns = 1 + max(len(_scenes(own)) for own in stages.values())
    figure = Figure(figsize=(4.2 * columns, 3.6 * len(stages)), layout="constrained")
    grid = figure.subplots(len(stages), columns, squeeze=False)
    for panels, (stage, own) in zip(grid, stages.items()):
        styles = _styles(own)
        for axes, scene in zip(panels, _scenes(own)):
            _draw(axes, [one for one in own if one.scene == scene], axis, styles)
            axes.set_title(f"{STAGES[stage]}: {scene}", fontsize=10)
        for axes in panels[len(_scenes(own)) :]:
            axes.set_axis_off()
        _legend(panels[len(_scenes(own))], styles, own, axis)
    figure.savefig(path, dpi=110)
    return path


def _scenes(rows):
    return list(dict.fromkeys(one.scene for one in rows))


def _styles(rows):
    """Colour and marker of each way, in order of appearance."""
    ways = dict.fromkeys(map(_way, rows))
    return {way: (COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]) for k, way in enumerate(ways)}


def _way(one):
    return one.method if one.solver == "-" else "auto" if one.solver == "auto" else f"{one.solver}, {one.method}"


def _draw(axes, rows, axis, styles):
    for way in dict.fromkeys(map(_way, rows)):
        own = [one for one in rows if _way(one) == way]
        colour, marker = styles[way]
        errors = [max(one.error, FLOOR) for one in own]
        if getattr(own[0], axis) is None:
            # without rays there is no place on this axis, but an error to compare with
            axes.axhline(errors[0], color=colour, linestyle=":")
        else:
            axes.plot([getattr(one, axis) for one in own], errors, color=colour, marker=marker, ms=5, lw=1.4)
    axes.set(xscale="log", yscale="log", xlabel=AXES[axis], ylabel="relative RMS error")
    _whole_decades(axes)
    axes.grid(True, which="major", color="0.88")


def _whole_decades(axes):
    """Limits at powers of ten, so that a narrow range shows no more digits than it has."""
    from matplotlib.ticker import LogLocator, NullFormatter

    for name in ("x", "y"):
        low, high = getattr(axes, f"get_{name}lim")()
        low, high = math.floor(math.log10(low)), math.ceil(math.log10(high))
        getattr(axes, f"set_{name}lim")(10.0**low, 10.0 ** max(high, low + 1))
        scale = getattr(axes, f"{name}axis")
        scale.set_major_locator(LogLocator(10, numticks=8))
        scale.set_minor_formatter(NullFormatter())


def _legend(axes, styles, rows, axis):
    from matplotlib.lines import Line2D

    handles = []
    for way, (colour, marker) in styles.items():
        has_place = any(getattr(one, axis) is not None for one in rows if _way(one) == way)
        look = {"marker": marker} if has_place else {"linestyle": ":"}
        handles.append(Line2D([], [], color=colour, label=way if has_place else f"{way} (no rays)", ms=5, **look))
    axes.legend(handles=handles, loc="center left", fontsize=9, frameon=False)
