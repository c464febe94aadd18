"""What a hole lets out, and that nothing goes beside it."""

import numpy as np
import pytest

from addon.core.patches import subdivide
from addon.core.transport import MonteCarloFormFactors
from tests.scenes import box, kernel_of, rectangle, scene_of


def box_with_hole(side):
    """A unit cube with a square hole in the middle of its ceiling."""
    low, high = 0.5 - side / 2, 0.5 + side / 2
    ring = [((0, 0), (1, low)), ((0, high), (1, 1)), ((0, low), (low, high)), ((high, low), (1, high))]
    frames = [rectangle((*a, 1), (0, b[1] - a[1], 0), (b[0] - a[0], 0, 0)) for a, b in ring]
    return scene_of([box((0, 0, 0), (1, 1, 1), inwards=True, without=("+z",)), *frames])


@pytest.mark.parametrize(("side", "rays"), [(0.3, 1 << 16), (0.1, 1 << 18), (0.03, 1 << 18)])
def test_a_hole_lets_out_what_it_sees(side, rays):
    """Walls of equal radiosity send s^2 of it through a hole of side s: reciprocity, as the hole sees only walls."""
    scene = box_with_hole(side)
    with kernel_of(scene, 2) as kernel:
        patches = subdivide(scene, kernel, 10.0, 1000, 0)
        rows = MonteCarloFormFactors(kernel, rays, 0).rows(np.arange(0, 2 * len(patches), 2))
    # float32 sums of 2^18 shares keep six digits
    escaped = patches.areas * (1 - rows.sum(axis=1, dtype=np.float64))
    spread = np.sqrt((patches.areas * escaped.clip(0) / rays).sum())
    assert escaped.sum() == pytest.approx(side**2, abs=5 * spread + 2e-6 * patches.areas.sum())


@pytest.mark.parametrize("side", [0.1, 1e-2, 1e-3])
def test_rays_go_through_a_pinhole_and_not_beside_it(side):
    rng = np.random.default_rng(0)
    count = 20_000
    origins = rng.uniform((0.05, 0.05, 0.05), (0.95, 0.95, 0.9), (count, 3))
    across = rng.uniform(-0.5, 0.5, (count, 2))
    rim = across / np.abs(across).max(axis=1, keepdims=True) / 2  # on the hole's edge, in units of its side
    scene = box_with_hole(side)
    with kernel_of(scene) as kernel:
        for scale, is_through in ((1 - 1e-3, True), (1 + 1e-3, False)):
            points = np.column_stack([0.5 + rim * side * scale, np.ones(count)])
            triangles, _ = kernel.closest_hits(origins, points - origins)
            # a thousandth of 1e-3 m is sixteen float32 at 0.5 m: no ray may round to the other side of the edge
            assert ((triangles < 0) == is_through).all()
