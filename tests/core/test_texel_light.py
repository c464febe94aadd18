"""The light of texels, packed for the kernel: what is lost, what rays find of it, and where they go on."""

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.gather_sums import no_sums
from addon.core.guides import no_guides
from addon.core.kernel import EVEN_SIDE
from addon.core.patch_solution import PatchSolution
from addon.core.patches import subdivide
from addon.core.receivers import surface_receivers
from addon.core.seen_light import SeenLight
from addon.core.settings import BakeSettings
from addon.core.smoothing import texel_grid
from addon.core.texel_light import NO_LIGHT, packed, texel_light
from addon.core.texels import texels
from addon.core.unwrap import unwrap
from tests.scenes import closed_box, kernel_of


def unpacked(light):
    """As the header has it: three float32 without sign and without their last 10 bits, red lowest."""
    fields = [(light >> np.uint64(21 * k)) & np.uint64((1 << 21) - 1) for k in range(3)]
    return (np.stack(fields, axis=-1).astype(np.uint32) << np.uint32(10)).view(np.float32)


def test_light_is_rounded_to_six_in_a_hundred_thousand_and_not_to_one_side():
    rng = np.random.default_rng(0)
    light = (10.0 ** rng.uniform(-30, 30, (10000, 3))).astype(np.float32)
    relative = unpacked(packed(light)).astype(np.float64) / light - 1
    # 13 bits of mantissa, rounded: half of the last one
    assert np.abs(relative).max() <= 2.0**-14
    # a mean of 30000 of a spread of 3e-5: four deviations
    assert abs(relative.mean()) < 4 * 3e-5 / 30000**0.5


@pytest.mark.parametrize("value", [0.0, -0.0, 1.0, 1.5, 2.0**-149, 2.0**-126, 1e38])
def test_dark_stays_dark_and_extremes_are_numbers(value):
    light = packed(np.full((1, 3), value, np.float32))
    assert light[0] >> np.uint64(63) == 0
    found = unpacked(light)
    assert np.isfinite(found).all()
    # denormals have fewer bits: of what is smaller than 1e-38 some is lost
    assert found == pytest.approx(value, rel=2.0**-14, abs=2.0**-126)
    assert (found == 0).all() or value > 0


def gathered_in_a_box(light, is_split):
    """What receivers of a box see, (N, 3), whose texels have ``light`` (3,) and whose patches are dark."""
    scene = closed_box()
    charts = unwrap(scene, BakeSettings(texels=1024))
    texel_map = texels(charts)
    receivers = surface_receivers(scene, texel_map.triangles, texel_map.barycentrics)
    grid = texel_grid(scene, charts, texel_map, receivers)
    marks = np.full(grid.receivers.shape, is_split)
    shown = texel_light(grid.uvs, grid.receivers, marks, 0.0)
    shown.show(np.tile(np.float32(light), (len(receivers), 1)))
    assert (shown.light[grid.receivers < 0] == NO_LIGHT).all()
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 0.5, 1000, 0)
        dark, count = np.zeros((2 * len(patches), 3), np.float32), 16
        field = PatchSolution(
            dark, dark, patches.side_reflectance, np.full(len(dark), EVEN_SIDE, np.uint8),
            np.zeros(len(dark), np.float32), np.zeros((1, 3), np.float32),
        )  # fmt: skip
        sums = no_sums(len(receivers), 1)
        everyone = np.arange(len(receivers), dtype=np.uint32)
        light = SeenLight(field, emitters_of(scene, kernel.centre), shown)
        kernel.gather(light, receivers, no_guides(len(receivers)), everyone, 0, count, 0, sums)
    return sums.means(count)


def test_what_was_shown_before_is_forgotten():
    cells = np.arange(600, dtype=np.int32).reshape(300, 2)[::-1] - 1  # the last has no receiver
    is_split = cells % 3 == 0
    shown, light = texel_light(np.zeros((0, 3, 2), np.float32), cells, is_split, 0.0), np.zeros((599, 3), np.float32)
    shown.show(light + 7)
    light[:] = np.arange(599)[:, None]
    shown.show(light)
    has_light = cells >= 0
    assert (shown.light[~has_light] == NO_LIGHT).all()
    assert (shown.light[has_light] >> np.uint64(63) == is_split[has_light]).all()
    assert unpacked(shown.light)[has_light] == pytest.approx(light[cells[has_light]], rel=1e-4)  # 14 bits


def test_rays_find_the_light_of_texels():
    light = (3.0, 0.7, 1e-6)
    found = gathered_in_a_box(light, is_split=False)
    # a few rays of the outermost receivers meet the border of a face, where no texel is
    assert np.median(found, axis=0) == pytest.approx(light, rel=2.0**-14 + 1e-5)
    assert found.mean(axis=0) == pytest.approx(light, rel=0.01)


def test_rays_go_on_from_texels_that_are_split():
    assert gathered_in_a_box((3.0, 0.7, 1.0), is_split=True).max() == 0
