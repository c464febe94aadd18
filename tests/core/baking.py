"""Small bakes, as luminance."""

import numpy as np

from addon.core.bake import bake
from addon.core.settings import BakeSettings

TEXELS = 48 * 48
COARSE = 0.12  # [m], of patches: the rooms are 1 m wide, and rows of form factors cost their square
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def lightmap_of(scene, **settings):
    """Luminance of the lightmap (H, W) and the report."""
    result = bake(
        scene, BakeSettings(**{"texels": TEXELS, "error": 0.05, "threads": 2, "patch_size": COARSE, **settings})
    )
    assert result.corner_colours is None
    return result.lightmap.pixels @ LUMINANCE, result.report


def colours_of(scene, **settings):
    """Luminance of the corner colours (T, 3) and the report."""
    result = bake(
        scene, BakeSettings(**{"target": "vertex", "error": 0.05, "threads": 2, "patch_size": COARSE, **settings})
    )
    assert result.lightmap is None
    return result.corner_colours @ LUMINANCE, result.report
