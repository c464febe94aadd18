"""The whole bake on small scenes: what it promises, whatever method and solver it takes."""

import resource
import threading

import numpy as np
import pytest

from addon.core.bake import bake
from addon.core.scene import AreaLight, Material, SceneError
from addon.core.settings import BakeCancelled, BakeSettings
from tests.core.baking import COARSE, TEXELS, lightmap_of
from tests.scenes import (
    BLACK,
    Part,
    box,
    closed_box,
    cornell_box,
    cube_room,
    kernel_of,
    room_with_occluder,
    scene_of,
)

ROUTES = [
    ("monte-carlo", "stochastic"),
    ("monte-carlo", "progressive"),
    ("monte-carlo", "direct"),
    ("monte-carlo", "conjugate-gradient"),
    ("hemicube", "progressive"),
    ("hemicube", "direct"),
]


def relative(first, second):
    """Local relative difference, as the report's error is defined: of E over E + 0.3 median E."""
    return (first - second) / (first + 0.3 * np.median(first))


@pytest.fixture(scope="module")
def cornell_lightmaps():
    scene = cornell_box()
    return {route: lightmap_of(scene, method=route[0], solver=route[1]) for route in ROUTES}


@pytest.mark.parametrize("route", ROUTES[1:], ids="-".join)
def test_all_methods_and_solvers_bake_the_same_cornell_box(cornell_lightmaps, route):
    (first, first_report), (second, second_report) = cornell_lightmaps[ROUTES[0]], cornell_lightmaps[route]
    assert (second_report.method, second_report.solver) == route
    assert first.shape == second.shape
    difference = relative(first, second)
    stated = np.hypot(first_report.estimated_error, second_report.estimated_error)
    # the estimate covers the sampling at receivers; the patches' own error, of a solver set to the same target,
    # comes on top and is no larger than that target
    assert np.sqrt(np.mean(difference**2)) < 1.5 * np.hypot(stated, 0.05)
    # means over some thousand texels have no sampling noise left: the solvers themselves agree
    assert np.mean(second) == pytest.approx(np.mean(first), rel=0.02)


def test_a_target_is_met_or_the_report_says_that_it_is_not(cornell_lightmaps):
    # a lamp 1 cm below a ceiling makes a spot on it that few rays find: there the target may be missed
    plain = lightmap_of(cube_room())[1]
    for report in (plain, *(report for _, report in cornell_lightmaps.values())):
        assert report.target_error == 0.05
        assert report.target_reached == (report.estimated_error <= 0.05)
        assert report.target_reached != any("was not reached" in warning for warning in report.warnings)
    assert plain.target_reached


def test_the_report_tells_what_ran(cornell_lightmaps):
    for (method, solver), (pixels, report) in cornell_lightmaps.items():
        assert (report.method, report.solver) == (method, solver)
        assert report.lightmap_size == pixels.shape[::-1]
        assert report.triangles == len(cornell_box().triangles)
        assert report.patches > 0
        assert 0 < report.receivers <= pixels.size
        assert set(report.seconds) == {"unwrap", "texels", "solve", "gather"}
        assert report.rays["gather"] > 0
        balance = report.energy.absorbed + report.energy.escaped + report.energy.unshot
        assert balance == pytest.approx(report.energy.shot, rel=1e-5)  # float64 sums over float32 form factors


@pytest.mark.parametrize("scene", [cornell_box(), cube_room()], ids=["cornell", "lamp"])
@pytest.mark.parametrize("error", [0.1, 0.05])
def test_the_estimated_error_is_honest(scene, error):
    """Against a bake of another seed whose error is five times smaller, and so counts for 1 / 25 in the squares.

    The factor is 1.5 because one bake's errors, found and stated, spread by a third: a few texels have most of them.
    """
    runs = [colours_and_errors(scene, error, seed) for seed in range(1, 7)]
    truth, _ = colours_and_errors(scene, error / 5, 9)
    found = np.sqrt(np.mean([np.mean(relative(pixels, truth) ** 2) for pixels, _ in runs]))
    stated = np.sqrt(np.mean([estimate**2 for _, estimate in runs]))
    assert found < 1.5 * stated
    assert stated < 1.5 * found


def test_patches_as_large_as_walls_leave_the_texels_right():
    """Looks from texel to texel take off what patches have wrong: after one alone it would be 2.2 times the noise."""
    scene = room_with_occluder((AreaLight("panel", (0.5, 0.5, 1.9), (0, 0.2, 0), (0.2, 0, 0), (3.0, 3.0, 4.0)),), False)
    truth = lightmap_of(scene, error=0.02, seed=9, patch_size=0.05)[0]

    def typical_error(patch_size):
        runs = [lightmap_of(scene, error=0.05, seed=seed, patch_size=patch_size)[0] for seed in (1, 2)]
        return np.mean([np.median(np.abs(relative(run, truth))) for run in runs])

    # both have the noise of some 1900 texels, whose median is known to a few percent
    assert typical_error(2.0) < 1.3 * typical_error(0.2)


def colours_and_errors(scene, error, seed):
    pixels, report = lightmap_of(scene, error=error, seed=seed)
    return pixels, report.estimated_error


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_the_same_bytes_at_any_number_of_threads(target):
    results = [bake_bytes(cornell_box(), target=target, threads=threads) for threads in (1, 2, 4)]
    assert results[1] == results[0]
    assert results[2] == results[0]


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_the_same_seed_gives_the_same_bytes_and_another_seed_other_ones(target):
    first, again, other = (bake_bytes(cube_room(), target=target, seed=seed) for seed in (5, 5, 6))
    assert first == again
    assert first != other


def bake_bytes(scene, **settings):
    result = bake(scene, BakeSettings(**{"texels": TEXELS, "error": 0.1, "patch_size": COARSE, **settings}))
    return (result.lightmap.pixels if result.lightmap else result.corner_colours).tobytes()


@pytest.mark.parametrize("solver", ["direct", "conjugate-gradient", "progressive", "stochastic"])
@pytest.mark.parametrize("rho", [0.5, 0.8])
def test_furnace(solver, rho):
    """Every wall of a closed box glows with L: E = pi L / (1 - rho) at every receiver, in every channel."""
    radiance = np.array([2.0, 1.0, 0.5])
    scene = closed_box(Material("glow", (rho,) * 3, radiance=tuple(radiance)), (1, 1.3, 0.8))
    result = bake(scene, BakeSettings(target="vertex", solver=solver, error=0.02, threads=2, patch_size=0.25))
    found = result.corner_colours / (radiance / (1 - rho))
    # of the bounced light rho / (1 - rho): 0.001 not shot; the rest is the error asked for
    assert found.mean() == pytest.approx(1, abs=0.01)
    assert np.sqrt(np.mean((found - 1) ** 2)) < 0.02 * 1.5 + 1e-3


def test_furnace_in_a_lightmap():
    scene = closed_box(Material("glow", (0.5,) * 3, radiance=(1.0, 1.0, 1.0)))
    pixels, report = lightmap_of(scene, error=0.02)
    assert pixels.mean() == pytest.approx(2, rel=0.01)
    assert np.sqrt(np.mean((pixels / 2 - 1) ** 2)) < 1.5 * report.estimated_error + 5e-3


def test_a_lamp_in_a_black_room_gives_the_cosine_law_on_the_texels():
    scene = cube_room(material=BLACK)
    result = bake(scene, BakeSettings(texels=TEXELS, error=0.1, threads=2))
    lamp = scene.lights[0]
    inside = np.random.default_rng(0).dirichlet((4, 4, 4), len(scene.triangles))
    points = np.einsum("tk,tkc->tc", inside, scene.corners)
    to = np.asarray(lamp.position) - points
    cosine = np.einsum("tc,tc->t", to, scene.corner_normals[:, 0]) / np.linalg.norm(to, axis=1)
    exact = cosine / (to**2).sum(axis=1) * lamp.intensity[0] / np.pi
    uvs = np.einsum("tk,tkc->tc", inside, result.lightmap.uvs)
    height, width, _ = result.lightmap.pixels.shape
    x, y = (uvs * [width, height] - 0.5).T
    column, row = np.floor([x, y]).astype(int)
    found = np.zeros(len(x))
    for right in (0, 1):
        for up in (0, 1):
            weight = np.abs(1 - right - (x - column)) * np.abs(1 - up - (y - row))
            found += weight * result.lightmap.pixels[row + up, column + right, 0]
    # bilinear lookup between texels 4 cm apart, 30 cm and more from the lamp: second derivative times h^2 / 8
    assert found == pytest.approx(exact, rel=0.02)


def test_objects_that_are_no_targets_stay_empty():
    scene = cornell_box()
    lamp = scene.objects[-1].span
    colours = bake(scene, BakeSettings(target="vertex", error=0.3, patch_size=0.3)).corner_colours
    assert np.isnan(colours[lamp]).all()
    assert np.isfinite(np.delete(colours, np.r_[lamp], axis=0)).all()
    uvs = bake(scene, BakeSettings(texels=1024, error=0.3, patch_size=0.3)).lightmap.uvs
    assert np.isnan(uvs[lamp]).all()
    assert np.isfinite(np.delete(uvs, np.r_[lamp], axis=0)).all()


def without_targets():
    return scene_of([Part(np.zeros((3, 3)), [], name="empty"), box((0, 0, 0), (1, 1, 1), is_target=False)])


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_a_scene_without_faces_to_bake_is_refused(target):
    with pytest.raises(SceneError, match="no target object"):
        bake(without_targets(), BakeSettings(target=target))


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_an_empty_object_beside_others_is_no_trouble(target):
    empty = Part(np.zeros((3, 3)), [], name="empty")
    plain = bake_bytes(scene_of([box((0, 0, 0), (1, 1, 1), inwards=True)]), target=target)
    scene = scene_of([box((0, 0, 0), (1, 1, 1), inwards=True), empty])
    assert bake_bytes(scene, target=target) == plain


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_darkness_bakes_to_zero(target):
    result = bake(closed_box(), BakeSettings(target=target, texels=1024))
    pixels = result.lightmap.pixels if result.lightmap else result.corner_colours
    assert (pixels == 0).all()
    assert result.report.target_reached


@pytest.mark.parametrize("settings", [{"target": "vertex"}, {}, {"solver": "progressive"}, {"solver": "direct"}])
def test_progress_rises_to_the_end_and_comes_from_the_calling_thread(settings):
    told = []

    def on_progress(stage, fraction):
        told.append((stage, fraction, threading.get_ident()))
        return True

    result = bake(
        cornell_box(), BakeSettings(texels=1024, error=0.2, threads=2, patch_size=COARSE, **settings), on_progress
    )
    fractions = [fraction for _, fraction, _ in told]
    assert {thread for _, _, thread in told} == {threading.get_ident()}
    assert {stage for stage, _, _ in told} <= set(result.report.seconds)
    assert fractions == sorted(fractions)
    assert 0 <= fractions[0]
    assert fractions[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_a_bake_can_be_cancelled_at_every_stage_and_leaves_no_thread(target):
    seen = []
    bake(
        cube_room(),
        BakeSettings(target=target, texels=1024, error=0.2, patch_size=COARSE),
        lambda s, f: seen.append(s) or True,
    )
    before = threading.active_count()
    for stage in dict.fromkeys(seen):
        calls = []

        def stop_at(current, _, stage=stage, calls=calls):
            calls.append(current)
            return current != stage

        with pytest.raises(BakeCancelled):
            bake(
                cube_room(), BakeSettings(target=target, texels=1024, error=0.2, patch_size=COARSE, threads=4), stop_at
            )
        # once told to stop it asks no more
        assert calls.count(stage) == 1
        assert threading.active_count() == before


def test_a_bake_after_a_cancelled_one_is_as_if_nothing_had_been():
    first = bake_bytes(cube_room())
    with pytest.raises(BakeCancelled):
        bake(cube_room(), BakeSettings(texels=TEXELS), lambda stage, fraction: stage != "gather")
    assert bake_bytes(cube_room()) == first


def test_an_exception_of_the_callback_comes_out_as_it_is():
    def fail(stage, fraction):
        raise KeyError(stage)

    before = threading.active_count()
    with pytest.raises(KeyError):
        bake(cube_room(), BakeSettings(texels=1024, threads=4), fail)
    assert threading.active_count() == before


def test_a_time_limit_ends_sampling_and_the_report_says_so():
    result = bake(cornell_box(), BakeSettings(texels=1024, error=0.02, time_limit=1e-3, patch_size=COARSE))
    assert not result.report.target_reached
    assert result.report.estimated_error > 0.02
    assert any("time limit" in warning for warning in result.report.warnings)
    assert np.isfinite(result.lightmap.pixels).all()


def test_a_smaller_error_is_asked_for_and_given():
    reports = [lightmap_of(cornell_box(), error=error, texels=1024)[1] for error in (0.2, 0.05)]
    assert reports[0].estimated_error <= 0.2
    assert reports[1].estimated_error <= 0.05
    assert reports[0].rays["gather"] < reports[1].rays["gather"]


def test_kernels_are_freed():
    """Scenes come and go: what a thousand of them hold is returned."""
    for _ in range(50):
        with kernel_of(closed_box()):
            pass
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(500):
        with kernel_of(cornell_box()):
            pass
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before  # [KiB]
    # a BVH of this scene alone takes some 20 KiB: 500 of them kept would be 10 MiB
    assert grown < 5000
