"""Nodes whose output hangs on where they are seen from, at their mean over the directions that light leaves for: what a
surface that many look at sends on, whatever each of them sees."""

from __future__ import annotations

import numpy as np

from .shader_nodes import Reached, Unreadable, constant

MOST_BLEND = 1 - 1e-5  # as in Cycles
NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)
COSINES, SHARES = 0.5 * (NODES + 1), 0.5 * WEIGHTS * (NODES + 1)  # 2 cos d(cos), which has the sum 1


def mean_over_view(reached: Reached) -> float:
    """The cosine-weighted mean over a hemisphere of a Fresnel or Layer Weight node's output, seen from the front.

    Raises
    ------
    Unreadable : another node, or one whose number varies over the surface
    """
    if reached.node.type == "FRESNEL":
        return float(SHARES @ fresnel(COSINES, constant(reached.feeding("IOR"))))
    if reached.node.type != "LAYER_WEIGHT":
        raise Unreadable(f"{reached.node.bl_label} node")
    blend = min(max(constant(reached.feeding("Blend")), 0.0), MOST_BLEND)
    if reached.socket.name == "Fresnel":
        return float(SHARES @ fresnel(COSINES, 1 / (1 - blend)))
    exponent = 2 * blend if blend < 0.5 else 0.5 / (1 - blend)
    return 1 - 2 / (exponent + 2)


def fresnel(cosines, ior: float) -> np.ndarray:
    """What a dielectric reflects of unpolarised light, by the cosine of incidence (Walter et al. 2007, eq. 22)."""
    ior = max(ior, 1e-5)
    squared = ior**2 - 1 + cosines**2
    g = np.sqrt(np.maximum(squared, 0))
    away, along = (g - cosines) / (g + cosines), (cosines * (g + cosines) - 1) / (cosines * (g - cosines) + 1)
    return np.where(squared > 0, 0.5 * away**2 * (1 + along**2), 1.0)
