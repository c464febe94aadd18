"""Patches: areas add up, points and patches name each other, no triangle takes them all."""

import numpy as np
import pytest

from addon.core.patches import LARGEST_SHARE, cut, grid_of, patch_size_for, subdivide
from addon.core.scene import Material, Texture
from addon.core.triangles import triangle_areas
from tests.reference.patches import area_share, depth_in, patch_polygons
from tests.scenes import Part, cornell_box, kernel_of, rectangle, scene_of


def one_triangle(rng):
    return scene_of([Part(rng.normal(size=(3, 3)), [(0, 1, 2)])])


def layout(scene, patches):
    """Columns of each row of the first triangle, found from where its patches lie: rows of equal height."""
    corners = scene.corners[0]
    edges = [np.linalg.norm(corners[(k + 2) % 3] - corners[(k + 1) % 3]) for k in range(3)]
    apex = int(np.argmax(edges))
    rows = max(1, int(np.ceil(2 * triangle_areas(scene.corners)[0] / (edges[apex] * patches.size) - 1e-6)))
    columns = [max(1, int(np.ceil(edges[apex] * (1 - r / rows) / patches.size - 1e-6))) for r in range(rows)]
    return apex, columns


@pytest.mark.parametrize("seed", range(6))
def test_points_of_a_patch_lie_in_it_and_areas_are_those_of_the_polygons(seed):
    rng = np.random.default_rng(seed)
    scene = one_triangle(rng)
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.2 * np.sqrt(triangle_areas(scene.corners)[0]), 10_000, 0)
        triangles, weights = kernel.patch_points(np.arange(len(patches)), 64, seed)
    polygons = patch_polygons(*layout(scene, patches))
    assert len(polygons) == len(patches) > 20
    assert (triangles == 0).all()
    shares = np.array([area_share(p) for p in polygons])
    assert patches.areas / triangle_areas(scene.corners)[0] == pytest.approx(shares, rel=1e-9)
    depths = [depth_in(p, w) for p, w in zip(polygons, weights.reshape(-1, 64, 3).astype(float))]
    assert np.min(depths) > -1e-6  # float32 weights


def test_patches_of_cells_that_are_cut_finer_make_up_their_cell():
    """Areas add up to the whole cell's, bounds to its bounds, and points lie within them."""
    scene = one_triangle(np.random.default_rng(9))
    grid = grid_of(scene, 0.3 * np.sqrt(triangle_areas(scene.corners)[0]), 10_000)
    along = np.random.default_rng(10).choice([1, 2, 4, 5], len(grid))
    with kernel_of(scene) as kernel:
        whole = cut(scene, kernel, grid, np.ones(len(grid), np.int64), 0)
        fine = cut(scene, kernel, grid, along, 0)
        _, weights = kernel.patch_points(np.arange(len(fine)), 64, 0)
    assert len(fine) == (along**2).sum()
    assert np.bincount(fine.cells, fine.areas) == pytest.approx(whole.areas, rel=1e-12)
    order = np.argsort(fine.cells, kind="stable")
    starts = np.searchsorted(fine.cells[order], np.arange(len(grid)))
    for column, outermost in enumerate((np.maximum, np.minimum, np.minimum, np.maximum)):
        assert outermost.reduceat(fine.bounds[order, column], starts) == pytest.approx(
            whole.bounds[:, column], abs=1e-6
        )
    apex = int(fine.apexes[0])
    weights = weights.reshape(len(fine), 64, 3).astype(np.float64)
    width, after = 1 - weights[..., apex], weights[..., (apex + 2) % 3]
    wide, narrow, first, second = fine.bounds.T[:, :, None]
    # float32, and points keep 4e-6 off the triangle's edges
    assert ((width < wide + 1e-5) & (width > narrow - 1e-5)).all()
    assert ((after < second * width + 1e-5) & (after > first * width - 1e-5)).all()


@pytest.mark.parametrize("seed", range(6))
def test_a_ray_finds_the_patch_whose_point_it_aims_at(seed):
    """Point -> patch through rays: all flux shot at a point is received by the point's own patch."""
    rng = np.random.default_rng(seed)
    scene = one_triangle(rng)
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.2 * np.sqrt(triangle_areas(scene.corners)[0]), 10_000, 0)
    a, b, c = scene.corners[0]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    # a tiny emitter close above a point well inside a patch sees, for half of its rays and more, that patch alone
    polygons = patch_polygons(*layout(scene, patches))
    chosen = rng.choice(len(patches), 5, replace=False)
    middles = polygons[chosen].mean(axis=1) @ scene.corners[0]
    size = 1e-3 * patches.size
    u = (b - a) / np.linalg.norm(b - a)
    v = np.cross(normal, u)
    emitters = [rectangle(m + size * normal, size * v, size * u) for m in middles]
    whole = scene_of([Part(scene.corners[0], [(0, 1, 2)]), *emitters])
    with kernel_of(whole) as kernel:
        both = subdivide(whole, kernel, patches.size, 10_000, 0)
        of_emitters = np.flatnonzero(both.triangles > 0)[::2]
        # the emitter's front looks down to the triangle
        rows = kernel.form_factors_monte_carlo(2 * of_emitters, 256, seed)
    assert (rows[:, : 2 * len(patches)].argmax(axis=1) == 2 * chosen).all()
    # 1 mm/m above a patch whose border is hundreds of times farther away
    assert (rows[np.arange(5), 2 * chosen] > 0.99).all()


def test_areas_add_up_to_the_triangles():
    scene = cornell_box()
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.07, 100_000, 0)
    sums = np.bincount(patches.triangles, patches.areas, len(scene.triangles))
    assert sums == pytest.approx(triangle_areas(scene.corners), rel=1e-12)
    assert (np.diff(patches.triangles) >= 0).all()
    # the longest edge is cut to the size, so no patch is larger than its square
    assert patches.areas.max() <= 0.07**2 * (1 + 1e-9)


def test_areas_by_sampling_equal_the_areas_given():
    """Even points on a triangle land in patches in proportion to their areas: chi-square."""
    rng = np.random.default_rng(7)
    scene = one_triangle(rng)
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.25 * np.sqrt(triangle_areas(scene.corners)[0]), 10_000, 0)
    points = rng.dirichlet((1, 1, 1), 40_000)
    depths = np.array([depth_in(p, points) for p in patch_polygons(*layout(scene, patches))])
    counts = np.bincount(depths.argmax(axis=0), minlength=len(patches))
    expected = len(points) * patches.areas / patches.areas.sum()
    freedom = len(patches) - 1
    # mean + 4 standard deviations of chi-square: one false alarm in ten thousand
    assert ((counts - expected) ** 2 / expected).sum() < freedom + 4 * np.sqrt(2 * freedom)


def test_points_are_even_within_a_patch():
    """The mean of a patch's points is its centroid."""
    scene = one_triangle(np.random.default_rng(8))
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.3 * np.sqrt(triangle_areas(scene.corners)[0]), 10_000, 0)
        _, weights = kernel.patch_points(np.arange(len(patches)), 4096, 0)
    for polygon, found in zip(patch_polygons(*layout(scene, patches)), weights.reshape(-1, 4096, 3).astype(float)):
        a, b, c, d = polygon
        first, second = area_share(np.array([a, b, c])), area_share(np.array([a, c, d]))
        centroid = (first * (a + b + c) / 3 + second * (a + c + d) / 3) / (first + second)
        # the error of a Sobol mean falls about as 1 / n: 1 / 4096 of a patch's size, times a few
        assert np.abs(found.mean(axis=0) - centroid).max() < 8 / 4096 * np.ptp(polygon, axis=0).max()


def test_about_as_many_patches_as_asked():
    scene = cornell_box()
    for budget in (300, 3000):
        with kernel_of(scene) as kernel:
            patches = subdivide(scene, kernel, patch_size_for(scene, budget), budget, 0)
        # rows and columns are rounded up, so more than asked, by the perimeter of each triangle
        assert budget / 2 < len(patches) < 3 * budget


def test_a_ground_plane_does_not_take_the_patches_of_the_room():
    room = rectangle((0, 0, 1), (1, 0, 0), (0, 1, 0), cuts=(8, 8))
    ground = rectangle((-500, -500, 0), (1000, 0, 0), (0, 1000, 0))
    scene = scene_of([room, ground])
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, patch_size_for(scene, 1000), 1000, 0)
    shares = np.bincount(patches.triangles) / 1000
    # rounding up of rows and columns again
    assert shares[-2:].max() < 2 * LARGEST_SHARE
    assert (shares[:-2] > 0).all()


def test_reflectance_is_the_texture_averaged_over_each_patch():
    pixels = np.zeros((64, 64, 3), np.float32)
    pixels[:, 32:] = (1.0, 0.5, 0.25)
    material = Material("half", (1.0, 1.0, 0.5), reflectance_texture=Texture("half", pixels))
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), material=material)])
    scene.uvs[:] = scene.corners[..., :2]
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.1, 1000, 0)
    mean = (patches.areas[:, None] * patches.reflectance).sum(axis=0) / patches.areas.sum()
    # eight points on each of the few patches across the seam
    assert mean == pytest.approx((0.5, 0.25, 0.0625), rel=0.03)
    assert patches.reflectance.max(axis=0) == pytest.approx((1, 0.5, 0.125), rel=1e-5)
    assert patches.reflectance.min() == 0
