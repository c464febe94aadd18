"""Seconds and error of Patchlight and of Cycles' diffuse bake: the same file, UVs, texels and cores, one reference.

    python tests/bench/beside_cycles.py S.blend S.npz --out DIR [--errors 0.1 0.05] [--samples 4 16] [--as-it-is]

Cycles bakes with all objects joined into one mesh, its best case: as they are it starts anew for each object, which
``--as-it-is`` measures too. Only its bake operator is timed; ours is the report's ``seconds.bake``: neither unwraps.
Where pyoidn is installed, each joined bake is denoised, too (Open Image Denoise, filter RTLightmap), its time added.
Two comparisons are printed: the time to a p50 of 1 %, Cycles' by 1 / sqrt(N), and that to be as good in p50 and in
p95 as each row of ours.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import bpy
import numpy as np
from patchlight.blender.files import open_blend
from patchlight.blender.read_mesh import LIGHTMAP_LAYER
from patchlight.blender.score_bake import load_reference, score
from patchlight.blender.write_lightmap import IMAGE_PROPERTY

try:
    import pyoidn
except ImportError:
    pyoidn = None

AIM = 0.01  # of p50, at which times are compared
BOUNCES = 32
FURTHEST = 100  # times the seconds of the last row: further than that no line through two rows is believed
MARGIN = 4  # texels: bilinear lookup at a chart's border needs them


def main() -> None:
    """Bake with both, print a table, write it as JSON."""
    args = arguments()
    args.out.mkdir(parents=True, exist_ok=True)
    if pyoidn is None:
        print("pyoidn is not installed: no denoised rows")
    reference = load_reference(args.reference)
    rows = [ours(args, error, reference) for error in args.errors]
    baked = rows[0]["file"]
    for is_joined in (True, False) if args.as_it_is else (True,):
        for samples in args.samples:
            rows += cycles(baked, samples, is_joined, reference)
    (args.out / "cycles.json").write_text(json.dumps(rows, indent=1))
    print_table(rows)


def arguments():
    """The command line."""
    parser = argparse.ArgumentParser(description="Patchlight against Cycles: seconds and error, the same texels.")
    parser.add_argument("blend", type=Path)
    parser.add_argument("reference", type=Path)
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument("--errors", type=float, nargs="+", default=[0.2, 0.1, 0.05])
    parser.add_argument("--samples", type=int, nargs="+", default=[1, 4, 16])
    parser.add_argument("--texels", type=int, default=1 << 18)
    parser.add_argument("--as-it-is", action="store_true", help="with its objects not joined, too")
    return parser.parse_args()


def ours(args, error, reference) -> dict:
    """One bake in a process of its own, and how wrong it is."""
    file, report = args.out / f"ours_{error:g}.blend", args.out / f"ours_{error:g}.json"
    command = [Path(sys.executable).with_name("patchlight"), "bake", args.blend, "--output", file, "--report", report]
    command += ["--target", "lightmap", "--texels", str(args.texels), "--error", str(error)]
    subprocess.run(list(map(str, command)), check=True)
    open_blend(file)
    seconds = json.loads(report.read_text())["seconds"]["bake"]
    return {"way": f"patchlight, error {error:g}", "seconds": seconds, "file": str(file), **result(reference)}


def cycles(baked, samples, is_joined, reference) -> list[dict]:
    """Cycles' bake over the UVs of ours, and denoised; its pixels are looked up through our file."""
    open_blend(baked)
    image = next(o[IMAGE_PROPERTY] for o in bpy.data.objects if IMAGE_PROPERTY in o)
    chosen = [o for o in bpy.context.scene.objects if IMAGE_PROPERTY in o]
    target = bpy.data.images.new("Cycles", *image.size, alpha=False, float_buffer=True, is_data=True)
    for blender_object in chosen:
        aim_at(blender_object, target)
    select(join(chosen) if is_joined else chosen)
    set_up(bpy.context.scene, samples)
    started = time.perf_counter()
    bpy.ops.object.bake(
        type="DIFFUSE", pass_filter={"DIRECT", "INDIRECT"}, uv_layer=LIGHTMAP_LAYER, margin=MARGIN, use_clear=True
    )
    seconds = time.perf_counter() - started
    pixels = np.empty((image.size[1], image.size[0], 4), np.float32)
    target.pixels.foreach_get(pixels.ravel())
    way = f"cycles{' joined' if is_joined else ''}"
    rows = [{"way": f"{way}, {samples} samples", "seconds": seconds, **looked_up(baked, pixels, reference)}]
    if is_joined and pyoidn is not None:
        started = time.perf_counter()
        pixels[..., :3] = pyoidn.denoise(np.ascontiguousarray(pixels[..., :3]), filter_type="RTLightmap")
        seconds += time.perf_counter() - started
        way = f"{way} and denoised, {samples} samples"
        rows.append({"way": way, "seconds": seconds, **looked_up(baked, pixels, reference)})
    return rows


def looked_up(baked, pixels, reference) -> dict:
    """The error of pixels (H, W, 4) in the place of our lightmap's."""
    open_blend(baked)
    image = next(o[IMAGE_PROPERTY] for o in bpy.data.objects if IMAGE_PROPERTY in o)
    image.pixels.foreach_set(pixels.ravel())
    return result(reference)


def aim_at(blender_object, image) -> None:
    """Make the image the active one of every material, where the operator bakes into."""
    slots = blender_object.material_slots
    if not slots:
        blender_object.data.materials.append(bpy.data.materials.new("grey"))
    for slot in slots:
        if slot.material is None:
            slot.material = bpy.data.materials.new("grey")
        slot.material.use_nodes = True
        nodes = slot.material.node_tree.nodes
        node = nodes.get("Bench") or nodes.new("ShaderNodeTexImage")
        node.name, node.image = "Bench", image
        nodes.active = node


def select(chosen) -> None:
    """Select these objects and no other."""
    for blender_object in bpy.context.view_layer.objects:
        blender_object.select_set(False)
    for blender_object in chosen:
        blender_object.hide_set(False)
        blender_object.hide_select = False
        blender_object.select_set(True)
    bpy.context.view_layer.objects.active = chosen[0]


def join(chosen):
    """One mesh of all, as evaluated."""
    select(chosen)
    if len(chosen) > 1:
        bpy.ops.object.make_single_user(object=True, obdata=True)
        bpy.ops.object.convert(target="MESH")
        bpy.ops.object.join()
    return [bpy.context.view_layer.objects.active]


def set_up(scene, samples) -> None:
    """Plain path tracing on all cores: every sample is taken, nothing is clamped, cut off or denoised."""
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = BOUNCES
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0
    scene.cycles.light_sampling_threshold = 0


def result(reference) -> dict:
    """The open file's error, as plain numbers."""
    found = score(reference)
    return {key: getattr(found, key) for key in ("p50", "p95", "error", "bias", "missing")}


def seconds_at_aim(rows) -> float:
    """Time to p50 = AIM: of the cheapest row that is there, else by 1 / sqrt(N) from the best one."""
    reached = [row["seconds"] for row in rows if row["p50"] <= AIM]
    best = min(rows, key=lambda row: row["p50"])
    return min(reached) if reached else best["seconds"] * (best["p50"] / AIM) ** 2


def seconds_to_match(theirs, wanted) -> tuple[float, str]:
    """Time until p50 and p95 are both as good as in the row ``wanted``, and how it is known.

    It is found on a line through the logarithms of two rows, those about it or else the last two; infinite where these
    do not fall. Where the first row is as good, its time is the most that it may be.
    """
    return max(seconds_until(theirs, measure, wanted[measure]) for measure in ("p50", "p95"))


def seconds_until(rows, measure, wanted) -> tuple[float, str]:
    """The same for one measure."""
    rows = sorted(rows, key=lambda row: row["seconds"])
    if rows[0][measure] <= wanted:
        return rows[0]["seconds"], "at most"
    pairs = list(pairwise(rows))
    between = next((pair for pair in pairs if pair[1][measure] <= wanted), None)
    before, after = between or pairs[-1]
    fall = np.log(before[measure] / after[measure])
    if fall <= 0:
        return np.inf, "by its rows never"
    share = np.log(before[measure] / wanted) / fall
    seconds = before["seconds"] * (after["seconds"] / before["seconds"]) ** share
    furthest = FURTHEST * rows[-1]["seconds"]
    if seconds > furthest:
        return furthest, "by its last two rows more than"
    return seconds, "between its rows" if between else "by its last two rows"


def print_table(rows) -> None:
    """The rows, then how many times sooner."""
    print("| way | seconds | p50 | p95 | error | bias |\n| --- | --- | --- | --- | --- | --- |")
    for row in rows:
        print(
            f"| {row['way']} | {row['seconds']:.1f} | "
            + " | ".join(f"{row[k]:.4f}" for k in ("p50", "p95", "error", "bias"))
            + " |"
        )
    kinds = {}
    for row in rows:
        kinds.setdefault(row["way"].split(",")[0], []).append(row)
    mine = kinds.pop("patchlight")
    here = seconds_at_aim(mine)
    for kind, theirs in kinds.items():
        if "denoised" not in kind:
            there = seconds_at_aim(theirs)
            print(
                f"p50 = {AIM:g}: patchlight {here:.1f} s, {kind} {there:.0f} s (1 / sqrt(N)), {there / here:.0f} times"
            )
        for row in mine if len(theirs) > 1 else ():
            there, how = seconds_to_match(theirs, row)
            times = there / row["seconds"]
            print(f"as good as {row['way']} in p50 and p95: {kind} {how} {there:.0f} s, {times:.0f} times")


if __name__ == "__main__":
    main()
