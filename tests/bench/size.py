"""How time and memory grow: bakes of a grid of furnished rooms against triangles, texels, objects and threads.

    make bench-size SIZE_OPTIONS="[--quick] [--error E]"

Each bake runs in a process of its own, without a denoiser. Under each table stands the exponent of every stage that
takes a second or more, from the smallest to the largest bake, beside that of N log N. ``--quick``: not the largest.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
from patchlight.core.bake import bake
from patchlight.core.scene import AreaLight, Material, Scene, SceneObject
from patchlight.core.settings import BakeSettings

TRIANGLES, TEXELS = (10**4, 10**5, 10**6, 3 * 10**6), (1 << 18, 1 << 20, 1 << 22, 1 << 24)
USUAL_TRIANGLES, USUAL_TEXELS = 10**5, 1 << 20
QUICK = 2  # the first so many of each
STAGES = ("unwrap", "texels", "solve", "gather")
LEAST_SECONDS = 1.0  # of a stage whose exponent is told
ALLOWED_BYTES = (2 << 30, 64, 400)  # at all, a texel, a triangle: what a bake is meant to take at most


def main() -> None:
    """A table for triangles, one for texels, one for objects and threads; all rows as JSON."""
    args = arguments()
    if args.worker:
        print(json.dumps(one_bake(*args.worker, args.error)))
        return
    args.out.mkdir(parents=True, exist_ok=True)
    count = QUICK if args.quick else None

    def measured(triangles=USUAL_TRIANGLES, texels=USUAL_TEXELS, is_joined=0, threads=0):
        return run(args, triangles, texels, is_joined, threads)

    by_triangles = [measured(triangles=n) for n in TRIANGLES[:count]]
    print_table(f"Triangles, {USUAL_TEXELS} texels", by_triangles)
    print_exponents(by_triangles, "triangles")
    by_texels = [measured(texels=n) for n in TEXELS[:count]]
    print_table(f"Texels, {USUAL_TRIANGLES} triangles", by_texels)
    print_exponents(by_texels, "texels")
    others = [measured(), measured(is_joined=1), measured(threads=1), measured(threads=2)]
    print_table("As it is; joined into one mesh; one thread; two", others)
    print_ratios(others[2], others[3])
    rows = [*by_triangles, *by_texels, *others]
    (args.out / "size.json").write_text(json.dumps(rows, indent=1))


def arguments():
    """The command line."""
    parser = argparse.ArgumentParser(description="Time and memory of bakes against their size.")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--error", type=float, default=0.2)
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument("--worker", type=int, nargs=4, help=argparse.SUPPRESS)
    return parser.parse_args()


def run(args, *what) -> dict:
    """One bake in a process of its own."""
    command = [sys.executable, __file__, "--error", args.error, "--worker", *what]
    done = subprocess.run(list(map(str, command)), check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def one_bake(triangles, texels, is_joined, threads, error) -> dict:
    """Seconds by stage, peak memory and error of one bake."""
    scene = rooms(triangles, bool(is_joined))
    report = bake(scene, BakeSettings(texels=texels, error=error, threads=threads)).report
    return {
        "triangles": len(scene.triangles),
        "objects": len(scene.objects),
        "texels": report.receivers,
        "threads": threads,
        "seconds": {stage: report.seconds[stage] for stage in STAGES},
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "error": report.estimated_error,
        "rays": report.rays,
    }


# ---- the scene ----


def rooms(triangles, is_joined) -> Scene:
    """About so many triangles of rooms in a square, each with a lamp and eleven objects; or all of it as one object."""
    parts = furnished_room()
    count = max(1, round(triangles / sum(len(part) for _, part in parts)))
    side = math.isqrt(count - 1) + 1
    shifts = np.array([(4.2 * (k % side), 4.2 * (k // side), 0) for k in range(count)])
    room = np.concatenate([part for _, part in parts])
    corners = (room + shifts[:, None, None, None]).reshape(-1, 3, 3)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    firsts = np.cumsum([0] + [len(part) for _, part in parts])
    objects = [
        SceneObject(f"{name}.{k}", k * len(room) + first, len(part))
        for k in range(count)
        for (name, part), first in zip(parts, firsts)
    ]
    lamps = [
        AreaLight(f"lamp.{k}", tuple(np.add(shift, (2, 2, 2.6))), (0, 0.3, 0), (0.3, 0, 0), (20.0, 19.0, 17.0))
        for k, shift in enumerate(shifts)
    ]
    return Scene(
        vertices=corners.reshape(-1, 3),
        triangles=np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3),
        corner_normals=np.repeat(flat[:, None], 3, axis=1).astype(np.float32),
        uvs=np.zeros((len(corners), 3, 2), np.float32),
        triangle_materials=np.zeros(len(corners), np.int32),
        objects=(SceneObject("all", 0, len(corners)),) if is_joined else tuple(objects),
        materials=(Material("paint", (0.7, 0.65, 0.6)),),
        lights=tuple(lamps),
    )


def furnished_room():
    """Names and triangles (N, 3, 3) of one room of 4 x 4 x 2.7 m, open to the next one at a door."""
    room = box((0, 0, 0), (4, 4, 2.7))[:, ::-1]
    open_room = room[[k for k in range(12) if k not in (10, 11)]]  # but for the wall at x = 4, which has a door
    door = np.concatenate([quad((4, 0, 0), (0, 1.5, 0), (0, 0, 2.7)), quad((4, 2.5, 0), (0, 1.5, 0), (0, 0, 2.7))])
    parts = [("shell", np.concatenate([open_room, door[:, ::-1]])), ("table", table((1.2, 1.4, 0), 1.2, 0.75))]
    parts += [(f"chair{k}", table((0.6 + 0.7 * k, 0.7, 0), 0.4, 0.45)) for k in range(4)]
    parts += [(f"vase{k}", ball((0.5 + k, 3.2, 0.4), 0.25)) for k in range(3)]
    parts += [("shelf", box((3.5, 0.3, 0), (3.9, 1.2, 1.8))), ("rug", ripples((2.2, 2.2, 0.01), 1.4))]
    return parts


def box(low, high):
    """Twelve triangles that look outwards, x = high last."""
    (x, y, z), (a, b, c) = low, np.subtract(high, low)
    faces = [
        quad((x, y, z), (0, b, 0), (a, 0, 0)), quad((x, y, z + c), (a, 0, 0), (0, b, 0)),
        quad((x, y, z), (a, 0, 0), (0, 0, c)), quad((x, y + b, z), (0, 0, c), (a, 0, 0)),
        quad((x, y, z), (0, 0, c), (0, b, 0)), quad((x + a, y, z), (0, b, 0), (0, 0, c)),
    ]  # fmt: skip
    return np.concatenate(faces)


def quad(corner, u, v):
    """Two triangles that look along u x v."""
    a, b, c, d = (np.add(corner, shift) for shift in ((0, 0, 0), u, np.add(u, v), v))
    return np.array([(a, b, c), (a, c, d)])


def table(corner, size, height):
    """A top on four legs."""
    x, y, z = corner
    top = box((x, y, z + height - 0.04), (x + size, y + size, z + height))
    ends = (0.0, size - 0.05)
    legs = [box((x + i, y + j, z), (x + i + 0.05, y + j + 0.05, z + height - 0.04)) for i in ends for j in ends]
    return np.concatenate([top, *legs])


def ball(centre, radius, rows=24, columns=48):
    """A ball of quads, and triangles at its poles."""
    polar, round_ = np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, columns + 1)
    grid = np.stack([np.outer(np.sin(polar), np.cos(round_)), np.outer(np.sin(polar), np.sin(round_)),
                     np.outer(np.cos(polar), np.ones(columns + 1))], axis=-1)  # fmt: skip
    return woven(np.asarray(centre) + radius * grid)


def ripples(corner, size, steps=40):
    """A rug that is not quite flat."""
    x, y = np.meshgrid(*[np.linspace(0, size, steps + 1)] * 2, indexing="ij")
    return woven(np.asarray(corner) + np.stack([x, y, 0.01 + 0.01 * np.sin(9 * x)], axis=-1))


def woven(grid):
    """Triangles between the points of a grid (I, J, 3), without those that have no area."""
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    both = np.concatenate([np.stack(three, axis=2).reshape(-1, 3, 3) for three in ((a, b, c), (a, c, d))])
    return both[np.linalg.norm(np.cross(both[:, 1] - both[:, 0], both[:, 2] - both[:, 0]), axis=1) > 1e-9]


# ---- what is printed ----


def print_table(title, rows) -> None:
    """One line a bake."""
    print(
        f"\n{title}\n\n| triangles | objects | texels | threads | {' | '.join(STAGES)} | MB, of those allowed | error |"
    )
    print("| --- " * (7 + len(STAGES)) + "|")
    for row in rows:
        seconds = " | ".join(f"{row['seconds'][stage]:.1f}" for stage in STAGES)
        base, of_texel, of_triangle = ALLOWED_BYTES
        allowed = (base + of_texel * row["texels"] + of_triangle * row["triangles"]) / 2**20
        sizes = f"{row['triangles']} | {row['objects']} | {row['texels']} | {row['threads'] or 'all'}"
        print(f"| {sizes} | {seconds} | {row['megabytes']:.0f} of {allowed:.0f} | {row['error']:.3f} |", flush=True)


def print_exponents(rows, size) -> None:
    """p of seconds ~ size^p between the first and the last, and what N log N would have."""
    first, last = rows[0], rows[-1]
    span = math.log(last[size] / first[size])
    told = [
        f"{stage} {math.log(last['seconds'][stage] / first['seconds'][stage]) / span:.2f}"
        for stage in STAGES
        if last["seconds"][stage] >= LEAST_SECONDS and first["seconds"][stage] > 0
    ]
    n_log_n = 1 + math.log(math.log(last[size]) / math.log(first[size])) / span
    print(f"\nExponents over {size}: {', '.join(told)}; N log N has {n_log_n:.2f}", flush=True)


def print_ratios(one, two) -> None:
    """How many times quicker two threads are, stage by stage."""
    told = [f"{stage} {one['seconds'][stage] / two['seconds'][stage]:.2f}" for stage in STAGES]
    print(f"\nTwo threads are so many times quicker than one: {', '.join(told)}")


if __name__ == "__main__":
    main()
