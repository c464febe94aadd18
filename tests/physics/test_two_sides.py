"""Surfaces whose back is another than their front, or is not there: solved for, gathered, and as lights."""

import numpy as np
import pytest

from addon.core.choose import choose
from addon.core.emitters import emitters_of
from addon.core.scene import Back, Material, SceneError, Texture
from addon.core.settings import BakeSettings, SettingsError
from tests.physics.lighting import direct_light, full_light, random_points
from tests.physics.test_clear import RHO, on_box_floor, room
from tests.physics.test_solutions import CHOICES, solve
from tests.scenes import kernel_of, rectangle, scene_of

FRONT, BACK = (0.7, 0.6, 0.2), (0.1, 0.3, 0.8)
SHEETS = {
    "two-faced": Material("two-faced", FRONT, back=Back(BACK)),
    "open behind": Material("open behind", FRONT, open_side="back"),
    "open in front": Material("open in front", FRONT, open_side="front"),
}
STEP = 3e-3  # what is not shot yet


def glow_of_one(patches):
    """What each side emits so that all of them send out 1: M = 1 - rho; open sides and the box's outside none."""
    emitted = 1 - patches.side_reflectance.astype(np.float64)
    emitted[1::2][patches.triangles < 12] = 0
    emitted[patches.side_areas == 0] = 0
    return emitted


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("sheet", SHEETS.values(), ids=SHEETS)
def test_where_all_that_is_seen_sends_out_one_all_does(choice, sheet):
    """A closed room across which the sheet hangs: whatever a ray meets sends out B = 1, so that each side gets 1.

    Light that is sent has to go where rays look back to, which is no way back where one side is open: only the
    stochastic solver sends it so.
    """
    if sheet.open_side and choice != "stochastic":
        with pytest.raises(SettingsError, match="on one side"):
            choose(BakeSettings(solver="direct"), 14, 28, needs_rays=sheet.name)
        return
    patches, solution = solve(room(sheet), choice, glow_of_one)
    seen = np.concatenate([np.arange(0, 2 * len(patches), 2), 2 * np.flatnonzero(patches.triangles >= 12) + 1])
    seen = seen[patches.side_areas[seen] > 0]
    light = np.average(solution.radiosity[seen], weights=patches.side_areas[seen], axis=0)
    assert light == pytest.approx([1] * 3, abs=STEP)
    lower = seen[(patches.triangles[seen // 2] < 4)]  # walls, of which the sheet parts the upper from the lower
    assert np.average(solution.radiosity[lower], weights=patches.side_areas[lower], axis=0) == pytest.approx(
        [1] * 3, abs=0.02
    )


@pytest.mark.parametrize("sheet", SHEETS.values(), ids=SHEETS)
def test_gathered_light_where_all_that_is_seen_sends_out_one(sheet):
    """The whole pipeline: E = 1 on the floor, below the sheet, whose back or what is above it rays see from there."""
    glow = {"radiance": tuple((1 - np.array(sheet.reflectance)) / np.pi)}
    dark = {"radiance": (0.0, 0.0, 0.0)}
    front, back = (dark, glow) if sheet.open_side == "front" else (glow, dark)
    if sheet.back:
        back = {"radiance": tuple((1 - np.array(BACK)) / np.pi)}
    reflectance = BACK if sheet.back else sheet.reflectance
    lit = Material("sheet", sheet.reflectance, **front, back=Back(reflectance, **back), open_side=sheet.open_side)
    points = np.stack([*np.random.default_rng(1).uniform(0.05, 0.95, (2, 200)), np.zeros(200)], axis=1)
    light, _ = full_light(room(lit, (1 - RHO) / np.pi), on_box_floor(points), error=0.01)
    # 200 receivers with 0.01 of luminance each, and three times that of a single channel
    assert light.values.mean(axis=0) == pytest.approx([1] * 3, abs=0.006)


def test_a_panel_that_glows_in_front_lights_one_side_only():
    points = random_points(100, np.random.default_rng(2), reach=0.5)

    def light_of(**sides):
        panel = Material("panel", (0, 0, 0), **sides)
        down = rectangle((-0.5, 0.5, 1), (1, 0, 0), (0, -1, 0), material=panel, name="panel")  # its front looks down
        return direct_light([], points, [down])[0]

    bright, dim, dark = (3.0, 2.0, 1.0), (0.3, 0.2, 0.1), (0.0, 0.0, 0.0)
    both = light_of(radiance=bright)
    assert both.min() > 0.1
    assert light_of(radiance=bright, back=Back()) == pytest.approx(both, rel=1e-6)
    assert not light_of(radiance=dark, back=Back(radiance=bright)).any()
    assert light_of(radiance=bright, open_side="back") == pytest.approx(both, rel=1e-6)
    assert not light_of(radiance=bright, open_side="front").any()
    assert light_of(radiance=dim, back=Back(radiance=bright)) == pytest.approx(0.1 * both, rel=1e-6)


def test_a_back_glows_by_an_image_of_its_own():
    halves = np.zeros((1, 2, 3), np.float32)
    halves[0, 1] = 1
    glow = Material("glow", (0, 0, 0), back=Back(radiance=(2.0,) * 3, radiance_texture=Texture("halves", halves)))
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), material=glow)])
    scene.uvs[:] = scene.corners[..., :2]
    with kernel_of(scene) as kernel:
        emitters = emitters_of(scene, kernel.centre)
    across = np.cross(
        emitters.corners[:, 3:6] - emitters.corners[:, :3], emitters.corners[:, 6:] - emitters.corners[:, :3]
    )
    areas = 0.5 * np.linalg.norm(across, axis=1)
    assert not emitters.radiances[:, :3].any()
    # of two texels, bilinear and repeating, the mean is a half
    assert areas @ emitters.radiances[:, 3] == pytest.approx(1.0, rel=1e-3)


def test_what_is_translucent_has_like_sides():
    for sides in ({"back": Back()}, {"open_side": "front"}):
        with pytest.raises(SceneError, match="material it is translucent"):
            Material("it", (0.2,) * 3, translucence=(0.2,) * 3, **sides)
    with pytest.raises(SceneError, match="open_side is 'top'"):
        Material("it", open_side="top")
