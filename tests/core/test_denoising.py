"""The denoiser: its library by C API, what is made of its estimate, and what the report says where there is none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from addon.core.bake import bake
from addon.core.denoiser import Denoiser, DenoiserError, open_denoiser
from addon.core.denoising import denoised, mixed
from addon.core.probes import Measured, Probes
from addon.core.settings import BakeCancelled, BakeSettings
from addon.core.smoothing import TexelGrid
from tests.scenes import closed_box, lamp

SETTINGS = BakeSettings(texels=1 << 14, error=0.1, threads=2)


@pytest.fixture
def library():
    from addon.blender.denoiser_library import denoiser_library

    found = denoiser_library()
    assert found is not None, "the module bpy has its library beside it"
    return found


def gradient_with_noise():
    x = np.linspace(1, 2, 96)
    clean = np.broadcast_to(x[None, :, None], (64, 96, 3)).astype(np.float32)
    return clean, clean * np.random.default_rng(0).normal(1, 0.2, clean.shape).astype(np.float32)


def test_noise_goes_and_light_stays(library):
    clean, noisy = gradient_with_noise()
    with Denoiser(library, 2) as denoise:
        result = denoise(noisy)
        assert denoise.name.startswith("Open Image Denoise 2.")
        assert denoise.failure == ""
    # noise of 20 %, alike over 6144 texels: a tenth is left of it, and 20 % / 6144^0.5 of the mean
    assert np.abs(result / clean - 1).std() < 0.02
    assert result.mean() == pytest.approx(clean.mean(), rel=0.01)


def test_the_same_bytes_with_any_number_of_threads(library):
    noisy = gradient_with_noise()[1]
    results = []
    for threads in (1, 2, 4):
        with Denoiser(library, threads) as denoise:
            results.append(denoise(noisy).tobytes())
    assert results[0] == results[1] == results[2]


def test_what_is_no_library_is_told_and_stops_nothing(tmp_path):
    wrong = tmp_path / "libOpenImageDenoise.so"
    wrong.write_bytes(b"nothing")
    with pytest.raises(DenoiserError, match=str(wrong)):
        Denoiser(wrong, 1)
    report = bake(closed_box(lights=[lamp()]), SETTINGS, denoiser_library=wrong).report
    assert report.denoiser.startswith("none: Open Image Denoise cannot be loaded")


@pytest.mark.parametrize(
    ("settings", "library", "why"),
    [
        (SETTINGS, None, "no library"),
        (replace(SETTINGS, denoise=False), Path("any"), "not asked for"),
        (replace(SETTINGS, target="vertex"), Path("any"), "vertex colours are no image"),
    ],
)
def test_why_there_is_none(settings, library, why):
    with open_denoiser(library, settings, lambda: None) as (denoise, reason):
        assert denoise is None
        assert why in reason


def as_they_are(values):
    return values


def probes_of(luminance, receivers):
    """Probes at receivers (K,) that found luminance (K,), for certain."""
    ones = np.ones(len(receivers))
    return Probes(receivers, ones, ones, Measured(luminance, 0 * ones, 0))


def test_two_estimates_are_mixed_where_the_probes_find_each_better():
    rng = np.random.default_rng(0)
    truth, count = np.ones((4096, 3)), 4096
    first, second = truth.copy(), truth.copy()
    # the second is right where the first is a little off, and far off where the first is right
    first[:2048] += 0.1
    second[2048:] += 0.5 + 0.1 * rng.random((2048, 1))
    chosen = np.arange(0, count, 2)
    noise = np.full(count, 0.01, np.float32)
    found = mixed(first, second, noise, as_they_are, probes_of(np.ones(len(chosen)), chosen))
    # luminance weights sum to 1 within float32
    assert np.abs(found - truth).max() < 1e-4


def test_noise_goes_where_it_is_as_stated_and_details_of_its_size_stay():
    rng = np.random.default_rng(1)
    truth = np.ones((1 << 14, 3))
    is_noisy = np.arange(len(truth)) % 2 == 0
    step = 0.1 * rng.choice((-1.0, 1.0), (len(truth), 1))
    # noise of 0.1 that the second has not, and details of 0.1 that it has painted over, where nothing is noisy
    truth[~is_noisy] += step[~is_noisy]
    first, second = truth.copy(), np.ones_like(truth)
    first[is_noisy] += step[is_noisy]
    noise = np.where(is_noisy, 0.01, 1e-6).astype(np.float32)
    chosen = np.arange(0, len(truth), 7)
    found = mixed(first, second, noise, as_they_are, probes_of(truth[chosen, 0], chosen))
    assert np.abs(found - truth).max() < 1e-4


def test_a_bake_with_it_is_no_worse_at_points_that_did_not_judge_it(library):
    scene = closed_box(lights=[lamp()])
    settings = replace(SETTINGS, error=0.03)
    plain, helped = bake(scene, settings).report, bake(scene, settings, denoiser_library=library).report
    assert helped.denoiser.startswith("Open Image Denoise")
    # 512 points each know their mean square to some 10 %
    assert helped.seen_error < 1.1 * plain.seen_error


def test_what_is_far_below_the_target_is_not_denoised(library):
    report = bake(closed_box(lights=[lamp()]), replace(SETTINGS, error=0.9), denoiser_library=library).report
    assert report.estimated_error < 0.125 * 0.9
    assert report.denoiser == "none: not needed for this target"


def four_texels():
    receivers = np.arange(4, dtype=np.int32).reshape(2, 2)
    ones = np.ones((4, 3), np.float32)
    grid = TexelGrid(receivers, 1.0, np.zeros((0, 3, 2), np.float32), ones, None, ones[:, 0])
    direct = np.array([[0.0] * 3, [1.0] * 3, [0.5] * 3, [0.5] * 3], np.float32)
    gathered = np.array([[0.0] * 3, [0.0] * 3, [0.2] * 3, [0.2] * 3], np.float32)
    return grid, direct, gathered


def test_texels_without_gathered_light_and_what_is_no_number_stay_as_they_were():
    grid, direct, gathered = four_texels()
    painted = np.full((2, 2, 3), 0.9, np.float32)
    painted[1, 1] = np.nan
    probes = probes_of(np.full(4, 0.9), np.arange(4))
    noise = np.ones(4, np.float32)
    light = direct + gathered, noise, direct, gathered
    found = denoised(lambda image: painted, grid, *light, as_they_are, probes)
    assert (found[:2] == direct[:2]).all()
    assert found[2] == pytest.approx(0.9)
    assert (found[3] == (direct + gathered)[3]).all()


def test_a_denoiser_that_fails_changes_nothing():
    grid, direct, gathered = four_texels()
    values = direct + gathered
    probes = probes_of(np.ones(4), np.arange(4))
    light = values, np.ones(4, np.float32), direct, gathered
    assert denoised(lambda image: None, grid, *light, as_they_are, probes) is values


def test_it_can_be_cancelled_while_it_works(library):
    def poll():
        raise BakeCancelled("the bake was cancelled")

    with Denoiser(library, 1, poll) as denoise, pytest.raises(BakeCancelled):
        denoise(np.ones((512, 512, 3), np.float32))
