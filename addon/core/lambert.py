"""Form factors from a surface element to a polygon, by Lambert's formula."""

from __future__ import annotations

import numpy as np


def element_factors(points, normal, corners):
    """Form factors from elements to polygons in front of them, positive where the polygon's front faces the element.

    F = 1 / (2 pi) sum_k angle_k n . g_k over edges, g_k the unit normal of the plane through the element and edge k
    (Lambert 1760; Howell, configuration factors, B-5). The polygon must lie above the element's horizon.

    Parameters
    ----------
    points : float64 (N, 3) [m]; normal : (3,) or (N, 3), unit; corners : (K, 3) or (N, K, 3) [m]

    Returns
    -------
    float64 (N,)
    """
    a = corners - points[:, None]
    b = np.roll(a, -1, axis=1)
    across = np.cross(a, b)
    sine = np.linalg.norm(across, axis=2)
    angle = np.arctan2(sine, (a * b).sum(axis=2))
    # an edge that the element sees as a point turns through no angle
    height = (across @ normal) if np.ndim(normal) == 1 else (across * normal[:, None]).sum(axis=2)
    return -(angle * height / np.where(sine > 0, sine, 1.0)).sum(axis=1) / (2 * np.pi)
