"""Polygons: normals, cleaning, clipping, convex pieces, holes."""

import numpy as np
import pytest

from addon.core.polygon import (
    bisect,
    clip,
    convex_pieces,
    distance_to,
    fault_of,
    heights_above,
    is_convex,
    polygon_area,
    subtract,
    unit_normal,
)

SQUARE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
SUMS = 1e-14  # a few roundings of numbers of order 1


def test_area_and_normal():
    assert polygon_area(SQUARE) == 1
    assert unit_normal(SQUARE) == pytest.approx([0, 0, 1])
    assert unit_normal(SQUARE[::-1]) == pytest.approx([0, 0, -1])
    # at 1e7 the corners are exact, and so is the area
    assert polygon_area(SQUARE + 1e7) == 1


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e30])
def test_any_size_has_an_area_and_degenerate_ones_do_not(size):
    assert fault_of(size * SQUARE) is None
    assert fault_of(size * SQUARE[[0, 1, 1]]) == "no area"
    assert fault_of(size * np.array([(0, 0, 0), (1, 1, 1), (3, 3, 3.0)])) == "no area"
    assert "finite" in fault_of(size * np.where(SQUARE == 0, np.nan, SQUARE))


def test_a_sliver_is_not_degenerate():
    assert fault_of(np.array([(0, 0, 0), (1, 0, 0), (0.5, 1e-9, 0)])) is None


@pytest.mark.parametrize("height", [0.25, 0.5, 0.999])
def test_clipped_parts_add_up(height):
    heights = heights_above(SQUARE, np.array([0, height, 0]), np.array([0, 1.0, 0]))
    parts = [clip(SQUARE, heights), clip(SQUARE, -heights)]
    assert [polygon_area(part) for part in parts] == pytest.approx([1 - height, height], abs=SUMS)


def test_what_only_touches_is_whole_or_nothing():
    heights = heights_above(SQUARE, np.zeros(3), np.array([0, 1.0, 0]))
    assert clip(SQUARE, heights) is SQUARE
    assert len(clip(SQUARE, -heights)) == 0


def test_concave_polygons_become_few_convex_pieces():
    plan = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
    pieces = convex_pieces(np.array([(x, y, 2.0) for x, y in plan]))
    assert len(pieces) == 2
    assert all(is_convex(piece) for piece in pieces)
    assert sum(polygon_area(piece) for piece in pieces) == pytest.approx(5, abs=SUMS)


def test_a_star_is_not_convex_although_it_always_turns_left():
    angles = 2 * np.pi * 2 * np.arange(5) / 5
    assert not is_convex(np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1))


def test_a_bent_quad_becomes_triangles():
    bent = SQUARE.copy()
    bent[2, 2] = 0.3
    assert [len(piece) for piece in convex_pieces(bent)] == [3, 3]


def test_a_hole_and_what_is_around_it_add_up():
    hole = 0.25 + 0.5 * SQUARE
    hole[:, 2] = 0
    rest = subtract(SQUARE, hole)
    assert sum(polygon_area(piece) for piece in rest) == pytest.approx(0.75, abs=SUMS)
    assert all(unit_normal(piece)[2] == pytest.approx(1) for piece in rest)
    beside = subtract(SQUARE, SQUARE + np.array([2.0, 0, 0]))
    assert len(beside) == 1
    assert beside[0] is SQUARE


def test_halves_are_halves():
    assert [polygon_area(half) for half in bisect(SQUARE * (4, 1, 1))] == pytest.approx([2, 2])


@pytest.mark.parametrize(("point", "distance"), [((0.5, 0.5, -2), 2), ((2, 0.5, 0), 1), ((4, 5, 0), 5), ((1, 1, 0), 0)])
def test_distance(point, distance):
    assert distance_to(np.array(point, float), SQUARE) == pytest.approx(distance, abs=SUMS)
