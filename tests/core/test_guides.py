"""Guides: they say where light comes from, and change how noisy the gathered light is, not what it is."""

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.gather_sums import no_sums
from addon.core.guides import EVEN, LEAST_GROUP, MOST_GROUP, WIDEST, group_size, guide_shares, learn_guides, no_guides
from addon.core.kernel import GUIDE_CELLS
from addon.core.radiosity import solve_radiosity
from addon.core.receivers import Receivers
from addon.core.seen_light import SeenLight
from addon.core.settings import BakeSettings
from tests.reference.guides import cell_directions, share_through_rectangle
from tests.scenes import BLACK, GREY, kernel_of, rectangle, scene_of

SKY = (1.0, 2.0, 3.0)
SKY_LUMINANCE = np.pi * np.dot((0.2126, 0.7152, 0.0722), SKY)
LOW, HIGH, TOP = 0.1, 0.4, 1.0  # the hole in the lid, and the lid's height


def box_with_a_hole(material):
    """A unit box under the sky whose lid has a square hole; the floor is triangles 0 and 1."""
    walls = [
        rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), material=material, name="floor"),
        rectangle((0, 0, 0), (0, 0, TOP), (1, 0, 0), material=material, name="front"),
        rectangle((0, 1, 0), (1, 0, 0), (0, 0, TOP), material=material, name="rear"),
        rectangle((0, 0, 0), (0, 1, 0), (0, 0, TOP), material=material, name="left"),
        rectangle((1, 0, 0), (0, 0, TOP), (0, 1, 0), material=material, name="right"),
    ]
    edges = (0.0, LOW, HIGH, 1.0)
    for i in range(3):
        for j in range(3):
            if (i, j) != (1, 1):
                width, depth = edges[i + 1] - edges[i], edges[j + 1] - edges[j]
                corner = (edges[i], edges[j], TOP)
                walls.append(rectangle(corner, (0, depth, 0), (width, 0, 0), material=material, name=f"lid {i} {j}"))
    return scene_of(walls, world=SKY)


def floor_points(points):
    points = np.asarray(points, np.float64)
    facing = np.tile(np.float32([0, 0, 1]), (len(points), 1))
    # the floor's diagonal runs along x = y
    return Receivers(points, facing, np.where(points[:, 0] >= points[:, 1], 0, 2).astype(np.int32))


def whole_floor(side=128):
    """So many that groups of 256 are an eighth of the floor wide."""
    x, y = np.meshgrid(np.linspace(0.005, 0.995, side), np.linspace(0.005, 0.995, side))
    return floor_points(np.stack([x.ravel(), y.ravel(), np.zeros(side * side)], axis=1))


def learned(scene, receivers, then):
    with kernel_of(scene, 2) as kernel:
        emitters = emitters_of(scene, kernel.centre)
        solved = solve_radiosity(scene, kernel, emitters, BakeSettings(error=0.1, patch_size=0.2), lambda done: None)
        guides, rays = learn_guides(kernel, SeenLight(solved.patches, solved.sources), receivers, 1)
        return then(kernel, solved, guides, rays)


def test_the_mean_square_through_each_cell_is_that_of_the_definition():
    """All black: a ray sees the sky through the hole, or nothing."""
    point = np.array([0.62, 0.31, 0.0])
    scene, rays = box_with_a_hole(BLACK), 1 << 16
    with kernel_of(scene) as kernel:
        emitters = emitters_of(scene, kernel.centre)
        solved = solve_radiosity(scene, kernel, emitters, BakeSettings(error=0.5, patch_size=0.5), lambda done: None)
        one = np.zeros(1, np.uint32), np.array([0, 1], np.uint32)
        receivers = floor_points([point])
        moments, traced = kernel.learn_guides(SeenLight(solved.patches, solved.sources), receivers, *one, rays, 5)
    rng = np.random.default_rng(0)
    for cell in range(GUIDE_CELLS):
        directions = cell_directions((0, 0, 1), cell, rays, rng)
        share = share_through_rectangle(point, directions, (LOW, LOW), (HIGH, HIGH), TOP)
        # rays / 64 of the kernel's rays fall into a cell, as strata; random ones would be within 5 of these 64 times
        spread = 5 * np.sqrt((share * (1 - share) + 1e-4) / (rays / GUIDE_CELLS))
        assert moments[0, cell] / SKY_LUMINANCE**2 == pytest.approx(share, abs=spread)
    assert traced == rays


def test_guided_rays_find_the_same_light_with_less_noise():
    receivers = whole_floor()

    def both(kernel, solved, guides, rays):
        light = []
        for by in (no_guides(len(receivers)), guides):
            sums = no_sums(len(receivers), 4)
            everyone = np.arange(len(receivers), dtype=np.uint32)
            kernel.gather(SeenLight(solved.patches, solved.sources), receivers, by, everyone, 0, 64, 9, sums)
            light.append(sums.luminances / 64)
        return light

    plain, guided = learned(box_with_a_hole(GREY), receivers, both)
    noises = [light.std(axis=1, ddof=1) / 2 for light in (plain, guided)]
    # the mean over 16384 independent receivers, at 4 standard errors
    limit = 4 * np.sqrt(sum((noise**2).mean() for noise in noises) / len(receivers))
    assert abs(plain.mean() - guided.mean()) < limit
    # the mean of 16384 variances of 3 degrees of freedom is known to 1 %: 5 % less is not by luck
    assert (noises[1] ** 2).mean() < 0.95 * (noises[0] ** 2).mean()


def test_shares_are_a_density_that_leaves_nothing_out():
    _, guides = learned(box_with_a_hole(GREY), whole_floor(), lambda kernel, solved, guides, rays: (rays, guides))
    assert guides.shares.sum(axis=1) == pytest.approx(1, abs=1e-5)  # 64 float32 additions
    assert guides.shares.min() >= 0.999 * EVEN / GUIDE_CELLS
    assert (guides.groups >= 0).all()


def test_what_is_too_bright_to_square_is_shared_as_the_brightest():
    moments = np.full((1, GUIDE_CELLS), 1e38, np.float32)
    moments[0, ::2] = np.inf
    with np.errstate(invalid="raise"):
        shares = guide_shares(moments)
    assert shares.sum() == pytest.approx(1, abs=1e-5)  # 64 float32 additions
    assert (shares[0, ::2] > shares[0, 1::2]).all()


def test_groups_grow_with_the_lightmap_between_two_sizes():
    assert [group_size(count) for count in (1, 1 << 18, 1 << 19, 1 << 24)] == [LEAST_GROUP, 256, 512, MOST_GROUP]


def test_groups_are_near():
    receivers = whole_floor()
    guides = learned(box_with_a_hole(GREY), receivers, lambda kernel, solved, guides, rays: guides)
    counts = np.bincount(guides.groups[guides.groups >= 0], minlength=len(guides.shares))
    assert 0 < counts.min() <= counts.max() <= LEAST_GROUP
    for group in range(len(guides.shares)):
        members = receivers.positions[guides.groups == group]
        assert np.ptp(members, axis=0).max() <= WIDEST * np.ptp(receivers.positions, axis=0).max()


def test_scattered_receivers_go_unguided():
    rng = np.random.default_rng(4)
    receivers = floor_points(np.concatenate([rng.random((40, 2)), np.zeros((40, 1))], axis=1))
    guides, rays = learned(box_with_a_hole(GREY), receivers, lambda kernel, solved, guides, rays: (guides, rays))
    assert (guides.groups == -1).all()
    assert rays == 0


def test_no_receivers_no_groups():
    nowhere = floor_points(np.zeros((0, 3)))
    guides, rays = learned(box_with_a_hole(GREY), nowhere, lambda kernel, solved, guides, rays: (guides, rays))
    assert len(guides.groups) == len(guides.shares) == rays == 0
