"""Lightmap: what is baked is what is looked up, and no empty texel is left for filters to find."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.core.lightmap import assemble
from addon.core.settings import BakeSettings
from addon.core.texels import texels
from addon.core.unwrap import unwrap
from tests.core.meshes import box, rough_sheet, scene_of

NO_UVS = np.full((1, 3, 2), np.nan, np.float32)


def cells_of(rows, columns, width, height):
    """Texels of a lightmap that are receivers, in this order."""
    cells = np.full((height, width), -1, np.int32)
    cells[rows, columns] = np.arange(len(rows))
    return cells


def bilinear(pixels, points):
    """Look up at points (N, 2) in texels, centres at i + 0.5."""
    corner = np.floor(points - 0.5).astype(int)
    fraction = points - 0.5 - corner
    found = np.zeros((len(points), 3))
    for right in (0, 1):
        for up in (0, 1):
            weight = np.abs(1 - right - fraction[:, 0]) * np.abs(1 - up - fraction[:, 1])
            column = np.clip(corner[:, 0] + right, 0, pixels.shape[1] - 1)
            row = np.clip(corner[:, 1] + up, 0, pixels.shape[0] - 1)
            found += weight[:, None] * pixels[row, column]
    return found


def baked_positions(scene, charts):
    """A lightmap that holds positions [m], and the positions looked up at points inside charts."""
    texel_map = texels(charts)
    positions = np.einsum("nk,nkx->nx", texel_map.barycentrics.astype(float), scene.corners[texel_map.triangles])
    return texel_map, assemble(np.pi * positions, texel_map.cells, charts.uvs)


def test_a_linear_function_of_position_is_looked_up_exactly_inside_charts():
    scene = scene_of(box((2, 3, 4)), box((1, 1, 0.5), (6, 0, 0)))
    charts = unwrap(scene, BakeSettings(texels=1 << 15))
    texel_map, lightmap = baked_positions(scene, charts)
    is_inside = np.zeros((charts.height, charts.width), bool)
    is_inside[texel_map.rows, texel_map.columns] = texel_map.is_inside

    rng = np.random.default_rng(0)
    triangles = rng.integers(0, len(scene.triangles), 4000)
    weights = rng.dirichlet((1, 1, 1), len(triangles))
    points = np.einsum("nk,nkx->nx", weights, charts.uvs[triangles].astype(float))
    expected = np.einsum("nk,nkx->nx", weights, scene.corners[triangles])
    found = bilinear(lightmap.pixels, points)
    corner = np.floor(points - 0.5).astype(int)
    surrounded = np.ones(len(points), bool)
    for right in (0, 1):
        for up in (0, 1):
            surrounded &= is_inside[corner[:, 1] + up, corner[:, 0] + right]
    assert surrounded.mean() > 0.8
    texel = 1 / np.sqrt(charts.width * charts.height / (52 + 4))  # [m], about
    # float32 pixels and barycentrics of metres
    assert found[surrounded] == pytest.approx(expected[surrounded], abs=1e-5)
    # at the border receivers stand inside their texels: less than a texel off along u and v
    assert np.linalg.norm(found - expected, axis=1).max() < 2 * texel


def test_a_constant_is_looked_up_everywhere():
    scene = scene_of(rough_sheet(np.random.default_rng(2)), box())
    charts = unwrap(scene, BakeSettings(texels=1 << 13))
    texel_map = texels(charts)
    lightmap = assemble(np.full((len(texel_map), 3), np.pi), texel_map.cells, charts.uvs)
    # means of equal numbers, in float32
    assert lightmap.pixels == pytest.approx(1, abs=1e-5)


def test_pixels_are_irradiance_over_pi_and_uvs_are_shares_of_the_image():
    uvs = np.float32([[[0.5, 0.5], [3.5, 0.5], [0.5, 1.5]]])
    lightmap = assemble(np.array([[np.pi, 2 * np.pi, 0]]), cells_of([1], [2], 4, 2), uvs)
    assert lightmap.pixels[1, 2] == pytest.approx([1, 2, 0])
    assert lightmap.uvs == pytest.approx(np.array([[[0.125, 0.25], [0.875, 0.25], [0.125, 0.75]]]))
    assert lightmap.pixels.dtype == lightmap.uvs.dtype == np.float32


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 33), st.integers(1, 33), st.integers(0, 2**32 - 1), st.floats(0.001, 1))
def test_no_texel_stays_empty_and_none_leaves_the_range(width, height, seed, share):
    rng = np.random.default_rng(seed)
    is_set = rng.random((height, width)) < share
    is_set[rng.integers(height), rng.integers(width)] = True
    rows, columns = np.nonzero(is_set)
    irradiance = np.pi * rng.uniform(2, 5, (len(rows), 3))
    lightmap = assemble(irradiance, cells_of(rows, columns, width, height), NO_UVS)
    # baked texels are left as they are
    assert (lightmap.pixels[rows, columns] == (irradiance / np.pi).astype(np.float32)).all()
    low, high = lightmap.pixels[rows, columns].min(axis=0), lightmap.pixels[rows, columns].max(axis=0)
    # means of float32
    assert (lightmap.pixels >= low - 1e-5).all()
    assert (lightmap.pixels <= high + 1e-5).all()


def test_the_first_ring_is_the_mean_of_the_neighbours():
    lightmap = assemble(np.pi * np.array([[1.0] * 3, [3.0] * 3]), cells_of([4, 4], [4, 6], 11, 9), NO_UVS)
    assert lightmap.pixels[4, 5] == pytest.approx(2)  # between both
    assert lightmap.pixels[3, 3] == pytest.approx(1)
    assert lightmap.pixels[5, 7] == pytest.approx(3)


def test_a_bake_without_receivers_is_black():
    lightmap = assemble(np.zeros((0, 3)), cells_of([], [], 5, 3), NO_UVS)
    assert (lightmap.pixels == 0).all()
