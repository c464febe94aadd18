"""What random meshes have found, each as a case of its own: lamps in faces, atoms, slivers, white rooms."""

import numpy as np
import pytest

from addon.core import _kernel, ranges
from addon.core.bake import bake
from addon.core.emitters import emitters_of
from addon.core.patches import subdivide
from addon.core.radiosity import solve_radiosity
from addon.core.scene import AreaLight, Material, PointLight, SunLight
from addon.core.settings import BakeSettings, SettingsError
from tests.physics.lighting import SINGLE, direct_light, floor
from tests.scenes import Part, closed_box, cube_room, kernel_of, lamp, scene_of

QUICK = {"target": "vertex", "error": 0.3, "patch_size": 0.5, "threads": 2}


def test_scene_and_kernel_agree_how_far_the_world_goes():
    assert ranges.LARGEST_COORDINATE == _kernel.PL_LARGEST_COORDINATE


@pytest.mark.parametrize("radius", [1e-30, 1e-12, 1e-6])
def test_a_lamp_the_size_of_an_atom_shines_as_a_point(radius):
    points = [(0.0, 0.0, 0.0), (1.0, 0.5, 0.0)]
    atom, _ = direct_light([lamp((0.2, 0.1, 1.5), radius=radius)], points)
    point, _ = direct_light([lamp((0.2, 0.1, 1.5))], points)
    assert atom == pytest.approx(point, rel=SINGLE)


@pytest.mark.parametrize("height", [0.0, 1e-30, 1e-7])
@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_a_lamp_in_a_face_gives_light_that_is_a_number(height, radius):
    points = [(0.0, 0.0, 0.0), (1e-4, 0.0, 0.0), (1.0, 0.0, 0.0)]
    light, variance = direct_light([lamp((0.0, 0.0, height), intensity=(1e15,) * 3, radius=radius)], points)
    assert np.isfinite(light).all()
    assert (light >= 0).all()
    assert np.isfinite(variance).all()


@pytest.mark.parametrize("target", ["vertex", "lightmap"])
@pytest.mark.parametrize("intensity", [1e-24, 1e-27, 1e-30])
def test_light_whose_square_is_no_float_is_baked_as_any_other(intensity, target):
    def errors(intensity):
        scene = cube_room((lamp(intensity=(intensity,) * 3),))
        report = bake(scene, BakeSettings(target=target, texels=1024)).report
        return report.estimated_error, report.seen_error

    with np.errstate(invalid="raise", divide="raise", over="raise"):
        # its variance is 0 in float32: rays go elsewhere, and what probes are unsure of themselves is not taken off
        ratios = np.divide(errors(intensity), errors(1.0))
    assert ((ratios > 0.5) & (ratios < 2)).all()


@pytest.mark.parametrize("solver", ["stochastic", "progressive", "direct"])
def test_a_closed_room_that_absorbs_nothing_is_given_up_and_named(solver):
    """Its light has no bound: what comes out is finite, much more than the lamp gives, and the report says of what."""
    settings = BakeSettings(**{**QUICK, "solver": solver, "error": 1.0})
    result = bake(cube_room(material=Material("white", (1.0, 1.0, 1.0))), settings)
    grey = bake(cube_room(), settings)
    assert np.isfinite(result.corner_colours).all()
    assert result.corner_colours.mean() > 10 * grey.corner_colours.mean()
    assert any("reflect all light" in warning for warning in result.report.warnings)
    assert not any("reflect all light" in warning for warning in grey.report.warnings)


def test_overshooting_leaves_no_light_below_nothing():
    """White leaves that glow in some channels, and a sun in the others: shot too far and back until little is left."""
    glowing = Material("glow", reflectance=(1.0, 0.8, 1.0), radiance=(1e-30, 1.0, 100.0))
    points = np.array([(500, 0, 0), (0, 0, 0), (0, 0, 1000), (0, 500, 0), (-408, 912, 0), (-838, 0, -66)], float)
    faces = [(1, 5, 4), (3, 1, 5), (1, 3, 0), (1, 3, 2), (0, 4, 5), (3, 5, 0)]
    sun = SunLight("sun", direction=(1, 1, 1), irradiance=(1.0, 1e-30, 100.0), angle=1.0)
    scene = scene_of([Part(points, faces, glowing)], (sun,))
    with kernel_of(scene) as kernel:
        settings = BakeSettings(method="monte-carlo", solver="progressive", error=0.5, patch_size=250.0)
        solved = solve_radiosity(scene, kernel, emitters_of(scene, kernel.centre), settings, lambda done: None)
    # a surface sends what it reflects of direct light, and more; single precision
    assert (solved.solution.radiosity >= solved.patches.direct * (1 - SINGLE)).all()


@pytest.mark.parametrize("length", [1e3, 1e7])
def test_a_sliver_takes_no_more_patches_than_its_share(length):
    sliver = Part([(0, 0, 0), (length, 0, 0), (length, 1e-3 * length, 0)], [(0, 1, 2)])
    scene = scene_of([sliver])
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.01, 1000, 0)
    # an eighth of the budget, and one more in every row that is rounded up
    assert len(patches) <= 2 * 1000 / 8
    assert patches.areas.sum() == pytest.approx(0.5e-3 * length**2)


@pytest.mark.parametrize("texels", [64, 1024])
def test_a_needle_longer_than_an_atlas_is_unwrapped(texels):
    needle = Part([(0, 0, 0), (-1e8, 0, 0), (0, 1e-30, 0)], [(0, 1, 2)])
    lit = bake(scene_of([needle]), BakeSettings(target="lightmap", error=0.5, texels=texels, threads=1)).lightmap
    assert lit.pixels.shape[0] * lit.pixels.shape[1] <= texels
    assert np.isfinite(lit.uvs).all()


def test_a_glow_that_nothing_sends_back_is_no_number_lost():
    # no patch is lit, and light that is spread unevenly has nothing to be held against
    glowing = Material("glow", reflectance=(0.0, 0.3, 0.0), radiance=(0.0, 0.0, 1e15))
    walls = Part([(0, 0, 0), (0, 0, 1), (0, 0.5, 0), (0.5, 0, 0), (0, 0, 0.5)], [(0, 1, 2), (0, 3, 4)], glowing)
    with np.errstate(over="raise", divide="raise", invalid="raise"):
        result = bake(scene_of([walls]), BakeSettings(**{**QUICK, "target": "lightmap"}))
    assert np.isfinite(result.lightmap.pixels).all()


def test_patches_that_no_memory_holds_are_refused():
    with pytest.raises(SettingsError, match="patch_size is 1e-06"):
        bake(many_faces(), BakeSettings(**{**QUICK, "patch_size": 1e-6}))


def many_faces():
    """A thousand triangles, each of which may take its share of patches."""
    points = np.random.default_rng(0).random((3000, 3))
    return scene_of([Part(points, np.arange(3000).reshape(-1, 3).tolist())], [lamp()])


def test_lights_as_bright_as_can_be_add_up_to_a_number():
    lights = [
        PointLight("lamp", (0.5, 0.5, 0.5), (1e15,) * 3, radius=0.01),
        AreaLight("panel", (0.5, 0.5, 1.0), (0, 0.1, 0), (0.1, 0, 0), (1e15,) * 3, spread=1e-3),
    ]
    colours = bake(closed_box(lights=lights), BakeSettings(**QUICK)).corner_colours
    assert np.isfinite(colours).all()
    assert (colours > 0).all()


def test_a_lamp_below_a_floor_lights_nothing_above_it():
    """However near it is below: shadow rays end a rounding before the lamp, not before the floor."""
    light, _ = direct_light([lamp((0.0, 0.0, -1e-3))], [(0.0, 0.0, 0.0), (1.0, 1.0, 0.0)], parts=(floor(2.0),))
    assert (light == 0).all()
