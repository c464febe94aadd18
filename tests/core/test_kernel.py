"""Rays of the kernel and of their brute-force twin: the same laws for both, and the same answers."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.kernel import KernelScene
from addon.core.scene import Material
from addon.core.workers import Workers
from tests.reference import polygon, rays
from tests.scenes import Part, closed_box, kernel_of, rectangle, scene_of


class Twin:
    """The brute-force twin with the kernel's methods."""

    def __init__(self, scene):
        self.corners = scene.corners

    def closest_hits(self, origins, directions):
        return rays.closest_hit(self.corners, origins, directions)

    def occluded(self, points_from, points_to):
        return rays.occluded(self.corners, points_from, points_to)


@pytest.fixture(params=["kernel", "twin"])
def rays_of(request):
    if request.param == "twin":
        yield Twin
    else:
        with Workers(1) as workers:
            yield lambda scene: KernelScene(scene, workers)


def soup(rng, count=60):
    """Random triangles in a unit cube."""
    return scene_of([Part(rng.random((3 * count, 3)), np.arange(3 * count).reshape(-1, 3).tolist())])


def directions(rng, count):
    d = rng.normal(size=(count, 3))
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def test_from_inside_a_closed_box_every_ray_meets_a_wall(rays_of):
    rng = np.random.default_rng(0)
    triangles, hits = rays_of(closed_box()).closest_hits(rng.uniform(0.01, 0.99, (5000, 3)), directions(rng, 5000))
    assert (triangles >= 0).all()
    assert (hits[:, :2] >= -1e-6).all()  # float32 rounding at the borders of triangles


def test_a_hit_is_the_point_that_its_weights_name(rays_of):
    rng = np.random.default_rng(1)
    scene, origins = soup(rng), rng.random((3000, 3))
    way = directions(rng, 3000)
    triangles, hits = rays_of(scene).closest_hits(origins, way)
    found = triangles >= 0
    assert 0.2 < found.mean() < 1
    u, v, distance = hits[found].astype(np.float64).T
    weights = np.stack([1 - u - v, u, v], axis=1)
    by_weights = np.einsum("nk,nkc->nc", weights, scene.corners[triangles[found]])
    along = origins[found] + distance[:, None] * way[found]
    # float32 positions of a unit cube, and hits under grazing angles
    assert np.abs(by_weights - along).max() < 1e-4
    assert np.median(np.abs(by_weights - along)) < 1e-6


def test_kernel_and_twin_name_the_same_triangles():
    rng = np.random.default_rng(2)
    scene, origins, way = soup(rng), rng.random((4000, 3)), directions(rng, 4000)
    # rays within float32 rounding of a border may go either way
    is_sure = rays.distance_to_borders(scene.corners, origins, way.astype(float)) > 1e-4
    assert is_sure.mean() > 0.8
    expected, expected_hits = rays.closest_hit(scene.corners, origins, way.astype(float))
    with kernel_of(scene) as kernel:
        triangles, hits = kernel.closest_hits(origins, way)
    assert (triangles[is_sure] == expected[is_sure]).all()
    found = is_sure & (expected >= 0)
    assert hits[found, 2] == pytest.approx(expected_hits[found, 2], abs=1e-5)  # float32 of metres


def test_what_lies_between_two_points_hides_them_and_what_lies_beyond_does_not(rays_of):
    wall = rectangle((0, 0, 1), (1, 0, 0), (0, 1, 0))
    where = rays_of(scene_of([wall]))
    below = np.tile([[0.3, 0.4, 0.0]], (4, 1))
    to = np.array([[0.3, 0.4, 2.0], [0.3, 0.4, 0.9], [2.5, 0.4, 2.0], [0.3, 0.4, -1.0]])
    assert where.occluded(below, to).tolist() == [True, False, False, False]


def test_kernel_and_twin_agree_on_occlusion():
    rng = np.random.default_rng(3)
    scene, ends = soup(rng), rng.random((2, 3000, 3))
    way = ends[1] - ends[0]
    is_sure = rays.distance_to_borders(scene.corners, ends[0], way) > 1e-4
    with kernel_of(scene) as kernel:
        found = kernel.occluded(*ends)
    expected = rays.occluded(scene.corners, *ends)
    assert 0.1 < expected.mean() < 0.9
    assert (found == expected)[is_sure].all()


def test_what_transmits_hides_nothing():
    pane = rectangle(
        (0, 0, 1), (1, 0, 0), (0, 1, 0), material=Material("glass", (0, 0, 0), transmittance=(0.9, 0.9, 0.9))
    )
    floor = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))
    with kernel_of(scene_of([floor, pane])) as kernel:
        point, above = np.array([[0.3, 0.4, 0.5]]), np.array([[0.3, 0.4, 2.0]])
        assert not kernel.occluded(point, above)[0]
        assert kernel.closest_hits(point, np.array([[0, 0, 1]]))[0].tolist() == [-1]


def test_triangles_without_area_are_kept_and_never_hit():
    line = Part([(0.2, 0.2, 1), (0.4, 0.4, 1), (0.8, 0.8, 1)], [(0, 1, 2)])
    point = Part([(0.5, 0.5, 1)], [(0, 0, 0)])
    wall = rectangle((0, 0, 2), (1, 0, 0), (0, 1, 0))
    rng = np.random.default_rng(4)
    targets = np.concatenate([rng.uniform(0.2, 0.8, (500, 1)) * [1, 1, 0] + [0, 0, 1.0], [[0.5, 0.5, 1.0]]])
    with kernel_of(scene_of([line, point, wall])) as kernel:
        triangles, _ = kernel.closest_hits(targets * [1, 1, 0], np.tile([[0, 0, 1]], (501, 1)))
    assert set(triangles) <= {2, 3}


def test_positions_far_from_the_origin_lose_no_digits():
    rng = np.random.default_rng(5)
    scene, origins, way = soup(rng), rng.random((2000, 3)), directions(rng, 2000)
    far = np.array([1 << 20, -(1 << 18), 1 << 19], float)  # powers of two: the shift itself rounds at 1e-10 only
    is_sure = rays.distance_to_borders(scene.corners, origins, way.astype(float)) > 1e-4
    with kernel_of(scene) as near, kernel_of(replace(scene, vertices=scene.vertices + far)) as away:
        here, there = near.closest_hits(origins, way), away.closest_hits(origins + far, way)
    assert (here[0] == there[0])[is_sure].all()


@pytest.mark.parametrize("seed", range(4))
def test_lamberts_formula_is_the_integral_of_its_kernel(seed):
    rng = np.random.default_rng(seed)
    corner, u, v = np.array([*rng.uniform(-1, 1, 2), rng.uniform(-0.3, 1)]), *rng.normal(size=(2, 3))
    corners = [corner, corner + u, corner + u + v, corner + v]
    normal = np.array([0, 0, 1.0])
    factor = polygon.point_to_polygon(np.zeros(3), normal, corners)
    summed = polygon.point_to_parallelogram_by_sum(np.zeros(3), normal, corner, u, v)
    # midpoint sums of 400^2 cells; what the horizon cuts is off by up to a row of cells there, of vanishing cosine
    assert factor == pytest.approx(summed, abs=2e-4)


def test_arrays_of_different_lengths_are_refused_and_named():
    with kernel_of(closed_box()) as kernel:
        with pytest.raises((TypeError, ValueError), match="directions"):
            kernel.closest_hits(np.full((2, 3), 0.5), np.ones((3, 3)))
        with pytest.raises((TypeError, ValueError), match="points_to"):
            kernel.occluded(np.full((2, 3), 0.5), np.ones((3, 3)))


def test_vectors_that_are_not_threes_are_refused():
    with kernel_of(closed_box()) as kernel, pytest.raises((TypeError, ValueError), match="directions"):
        kernel.closest_hits(np.zeros((2, 3)), np.zeros((2, 2)))
