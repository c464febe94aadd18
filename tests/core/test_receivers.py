"""Receivers: where they stand, what they look to, which corners share a value."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.patches import subdivide
from addon.core.receivers import patch_receivers, surface_receivers
from tests.graphs import vertices_of
from tests.scenes import Part, box, closed_box, kernel_of, moved, rectangle, scene_of, sphere


def test_surface_receivers_stand_where_their_weights_say_on_flat_faces():
    scene = closed_box()
    rng = np.random.default_rng(0)
    # not on an edge, off which receivers are kept
    triangles, weights = rng.integers(0, 12, 200).astype(np.int32), 0.9 * rng.dirichlet((1, 1, 1), 200) + 0.1 / 3
    receivers = surface_receivers(scene, triangles, weights)
    assert receivers.positions == pytest.approx(np.einsum("nk,nkc->nc", weights, scene.corners[triangles]))
    assert receivers.normals == pytest.approx(scene.corner_normals[triangles, 0])
    assert (receivers.triangle_sides == 2 * triangles).all()


def test_receivers_on_an_edge_stand_a_little_inside():
    scene = closed_box()
    triangles = np.arange(12, dtype=np.int32)
    receivers = surface_receivers(scene, triangles, np.tile([[0.0, 0.0, 1.0]], (12, 1)))
    off = np.linalg.norm(receivers.positions - scene.corners[:, 2], axis=1)
    assert (off > 0).all()
    assert off.max() < 5e-3  # of a 1 m face: less than a texel


def test_receivers_of_a_smooth_ball_lie_between_its_facets_and_the_ball():
    scene = scene_of([sphere((1, 2, 3), 0.5, rings=12, segments=24)])
    rng = np.random.default_rng(1)
    triangles = rng.integers(0, len(scene.triangles), 500).astype(np.int32)
    weights = rng.dirichlet((1, 1, 1), 500)
    receivers = surface_receivers(scene, triangles, weights)
    on_facets = np.linalg.norm(np.einsum("nk,nkc->nc", weights, scene.corners[triangles]) - [1, 2, 3], axis=1)
    radii = np.linalg.norm(receivers.positions - [1, 2, 3], axis=1)
    # tangent planes touch the ball from outside: a little above it is possible, by the square of a facet's angle
    assert (radii > on_facets - 1e-9).all()
    assert (radii < 0.5 * (1 + (np.pi / 12) ** 2 / 4)).all()
    outwards = (receivers.positions - [1, 2, 3]) / radii[:, None]
    assert np.linalg.norm(receivers.normals, axis=1) == pytest.approx(1, abs=1e-6)
    # interpolated normals are the ball's to second order in a facet's angle
    assert ((receivers.normals * outwards).sum(axis=1) > np.cos(np.pi / 12 / 2)).all()


def test_normals_that_cancel_give_way_to_the_face():
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))])
    scene.corner_normals[0] = [(1, 0, 0), (-1, 0, 0), (0, 0, 0)]
    receivers = surface_receivers(scene, np.zeros(1, np.int32), np.array([[0.5, 0.5, 0]]))
    assert receivers.normals[0] == pytest.approx((0, 0, 1))


def test_patch_receivers_come_in_pairs_of_sides():
    scene = closed_box()
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.5, 1000, 0)
        chosen = np.array([3, 7])
        receivers = patch_receivers(scene, kernel, chosen, 4, 0)
    positions, normals = (a.reshape(2, 2, 4, 3) for a in (receivers.positions, receivers.normals))
    sides = receivers.triangle_sides.reshape(2, 2, 4)
    assert (positions[:, 0] == positions[:, 1]).all()
    assert (normals[:, 0] == -normals[:, 1]).all()
    for patch, own in zip(chosen, sides):
        assert (own == 2 * patches.triangles[patch] + np.array([[0], [1]])).all()
    front = scene.corner_normals[patches.triangles[chosen], 0]
    assert normals[:, 0, 0] == pytest.approx(front)


@pytest.mark.parametrize("offset", [0.0, 1e5])
def test_patch_receivers_lie_in_the_plane_of_their_triangle_wherever_the_scene_stands(offset):
    scene = moved(closed_box(), offset=(offset, -offset, offset))
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.5, 1000, 0)
        receivers = patch_receivers(scene, kernel, np.arange(len(patches)), 8, 0)
    triangles = receivers.triangle_sides // 2
    from_corner = receivers.positions - scene.corners[triangles, 0]
    off = np.abs((from_corner * receivers.normals.astype(np.float64)).sum(axis=1))
    # doubles hold 1e-11 m at 1e5 m; what is off by more than the kernel's push of 1e-6 starts behind its own wall
    assert off.max() < 1e-9


def shared_vertices(scene, angle=30.0):
    """For each corner of the scene, the set of triangles whose corners share its value."""
    _, graph = vertices_of(scene, angle)
    owner = np.repeat(graph.triangles, 3)
    return [frozenset(owner[graph.owners == value].tolist()) for value in graph.owners]


def test_a_cubes_corners_share_within_their_face_only():
    scene = scene_of([box((0, 0, 0), (1, 1, 1))])
    for corner, group in enumerate(shared_vertices(scene)):
        face = corner // 3 // 2
        assert group <= {2 * face, 2 * face + 1}


@pytest.mark.parametrize(("rings", "segments"), [(3, 4), (4, 6), (16, 32)])
def test_a_smooth_balls_corners_share_around_each_vertex(rings, segments):
    """However its faces bend: what rises between them is their own edge."""
    scene = scene_of([sphere((0, 0, 0), 1, rings=rings, segments=segments)])
    groups = shared_vertices(scene)
    for corner, group in enumerate(groups):
        vertex = scene.triangles.ravel()[corner]
        assert group == frozenset(np.flatnonzero((scene.triangles == vertex).any(axis=1)).tolist())


def test_a_wide_smooth_angle_does_not_join_faces_across_a_sharp_edge():
    sheet = rectangle((0, 0, 0), (2, 0, 0), (0, 1, 0), cuts=(2, 1))
    scene = scene_of([sheet])
    assert max(len(group) for group in shared_vertices(scene)) > 2
    middle = np.isin(scene.triangles, [1, 4])
    sharp = middle & np.roll(middle, -1, axis=1)
    marked = replace(scene, objects=(replace(scene.objects[0], sharp_edges=sharp),))
    for corner, group in enumerate(shared_vertices(marked, 180.0)):
        assert group <= ({0, 1} if corner < 6 else {2, 3})


@pytest.mark.parametrize("degrees", [-60, -20, 20, 60])
def test_faces_that_bend_off_share_up_to_the_smooth_angle(degrees):
    x, z = 1 + np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (x, 0, z), (x, 1, z)]
    fold = scene_of([Part(corners, [(0, 1, 2), (0, 2, 3), (1, 4, 5), (1, 5, 2)])])
    assert any(group & {0, 1} and group & {2, 3} for group in shared_vertices(fold, abs(degrees) + 1))
    assert not any(group & {0, 1} and group & {2, 3} for group in shared_vertices(fold, abs(degrees) - 1))


def test_objects_that_only_touch_do_not_share():
    halves = [rectangle((x, 0, 0), (1, 0, 0), (0, 1, 0)) for x in (0, 1)]
    for corner, group in enumerate(shared_vertices(scene_of(halves))):
        assert group <= ({0, 1} if corner < 6 else {2, 3})


def test_only_targets_have_vertex_receivers():
    plates = [rectangle((0, 0, z), (1, 0, 0), (0, 1, 0), is_target=z == 1) for z in (0, 1, 2)]
    receivers, graph = vertices_of(scene_of(plates))
    assert graph.triangles.tolist() == [2, 3]
    assert len(receivers) == 6
    assert (receivers.positions[:, 2] == 1).all()


def test_a_constant_comes_through_the_means_as_it_is():
    degenerate = Part([(0, 0, 0), (1, 1, 1), (2, 2, 2)], [(0, 1, 2)])
    scene = scene_of([sphere((0, 0, 0), 1), degenerate])
    receivers, graph = vertices_of(scene)
    values = graph.corner_values(np.full((len(receivers), 3), 7.0))
    assert values.shape == (len(scene.triangles), 3, 3)
    # weights over their sum; a face without area has a mean, too
    assert values == pytest.approx(7.0, rel=1e-12)


def test_a_value_is_the_mean_of_the_receivers_near_its_vertex():
    """A linear function of position on a flat sheet: each vertex gets its value within what receivers are inset."""
    scene = scene_of([rectangle((0, 0, 0), (4, 0, 0), (0, 4, 0), cuts=(4, 4))])
    receivers, graph = vertices_of(scene)
    values = graph.corner_values(receivers.positions)
    off = np.linalg.norm(values - scene.corners, axis=2)
    # receivers stand a sixth of a 1 m cell's way towards the middle of their triangle
    assert off.max() < 2 / 6
    # inside the sheet the neighbours are around it on all sides
    inner = ((scene.corners[..., :2] > 0.5) & (scene.corners[..., :2] < 3.5)).all(axis=2)
    assert off[inner].max() < 0.02
