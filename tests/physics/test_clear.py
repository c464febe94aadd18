"""What lets a part of the light pass: cloth, colours, what an image cuts out; direct, solved for and gathered."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.patches import CUT_OUT_SAMPLES
from addon.core.radiosity import solve_radiosity
from addon.core.receivers import Receivers
from addon.core.scene import Material, PointLight, SceneError, Texture
from addon.core.settings import BakeSettings
from addon.core.textures import lookup
from tests.physics.lighting import SINGLE, direct_light, floor, floor_receivers, full_light, random_points
from tests.physics.test_solutions import CHOICES, noise_of_arrivals, solve
from tests.scenes import box, kernel_of, rectangle, scene_of

RHO, RADIANCE = 0.5, 1 / np.pi
UV_SQUARE = np.float32([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]])  # of a rectangle's two triangles
CHECKS = Texture("checks", np.repeat((np.indices((8, 8)).sum(axis=0) % 2)[..., None], 3, axis=2).astype(np.float32))
COLOURED = (0.9, 0.5, 0.1)


def with_uvs(scene, name, uvs):
    """The scene, one object of which has texture coordinates (T, 3, 2)."""
    every = scene.uvs.copy()
    every[next(obj.span for obj in scene.objects if obj.name == name)] = uvs
    return replace(scene, uvs=every)


def room(sheet, radiance=0.0):
    """A closed box across the middle of which hangs a sheet, its image once over it."""
    walls = Material("wall", (RHO,) * 3, radiance=(radiance,) * 3)
    cloth = rectangle((0, 0, 0.4), (1, 0, 0), (0, 1, 0), material=sheet, name="sheet")
    scene = scene_of([box((0, 0, 0), (1, 1, 1), inwards=True, material=walls, name="box"), cloth])
    return with_uvs(scene, "sheet", UV_SQUARE)


@pytest.mark.parametrize("extends", [False, True], ids=["repeats", "extends"])
def test_direct_light_through_an_image_is_what_the_image_says(extends):
    """A lamp 2 m up, a sheet 1 m up with an image of noise several times over it: each point sees one point of it."""
    rng = np.random.default_rng(3)
    noise = Texture("noise", rng.uniform(0, 1, (7, 5, 3)).astype(np.float32))
    tint = (0.8, 0.5, 1.0)
    material = Material("sheet", transmittance=tint, transmittance_texture=noise, textures_extend=extends)
    sheet = rectangle((-4, -4, 1), (8, 0, 0), (0, 8, 0), material=material, name="sheet")
    points, lamp = random_points(400, rng), PointLight("lamp", (0.0, 0.0, 2.0), (3.0, 2.0, 1.0))
    uvs = 3.7 * UV_SQUARE - np.float32([1.3, 0.4])
    scene = with_uvs(scene_of([floor(), sheet], [lamp]), "sheet", uvs)
    with kernel_of(scene) as kernel:
        found, _, _ = kernel.direct(emitters_of(scene, kernel.centre), floor_receivers(points), 64, 0)
    crossed = 3.7 * (0.5 * points[:, :2] + 4) / 8 - [1.3, 0.4]
    expected = direct_light([lamp], points)[0] * lookup(noise, crossed, extends) * tint
    # a texel of the image is a fifth of 8 / 3.7 m, float32 places on it are good to 1e-6 of that times their size
    assert found == pytest.approx(expected, rel=SINGLE, abs=2e-5)


SHEETS = {
    "half": Material("half", (RHO,) * 3, transmittance=(0.5,) * 3),
    "nearly opaque": Material("dense", (RHO,) * 3, transmittance=(0.02,) * 3),
    "nearly nothing": Material("thin", (RHO,) * 3, transmittance=(0.98,) * 3),
    "cut out": Material("checks", (RHO,) * 3, transmittance=(1.0,) * 3, transmittance_texture=CHECKS),
}


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("sheet", SHEETS.values(), ids=SHEETS)
def test_furnace_with_a_sheet_across_it(choice, sheet):
    """Of one emission and reflectance, whatever passes where: B = M / (1 - rho), on both sides of the sheet, too."""
    patches, solution = solve(room(sheet), choice, everything_glows, reflectance=RHO)
    exact = 1 / (1 - RHO)
    areas = patches.side_areas
    inside = np.concatenate([np.arange(0, 2 * len(patches), 2), 2 * np.flatnonzero(patches.triangles >= 12) + 1])
    light = solution.radiosity[inside]
    # what is not shot yet adds at most a thousandth; samples that tell what is cut out of a patch leave a part of
    # 1 / sqrt(32) of it, by chance, that the mean over all patches has hardly any of
    assert np.average(light, weights=areas[inside], axis=0) == pytest.approx([exact] * 3, rel=3e-3)
    is_sheet = patches.triangles[inside // 2] >= 12
    sampled = 1 / np.sqrt(CUT_OUT_SAMPLES) if sheet.transmittance_texture else 0.0
    noise = noise_of_arrivals(patches, "stochastic" if choice == "stochastic" else "progressive")
    for part, spread in ((~is_sheet, noise), (is_sheet, noise + sampled)):
        assert np.sqrt(np.mean((light[part] / exact - 1) ** 2)) < RHO * spread + 3e-3


@pytest.mark.parametrize("solver", ["stochastic", "conjugate-gradient", "direct", "progressive"])
def test_a_pane_that_all_light_passes_is_not_there(solver):
    """Whatever averages what two sides know of each other must not ask the pane, which no ray meets."""
    settings = BakeSettings(target="vertex", solver=solver, error=0.02, patch_size=0.2)
    light = []
    for passing in (1.0, None):
        sheet = Material("pane", (0, 0, 0), transmittance=(passing,) * 3) if passing else Material("air", (0, 0, 0))
        scene = room(sheet, RADIANCE)
        if passing is None:  # the same patches, out of the way
            scene = replace(scene, vertices=scene.vertices + np.where(np.arange(12) >= 8, 9.0, 0.0)[:, None])
        with kernel_of(scene, 2) as kernel:
            emitters = emitters_of(scene, kernel.centre)
            solved = solve_radiosity(scene, kernel, emitters, settings, lambda done: None)
        shining = solved.solution.radiosity[:, 1] > 0  # neither pane does
        light.append(solved.solution.radiosity[shining].mean())
    # the same rays in another order of sides, of a solver's error of 0.02 in each of some hundred patches
    assert light[0] == pytest.approx(light[1], rel=0.01)


def everything_glows(patches):
    """Emission 1 of all fronts, and of the sheet's backs."""
    emitted = np.tile([[1.0] * 3, [0.0] * 3], (len(patches), 1))
    emitted[1::2][patches.triangles >= 12] = 1.0
    return emitted


@pytest.mark.parametrize(
    ("transmittance", "texture"),
    [((0.5,) * 3, None), ((1.0,) * 3, CHECKS), (COLOURED, None)],
    ids=["half", "cut out", "coloured"],
)
def test_gathered_light_of_a_furnace_with_a_sheet(transmittance, texture):
    """The whole pipeline: E = M / (1 - rho) on the floor, where the sheet glows by what does not pass it.

    What meets a coloured sheet is its mean share, so a reflectance of rho (1 - t) in all is one of
    rho (1 - t) / (1 - mean t) of what meets it.
    """
    taken = 1 - np.array(transmittance) * (texture.pixels.mean() if texture else 1.0)
    sheet = Material(
        "sheet",
        tuple(RHO * taken / taken.mean()),
        radiance=tuple(taken / np.pi),
        transmittance=transmittance,
        transmittance_texture=texture,
    )
    points = np.stack([*np.random.default_rng(1).uniform(0.05, 0.95, (2, 200)), np.zeros(200)], axis=1)
    light, _ = full_light(room(sheet, 1 / np.pi), on_box_floor(points), error=0.01)
    errors = light.values * (1 - RHO) - 1
    # 200 receivers with 0.01 of luminance each, and three times that of a single channel; what patches have wrong
    # they share: 0.3 % in the worst channel at an error of 0.005
    assert errors.mean(axis=0) == pytest.approx(0, abs=0.006)
    assert np.sqrt(np.mean(errors.mean(axis=1) ** 2)) < 0.02


def on_box_floor(points):
    """Receivers on the floor of the room, whose box has it as its fifth quad."""
    up = np.tile(np.float32([0, 0, 1]), (len(points), 1))
    with kernel_of(room(SHEETS["half"])) as kernel:
        triangles, _ = kernel.closest_hits(points + np.array([0, 0, 0.01]), -up)
    return Receivers(points, up, 2 * triangles)


def test_what_gives_more_than_it_gets_is_refused():
    with pytest.raises(SceneError, match=r"material it sends on 1\.5 times"):
        Material("it", (0.9,) * 3, translucence=(0.6,) * 3)
    with pytest.raises(SceneError, match=r"material it sends on 1\.44 times"):
        Material("it", (0.9,) * 3, transmittance=(0.9, 0.3, 0.0))  # of six tenths that meet it, and nine that pass
