"""Form factors with others in between: laws, exact values by symmetry, and pairs of random points."""

import numpy as np
import pytest

from addon.core.analytic import exchange_among, surface, surface_exchange
from addon.core.case_scene import box
from addon.core.visibility import blocking_part, blocks_all
from tests.physics.test_analytic import SQUARE, UNIT, down, up
from tests.reference import closed_forms as howell
from tests.reference.exchange import exchange as by_definition

ABOVE = down(UNIT, UNIT, 1)
CLEAR = howell.c11(1, 1, 1)
HIDDEN = 1e-6  # of a pair, to which hidden parts are integrated


def test_a_divider_leaves_each_half_its_own():
    wall = np.array([(0.5, 0, 0), (0.5, 1, 0), (0.5, 1, 1), (0.5, 0, 1)])
    assert exchange_among(SQUARE, ABOVE, [wall]) == pytest.approx(howell.c11(0.5, 1, 1), abs=HIDDEN)


def test_half_a_plane_half_way_hides_half():
    assert exchange_among(SQUARE, ABOVE, [up((-50, 0.5), (-50, 50), 0.5)]) == pytest.approx(CLEAR / 2, abs=HIDDEN)


def test_a_plate_and_its_complement_hide_it_all_together():
    left, right = up((-9, 0.3), (-9, 9), 0.5), up((0.3, 9), (-9, 9), 0.5)
    seen = exchange_among(SQUARE, ABOVE, [left]) + exchange_among(SQUARE, ABOVE, [right])
    assert seen == pytest.approx(CLEAR, abs=2 * HIDDEN)
    assert exchange_among(SQUARE, ABOVE, [left, right]) == 0


def test_a_large_plate_hides_it_all_exactly():
    assert exchange_among(SQUARE, ABOVE, [up((-1, 2), (-1, 2), 0.5)]) == 0


@pytest.mark.parametrize(
    "occluder",
    [up((0, 1), (0, 1), 0), up((0, 1), (0, 1), 1), up((1, 2), UNIT, 0.5), up(UNIT, UNIT, 2), up(UNIT, UNIT, -1)],
    ids=["on one", "on the other", "beside", "above", "below"],
)
def test_what_is_not_between_changes_no_bit(occluder):
    assert exchange_among(SQUARE, ABOVE, [occluder]) == exchange_among(SQUARE, ABOVE, [])


@pytest.mark.parametrize("height", [1e-2, 0.5])
def test_a_window_and_its_shutter_add_up(height):
    """What a plate hides is what a wall with a hole of its shape lets through."""
    a, b = 0.2, 0.7
    plate = up((a, b), (a, b), height)
    wall = [
        up((-9, a), (-9, 9), height),
        up((b, 9), (-9, 9), height),
        up((a, b), (-9, a), height),
        up((a, b), (b, 9), height),
    ]
    both = exchange_among(SQUARE, ABOVE, [plate]) + exchange_among(SQUARE, ABOVE, wall)
    assert both == pytest.approx(CLEAR, abs=5 * HIDDEN)


def test_a_pinhole():
    """Through a hole small against its distance: the point kernel, cos^2 A_1 A_2 averaged over the hole."""
    s, height = 1e-3, 0.5
    low, high = 0.5 - s / 2, 0.5 + s / 2
    wall = [up((-9, low), (-9, 9), height), up((high, 9), (-9, 9), height), up((low, high), (-9, low), height),
            up((low, high), (high, 9), height)]  # fmt: skip
    # all that enters the hole from the square lands on the mirror image above it; the hole's size squared is the rest
    expected = s**2 * 4 * howell.b4(0.5, 0.5, 0.5)
    assert exchange_among(SQUARE, ABOVE, wall) == pytest.approx(expected, rel=1e-3)


def test_nested_cubes():
    outer, inner = box((-1, -1, -1), (1, 1, 1)), box((-0.5,) * 3, (0.5,) * 3, looks_in=False)
    to_inner = sum(surface_exchange(outer[0], face, [f for f in inner if f is not face]) for face in inner)
    # convex body in a closed one: A_inner F = A_inner; a sixth by symmetry
    assert to_inner == pytest.approx(1.0, abs=6 * HIDDEN)


def test_interpenetrating_plates_against_pairs_of_random_points():
    occluder = np.array([(0.2, -0.2, -0.3), (0.9, 0.3, -0.2), (0.7, 0.9, 1.3), (0.1, 0.4, 1.2)])
    occluder = np.array([occluder[0], occluder[1], occluder[2]])
    mean, error = by_definition(SQUARE, ABOVE, [occluder], 100_000, np.random.default_rng(2))
    assert abs(exchange_among(SQUARE, ABOVE, [occluder]) - mean) < 4 * error


def test_random_occluders_against_pairs_of_random_points():
    rng = np.random.default_rng(4)
    for _ in range(2):
        occluders = [np.array([0.5, 0.5, 0.5]) + 0.4 * rng.normal(size=(3, 3)) for _ in range(2)]
        mean, error = by_definition(SQUARE, ABOVE, occluders, 30_000, rng)
        found = exchange_among(SQUARE, ABOVE, occluders)
        assert 0 <= found <= CLEAR * (1 + 1e-12)
        # four standard errors: one false alarm in 16 000
        assert abs(found - mean) < 4 * error + 1e-6


def test_both_directions_agree():
    rng = np.random.default_rng(6)
    occluder = np.array([0.5, 0.5, 0.5]) + 0.4 * rng.normal(size=(3, 3))
    wide = down((-0.5, 2), (-0.5, 2), 1)
    there, back = exchange_among(SQUARE, wide, [occluder]), exchange_among(wide, SQUARE, [occluder])
    assert there == pytest.approx(back, rel=1e-12)


def test_the_walls_of_a_convex_room_block_nothing():
    room = [face.pieces[0] for face in box((0, 0, 0), (1, 2, 3))]
    for i in range(6):
        for j in range(i):
            others = [room[k] for k in range(6) if k not in (i, j)]
            assert all(blocking_part(other, room[i], room[j]) is None for other in others)


def test_a_wall_that_touches_both_blocks_all_across_it():
    wall = np.array([(1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)], float)
    floor, ceiling = up((0, 1), UNIT, 0), down((1, 2), UNIT, 1)
    assert blocks_all(wall, floor, ceiling)
    assert surface_exchange(surface("floor", floor), surface("ceiling", ceiling), [surface("wall", wall)]) == 0
