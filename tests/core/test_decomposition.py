"""Adaptive decomposition: patches are cut where the light changes, and fewer of them are then as good."""

import numpy as np
import pytest

from addon.core import patches as patches_of_one_size
from addon.core import radiosity
from addon.core.decomposition import MOST_ALONG, finer, patches_at
from addon.core.emitters import emitters_of
from addon.core.gather_sums import no_sums
from addon.core.guides import no_guides
from addon.core.luminance import LUMINANCE
from addon.core.patches import cut, grid_of, patch_size_for
from addon.core.receivers import surface_receivers
from addon.core.relative import scale_of
from addon.core.seen_light import SeenLight
from addon.core.settings import BakeSettings
from addon.core.triangles import triangle_areas
from tests.scenes import cornell_box, cube_room, kernel_of, lamp, rectangle, scene_of

SQUARE = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))


def square_grid(size=0.1):
    scene = scene_of([SQUARE])
    return scene, grid_of(scene, size, 10_000)


def test_the_patch_at_a_point_is_the_one_that_the_point_was_drawn_from():
    scene, grid = square_grid(0.23)
    along = np.random.default_rng(1).choice([1, 2, 3, 8], len(grid))
    with kernel_of(scene) as kernel:
        patches = cut(scene, kernel, grid, along, 0)
        triangles, weights = kernel.patch_points(np.arange(len(patches)), 16, 0)
    rows = np.arange(len(triangles))
    apexes = patches.apexes[triangles].astype(int)
    weights = weights.astype(np.float64)
    down, after = weights[rows, apexes], weights[rows, (apexes + 2) % 3]
    found = patches_at(grid, along, triangles, down, after / (1 - down))
    # points within float32 rounding of a border may stray
    assert (found == np.repeat(np.arange(len(patches)), 16)).mean() > 0.999


def cut_once(light_at, most):
    """Patches along the sides of a square's cells, lit by ``light_at(x, y)`` in front; their middles and number."""
    scene, grid = square_grid()
    ones = np.ones(len(grid), np.int64)
    with kernel_of(scene) as kernel:
        patches = cut(scene, kernel, grid, ones, 0)
        triangles, weights = kernel.patch_points(np.arange(len(patches)), 16, 0)
    points = np.einsum("nk,nkc->nc", weights, scene.corners[triangles]).reshape(-1, 16, 3).mean(axis=1)
    irradiance = np.stack([light_at(points[:, 0], points[:, 1]), np.zeros(len(points))], axis=1).ravel()
    return finer(grid, ones, patches, irradiance, np.zeros(2 * len(patches)), most), points, len(patches)


def test_cells_are_cut_along_the_edge_of_a_shadow():
    along, points, _ = cut_once(lambda x, y: np.where(x < 0.5, 1.0, 0.1), 10_000)
    from_edge = np.abs(points[:, 0] - 0.5)
    # cells are 0.1 and less: those at the edge have a neighbour across it, those two cells off have none
    assert (along[from_edge < 0.05] == 2).all()
    assert (along[from_edge > 0.21] == 1).all()


def test_even_light_is_left_as_it_is():
    along, _, _ = cut_once(lambda x, y: 1 + 0.01 * x, 10_000)
    assert (along == 1).all()


def test_no_more_patches_than_there_may_be():
    along, _, count = cut_once(lambda x, y: np.where(x < 0.5, 1.0, 0.1), 250)
    assert count < (along**2).sum() <= 250


def test_cells_are_not_cut_for_ever():
    scene, grid = square_grid()
    full = np.full(len(grid), MOST_ALONG)
    with kernel_of(scene) as kernel:
        patches = cut(scene, kernel, grid, full, 0)
    irradiance = np.random.default_rng(0).random(2 * len(patches))
    assert (finer(grid, full, patches, irradiance, np.zeros(2 * len(patches)), 1 << 30) == full).all()


def solved_by_gradients(scene, kernel, monkeypatch, **settings):
    """The solution of conjugate gradients, and the last grid and cuts that patches were made by."""
    made = []

    def remember(scene, kernel, grid, along, seed):
        made.append((grid, along))
        return cut(scene, kernel, grid, along, seed)

    monkeypatch.setattr(radiosity, "cut", remember)
    monkeypatch.setattr(patches_of_one_size, "cut", remember)
    settings = BakeSettings(solver="conjugate-gradient", error=0.02, **settings)
    solved = radiosity.solve_radiosity(scene, kernel, emitters_of(scene, kernel.centre), settings, lambda done: None)
    return solved, *made[-1]


def even_points(scene, count):
    """Points by area: triangles (N,), barycentrics (N, 3)."""
    rng = np.random.default_rng(0)
    areas = triangle_areas(scene.corners)
    return rng.choice(len(areas), count, p=areas / areas.sum()).astype(np.int32), rng.dirichlet((1, 1, 1), count)


def gathered_light(scene, kernel, triangles, weights):
    """Irradiance (N, 3) at points, gathered from 30000 patches."""
    fine = BakeSettings(patch_size=patch_size_for(scene, 30_000), error=0.02)
    solved = radiosity.solve_radiosity(scene, kernel, emitters_of(scene, kernel.centre), fine, lambda done: None)
    receivers, count = surface_receivers(scene, triangles, weights), len(triangles)
    sums, everyone = no_sums(count, 1), np.arange(count, dtype=np.uint32)
    light = SeenLight(solved.patches, solved.sources)
    kernel.gather(light, receivers, no_guides(count), everyone, 0, 2048, 0, sums)
    return sums.means(2048) + kernel.direct(solved.sources, receivers, 256, 0)[0]


def error_of_patches(solved, grid, along, triangles, weights, truth):
    """Relative RMS error of the light that patches have, where they reflect any."""
    apexes, rows = grid.apexes[triangles].astype(int), np.arange(len(triangles))
    down, after = weights[rows, apexes], weights[rows, (apexes + 2) % 3]
    at = patches_at(grid, along, triangles, down, after / (1 - down))
    reflectance = solved.patches.reflectance[at]
    found = solved.patches.radiosity[2 * at] / np.maximum(reflectance, 1e-3)
    off = ((found - truth) @ LUMINANCE / scale_of(truth))[reflectance.min(axis=1) > 0]
    return np.sqrt(np.mean(np.clip(off, -1, 1) ** 2))


@pytest.mark.parametrize("scene", [cornell_box(), cube_room((lamp((0.5, 0.5, 0.93)),))], ids=["cornell", "low lamp"])
def test_half_as_many_patches_are_as_good(scene, monkeypatch):
    """The light of adaptive patches against that of twice as many of one size."""
    points = even_points(scene, 2000)
    with kernel_of(scene, threads=2) as kernel:
        truth = gathered_light(scene, kernel, *points)
        even = solved_by_gradients(scene, kernel, monkeypatch, patch_size=patch_size_for(scene, 4000))
        monkeypatch.setitem(radiosity.PATCH_BUDGETS, "conjugate-gradient", 2000)
        adaptive = solved_by_gradients(scene, kernel, monkeypatch)
    assert len(adaptive[0].patches) < 0.6 * len(even[0].patches)
    # what is gathered is itself off by 1 / sqrt(2048), 2 %, in both alike; they are off by 3 to 10 %
    assert error_of_patches(*adaptive, *points, truth) < error_of_patches(*even, *points, truth)
