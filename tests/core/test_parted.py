"""What parts patches and texels in two, and what does not."""

import numpy as np
import pytest

from addon.core.parted import finer_where_parted, is_parted
from addon.core.patches import grid_of, subdivide
from addon.core.receivers import surface_receivers
from addon.core.settings import BakeSettings
from addon.core.smoothing import texel_grid
from addon.core.texel_light import split_where_blocked
from addon.core.texels import texels
from addon.core.unwrap import unwrap
from tests.scenes import box, closed_box, kernel_of, rectangle, scene_of

WALL = 0.53  # x of it [m]


def floor_with_wall():
    floor = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), name="floor")
    return scene_of([floor, rectangle((WALL, 0, 0), (0, 1, 0), (0, 0, 1), name="wall")])


def spans(scene, kernel, patches):
    """Least and largest x of 64 points of each patch: a hundredth or two of a 0.1 m patch is left at its border."""
    _, barycentrics = kernel.patch_points(np.arange(len(patches)), 64, 1)
    corners = scene.corners[np.repeat(patches.triangles, 64)]
    x = np.einsum("nk,nkc->nc", barycentrics, corners)[:, 0].reshape(len(patches), 64)
    return x.min(axis=1), x.max(axis=1)


def test_patches_under_a_wall_are_parted_on_its_side_only():
    scene = floor_with_wall()
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.1, 10000, 0)
        parted = is_parted(scene, kernel, patches, 0).reshape(-1, 2)
        low, high = spans(scene, kernel, patches)
    on_floor = patches.triangles < 2
    crosses = (low < WALL - 0.03) & (high > WALL + 0.03)
    assert crosses[on_floor].any()
    assert parted[on_floor & crosses, 0].all()
    assert not parted[on_floor, 1].any()
    assert not parted[on_floor & ((high < WALL - 0.03) | (low > WALL + 0.03)), 0].any()


@pytest.mark.parametrize("scene", [closed_box(), scene_of([box((0, 0, 0), (1, 1, 1))])], ids=["room", "block"])
def test_in_a_room_and_on_a_block_nothing_is_parted(scene):
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.1, 10000, 0)
        assert not is_parted(scene, kernel, patches, 0).any()


def test_parted_cells_are_cut_and_no_other():
    scene = floor_with_wall()
    with kernel_of(scene) as kernel:
        grid = grid_of(scene, 0.1, 10000)
        coarse = subdivide(scene, kernel, 0.1, 10000, 0)
        count = is_parted(scene, kernel, coarse, 0).reshape(-1, 2).any(axis=1).sum()
        fine = finer_where_parted(scene, kernel, grid, 10000, 0)
        assert len(fine) == len(coarse) + 15 * count
        assert fine.areas.sum() == pytest.approx(coarse.areas.sum())
        # parts of cells are asked again, however small: those that cross it by a third of their 0.025 m
        low, high = spans(scene, kernel, fine)
        crosses = (fine.triangles < 2) & (low < WALL - 0.008) & (high > WALL + 0.008)
        assert crosses.any()
        assert is_parted(scene, kernel, fine, 0)[::2][crosses].all()
        assert len(finer_where_parted(scene, kernel, grid, 1, 0)) == len(coarse)


def test_texels_beside_a_wall_are_split_and_no_other():
    scene = floor_with_wall()
    charts = unwrap(scene, BakeSettings(texels=1 << 14))
    texel_map = texels(charts)
    receivers = surface_receivers(scene, texel_map.triangles, texel_map.barycentrics)
    grid = texel_grid(scene, charts, texel_map, receivers)
    with kernel_of(scene, 2) as kernel:
        is_split = split_where_blocked(kernel, grid.receivers, receivers, grid.spacing)
    assert not is_split[grid.receivers < 0].any()
    split = np.zeros(len(receivers), bool)
    split[grid.receivers[is_split]] = True
    away = np.abs(receivers.positions[:, 0] - WALL) / grid.spacing
    on_floor = texel_map.triangles < 2
    # the two beside it, and as many as light is blurred over
    assert split[on_floor & (away < 2)].all()
    assert not split[on_floor & (away > 4)].any()
