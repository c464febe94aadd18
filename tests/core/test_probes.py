"""Probes: what a viewer sees between texels and between corners, and an error that is what it is called."""

import numpy as np
import pytest

from addon.core.probes import (
    LEAST_PROBES,
    MOST_OF_OBJECT,
    Measured,
    rms_of,
    seen_through_corners,
    seen_through_lightmap,
)
from addon.core.relative import scale_of
from addon.core.settings import BakeSettings
from addon.core.texels import texels
from addon.core.unwrap import unwrap
from tests.graphs import vertices_of
from tests.scenes import closed_box, rectangle, scene_of


def smooth_field(positions):
    """Three fields that are linear in space."""
    return positions @ np.array([[1.0, 0.2, -0.3], [0.5, 1.5, 0.1], [-0.2, 0.3, 0.9]]) + 4.0


def test_a_lightmap_shows_a_linear_field_as_it_is():
    scene = closed_box()
    charts = unwrap(scene, BakeSettings(texels=1 << 14))
    texel_map = texels(charts)
    seen = seen_through_lightmap(scene, texel_map.cells, charts.uvs, 1)
    corners = scene.corners[texel_map.triangles]
    values = smooth_field(np.einsum("nk,nkc->nc", texel_map.barycentrics.astype(np.float64), corners))
    shown = seen.look_up(values)
    # bilinear lookup is exact but where a texel beside an edge stands for the chart's nearest point: at most a texel
    # of 1 / 50 m away, times a slope of less than 2
    assert np.abs(shown - smooth_field(seen.receivers.positions)).max() < 2 / 50
    inner = np.abs(seen.receivers.positions - 0.5).max(axis=1)
    is_inner = np.sort(np.abs(seen.receivers.positions - 0.5), axis=1)[:, 1] < 0.45
    assert inner == pytest.approx(0.5)
    error = np.abs(shown - smooth_field(seen.receivers.positions))[is_inner]
    assert np.quantile(error, 0.9) < 2e-4  # float32 UVs of some 100 texels; receivers stand 1e-3 off edges


def test_corner_colours_show_a_linear_field_about_as_it_is():
    scene = closed_box()
    receivers, graph = vertices_of(scene)
    seen = seen_through_corners(scene, graph, 1)
    shown = seen.look_up(smooth_field(receivers.positions))
    # a receiver stands a sixth of an edge inside its face
    assert np.abs(shown - smooth_field(seen.receivers.positions)).max() < 0.5 * 2


def test_a_ground_plane_does_not_take_all_points():
    ground = rectangle((-50, -50, 0), (100, 0, 0), (0, 100, 0), name="ground")
    table = rectangle((0, 0, 1), (1, 0, 0), (0, 1, 0), name="table")
    chair = rectangle((2, 0, 1), (1, 0, 0), (0, 1, 0), name="chair")
    scene = scene_of([ground, table, chair])
    _, graph = vertices_of(scene)
    points = seen_through_corners(scene, graph, 1).receivers
    on_ground = np.mean(points.positions[:, 2] == 0)
    # the ground's weight is a quarter of the whole area, so all but 1 / 1250 of what is chosen from
    assert MOST_OF_OBJECT < on_ground
    assert len(points) == LEAST_PROBES


def test_the_error_of_probes_takes_out_what_they_do_not_know():
    rng = np.random.default_rng(0)
    truth = np.ones((20000, 3))
    noise = 0.1
    measured = Measured(1 + noise * rng.normal(size=20000), np.full(20000, noise**2), 0)
    for wrong in (0.0, 0.05, 0.2):
        values = truth + wrong * rng.choice([-1.0, 1.0], 20000)[:, None]
        # 20000 squares of a normal number of variance 0.01 and more: their mean is known to 1e-4 and some
        assert rms_of(measured.squares_of(values, 1.0)) ** 2 == pytest.approx(wrong**2, abs=1.5e-3)


def test_the_scale_of_an_error_is_the_light_and_a_share_of_the_median():
    light = np.repeat(np.array([[0.0], [1.0], [2.0], [3.0]]), 3, axis=1)
    assert scale_of(light) == pytest.approx([0.6, 1.6, 2.6, 3.6])


def test_probes_that_know_too_little_do_not_say_that_there_is_no_error():
    """Squares about 0 by their noise alone: what their mean may be off by is stated, not 0."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        squares = rng.normal(0, 1, 400)
        assert rms_of(squares) >= (squares.std() / 20) ** 0.5 > 0
    assert rms_of(np.zeros(400)) == 0
