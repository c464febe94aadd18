"""Analytic form factors: Howell's forms, laws, and geometry that makes others fail."""

import numpy as np
import pytest

from addon.core.analytic import (
    cut_overlaps,
    element_form_factor,
    exchange,
    exchange_matrix,
    surface,
    surface_exchange,
)
from addon.core.bodies import body_exchanges, cylinder, disk, equal_area_radius, ring_exchanges, sphere
from addon.core.case_scene import box, l_room, tetrahedron
from addon.core.estimators import AnalyticEstimator
from addon.core.polygon import polygon_area
from tests.reference import closed_forms as howell
from tests.reference.exchange import exchange as by_definition
from tests.reference.polygon import point_to_polygon


def up(x, y, z):
    return np.array([(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)], float)


def down(x, y, z):
    return up(x, y, z)[::-1]


def hinged(angle, width=1.0, length=1.0):
    """A rectangle in z = 0, and one that shares its edge on the y axis, ``angle`` from it [rad]."""
    c, s = width * np.cos(angle), width * np.sin(angle)
    return up((0, width), (0, length), 0), np.array([(0, 0, 0), (0, length, 0), (c, length, s), (c, 0, s)])


UNIT = (0, 1)
SQUARE = up(UNIT, UNIT, 0)
# float64 with sums of about a hundred terms of order 1
SUMS = 1e-13


def factor(first, second):
    return exchange(first, second) / polygon_area(first)


# ---- closed forms ----


@pytest.mark.parametrize(("a", "b", "c"), [(1, 1, 1), (4, 1, 1), (10, 10, 1), (1, 1, 0.1), (2, 3, 5)])
def test_opposed_rectangles_are_howells_c11(a, b, c):
    # both are sums of terms some hundred times their result, in float64
    assert factor(up((0, a), (0, b), 0), down((0, a), (0, b), c)) == pytest.approx(howell.c11(a, b, c), rel=1e-11)


@pytest.mark.parametrize(("w", "h", "length"), [(1, 1, 1), (10, 1, 1), (1, 1, 10), (0.3, 2, 1)])
def test_rectangles_with_a_common_edge_are_howells_c14(w, h, length):
    upright = np.array([(0, 0, 0), (0, length, 0), (0, length, h), (0, 0, h)], float)
    assert factor(up((0, w), (0, length), 0), upright) == pytest.approx(howell.c14(w, h, length), rel=1e-12)


@pytest.mark.parametrize("distance", [100, 1e3, 1e4, 1e6])
def test_nothing_cancels_far_away(distance):
    # cos cos' / (pi r^2) = d^2 / (pi (d^2 + s^2)^2), s the distance across: mean s^2 = 1/3, mean s^4 = 17/90
    expected = (1 - 2 / 3 / distance**2 + 17 / 30 / distance**4) / (np.pi * distance**2)
    assert factor(SQUARE, down(UNIT, UNIT, distance)) == pytest.approx(expected, rel=1 / distance**6 + 1e-13)


@pytest.mark.parametrize("gap", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_plates_close_together(gap):
    # the closed form is a sum of terms of order 1: 1e-15 is left of them
    assert factor(SQUARE, down(UNIT, UNIT, gap)) == pytest.approx(howell.c11(1, 1, gap), abs=1e-14)


@pytest.mark.parametrize("degrees", [0.01, 1, 30, 90, 150])
def test_long_hinged_strips_are_hottels_crossed_strings(degrees):
    # of length 300: the ends' share is about 1 / length
    angle = np.radians(degrees)
    found = factor(*hinged(angle, 1.0, 300.0))
    assert found == pytest.approx(howell.crossed_strings(angle), rel=1e-2)


def test_nearly_flat_hinges_go_with_the_square_of_what_is_missing():
    # F(pi - e) = c e^2 (1 + O(e^2)): e = 0.1 and 1 degrees, (1 degree)^2 = 3e-4
    assert factor(*hinged(np.radians(179.9))) == pytest.approx(0.01 * factor(*hinged(np.radians(179))), rel=3e-4)


@pytest.mark.parametrize("degrees", [0.01, 1, 45, 135, 179])
def test_hinged_squares_are_additive_in_both(degrees):
    """No closed form here: the whole is the sum over halves, each pair another mix of touching and not."""
    first, second = hinged(np.radians(degrees))
    middle = 0.5 * (second[0] + second[3]), 0.5 * (second[1] + second[2])
    near, far = np.array([second[0], second[1], middle[1], middle[0]]), np.array([middle[0], middle[1], *second[2:]])
    whole = exchange(first, second)
    # the contour integral is to 1e-9 of each pair, and three are compared
    assert exchange(first, near) + exchange(first, far) == pytest.approx(whole, rel=1e-8)


@pytest.mark.parametrize("width", [1e-4, 1e-6])
def test_slivers(width):
    upright = np.array([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)], float)
    # an infinitely thin strip at the edge sees half of what it would see of a half plane, less the ends: Howell B-5
    thin = factor(up((0, width), UNIT, 0), upright)
    assert thin == pytest.approx(howell.c14(width, 1, 1), rel=1e-16 / width**2 + 1e-9)
    # two of them a width apart: the crossed strings of opposed strips, sqrt 2 - 1, up to their ends
    pair = factor(up(UNIT, (0, width), 0), down(UNIT, (0, width), width))
    assert pair == pytest.approx(np.sqrt(2) - 1, rel=2 * width)


def test_a_small_lamp_in_a_large_hall_is_a_point():
    lamp = down((-5e-4, 5e-4), (-5e-4, 5e-4), 20.0)
    # the lamp's size over the distance, squared
    assert factor(lamp, up((-50, 50), (-50, 50), 0)) == pytest.approx(4 * howell.b4(50, 50, 20), rel=1e-8)


@pytest.mark.parametrize("r", [0.1, 1, 2])
def test_disks_are_howells_c41(r):
    sides = 96
    bodies = [
        disk("1", equal_area_radius(1, sides), 0, sides, True),
        disk("2", equal_area_radius(r, sides), 1, sides, False),
    ]
    # polygons of the disks' area: what is left is far below the square of the sides' size, 4e-3
    assert body_exchanges(bodies)[0, 1] / bodies[0].area == pytest.approx(howell.c41(1, r, 1), rel=1e-6)


def test_points_against_the_slow_formula():
    rng = np.random.default_rng(3)
    for _ in range(20):
        target = rng.normal(size=(3, 3)) + np.array([0, 0, 0.5])
        facing = target if np.cross(target[1] - target[0], target[2] - target[0]) @ target[0] < 0 else target[::-1]
        expected = point_to_polygon(np.zeros(3), np.array([0, 0, 1.0]), facing)
        found = element_form_factor(np.zeros(3), np.array([0, 0, 1.0]), surface("B", facing))
        assert found == pytest.approx(expected, abs=SUMS)


# ---- laws ----


@pytest.mark.parametrize("room", [box((0, 0, 0), (1, 1, 1)), box((0, 0, 0), (4, 3, 2.5)), tetrahedron()])
def test_a_convex_room_takes_all_light(room):
    factors = AnalyticEstimator().matrix(room).value
    assert factors.sum(axis=1) == pytest.approx(np.ones(len(room)), abs=1e-12)


def test_a_room_with_a_corner_in_the_way_takes_all_light():
    factors = AnalyticEstimator().matrix(l_room()).value
    # hidden parts are integrated to 1e-6 of each pair
    assert factors.sum(axis=1) == pytest.approx(np.ones(8), abs=3e-6)


def test_reciprocity_is_exact():
    room = l_room()[:4]
    exchanges = exchange_matrix(room)
    assert (exchanges == exchanges.T).all()


def test_bounds():
    rng = np.random.default_rng(0)
    for _ in range(60):
        first, second = rng.normal(size=(2, 3, 3))
        value = exchange(first, second)
        assert 0 <= value <= min(polygon_area(first), polygon_area(second))


def test_random_triangles_do_not_care_how_they_are_described():
    rng = np.random.default_rng(1)
    for _ in range(20):
        first, second = rng.normal(size=(2, 3, 3))
        value = exchange(first, second)
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turn *= np.sign(np.linalg.det(turn))
        tolerance = 1e-9 * max(value, 1e-3)
        assert exchange(second, first) == pytest.approx(value, abs=tolerance)
        assert exchange(np.roll(first, 1, axis=0), np.roll(second, 2, axis=0)) == pytest.approx(value, abs=tolerance)
        assert exchange(first @ turn.T + 5, second @ turn.T + 5) == pytest.approx(value, abs=tolerance)
        assert exchange(1e-3 * first, 1e-3 * second) == pytest.approx(1e-6 * value, abs=1e-6 * tolerance)


def test_parts_add_up_to_a_concave_whole():
    whole = [(0, 0, 0), (3, 0, 0), (3, 1, 0), (1, 1, 0), (1, 3, 0), (0, 3, 0)]
    parts = [up((0, 3), (0, 1), 0), up((0, 1), (1, 3), 0)]
    above = surface("above", down((0, 3), (0, 3), 3))
    found = surface_exchange(surface("L", whole), above)
    assert found == pytest.approx(sum(exchange(part, above.pieces[0]) for part in parts), rel=1e-12)


@pytest.mark.parametrize("offset", [1e3, 1e5, 1e7])
def test_far_from_the_origin(offset):
    # multiples of 2^-3 are exact at 1e7: the shape is the same, so is the factor
    first, second = up((0, 0.25), (0, 0.5), 0), down((0, 0.25), (0, 0.5), 0.125)
    assert factor(first + offset, second + offset) == pytest.approx(factor(first, second), rel=1e-12)


def test_a_plate_through_the_others_plane_counts_only_in_front():
    through = np.array([(0, 0, -1), (0, 1, -1), (0, 1, 1), (0, 0, 1)], float)
    assert factor(SQUARE, through) == pytest.approx(howell.c14(1, 1, 1), rel=1e-12)


def test_coplanar_and_turned_away_see_nothing():
    assert exchange(SQUARE, up((2, 3), UNIT, 0)) == 0
    assert exchange(SQUARE, up(UNIT, UNIT, 1)) == 0
    assert exchange(SQUARE, SQUARE) == 0


def test_duplicates_share_one_factor():
    copies = cut_overlaps([surface("B1", down(UNIT, UNIT, 1)), surface("B2", down(UNIT, UNIT, 1))])
    total = sum(surface_exchange(surface("A", SQUARE), copy) for copy in copies)
    assert total == pytest.approx(howell.c11(1, 1, 1), rel=1e-12)


def test_t_junctions_leave_no_gap():
    parts = [down((0, 0.5), UNIT, 1), down((0.5, 1), (0, 0.5), 1), down((0.5, 1), (0.5, 1), 1)]
    assert sum(exchange(SQUARE, part) for part in parts) == pytest.approx(howell.c11(1, 1, 1), rel=1e-12)


@pytest.mark.parametrize(
    "bad", [[(0, 0, 0)] * 3, [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 0, 0), (np.nan, 0, 0), (0, 1, 0)]]
)
def test_what_has_no_area_is_refused_by_name(bad):
    with pytest.raises(ValueError, match="plate: "):
        surface("plate", bad)


# ---- bodies ----


def test_a_closed_cylinder_takes_all_light():
    sides = 24
    bodies = [disk("b", 1, 0, sides, True), cylinder("s", 1, 0, 2, sides, 2), disk("t", 1, 2, sides, False)]
    areas = np.array([body.area for body in bodies])
    # far panels by four Gauss points a side: 1e-6
    assert body_exchanges(bodies).sum(axis=1) / areas == pytest.approx(np.ones(3), abs=1e-5)


def test_rings_of_a_sphere_take_all_light():
    rings = sphere("s", 1, np.linspace(0, np.pi, 9), 16, looks_in=True).rings
    # far panels by four Gauss points a side, as above
    assert ring_exchanges(rings).sum(axis=1) == pytest.approx([ring.area for ring in rings], rel=1e-5)


# ---- the definition ----


def test_skew_triangles_against_pairs_of_random_points():
    first = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
    second = np.array([(0.2, 0.1, 0.5), (-0.3, 0.9, 0.8), (1.1, 0.7, 1.4)])
    mean, error = by_definition(first, second, [], 200_000, np.random.default_rng(5))
    # four standard errors: one false alarm in 16 000
    assert abs(exchange(first, second) - mean) < 4 * error
    assert error < 0.01 * mean
