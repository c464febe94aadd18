"""What some rays miss: lamps that cast no shadows, surfaces that hide no lamps, surfaces that nobody sees."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.kernel import LIGHT_SIDE
from addon.core.radiosity import solve_radiosity
from addon.core.scene import AreaLight, Material, PointLight, SceneError, SunLight
from addon.core.settings import BakeSettings
from tests.physics.lighting import direct_light, random_points
from tests.physics.test_bright_sides import SPOT
from tests.physics.test_clear import RHO, everything_glows, room
from tests.physics.test_solutions import CHOICES, solve
from tests.scenes import closed_box, kernel_of, rectangle

SHEET = Material("sheet", (RHO,) * 3)
LAMPS = {
    "point": PointLight("lamp", (0.0, 0.0, 2.0), (3.0, 2.0, 1.0)),
    "sphere": PointLight("lamp", (0.0, 0.0, 2.0), (3.0, 2.0, 1.0), radius=0.1),
    "area": AreaLight("lamp", (0.0, 0.0, 2.0), (0.0, 0.5, 0.0), (0.5, 0.0, 0.0), (3.0, 2.0, 1.0)),
    "sun": SunLight("sun", (0.1, 0.2, -1.0), (3.0, 2.0, 1.0), angle=0.1),
}
POINTS = random_points(200, np.random.default_rng(3), reach=0.5)


def board(material):
    """Between the lamps and the floor's points, all of which it hides."""
    return rectangle((-4, -4, 1), (8, 0, 0), (0, 8, 0), material=material, name="board")


@pytest.mark.parametrize("lamp", LAMPS.values(), ids=LAMPS)
def test_a_lamp_without_shadows_shines_through(lamp):
    bare = replace(lamp, casts_shadow=False)
    assert not direct_light([lamp], POINTS, [board(SHEET)])[0].any()
    # the same samples, none of which anything hides
    assert direct_light([bare], POINTS, [board(SHEET)])[0] == pytest.approx(direct_light([lamp], POINTS)[0], rel=1e-6)


def test_lamps_without_shadows_do_so_among_many():
    """Weak ones share rays: of 60 lamps every third casts no shadows, and only these light what is under the board."""
    lamps = [PointLight(f"{k}", (0.1 * k - 3, 0.0, 2.0), (1.0,) * 3, casts_shadow=k % 3 > 0) for k in range(60)]
    alone = [lamp for lamp in lamps if not lamp.casts_shadow]
    found, variance = direct_light(lamps, POINTS, [board(SHEET)], samples=256)
    expected = direct_light(alone, POINTS, samples=256)[0]
    assert found.mean(axis=0) == pytest.approx(expected.mean(axis=0), rel=4 * np.sqrt(variance.mean() / 200) + 1e-3)


@pytest.mark.parametrize("lamp", LAMPS.values(), ids=LAMPS)
def test_what_shadow_rays_miss_hides_no_lamp(lamp):
    unhiding = SHEET.seen_by(shadow_rays=False, light=True)
    found = direct_light([lamp], POINTS, [board(unhiding)])[0]
    assert found == pytest.approx(direct_light([lamp], POINTS)[0], rel=1e-6)


@pytest.mark.parametrize("lamp", LAMPS.values(), ids=LAMPS)
def test_what_nobody_sees_hides_lamps_all_the_same(lamp):
    assert not direct_light([lamp], POINTS, [board(SHEET.seen_by(shadow_rays=True, light=False))])[0].any()


@pytest.mark.parametrize("choice", CHOICES)
def test_what_nobody_sees_is_not_there_for_light_that_bounces(choice):
    """A furnace across which it hangs: B = M / (1 - rho) on the walls, as if it were glass."""
    unseen = room(SHEET.seen_by(shadow_rays=True, light=False))

    def emission(patches):
        return np.where((patches.triangles < 12)[:, None, None], [[[1.0] * 3, [0.0] * 3]], 0.0).reshape(-1, 3)

    patches, solution = solve(unseen, choice, emission, reflectance=RHO)
    walls = 2 * np.flatnonzero(patches.triangles < 12)
    mean = np.average(solution.radiosity[walls], weights=patches.side_areas[walls], axis=0)
    assert mean == pytest.approx([1 / (1 - RHO)] * 3, rel=3e-3)  # what is not shot yet


@pytest.mark.parametrize("choice", CHOICES)
def test_light_that_bounces_meets_what_shadow_rays_miss(choice):
    """A furnace across which it hangs and glows as the walls do: B = M / (1 - rho) everywhere."""
    patches, solution = solve(
        room(SHEET.seen_by(shadow_rays=False, light=True)), choice, everything_glows, reflectance=RHO
    )
    seen = np.concatenate([np.arange(0, 2 * len(patches), 2), 2 * np.flatnonzero(patches.triangles >= 12) + 1])
    mean = np.average(solution.radiosity[seen], weights=patches.side_areas[seen], axis=0)
    assert mean == pytest.approx([1 / (1 - RHO)] * 3, rel=3e-3)  # what is not shot yet


@pytest.mark.parametrize("is_unhiding", [False, True], ids=["hides as it shows", "hides no lamp"])
def test_bright_sides_are_no_lights_where_the_two_kinds_of_rays_differ(is_unhiding):
    """Lights are found by shadow rays, but what a lit wall sends on is light that bounces."""
    scene = closed_box(SHEET.seen_by(shadow_rays=not is_unhiding, light=True), lights=(SPOT,))
    with kernel_of(scene, 2) as kernel:
        emitters = emitters_of(scene, kernel.centre)
        solved = solve_radiosity(scene, kernel, emitters, BakeSettings(error=0.02), lambda done: None)
    assert (solved.patches.kinds == LIGHT_SIDE).any() != is_unhiding


def test_a_surface_that_nobody_sees_must_not_shine():
    with pytest.raises(SceneError, match="material it sends on light, which nobody sees"):
        Material("it", (0.5,) * 3, meets_light=False)
