"""Smoothing: noise goes, what the light does stays."""

import numpy as np
import pytest

from addon.core.gather_sums import GatherSums
from addon.core.kernel import clamp_outliers, smooth
from addon.core.luminance import LUMINANCE
from addon.core.receivers import Receivers
from addon.core.relative import scale_of
from addon.core.smoothing import BAND, KEPT, MOST_KEPT, TexelGrid, restoring, sums_around
from addon.core.workers import Workers
from tests.reference import smoothing as reference

SIDE = 40
SPACING = 0.01


def wall(side=SIDE, heights=None, normals=None, rows=None):
    """A square of texels on z = 0, or so many rows of them, with where they are."""
    count = side * (rows or side)
    grid = np.arange(count, dtype=np.int32).reshape(-1, side)
    y, x = np.divmod(np.arange(count), side)
    z = np.zeros(count) if heights is None else heights
    facing = np.tile(np.float32([0, 0, 1]), (count, 1)) if normals is None else normals
    receivers = Receivers(SPACING * np.stack([x, y, z / SPACING], 1), facing, np.zeros(count, np.int32))
    nowhere = np.full((1, 3, 2), np.nan, np.float32)
    ones = np.ones((count, 3), np.float32)
    return TexelGrid(grid, SPACING, nowhere, ones, None, ones[:, 0]), receivers


def rough_wall(seed, most_variance, holes, side=12, rows=12):
    """A wall that is not even, with a share of holes; values (N, 3) and variances (N,) of its texels."""
    rng, count = np.random.default_rng(seed), side * rows
    normals = np.float32([0, 0, 1]) + 0.3 * rng.standard_normal((count, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    grid, receivers = wall(side, 0.003 * rng.standard_normal(count), normals, rows)
    grid.receivers[rng.random((rows, side)) < holes] = -1
    values = rng.random((count, 3)).astype(np.float32)
    return grid, receivers, values, (most_variance * rng.random(count)).astype(np.float32)


def noisy(light, deviation, seed=1):
    """Four replicates (N, 4, 3) about the light (N,), grey."""
    rng = np.random.default_rng(seed)
    values = light[:, None] + deviation * rng.standard_normal((len(light), 4))
    return np.repeat(values[..., None], 3, axis=2).astype(np.float32)


def run(grid, receivers, means, taken=1):
    with Workers(2) as workers:
        sums = GatherSums(means.sum(axis=1), means @ LUMINANCE)
        values, variances = sums.means(1), sums.variances(1)
        near = scale_of(grid.blurred(workers, receivers, values))
        taken = np.broadcast_to(taken, len(means))
        return grid.smoothed(workers, receivers, values, variances, near, taken)


# the kernel takes 64 texels of a row at once, and ranges of 16 rows or more: one less, one more, several of each, and a
# last range that is no whole number of steps
@pytest.mark.parametrize(
    ("step", "side", "rows"), [(1, 12, 12), (4, 12, 12), (1, 130, 21), (2, 63, 21), (4, 65, 45), (8, 1, 5), (3, 64, 29)]
)
@pytest.mark.parametrize("stops_on_value", [False, True], ids=["geometry", "value"])
def test_a_level_is_what_its_definition_says(step, side, rows, stops_on_value):
    grid, receivers, values, variances = rough_wall(3, 0.05, 0.2, side, rows)
    with Workers(2) as workers:
        found = smooth(workers, grid, receivers, values, variances, step, stops_on_value)
    where = grid.receivers, SPACING, receivers.positions, receivers.normals.astype(float)
    exact = reference.smooth(*where, values, variances, step, stops_on_value)
    # 25 weights of float32, the exponents known to 1e-6 of at most some tens
    assert found[0] == pytest.approx(exact[0], abs=3e-5)
    assert found[1] == pytest.approx(exact[1], abs=3e-6)


@pytest.mark.parametrize(("side", "rows"), [(12, 12), (66, 18)])
def test_outliers_are_clamped_as_the_definition_says(side, rows):
    grid, receivers, values, variances = rough_wall(6, 0.02, 0.4, side, rows)
    with Workers(2) as workers:
        found = clamp_outliers(workers, grid, receivers, values, variances)
    where = grid.receivers, SPACING, receivers.positions, receivers.normals.astype(float)
    exact = reference.clamp_outliers(*where, values, variances)
    is_set = grid.receivers[grid.receivers >= 0]
    # one factor, a ratio of luminances of float32
    assert found[is_set] == pytest.approx(exact[is_set], rel=1e-5)
    is_changed = (exact[is_set] != values[is_set]).any(axis=1)
    assert 0.1 < is_changed.mean() < 0.9


def test_a_texel_that_stands_alone_goes_and_a_line_and_an_edge_stay():
    grid, receivers = wall()
    light = np.ones((SIDE, SIDE))
    light[20, :] = 3.0  # a line of single texels
    light[:, 30:] += 1.0
    light[0, 0] = 5.0  # three neighbours tell as well as eight
    with_one = light.copy()
    with_one[10, 10] = 50.0
    with_one[12, 35] = 0.1
    values = np.float32(with_one.reshape(-1, 1)) * np.ones(3, np.float32)
    with Workers(2) as workers:
        found = clamp_outliers(workers, grid, receivers, values, np.full(SIDE * SIDE, 1e4, np.float32))
        certain = clamp_outliers(workers, grid, receivers, values, np.zeros(SIDE * SIDE, np.float32))
    light[0, 0] = 1.0
    assert found[:, 0] == pytest.approx(light.ravel(), rel=1e-6)  # float32
    assert (certain == values).all()


def test_smoothing_leaves_no_texel_alone_that_found_a_lamp_by_chance():
    side = 96
    grid, receivers = wall(side)
    replicates = noisy(np.ones(side * side), 0.02)
    alone = grid.receivers[48, 48]
    replicates[alone, 0] = 9.0
    values, _ = run(grid, receivers, replicates)
    # 3 as it was found, 1.4 if it were not clamped; its neighbours have some of it, and a little is restored
    around = grid.receivers[47:50, 47:50].ravel()
    assert values[alone, 0] < 1.05 * values[around[around != alone], 0].max() < 1.2
    near = grid.receivers[32:65, 32:65].ravel()
    assert values[near].mean() == pytest.approx(replicates[near].mean(), rel=1e-3)


def test_a_blur_keeps_the_light_that_few_rays_found():
    grid, receivers = wall()
    # one ray in ten finds a lamp: what smoothing takes for noise is all the light there is
    found = 10.0 * (np.random.default_rng(4).random((SIDE * SIDE, 4, 1)) < 0.1) * np.ones(3)
    with Workers(2) as workers:
        light = grid.blurred(workers, receivers, found.mean(axis=1).astype(np.float32))
    # the means of neighbours have the mean of all; only at borders do some count for more
    assert light.mean() == pytest.approx(found.mean(), rel=0.01)
    assert light.std() < 0.5 * found.mean(axis=1).std()


def test_smoothing_keeps_the_light_that_few_rays_found():
    side = 96
    grid, receivers = wall(side)
    # eight rays of a replicate, of which one in fifty finds a lamp: half of all texels see nothing of it
    found = np.random.default_rng(5).binomial(8, 0.02, (side * side, 4, 1)) / 0.16 * np.ones(3)
    values, _ = run(grid, receivers, found.astype(np.float32), 8)
    # every square of 1089 texels is kept but for what is clipped; without that 5 % is lost
    assert values.mean() == pytest.approx(found.mean(), rel=0.01)
    assert values.std() < 0.3 * found.mean(axis=1).std()


@pytest.mark.parametrize(("bright", "dim"), [(1e6, 1e-12), (1e17, 1e-32)])
def test_what_is_restored_leaves_the_dark_dark(bright, dim):
    """Sums beside what is bright are rounded by more than the dim there is: that is changed by half at the most."""
    side = 64
    grid, _ = wall(side)
    rng = np.random.default_rng(6)
    columns = np.arange(side * side) % side
    light = np.where(columns < side // 2, bright * rng.random(side * side), np.where(columns % 2, dim, 0.0))
    before = light.astype(np.float32)
    luminance = (before * rng.uniform(0.8, 1, side * side)).astype(np.float32)
    with np.errstate(over="raise", divide="raise", invalid="raise"):
        # pooled, so that the dark has the noise of what is bright
        ratios = restoring(grid, before, luminance, np.full(side * side, np.sqrt(bright), np.float32))
    assert (abs(ratios - 1) <= MOST_KEPT + 1e-6).all()


def test_what_is_around_a_texel_is_the_square_it_stands_in():
    """Over more rows than are summed at once."""
    grid, _ = wall(50, rows=2 * BAND + 9)
    rng = np.random.default_rng(8)
    grid.receivers[rng.random(grid.receivers.shape) < 0.3] = -1
    light = rng.random(grid.receivers.size).astype(np.float32)
    image = np.where(grid.receivers >= 0, light.reshape(grid.receivers.shape), 0.0)
    found = sums_around(grid, light)
    for row, column in zip(*np.nonzero(grid.receivers >= 0)):
        square = image[max(row - KEPT, 0) : row + KEPT + 1, max(column - KEPT, 0) : column + KEPT + 1]
        # differences of float64 sums over all rows, rounded once
        assert found[grid.receivers[row, column]] == pytest.approx(square.sum(), rel=1e-6)


def test_noise_falls_by_what_so_many_texels_are_worth():
    deviation = 0.05
    grid, receivers = wall()
    values, variances = run(grid, receivers, noisy(np.ones(SIDE * SIDE), 2 * deviation))
    inner = grid.receivers[10:-10, 10:-10].ravel()
    found = np.sqrt(np.mean((values[inner, 0] - 1) ** 2))
    # the splines come to some 15 x 15 even texels; stops on value, which cannot tell all noise from light, leave half
    assert found < deviation / 7.5
    # what is stated takes neighbours for independent after every level, which they are not: probes tell how much more
    assert 0 < np.sqrt(variances[inner].mean()) < found


def test_a_texel_of_many_rays_is_not_taken_for_as_noisy_as_its_neighbours():
    """Else texels in a corner, whose neighbours few rays reach, get ever more rays, whatever they found."""
    grid, receivers = wall(3)
    means, taken = noisy(np.ones(9), 3.0), np.ones(9)
    means[4], taken[4] = noisy(np.ones(1), 0.03, 2), 10**4
    _, alike = run(grid, receivers, means)
    _, variances = run(grid, receivers, means, taken)
    # its variance is 2e-4, a neighbour's 2: one that has its value by chance may still add some
    assert variances[4] < 0.05 * alike[4]


def test_a_step_above_the_noise_stays_and_one_below_may_go():
    grid, receivers = wall()
    edge = (np.arange(SIDE * SIDE) % SIDE >= SIDE // 2).astype(float)
    values, _ = run(grid, receivers, noisy(1 + edge, 0.02))
    beside = values.reshape(SIDE, SIDE, 3)[10:-10, SIDE // 2 - 1 : SIDE // 2 + 1, 0].mean(axis=0)
    assert beside == pytest.approx([1, 2], abs=0.02)


def test_bright_and_noisy_does_not_spread_over_calm():
    """Texels under a lamp that hangs just off the ceiling: their light must not run out beside the lamp."""
    grid, receivers = wall()
    rows, columns = np.divmod(np.arange(SIDE * SIDE), SIDE)
    is_hot = (abs(rows - SIDE / 2) < 5) & (abs(columns - SIDE / 2) < 5)
    means = noisy(np.ones(SIDE * SIDE), 0.01)
    means[is_hot] = noisy(np.full(is_hot.sum(), 30.0), 20.0, 2)
    values, _ = run(grid, receivers, means)
    # beside the hot ones, whose noise is pooled with theirs, some may come over
    is_far = (abs(rows - SIDE / 2) > 8) | (abs(columns - SIDE / 2) > 8)
    assert values[is_far, 0] == pytest.approx(1, abs=0.02)


def test_creases_and_steps_stop_it():
    """A floor that is folded up into a wall, and a shelf that hangs above it, all beside each other in the atlas."""
    rows, columns = np.divmod(np.arange(SIDE * SIDE), SIDE)
    is_wall, is_shelf = rows >= SIDE // 2, (rows < SIDE // 2) & (columns >= SIDE // 2)
    normals = np.where(is_wall[:, None], np.float32([0, -1, 0]), np.float32([0, 0, 1]))
    grid, receivers = wall(SIDE, np.where(is_wall, SPACING * (rows - SIDE // 2), 1.0 * is_shelf), normals)
    receivers.positions[is_wall, 1] = SPACING * SIDE // 2
    light = 1.0 + is_shelf + 2.0 * is_wall
    means = np.repeat(np.repeat(light[:, None, None], 4, axis=1), 3, axis=2).astype(np.float32)
    means[:, :2] += 10
    means[:, 2:] -= 10  # so noisy that value stops nothing
    values, _ = run(grid, receivers, means)
    assert values[:, 0] == pytest.approx(light, abs=1e-4)
