"""Smoothing over the vertices of meshes: noise goes, what the light does stays."""

from dataclasses import dataclass

import numpy as np
import pytest

from addon.core import _kernel
from addon.core.kernel import smooth_graph
from addon.core.measuring import probes_among
from addon.core.receivers import Receivers
from addon.core.vertex_graph import COMMON, ROUNDS
from addon.core.workers import Workers
from tests.graphs import row_graph, vertices_of
from tests.reference import smoothing as reference
from tests.scenes import box, rectangle, scene_of, sphere


def sheet(cuts=30):
    """A square of many faces in one plane, and its values' graph."""
    return vertices_of(scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), cuts=(cuts, cuts))]))


@dataclass(frozen=True)
class Job:
    """A gather job whose light is 1 of direct and 1 of gathered light everywhere."""

    receivers: Receivers
    weights: np.ndarray

    def part(self, chosen):
        return Job(self.receivers.part(chosen), self.weights[chosen])

    def direct(self, samples, seed):
        return np.ones((len(self.receivers), 3), np.float32), np.zeros(len(self.receivers), np.float32), 0

    gathered = direct


def noisy(light, deviation, seed=1):
    rng = np.random.default_rng(seed)
    return np.repeat((light + deviation * rng.standard_normal(len(light)))[:, None], 3, axis=1).astype(np.float32)


def smoothed(graph, receivers, values, variances):
    with Workers(2) as workers:
        scales = np.ones(len(values))
        return graph.smoothed(workers, receivers, values, variances, scales, np.ones(len(values)))


@pytest.mark.parametrize("stops_on_value", [False, True], ids=["geometry", "value"])
def test_a_round_is_what_its_definition_says(stops_on_value):
    _, graph = vertices_of(scene_of([sphere((0, 0, 0), 1, rings=8, segments=12)]))
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
    receivers, graph = vertices_of(scene_of([box((0, 0, 0), (1, 1, 1)), sphere((3, 0, 0), 1)]))
    positions = np.stack([np.bincount(graph.owners, graph.shares * axis) for axis in receivers.positions.T], axis=1)
    here = np.repeat(np.arange(graph.value_count), np.diff(graph.first_edges))
    there = graph.neighbours
    assert set(zip(here, there)) == set(zip(there, here))
    assert (here != there).all()
    # of a cube's face two corners have two neighbours, the diagonal's ends three, none in another face
    on_cube = positions.max(axis=1) < 1.5
    assert sorted(np.diff(graph.first_edges)[on_cube]) == [2] * 12 + [3] * 12
    assert (on_cube[here] == on_cube[there]).all()
    axis = np.argmax(np.abs(positions - 0.5)[here], axis=1)[on_cube[here], None]
    apart = np.abs(positions[here] - positions[there])[on_cube[here]]
    assert np.take_along_axis(apart, axis, axis=1).max() < 1e-6
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
    # six neighbours of 2 / 3 each: .15 in variance, and what a second round takes; stops on value leave some
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
    receivers, graph = vertices_of(faces)
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


def test_noise_is_pooled_as_that_of_one_receiver():
    """Whatever number of receivers values are made of: at a border one, two or three, inside six."""
    _, graph = sheet(8)
    expected = np.bincount(graph.owners, graph.shares**2)[graph.owners]
    with Workers(2) as workers:
        # float32
        assert graph.pooled(workers, None, np.full(len(graph.owners), 3.0)) == pytest.approx(3 * expected, rel=1e-5)


def test_probes_weigh_values_and_not_their_receivers():
    receivers, graph = sheet(8)
    job = Job(receivers, graph.shown)
    probes = probes_among(job, graph, 0.1, 0)
    assert len(probes.receivers) == graph.value_count  # few: all are measured
    surface = np.bincount(graph.owners, graph.shown)[graph.owners[probes.receivers]]
    assert probes.weights == pytest.approx(surface / surface.mean(), rel=1e-5)
    assert probes.weights * probes.shares == pytest.approx(graph.shown[probes.receivers], rel=1e-5)
    # what is the same everywhere is the same in their means
    assert probes.measured.luminance == pytest.approx(2.0, rel=1e-6)


def test_corners_with_a_wall_between_do_not_share():
    """A floor in two halves, and a wall without thickness on the line where they meet."""
    floor = rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0), cuts=(2, 2))
    wall = rectangle((0, -1, 0), (0, 2, 0), (0, 0, 1))
    receivers, open_floor = vertices_of(scene_of([floor]))
    _, parted = vertices_of(scene_of([floor, wall]))
    sides = np.sign(receivers.positions[:, 0])

    def sides_of_values(graph):
        return [set(sides[graph.owners[: len(sides)] == value]) for value in np.unique(graph.owners[: len(sides)])]

    assert {-1.0, 1.0} in sides_of_values(open_floor)
    assert all(len(one) == 1 for one in sides_of_values(parted))
    here = np.repeat(np.arange(parted.value_count), np.diff(parted.first_edges))
    value_sides = np.zeros(parted.value_count)
    value_sides[parted.owners[: len(sides)]] = sides
    assert (value_sides[here] * value_sides[parted.neighbours] >= 0).all()


def test_nothing_to_colour_is_no_values():
    receivers, graph = vertices_of(scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), is_target=False)]))
    assert len(receivers) == graph.value_count == len(graph.neighbours) == 0


def test_bytes_do_not_hang_on_ranges():
    _, graph = sheet(20)
    rng = np.random.default_rng(5)
    values, variances = rng.random((graph.value_count, 3), np.float32), rng.random(graph.value_count, np.float32)
    whole, parts = (np.zeros_like(values), np.zeros_like(variances)), (np.zeros_like(values), np.zeros_like(variances))
    _kernel.smooth_graph(*graph.arrays(), values, variances, 1, 0, graph.value_count, *whole)
    for first, count in ((0, 7), (7, 100), (107, graph.value_count - 107)):
        _kernel.smooth_graph(*graph.arrays(), values, variances, 1, first, count, *parts)
    for one, other in zip(whole, parts):
        assert one.tobytes() == other.tobytes()
