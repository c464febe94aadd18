"""Closure and reciprocity as a report states them: kept where they hold, and missed where they are broken."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.bake import bake
from addon.core.laws import RAYS, measured_laws
from addon.core.patches import subdivide
from addon.core.scene import Material
from addon.core.settings import BakeSettings
from tests.physics.lighting import floor
from tests.reference.closed_forms import c11
from tests.scenes import GREY, closed_box, kernel_of, rectangle, scene_of

# of the rays of two groups that each send a fifth of theirs to each other, three standard errors of the difference
NOISE = 3 * np.sqrt(2 * 0.2 * 0.8 / RAYS) / (2 * 0.2)


def laws_of(scene, patches=lambda patches: patches):
    with kernel_of(scene) as kernel:
        cut = subdivide(scene, kernel, 0.5, 4096, 0)
        return measured_laws(scene, kernel, patches(cut), 1)


@pytest.mark.parametrize("size", [(1, 1, 1), (3, 0.5, 1)])
def test_a_closed_room_loses_nothing_and_gives_as_it_takes(size):
    laws, rays = laws_of(closed_box(GREY, size))
    assert laws.closure == 0
    # both sides of all walls
    assert rays == 6 * RAYS
    assert 0 < laws.reciprocity < NOISE


def test_what_leaves_an_open_scene_is_counted():
    laws, _ = laws_of(scene_of([floor(2.0), rectangle((-1, 1, 0), (2, 0, 0), (0, 0, 1), material=GREY)]))
    assert laws.closure == 0


def test_tinted_glass_takes_what_it_takes():
    """A pane over the whole floor of a room takes half of what the floor sends; both ways alike."""
    glass = Material("glass", (0, 0, 0), transmittance=(0.5, 0.5, 0.5))
    laws, _ = laws_of(scene_of([*walls(), rectangle((0, 0, 0.2), (1, 0, 0), (0, 1, 0), material=glass)]))
    # half of what passes the pane from below; half of the group's area is the ceiling's back, which sees nothing
    lost = c11(1, 1, 0.2) / 2 / 2
    assert laws.closure == pytest.approx(lost, abs=3 * np.sqrt(lost / RAYS))
    assert laws.reciprocity < 2 * NOISE


def test_cloth_takes_no_more_than_it_gives():
    """What meets the cloth lands there, the rest passes: nothing is lost, and both ways are alike."""
    cloth = Material("cloth", (0.5,) * 3, transmittance=(0.3,) * 3)
    laws, _ = laws_of(scene_of([*walls(), rectangle((0, 0, 0.4), (1, 0, 0), (0, 1, 0), material=cloth)]))
    assert laws.closure == 0
    # what passes by chance is not stratified as directions are
    assert laws.reciprocity < 2 * NOISE


def walls():
    """A unit room's six walls, looking in."""
    return [
        rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), material=GREY, name="floor"),
        rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0), material=GREY, name="ceiling"),
        rectangle((0, 0, 0), (0, 0, 1), (1, 0, 0), material=GREY, name="front"),
        rectangle((0, 1, 0), (1, 0, 0), (0, 0, 1), material=GREY, name="rear"),
        rectangle((0, 0, 0), (0, 1, 0), (0, 0, 1), material=GREY, name="left"),
        rectangle((1, 0, 0), (0, 0, 1), (0, 1, 0), material=GREY, name="right"),
    ]


def test_wrong_areas_break_reciprocity_and_are_seen():
    """With two of six walls twice as large as they are, what they exchange with the other four is wrong by a third."""

    def wrong(patches):
        return replace(patches, met=np.where(patches.triangles < 4, 2, 1) * patches.met)

    laws, _ = laws_of(scene_of(walls()), wrong)
    # each of six walls gives each other a fifth: of 15 pairs 8 give 2 for 1, of the rest one 2 for 2, six 1 for 1
    assert laws.reciprocity == pytest.approx(8 * (2 - 1) / (8 * (2 + 1) + (2 + 2) + 6 * (1 + 1)), abs=NOISE)


def test_the_report_states_both():
    report = bake(closed_box(Material("glow", radiance=(1.0, 1.0, 1.0))), BakeSettings(texels=1024, error=0.2)).report
    assert report.closure == 0
    assert 0 < report.reciprocity < NOISE
    assert {"closure", "reciprocity"} <= report.as_dict().keys()
    assert report.rays["laws"] >= 6 * RAYS - 6
