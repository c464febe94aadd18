"""No ray escapes where faces meet: T-junctions, and boxes that stick in each other."""

import numpy as np
import pytest

from addon.core.bake import bake
from addon.core.emitters import emitters_of
from addon.core.patches import subdivide
from addon.core.receivers import surface_receivers
from addon.core.scene import AreaLight, Material
from addon.core.settings import BakeSettings
from addon.core.transport import MonteCarloFormFactors
from tests.physics.plates import factors, noise
from tests.physics.test_form_factors import C_11
from tests.scenes import BLACK, box, kernel_of, rectangle, scene_of


def test_no_ray_escapes_through_a_t_junction():
    """A wall of three rectangles with a vertex of two in the middle of the third's edge; 600k rays at the seams."""
    walls = box((0, 0, 0), (1, 1, 1), inwards=True, without=("+x",))
    pieces = [
        rectangle((1, 0, 0), (0, 0, 1), (0, 1 / 3, 0)),
        rectangle((1, 1 / 3, 0), (0, 0, 0.3), (0, 2 / 3, 0)),
        rectangle((1, 1 / 3, 0.3), (0, 0, 0.7), (0, 2 / 3, 0)),
    ]
    scene = scene_of([walls, *pieces])
    rng = np.random.default_rng(0)
    count = 200_000
    seams = [
        np.column_stack([np.ones(count), np.full(count, 1 / 3), rng.random(count)]),
        np.column_stack([np.ones(count), rng.uniform(1 / 3, 1, count), np.full(count, 0.3)]),
        np.column_stack([np.ones(count), rng.random(count), np.zeros(count)]),
    ]
    origins = rng.uniform(0.05, 0.95, (count, 3))
    with kernel_of(scene) as kernel:
        for points in seams:
            triangles, hits = kernel.closest_hits(origins, points - origins)
            assert (triangles >= 0).all()
            # at the seam, not at something behind it: float32 of a metre, and edges hit under small angles
            assert np.abs(hits[:, 2] - 1).max() < 1e-4


def test_a_plate_split_at_a_t_junction_takes_what_it_takes_whole():
    pieces = [
        rectangle((0, 0, 1), (0, 1, 0), (0.5, 0, 0)),
        rectangle((0.5, 0, 1), (0, 0.5, 0), (0.5, 0, 0)),
        rectangle((0.5, 0.5, 1), (0, 0.5, 0), (0.5, 0, 0)),
    ]
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), *pieces])
    assert factors(scene, to=(1, 2, 3)) == pytest.approx(C_11, abs=noise(C_11, 2 << 16))


def boxes_in_a_box(material):
    """Two boxes that stick in each other, in the middle of a closed room."""
    return [
        box((0, 0, 0), (2, 2, 2), inwards=True, material=material, name="room"),
        box((0.5, 0.5, 0.1), (1.1, 1.1, 0.7), material=material, name="one"),
        box((0.8, 0.8, 0.3), (1.4, 1.4, 1.2), material=material, name="other"),
    ]


def test_from_boxes_that_stick_in_each_other_no_ray_escapes_into_the_room_or_out_of_it():
    """Both sides of every face look into a closed space, but for the room's own backs."""
    scene = scene_of(boxes_in_a_box(BLACK))
    with kernel_of(scene, 2) as kernel:
        patches = subdivide(scene, kernel, 0.3, 1000, 0)
        sides = np.arange(2 * len(patches))
        is_outside = (patches.triangles[sides // 2] < 12) & (sides % 2 == 1)
        rows = MonteCarloFormFactors(kernel, 4096, 0).rows(sides)
    # float32 sums of 4096 equal shares
    assert rows[~is_outside].sum(axis=1) == pytest.approx(1, abs=2e-5)
    assert (rows[is_outside] == 0).all()
    assert (rows[:, is_outside] == 0).all()


def test_inside_another_box_a_box_has_no_light_of_the_room():
    """The top of one box, where it is inside the other: dark to the bit; and where it is not, lit."""
    panel = AreaLight("panel", (1.0, 1.0, 1.9), (0, 0.5, 0), (0.5, 0, 0), (30.0, 30.0, 30.0))
    scene = scene_of(boxes_in_a_box(BLACK), (panel,))
    top = np.flatnonzero((scene.corners[12:24, :, 2] == 0.7).all(axis=1)) + 12
    rng = np.random.default_rng(0)
    receivers = surface_receivers(scene, rng.choice(top, 2000).astype(np.int32), rng.dirichlet((1, 1, 1), 2000))
    is_inside = (receivers.positions[:, :2] > 0.8 + 1e-5).all(axis=1)
    is_outside = (receivers.positions[:, :2] < 0.8 - 1e-5).any(axis=1)
    with kernel_of(scene) as kernel:
        light, _, _ = kernel.direct(emitters_of(scene, kernel.centre), receivers, 256, 0)
    assert (light[is_inside] == 0).all()
    # the other box beside it hides a part of the lamp only
    assert (light[is_outside] > 0).all()


@pytest.mark.parametrize("solver", ["stochastic", "progressive"])
def test_around_boxes_that_stick_in_each_other_a_room_is_a_furnace_like_any_other(solver):
    """All glows with L, inside and out: E = pi L / (1 - rho) on the room's walls."""
    glow = Material("glow", (0.5,) * 3, radiance=(1.0, 2.0, 3.0))
    settings = BakeSettings(target="vertex", solver=solver, error=0.05, patch_size=0.2, threads=2)
    colours = bake(scene_of(boxes_in_a_box(glow)), settings).corner_colours
    found = colours[:12] / (2 * np.array(glow.radiance))
    # 36 corners of an error of 0.05 each; patches that are half in another box are dark in part
    assert found.mean() == pytest.approx(1, abs=0.02)
    assert np.sqrt(np.mean((found - 1) ** 2)) < 1.5 * 0.05
