"""Other programs for form factors that pip installs, measured beside ours where they are there."""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .quadrature import fan

RAYSTRACK_RAYS = tuple(1 << k for k in range(3, 14, 2))  # of a cell of the emitter, in each replicate
RAYSTRACK_REPLICATES = 16  # as many as ours


@dataclass(frozen=True, slots=True)
class Peer:
    """A program and how to ask it.

    Attributes
    ----------
    name, version : str
    settings : what its effort is set to; (None,) where it has no such setting
    run : (case, setting, seed) -> F, rays or None, what it says of its own error or None
    """

    name: str
    version: str
    settings: tuple
    run: Callable

    def label(self, setting) -> str:
        """The setting in words."""
        return "-" if setting is None else f"rays {setting}/cell"


def installed_peers(threads: int = 1) -> tuple[list[Peer], list[str]]:
    """Those that can be imported, and a sentence for each that cannot; ``threads`` is what they may use."""
    peers, missing = [], []
    for name, settings, make in (
        ("pyviewfactor", (None,), _pyviewfactor),
        ("raystrack", RAYSTRACK_RAYS, _raystrack),
    ):
        try:
            run = make(importlib.import_module(name), threads)
        except ImportError as error:
            missing.append(f"{name} was not measured: {error} (pip install 'patchlight[bench]')")
            continue
        peers.append(Peer(name, importlib.metadata.version(name), settings, run))
    return peers, missing


def _pyviewfactor(module, _threads):
    """Contour integral; a pair is hidden, or not, by whether the ray between its centres is."""
    pyvista = importlib.import_module("pyvista")

    def polydata(polygons):
        counts = [len(polygon) for polygon in polygons]
        starts = np.cumsum([0, *counts])
        faces = np.concatenate([[n, *range(s, s + n)] for n, s in zip(counts, starts)])
        return pyvista.PolyData(np.concatenate(polygons), faces)

    def run(case, _setting, _seed):
        emitter, target = polydata([case.emitter]), polydata([case.target])
        if case.blockers:
            triangles = polydata([triangle for blocker in case.blockers for triangle in fan(blocker)])
            if not module.get_obstruction(target, emitter, triangles)[0]:
                return 0.0, None, None
        return float(module.compute_viewfactor(target, emitter)), None, None

    return run


def _raystrack(module, threads):
    """Cosine rays from shifted Halton sequences, over a BVH in float32."""
    numba = importlib.import_module("numba")
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))

    def run(case, rays, seed):
        meshes = {}
        for k, polygon in enumerate(case.polygons):
            corners = fan(polygon).reshape(-1, 3).astype(np.float32)
            meshes[f"s{k}"] = module.Mesh(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))
        options = module.SolveOptions(
            sampling=module.Sampling(rays_per_cell=rays, seed=seed + 1),
            # a tolerance that is never met: it stops when all replicates are done
            accuracy=module.Accuracy(RAYSTRACK_REPLICATES, 1e-12, min_replicates=RAYSTRACK_REPLICATES),
        )
        scene, channel = module.Scene.from_meshes(meshes), module.Channel("surface", "s1", "front")
        # its own choice of a BVH is timed anew for every scene, for a second
        with module.Solver(scene, device="cpu", bvh="builtin", auto_tune=False) as solver:
            result = solver.solve(module.Query.pair("s0", "s1", receiver_sides=("front",)), options)
        return float(result.value("s0", channel) or 0.0), result.cumulative_rays, result.error("s0", channel)

    return run
