"""How much of a kernel's time is Embree's: our rays per second against a bare loop over the very same rays.

    python tests/bench/embree_rate.py [S.blend] [--texels N] [--receivers N]

A recorder stands between the kernel and Embree. Each kernel runs once to have its rays kept, then in turn with the bare
loop of rtcIntersect1 and rtcOccluded1 over them, on one thread; medians of five. Without a file, the demo room.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np
from patchlight.blender import bake_scene, demo
from patchlight.blender.files import open_blend
from patchlight.core import kernel as kernel_module
from patchlight.core.emitters import emitters_of
from patchlight.core.gather import NEAR
from patchlight.core.gather_job import REPLICATES
from patchlight.core.gather_sums import no_sums
from patchlight.core.guides import learn_guides
from patchlight.core.radiosity import solve_radiosity
from patchlight.core.receivers import surface_receivers
from patchlight.core.seen_light import SeenLight
from patchlight.core.settings import BakeSettings
from patchlight.core.sky import with_suns
from patchlight.core.smoothing import texel_grid
from patchlight.core.sound_faces import sound_faces
from patchlight.core.texel_light import split_where_blocked, texel_light
from patchlight.core.texels import texels
from patchlight.core.unwrap import unwrap
from patchlight.core.workers import Workers

ROOT = Path(__file__).resolve().parents[2]
RUNS = 5
SHADOW_SAMPLES, RAYS = 16, 2  # of a receiver, and of its replicates, as in a bake's first pass at an error of 0.2
MOST_RAYS = 1 << 24


def main() -> None:
    """A line for each kernel: rays, both rates, their ratio."""
    args = arguments()
    with tempfile.TemporaryDirectory() as folder:
        recorder = open_recorder(Path(folder))
        open_blend(args.blend or next(p for p in demo.save_demo(folder) if p.stem == "room"))
        settings = BakeSettings(texels=args.texels, error=0.2)
        scene = with_suns(sound_faces(bake_scene.prepare(bpy.context.scene, settings).scene).scene)
        print("| kernel | rays | ours [M rays/s] | bare loop [M rays/s] | of the bare loop |")
        print("| --- | --- | --- | --- | --- |")
        with Workers(1) as workers:
            for name, run in kernels(scene, settings, workers, args.receivers).items():
                print_row(name, *measured(recorder, run))


def arguments():
    """The command line."""
    parser = argparse.ArgumentParser(description="Our kernels' rays per second against Embree's own.")
    parser.add_argument("blend", type=Path, nargs="?")
    parser.add_argument("--texels", type=int, default=1 << 18)
    parser.add_argument("--receivers", type=int, default=1 << 15, help="of the texels, that light is measured at")
    return parser.parse_args()


def open_recorder(folder):
    """The recorder, as the library that the kernel opens for Embree."""
    library, real = folder / "librecorder.so", kernel_module.embree_path()
    command = ["cc", "-O2", "-shared", "-fPIC", "-I", ROOT / "native/include", "-I", ROOT / "native/src"]
    command += [Path(__file__).with_name("embree_recorder.c"), "-o", library]
    command += ["-Wl,--no-as-needed", real, f"-Wl,-rpath,{real.parent}", "-ldl"]
    subprocess.run(list(map(str, command)), check=True)
    recorder = ctypes.CDLL(str(library))
    recorder.recorder_keep.argtypes = [ctypes.c_size_t]
    recorder.recorder_count.restype, recorder.recorder_replay.restype = ctypes.c_size_t, ctypes.c_double
    if not recorder.recorder_open(str(real).encode()):
        raise SystemExit(f"{real} is not Embree")
    kernel_module.embree_path = lambda: library
    return recorder


def kernels(scene, settings, workers, count):
    """What is measured: direct light and final gather, at so many of the texels, in their order."""
    charts = unwrap(scene, settings)
    texel_map = texels(charts)
    everywhere = surface_receivers(scene, texel_map.triangles, texel_map.barycentrics)
    grid = texel_grid(scene, charts, texel_map, everywhere)
    # how much light there is on the texels makes no difference to the time
    ones = np.ones((len(texel_map), 3), np.float32)
    receivers = everywhere.part(np.unique(np.linspace(0, len(texel_map) - 1, min(count, len(texel_map))).astype(int)))
    kernel = kernel_module.KernelScene(scene, workers)
    is_split = split_where_blocked(kernel, grid.receivers, everywhere, grid.spacing)
    light = texel_light(grid.uvs, grid.receivers, is_split, NEAR * grid.spacing)
    light.show(ones)
    solved = solve_radiosity(scene, kernel, emitters_of(scene, kernel.centre), settings, lambda done: None)
    seen = SeenLight(solved.patches, solved.sources, light)
    guides, _ = learn_guides(kernel, seen, receivers, 3)
    everyone = np.arange(len(receivers), dtype=np.uint32)

    def gather():
        sums = no_sums(len(receivers), REPLICATES)
        kernel.gather(seen, receivers, guides, everyone, 0, RAYS, 1, sums)

    return {"direct": lambda: kernel.direct(solved.sources, receivers, SHADOW_SAMPLES, 1), "gather": gather}


def measured(recorder, run):
    """Rays, and the medians of our seconds and the bare loop's."""
    if not recorder.recorder_keep(MOST_RAYS):
        raise SystemExit("no memory to keep the rays in")
    run()
    rays = recorder.recorder_count()
    recorder.recorder_keep(0)
    if rays > MOST_RAYS:
        raise SystemExit(f"{rays} rays are more than the {MOST_RAYS} that are kept: ask for fewer --receivers")
    ours, bare = [], []
    for _ in range(RUNS):
        started = time.perf_counter()
        run()
        ours.append(time.perf_counter() - started)
        bare.append(recorder.recorder_replay())
    return rays, float(np.median(ours)), float(np.median(bare))


def print_row(name, rays, ours, bare) -> None:
    """One line of the table."""
    rates = f"{rays / ours / 1e6:.2f} | {rays / bare / 1e6:.2f}"
    print(f"| {name} | {rays} | {rates} | {100 * bare / ours:.0f} % |", flush=True)


if __name__ == "__main__":
    main()
