"""What lets light through diffusely, as a lampshade does: solved for, gathered, and shown on itself."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.bake import bake
from addon.core.patches import subdivide
from addon.core.radiosity import UNSHOT_LIMIT
from addon.core.scene import Material, Texture
from addon.core.settings import BakeSettings, SettingsError
from addon.core.stochastic import solve_stochastic
from tests.physics.lighting import floor_receivers, full_light
from tests.physics.test_clear import on_box_floor, room
from tests.scenes import box, kernel_of, rectangle, scene_of

RHO, TAU = 0.3, 0.2
HEIGHT = 0.5  # of the sheet over the floor, and of the ceiling over it
RADIANCE = 1 / np.pi  # of all that glows: it emits 1


def two_rooms():
    """A room whose walls glow and reflect RHO, over it a black one; the ceiling between them is the translucent sheet.

    From above nothing comes back, and from below the sheet is as the walls are: a furnace of B = 1 / (1 - RHO), of
    which TAU shows above.
    """
    glowing = Material("wall", (RHO,) * 3, radiance=(RADIANCE,) * 3)
    sheet = Material("sheet", (RHO,) * 3, radiance=(RADIANCE,) * 3, translucence=(TAU,) * 3)
    black = Material("black", (0, 0, 0))
    walls = {"inwards": True, "is_target": False}
    below = box((0, 0, 0), (1, 1, HEIGHT), without=("+z",), material=glowing, name="below", **walls)
    above = box((0, 0, HEIGHT), (1, 1, 2 * HEIGHT), without=("-z",), material=black, name="above", **walls)
    between = rectangle((0, 0, HEIGHT), (1, 0, 0), (0, 1, 0), (4, 4), material=sheet, name="sheet")
    return scene_of([below, above, between])


def test_furnace_of_what_reflects_and_lets_through():
    """A closed box and a sheet across it: B = M / (1 - rho - tau), on both sides of the sheet."""
    scene = room(Material("sheet", (RHO,) * 3, translucence=(TAU,) * 3))
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.25, 10_000, 0)
        is_sheet = patches.triangles >= 12
        reflectance = np.repeat(np.where(is_sheet, RHO, RHO + TAU), 2)[:, None] * np.ones(3)
        emitted = np.tile([[1.0] * 3, [0.0] * 3], (len(patches), 1))
        emitted[1::2][is_sheet] = 1.0
        areas = patches.side_areas
        solution = solve_stochastic(
            kernel, reflectance, emitted, areas, 1 << 18, UNSHOT_LIMIT, 0, translucence=patches.translucence
        )
    exact = 1 / (1 - RHO - TAU)
    for sides in (np.arange(0, 2 * len(patches), 2), 2 * np.flatnonzero(is_sheet) + 1):
        mean = np.average(solution.radiosity[sides], weights=areas[sides], axis=0)
        # 2^18 rays, of which each side of the sheet gets an eighth
        assert mean == pytest.approx([exact] * 3, rel=0.01)
    energy = solution.energy
    assert energy.absorbed + energy.escaped + energy.unshot == pytest.approx(energy.shot, rel=1e-6)


def test_gathered_light_of_a_furnace_with_a_translucent_sheet():
    sheet = Material("sheet", (RHO,) * 3, radiance=(RADIANCE,) * 3, translucence=(0.5 - RHO,) * 3)
    points = np.stack([*np.random.default_rng(1).uniform(0.05, 0.95, (2, 200)), np.zeros(200)], axis=1)
    light, _ = full_light(room(sheet, RADIANCE), on_box_floor(points), error=0.01)
    errors = light.values / 2 - 1  # the walls reflect a half
    # 200 receivers of 0.01 each, and what patches have wrong, which they share
    assert errors.mean(axis=0) == pytest.approx(0, abs=0.006)
    assert np.sqrt(np.mean(errors**2)) < 0.02


def test_light_from_below_shows_above():
    """The irradiance in the middle of the black ceiling: of the sheet's 1 + TAU B, by the factor of a quarter of it."""
    scene = two_rooms()
    receivers = floor_receivers([(0.5, 0.5, 2 * HEIGHT)])
    with kernel_of(scene) as kernel:
        triangles, _ = kernel.closest_hits(np.array([[0.49, 0.47, 0.9]]), np.float32([[0, 0, 1]]))
    receivers = type(receivers)(receivers.positions, -receivers.normals, 2 * triangles)
    light, _ = full_light(scene, receivers, error=0.01)
    radiosity = 1 + TAU / (1 - RHO)
    a = 0.5 / HEIGHT  # sides of a quarter by its distance: of a small element over a corner (Howell B-4)
    factor = 4 / (2 * np.pi) * 2 * a / np.sqrt(1 + a * a) * np.arctan(a / np.sqrt(1 + a * a))
    assert light.values[0] == pytest.approx([radiosity * factor] * 3, rel=0.02)


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_the_sheet_shows_what_arrives_behind_it(target):
    """From above comes nothing: what is stored is TAU / (RHO + TAU) of what comes from below."""
    scene = two_rooms()
    result = bake(scene, BakeSettings(target=target, texels=4096, error=0.02))
    sheet = scene.objects[2].span
    if target == "vertex":
        stored = result.corner_colours[sheet].reshape(-1, 3).mean(axis=0)
    else:
        pixels = result.lightmap.pixels
        stored = pixels[pixels[..., 1] > 0].mean(axis=0)
    expected = TAU / (RHO + TAU) / (1 - RHO) / np.pi
    # the mean of a sheet's texels, whose error is a few per cent each, but for what rooms' corners interpolate
    assert stored == pytest.approx([expected] * 3, rel=0.02)
    assert result.report.target_reached


def test_a_solver_that_does_not_know_it_is_refused():
    settings = BakeSettings(target="vertex", solver="direct")
    with pytest.raises(SettingsError, match="'sheet' lets light through"):
        bake(two_rooms(), settings)


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_an_image_says_where_the_sheet_is_translucent(target):
    """One half is opaque and black above: from a dark room it shows nothing, the other half what arrives below."""
    pixels = np.zeros((64, 64, 3), np.float32)
    pixels[:, 32:] = 1
    scene = two_rooms()
    sheet = replace(scene.materials[2], translucence_texture=Texture("half", pixels))
    uvs = scene.uvs.copy()
    uvs[scene.objects[2].span] = scene.corners[scene.objects[2].span][..., :2]
    scene = replace(scene, uvs=uvs, materials=(*scene.materials[:2], sheet))
    result = bake(scene, BakeSettings(target=target, texels=4096, error=0.05))
    span = scene.objects[2].span
    if target == "vertex":
        x, light = scene.corners[span][..., 0], result.corner_colours[span][..., 1]
    else:
        pixels, middles = result.lightmap.pixels, result.lightmap.uvs[span].mean(axis=1)
        columns, rows = (middles * pixels.shape[1::-1]).astype(int).T
        x, light = scene.corners[span][..., 0].mean(axis=1), pixels[rows, columns, 1]
    # nothing and all, but for texels whose image is interpolated between both
    assert light[x < 0.45].max() < 1e-3
    assert light[x > 0.55].min() > 0.1
