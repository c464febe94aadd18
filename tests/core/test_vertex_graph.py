"""Smoothing over the vertices of meshes: noise goes, what the light does stays."""

import numpy as np
import pytest

from addon.core.kernel import smooth_graph
from addon.core.vertex_graph import COMMON, ROUNDS
from addon.core.vertices import vertex_receivers
from addon.core.workers import Workers
from tests.graphs import row_graph
from tests.reference import smoothing as reference
from tests.scenes import box, rectangle, scene_of, sphere


def sheet(cuts=30):
    """A square of many faces in one plane, and its values' graph."""
    return vertex_receivers(scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), cuts=(cuts, cuts))]), 30.0)


def noisy(light, deviation, seed=1):
    rng = np.random.default_rng(seed)
    return np.repeat((light + deviation * rng.standard_normal(len(light)))[:, None], 3, axis=1).astype(np.float32)


def smoothed(graph, receivers, values, variances):
    with Workers(2) as workers:
        scales = np.ones(len(values))
        return graph.smoothed(workers, receivers, values, variances, scales, np.ones(len(values)))


@pytest.mark.parametrize("stops_on_value", [False, True], ids=["geometry", "value"])
def test_a_round_is_what_its_definition_says(stops_on_value):
    _, graph = vertex_receivers(scene_of([sphere((0, 0, 0), 1, rings=8, segments=12)]), 30.0)
    rng, count = np.random.default_rng(3), graph.value_count
    values, variances = rng.random((count, 3)).astype(np.float32), (0.05 * rng.random(count)).astype(np.float32)
    variances[::7] = 0
    runs = graph.first_edges[1:-1]
    lists = np.split(graph.neighbours, runs), np.split(graph.nearness.astype(float), runs)
    with Workers(2) as workers:
        found = smooth_graph(workers, graph, values, variances, stops_on_value)
    exact = reference.smooth_graph(*lists, values.astype(float), variances.astype(float), stops_on_value)
    # some ten weights of float32, the exponents known to 1e-6 of at most some tens
    assert found[0] == pytest.approx(exact[0], abs=3e-5)
    assert found[1] == pytest.approx(exact[1], abs=3e-6)


def test_neighbours_are_along_the_edges_of_one_surface():
    receivers, graph = vertex_receivers(scene_of([box((0, 0, 0), (1, 1, 1)), sphere((3, 0, 0), 1)]), 30.0)
    positions = np.stack([np.bincount(graph.owners, graph.shares * axis) for axis in receivers.positions.T], axis=1)
    here = np.repeat(np.arange(graph.value_count), np.diff(graph.first_edges))
    there = graph.neighbours
    assert set(zip(here, there)) == set(zip(there, here))
    assert (here != there).all()
    # each corner of a cube's face but two has three neighbours in it, these two: none in the faces around it
    on_cube = positions[here].max(axis=1) < 1.5
    axis = np.argmax(np.abs(positions[here] - 0.5)[on_cube], axis=1)
    rows = np.arange(on_cube.sum())
    assert (np.abs(positions[here][on_cube] - positions[there][on_cube])[rows, axis] < 1e-6).all()
    assert np.isin(np.unique(here[~on_cube]), np.unique(there[~on_cube])).all()
    assert (graph.nearness > 0).all()
    # a neighbour at the usual distance on a plane counts 2 / 3 of the value itself, as in a lightmap
    assert graph.nearness.max() == pytest.approx(2 / 3, rel=1e-6)


def test_noise_falls_by_what_so_many_neighbours_are_worth():
    receivers, graph = sheet()
    values = noisy(np.ones(len(receivers)), 0.1)
    # what the receivers of each value have in common does not lie in their mean: that is of independent ones
    alone = graph.stored(values)[:, 0]
    found, variances = smoothed(graph, receivers, values, np.full(len(receivers), 0.01, np.float32))
    inner = np.abs(receivers.positions[:, :2] - 0.5).max(axis=1) < 0.4
    before, after = (np.sqrt(np.mean((x[inner] - 1) ** 2)) for x in (alone, found[:, 0]))
    # six neighbours of 2 / 3 each: 1 / 5 in variance, a second round half of the rest; stops on value leave some
    assert after < 0.4 * before
    stated = np.sqrt(variances[inner].mean())
    assert 0.5 * after < stated < 1.5 * after


def test_a_step_above_the_noise_stays():
    receivers, graph = sheet()
    light = 1.0 + (receivers.positions[:, 0] > 0.5)
    found, _ = smoothed(graph, receivers, noisy(light, 0.02), np.full(len(receivers), 4e-4, np.float32))
    # values at x = 0.5 have receivers on both sides; beyond them none is mixed up
    is_beside = (np.abs(receivers.positions[:, 0] - 0.5) < 2.5 / 30) & (
        np.abs(graph.stored(receivers.positions)[:, 0] - 0.5) > 0.5 / 30
    )
    assert found[is_beside, 0] == pytest.approx(light[is_beside], abs=0.05)


def test_noise_does_not_go_around_a_crease():
    """A cube's faces, each with a light of its own, so noisy that value stops nothing."""
    faces = scene_of([box((0, 0, 0), (1, 1, 1))])
    receivers, graph = vertex_receivers(faces, 30.0)
    light = receivers.normals @ (1.0, 2.0, 4.0) + 8
    values = np.repeat(light[:, None], 3, axis=1).astype(np.float32)
    found, _ = smoothed(graph, receivers, values, np.full(len(receivers), 100, np.float32))
    assert found == pytest.approx(values, rel=1e-6)


def test_receivers_of_a_value_come_together():
    graph = row_graph(4, owners=np.array([0, 0, 0, 1]))
    values = np.float32([[0, 3, 6], [3, 3, 3], [6, 3, 0], [5, 5, 5]])
    assert graph.stored(values) == pytest.approx(np.float32([[3] * 3] * 3 + [[5] * 3]))
    # errors of the two values count alike, whatever they are made of
    assert graph.shown == pytest.approx([2 / 3] * 3 + [2])
    with Workers(1) as workers:
        # no neighbours: three receivers have a third of the variance, and each round is told to state more
        _, variances = graph.smoothed(workers, None, values, np.float32([1, 1, 1, 1]), np.ones(4), np.ones(4))
        assert variances == pytest.approx(COMMON**ROUNDS * np.array([1 / 3] * 3 + [1]))
        assert graph.pooled(workers, None, np.ones(4)) == pytest.approx([1 / 3] * 3 + [1])
    members, starts, shares = graph.members(np.array([0, 1]))
    assert members.tolist() == [0, 1, 2, 3]
    assert starts.tolist() == [0, 3]
    assert shares == pytest.approx([1 / 3] * 3 + [1])


def test_what_the_kernel_cannot_read_is_refused():
    graph, values = row_graph(3, 1), np.zeros((3, 3), np.float32)
    with Workers(1) as workers:
        graph.neighbours[1] = 3
        with pytest.raises(ValueError, match="neighbours: 3 is no index below 3"):
            smooth_graph(workers, graph, values, values[:, 0].copy(), True)
        graph.first_edges[-1] = 9
        with pytest.raises(ValueError, match="first_edges: they are no runs of the neighbours"):
            smooth_graph(workers, graph, values, values[:, 0].copy(), True)
