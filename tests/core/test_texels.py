"""Texels: the kernel agrees with the definition, and a receiver stands where its texel is looked up."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.core import kernel
from addon.core.charts import Charts
from addon.core.texels import INSET, further_in, texels
from tests.reference import texels as reference

WIDTH, HEIGHT = 13, 9
# eighths make corners meet texel centres, edges and each other exactly; the rest is anywhere
COORDINATES = st.one_of(st.integers(-16, 120).map(lambda n: n / 8), st.floats(-2, 15, width=32))
TRIANGLES = st.lists(st.lists(COORDINATES, min_size=6, max_size=6), min_size=1, max_size=6)


@settings(max_examples=150, deadline=None)
@given(TRIANGLES)
def test_agrees_with_the_definition(corners):
    uvs = np.array(corners, np.float32).reshape(-1, 3, 2)
    triangles, distances, barycentrics = kernel.rasterise_texels(uvs, WIDTH, HEIGHT)
    # a triangle that just touches a texel's square may count or not: rounding decides
    wide, wide_distances, _ = reference.rasterise_texels(uvs, WIDTH, HEIGHT, reach=1 + 1e-6)
    narrow, narrow_distances, _ = reference.rasterise_texels(uvs, WIDTH, HEIGHT, reach=1 - 1e-6)

    assert (wide[triangles >= 0] >= 0).all()
    assert (triangles[narrow >= 0] >= 0).all()
    # distances are stored as float32 and called equal to 1e-6
    assert (distances <= narrow_distances + 1e-5).all()
    assert (distances >= wide_distances - 1e-5).all()

    rows, columns = np.nonzero(triangles >= 0)
    weights = barycentrics[rows, columns]
    assert (weights >= 0).all()
    # rounding of three float32
    assert weights.sum(axis=1) == pytest.approx(1, abs=1e-6)
    points = np.einsum("nk,nkx->nx", weights.astype(float), uvs[triangles[rows, columns]])
    offsets = points - np.stack([columns + 0.5, rows + 0.5], axis=1)
    # barycentrics as float32 in triangles up to 25 texels long
    assert np.hypot(*offsets.T) == pytest.approx(distances[rows, columns], abs=1e-5)


@pytest.mark.parametrize("seed", range(6))
def test_the_winning_triangle_is_the_definitions(seed):
    rng = np.random.default_rng(seed)
    middle = rng.uniform(0, 10, (40, 1, 2))
    uvs = (middle + rng.normal(0, rng.uniform(0.05, 3), (40, 3, 2))).astype(np.float32)
    expected = reference.rasterise_texels(uvs, WIDTH, HEIGHT)
    found = kernel.rasterise_texels(uvs, WIDTH, HEIGHT)
    # random corners: no two distances are within rounding of each other
    assert (found[0] == expected[0]).all()
    # float32
    assert np.nan_to_num(found[1], posinf=9) == pytest.approx(np.nan_to_num(expected[1], posinf=9), abs=1e-6)
    assert found[2] == pytest.approx(expected[2], abs=1e-4)


def test_the_lower_triangle_wins_where_two_are_equally_near():
    quad = np.float32([[[0.5, 0.5], [6.5, 0.5], [6.5, 6.5]], [[0.5, 0.5], [6.5, 6.5], [0.5, 6.5]]])
    triangles, distances, _ = kernel.rasterise_texels(quad, 8, 8)
    diagonal = np.arange(7)
    assert (distances[diagonal, diagonal] == 0).all()
    assert (triangles[diagonal, diagonal] == 0).all()
    swapped, _, _ = kernel.rasterise_texels(quad[::-1], 8, 8)
    assert (swapped[diagonal, diagonal] == 0).all()


def test_a_speck_between_four_centres_has_four_receivers_at_the_speck():
    uvs = np.float32([[[3.0, 3.0], [3.001, 3.0], [3.0, 3.001]]])
    triangles, distances, _ = kernel.rasterise_texels(uvs, 6, 6)
    assert np.argwhere(triangles >= 0).tolist() == [[2, 2], [2, 3], [3, 2], [3, 3]]
    # half a texel's diagonal away, less the speck's size
    assert distances[triangles >= 0] == pytest.approx(np.sqrt(0.5), abs=1.5e-3)


def test_a_chart_that_ends_on_texel_centres_touches_no_texel_more():
    uvs = np.float32([[[2.5, 1.5], [5.5, 1.5], [5.5, 3.5]], [[2.5, 1.5], [5.5, 3.5], [2.5, 3.5]]])
    triangles, _, _ = kernel.rasterise_texels(uvs, 8, 8)
    rows, columns = np.nonzero(triangles >= 0)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (1, 3, 2, 5)


def test_triangles_without_a_place_and_without_an_area_do_no_harm():
    nan = np.float32(np.nan)
    uvs = np.float32(
        [
            [[nan, 1], [2, 2], [3, 1]],
            [[4.5, 4.5], [4.5, 4.5], [4.5, 4.5]],  # a point
            [[1, 1], [2, 2], [3, 3]],  # a line
            [[1e30, 0], [-1e30, 1], [0, 1e30]],
            [[-9, -9], [-8, -9], [-9, -8]],  # outside
        ]
    )
    triangles, distances, barycentrics = kernel.rasterise_texels(uvs[[0, 1, 2, 4]], 7, 7)
    assert set(np.unique(triangles)) == {-1, 1, 2}
    assert triangles[4, 4] == 1
    assert (barycentrics[triangles < 0] == 0).all()
    assert np.isinf(distances[triangles < 0]).all()
    triangles, _, _ = kernel.rasterise_texels(uvs[3:4], 7, 7)
    assert triangles.shape == (7, 7)


def morton(row, column):
    """Bits of both, taken in turns."""
    return int("".join(a + b for a, b in zip(f"{row:020b}", f"{column:020b}")), 2)


def test_the_texel_map_lists_neighbours_after_each_other():
    charts = Charts(np.float32([[[1.5, 1.5], [4.5, 1.5], [1.5, 4.5]]]), np.zeros(1, np.int32), 8, 6)
    found = texels(charts)
    order = [morton(row, column) for row, column in zip(found.rows.tolist(), found.columns.tolist())]
    assert order == sorted(set(order))
    assert found.is_inside.sum() == 10  # 4 + 3 + 2 + 1 centres
    # outside, beyond the hypotenuse but within bilinear reach
    assert len(found) == 10 + 3
    assert (found.triangles == 0).all()


@pytest.mark.parametrize(("width", "height"), [(0, 4), (4, 0), (-1, 4)])
def test_a_lightmap_without_texels_is_refused(width, height):
    from addon.core import _kernel

    empty = np.empty(0, np.int32), np.empty(0, np.float32), np.empty((0, 3), np.float32)
    with pytest.raises(ValueError, match=r"\w"):
        _kernel.rasterise_texels(np.zeros((1, 3, 2), np.float32), width, height, *empty)


def test_how_much_is_looked_up_in_texels_is_what_their_hats_leave_of_a_chart():
    """Against the integral of each texel's hat over a quad, at its middle rows; corners are looked up less."""
    low, high = 2.2, 11.9
    quad = np.float32([[[low, low], [high, low], [high, high]], [[low, low], [high, high], [low, high]]])
    found = texels(Charts(quad, np.zeros(2, np.int32), 14, 14))
    fine = np.linspace(low, high, 20001)
    fine = 0.5 * (fine[1:] + fine[:-1])
    across = {c: np.maximum(1 - np.abs(fine - c - 0.5), 0).sum() * (high - low) / 20000 for c in range(14)}
    middle = np.flatnonzero(found.rows == 7)
    exact = np.array([across[c] for c in found.columns[middle].tolist()])
    inside = found.is_inside[middle]
    shown = found.shown[middle] / found.shown.max()
    # 20000 steps of a kinked integrand: 1e-6; inside a whole texel is taken, which at the very edge is half of one
    assert shown[~inside] == pytest.approx(exact[~inside], abs=1e-5)
    assert (~inside).sum() == 2
    assert ((shown[inside] >= exact[inside] - 1e-6) & (exact[inside] >= 0.5)).all()
    assert found.shown.mean() == pytest.approx(1, abs=1e-5)  # float32
    assert found.shown.min() > 0


@given(
    st.lists(st.tuples(st.floats(1, 15), st.floats(1, 15)), min_size=3, max_size=12).map(lambda c: c[: len(c) // 3 * 3])
)
def test_what_stands_for_texels_outside_is_inside_a_chart_off_its_edge(corners):
    uvs = np.array(corners, np.float32).reshape(-1, 3, 2)
    found = texels(Charts(uvs, np.zeros(len(uvs), np.int32), 16, 16))
    assert (found.barycentrics >= -1e-6).all()  # float32
    assert found.barycentrics.sum(axis=1) == pytest.approx(1, abs=1e-5)
    at = np.einsum("nk,nkc->nc", found.barycentrics, uvs[found.triangles].astype(np.float64))
    moved = np.linalg.norm(at - np.stack([found.columns, found.rows], 1) - 0.5, axis=1)
    nearest = kernel.rasterise_texels(uvs, 16, 16)[1][found.rows, found.columns]
    # no further than INSET beyond what is nearest; float32 positions of 15
    assert (moved <= nearest + INSET + 1e-5).all()


def test_the_point_for_a_texel_outside_is_a_quarter_texel_in_or_half_way():
    wide = np.float32([[[1.8, 1.8], [9.8, 1.8], [1.8, 9.8]]])
    found = texels(Charts(wide, np.zeros(1, np.int32), 12, 12))
    below = np.flatnonzero((found.rows == 1) & (found.columns == 4))
    assert found.barycentrics[below] @ wide[0, :, 1] == pytest.approx(1.8 + INSET, abs=1e-5)
    thin = np.float32([[[1.5, 1.8], [8.5, 1.8], [8.5, 2.0]]])
    found = texels(Charts(thin, np.zeros(1, np.int32), 12, 4))
    below = np.flatnonzero((found.rows == 1) & (found.columns == 6))
    # 5 of its 7 texels along, the strip is 1/7 texel wide
    assert found.barycentrics[below] @ thin[0, :, 1] == pytest.approx(1.8 + 0.5 / 7, abs=1e-5)


def test_a_centre_that_rounds_to_the_edge_gets_a_point_inside_too():
    corners = np.array([[[0.0, 0.0], [8.0, 0.0], [0.0, 8.0]]])
    weights = np.array([[0.5, 0.5, 0.0]])
    found = further_in(corners, np.array([[4.0, 0.0]]), weights)
    assert np.isfinite(found).all()
    assert (found > 0).all()
