"""Geometry that breaks ray tracers: hairs, copies, seams, kilometres from the origin. Each case with its law."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.bake import bake
from addon.core.emitters import emitters_of
from addon.core.patches import subdivide
from addon.core.receivers import Receivers, surface_receivers
from addon.core.scene import AreaLight, Material
from addon.core.settings import BakeSettings
from addon.core.transport import HemicubeFormFactors, MonteCarloFormFactors
from tests.physics.lighting import SINGLE, direct_light, floor, floor_receivers, full_light
from tests.physics.test_form_factors import C_11, fronts
from tests.scenes import BLACK, box, kernel_of, moved, rectangle, scene_of, two_plates

PUSH = 8 * 2.0**-23  # of the largest coordinate: how far off their face rays start


def factors(scene, rays=1 << 16, seed=0, size=10.0, to=(1,)):
    """Share of the power from the front of object 0 that lands on either side of the objects ``to``."""
    with kernel_of(scene, 2) as kernel:
        patches = subdivide(scene, kernel, size, 1000, seed)
        sources = fronts(patches, scene, 0)
        rows = MonteCarloFormFactors(kernel, rays, seed).rows(sources)
    targets = np.concatenate([fronts(patches, scene, obj) for obj in to])
    landed = rows[:, targets].sum(axis=1) + rows[:, targets + 1].sum(axis=1)
    return np.average(landed, weights=patches.side_areas[sources])


def noise(exact, rays):
    """Five standard errors of random rays, which quasi-random ones stay below, and two rays where there are few."""
    return 5 * np.sqrt(exact * (1 - exact) / rays) + 2 / rays


# ---- far from the origin ----


@pytest.mark.parametrize("offset", [1e3, 1e5, 1e7])
def test_far_from_the_origin_form_factors_are_the_same_to_the_bit(offset):
    """Coordinates in eighths of a metre are exact in doubles out to 1e7 m, and so is what is left when re-centred."""
    scene = two_plates(0.125)
    there = moved(scene, offset=(offset, -offset, offset))
    for estimator in (lambda k: MonteCarloFormFactors(k, 1024, 0), lambda k: HemicubeFormFactors(k, 16, 4, 0)):
        rows = []
        for each in (scene, there):
            with kernel_of(each) as kernel:
                patches = subdivide(each, kernel, 0.5, 1000, 0)
                rows.append(estimator(kernel).rows(np.arange(2 * len(patches))))
        assert rows[0].tobytes() == rows[1].tobytes()


@pytest.mark.parametrize("offset", [1e4, 1e7])
def test_far_from_the_origin_plates_of_odd_sizes_are_still_seen(offset):
    """0.3 x 0.2 m, 0.1 m apart: 0.4755764365, where float32 vertices give 0.477 at 1e4 m and nothing at 1e7 m."""
    lower = rectangle((0, 0, 0), (0.3, 0, 0), (0, 0.2, 0), name="lower")
    upper = rectangle((0, 0, 0.1), (0, 0.2, 0), (0.3, 0, 0), name="upper")
    found = factors(moved(scene_of([lower, upper]), offset=(offset, offset, offset)))
    # doubles are 2e-9 m apart at 1e7 m: nothing of 0.1 m
    assert found == pytest.approx(0.475576436533, abs=noise(0.4756, 2 << 16))


@pytest.mark.parametrize("offset", [1e5, 1e7])
def test_far_from_the_origin_a_lamp_gives_the_same_light(offset):
    scene = box_with_panel()
    lights = []
    for each in (scene, moved(scene, offset=(offset, offset, -offset))):
        receivers = well_inside(each)
        lights.append(full_light(each, receivers, error=0.1, patch_size=0.25)[0])
    near, far = (light.values.astype(float) for light in lights)
    # the same patches and the same sequences: only rays on the very edge of something may go elsewhere
    assert np.sqrt(np.mean((far / near - 1) ** 2)) < 0.3 * max(lights[0].relative_error, 0.01)
    assert far.mean() == pytest.approx(near.mean(), rel=2e-3)


def box_with_panel():
    panel = AreaLight("panel", (0.5, 0.5, 0.875), (0, 0.25, 0), (0.25, 0, 0), (3.0, 3.0, 4.0))
    return scene_of([box((0, 0, 0), (1, 1, 1), inwards=True)], (panel,))


def well_inside(scene, count=200):
    rng = np.random.default_rng(0)
    triangles = rng.integers(0, len(scene.triangles), count).astype(np.int32)
    return surface_receivers(scene, triangles, 0.9 * rng.dirichlet((1, 1, 1), count) + 0.1 / 3)


# ---- a hair away ----

GAPS = {1e-1: 0.826994522397, 1e-2: 0.980416602926, 1e-3: 0.998005631908, 1e-4: 0.999800070978, 1e-5: 0.999980000856}
GAPS[1e-6] = 0.999998000010


@pytest.mark.parametrize("gap", GAPS)
def test_plates_a_hair_apart_see_nothing_but_each_other(gap):
    found = factors(two_plates(gap))
    # Howell C-11; rays start a push nearer to the other plate, which loses no more than a smaller gap does
    assert found == pytest.approx(GAPS[gap], abs=noise(GAPS[gap], 2 << 16))


@pytest.mark.parametrize("gap", [1e-5, 1e-6])
def test_a_lamp_a_hair_off_a_wall_does_not_shine_through_it(gap):
    """Floor, a hair above it a board, a lamp above: under the board it is dark, to the last bit."""
    points = np.column_stack([np.random.default_rng(0).uniform(-0.9, 0.9, (500, 2)), np.zeros(500)])
    board = rectangle((-1, -1, gap), (2, 0, 0), (0, 2, 0), material=BLACK)
    panel = AreaLight("panel", (0, 0, 1.0), (0, 0.3, 0), (0.3, 0, 0), (1.0, 1.0, 1.0))
    # 1 m from the middle a push is 9.5e-7 m: what lies nearer than that is beyond what rays can tell
    scene = scene_of([floor(1.9), board], (panel,))
    where = floor_receivers(points)
    with kernel_of(scene) as kernel:
        light, _, _ = kernel.direct(emitters_of(scene, kernel.centre), where, 64, 0)
        above = Receivers(points + np.array([0, 0, gap]), where.normals, np.full(500, 4, np.int32))
        lit, _, _ = kernel.direct(emitters_of(scene, kernel.centre), above, 64, 0)
    assert (light == 0).all()
    assert (lit > 0).all()


# ---- very small in very large ----


def hall():
    """100 x 100 x 20 m, black, centred on the origin of floor_receivers."""
    return box((-50, -50, 0), (50, 50, 20), inwards=True, material=BLACK, name="hall")


def millimetre_lamps():
    """1 W from a square of 1 mm in the ceiling's plane: as an area lamp, and as a glowing face."""
    radiance = (1 / (np.pi * 1e-6),) * 3
    half = 0.0005
    lamp = AreaLight("lamp", (0, 0, 20), (0, half, 0), (half, 0, 0), radiance)
    glow = Material("glow", (0.0,) * 3, radiance=radiance)
    mesh = rectangle((-half, -half, 20), (0, 2 * half, 0), (2 * half, 0, 0), material=glow, name="lamp")
    return {"lamp": ((), (lamp,)), "mesh": ((mesh,), ())}


@pytest.mark.parametrize("kind", ["lamp", "mesh"])
def test_a_millimetre_lamp_lights_a_hall_of_a_hundred_metres(kind):
    """E = cos^4 / (pi h^2) of 1 W: below the lamp 1 / (400 pi), in the corner 4.36639e-6."""
    parts, lights = millimetre_lamps()[kind]
    below, corner = 7.95774714796e-4, 4.3663907574584609e-6
    scene = scene_of([hall(), *parts], lights)
    below_all = np.flatnonzero((scene.corners[:12, :, 2] == 0).all(axis=1))
    points = np.array([(0.0, 0.0, 0.0), (49.999, 49.999, 0.0)])
    with kernel_of(scene) as kernel:
        light, _, _ = kernel.direct(emitters_of(scene, kernel.centre), on_floor(scene, below_all, points), 64, 0)
    # the corner is a millimetre outside the receiver: 2e-5 / m x 1.4 mm at the sixth power of the distance
    assert light[0] == pytest.approx([below] * 3, rel=SINGLE)
    assert light[1] == pytest.approx([corner] * 3, rel=2e-4)


def on_floor(scene, triangles, points):
    """Receivers at points of the floor, on whichever of its two triangles holds them."""
    sides = []
    for point in points:
        for triangle in triangles:
            a, b, c = scene.corners[triangle][:, :2]
            weights = np.linalg.solve(np.array([b - a, c - a]).T, point[:2] - a)
            if weights.min() >= -1e-9 and weights.sum() <= 1 + 1e-9:
                sides.append(2 * triangle)
                break
    return Receivers(points, np.tile(np.float32([0, 0, 1]), (len(points), 1)), np.array(sides, np.int32))


# ---- copies ----


def test_two_copies_of_a_plate_take_what_one_takes_whichever_is_hit():
    upper = rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0), name="upper")
    plates = [rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), name="lower"), upper, upper]
    assert factors(scene_of(plates), to=(1, 2)) == pytest.approx(C_11, abs=noise(C_11, 2 << 16))
    # and a copy of the plate that shoots hides nothing
    assert factors(scene_of([plates[0], upper, plates[0]])) == pytest.approx(C_11, abs=noise(C_11, 2 << 16))


def test_plates_that_overlap_in_a_plane_take_what_their_union_takes():
    first = rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0), name="first")
    second = rectangle((0.5, 0, 1), (0, 1, 0), (1, 0, 0), name="second")
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), name="lower"), first, second])
    exact = 0.25994218054770134  # of the union, [0, 1.5] x [0, 1]
    assert factors(scene, to=(1, 2)) == pytest.approx(exact, abs=noise(exact, 2 << 16))


@pytest.mark.parametrize("turned", [False, True], ids=["same side", "back to back"])
def test_two_copies_of_a_glowing_face_shine_as_one(turned):
    glow = Material("glow", (0.0,) * 3, radiance=(2.0, 1.0, 0.5))
    one = rectangle((-0.5, -0.5, 1), (0, 1, 0), (1, 0, 0), material=glow)
    other = rectangle((-0.5, -0.5, 1), (1, 0, 0), (0, 1, 0), material=glow) if turned else one
    points = [(0.0, 0.0, 0.0), (0.7, -0.4, 0.0)]
    single, _ = direct_light((), points, (one,))
    double, _ = direct_light((), points, (one, other))
    # the copies' triangles have another diagonal, so other samples of what is not hidden anywhere: closed form
    assert double == pytest.approx(single, rel=1e-5)


# ---- seams ----


def test_no_ray_escapes_through_a_t_junction():
    """A wall of three rectangles with a vertex of two in the middle of the third's edge; 600k rays at the seams."""
    walls = box((0, 0, 0), (1, 1, 1), inwards=True, without=("+x",))
    pieces = [
        rectangle((1, 0, 0), (0, 0, 1), (0, 1 / 3, 0)),
        rectangle((1, 1 / 3, 0), (0, 0, 0.3), (0, 2 / 3, 0)),
        rectangle((1, 1 / 3, 0.3), (0, 0, 0.7), (0, 2 / 3, 0)),
    ]
    scene = scene_of([walls, *pieces])
    rng = np.random.default_rng(0)
    count = 200_000
    seams = [
        np.column_stack([np.ones(count), np.full(count, 1 / 3), rng.random(count)]),
        np.column_stack([np.ones(count), rng.uniform(1 / 3, 1, count), np.full(count, 0.3)]),
        np.column_stack([np.ones(count), rng.random(count), np.zeros(count)]),
    ]
    origins = rng.uniform(0.05, 0.95, (count, 3))
    with kernel_of(scene) as kernel:
        for points in seams:
            triangles, hits = kernel.closest_hits(origins, points - origins)
            assert (triangles >= 0).all()
            # at the seam, not at something behind it: float32 of a metre, and edges hit under small angles
            assert np.abs(hits[:, 2] - 1).max() < 1e-4


def test_a_plate_split_at_a_t_junction_takes_what_it_takes_whole():
    pieces = [
        rectangle((0, 0, 1), (0, 1, 0), (0.5, 0, 0)),
        rectangle((0.5, 0, 1), (0, 0.5, 0), (0.5, 0, 0)),
        rectangle((0.5, 0.5, 1), (0, 0.5, 0), (0.5, 0, 0)),
    ]
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), *pieces])
    assert factors(scene, to=(1, 2, 3)) == pytest.approx(C_11, abs=noise(C_11, 2 << 16))


# ---- holes ----


def box_with_hole(side):
    """A unit cube with a square hole in the middle of its ceiling."""
    low, high = 0.5 - side / 2, 0.5 + side / 2
    ring = [((0, 0), (1, low)), ((0, high), (1, 1)), ((0, low), (low, high)), ((high, low), (1, high))]
    frames = [rectangle((*a, 1), (0, b[1] - a[1], 0), (b[0] - a[0], 0, 0)) for a, b in ring]
    return scene_of([box((0, 0, 0), (1, 1, 1), inwards=True, without=("+z",)), *frames])


@pytest.mark.parametrize(("side", "rays"), [(0.3, 1 << 16), (0.1, 1 << 18), (0.03, 1 << 18)])
def test_a_hole_lets_out_what_it_sees(side, rays):
    """Walls of equal radiosity send s^2 of it through a hole of side s: reciprocity, as the hole sees only walls."""
    scene = box_with_hole(side)
    with kernel_of(scene, 2) as kernel:
        patches = subdivide(scene, kernel, 10.0, 1000, 0)
        rows = MonteCarloFormFactors(kernel, rays, 0).rows(np.arange(0, 2 * len(patches), 2))
    # float32 sums of 2^18 shares keep six digits
    escaped = patches.areas * (1 - rows.sum(axis=1, dtype=np.float64))
    spread = np.sqrt((patches.areas * escaped.clip(0) / rays).sum())
    assert escaped.sum() == pytest.approx(side**2, abs=5 * spread + 2e-6 * patches.areas.sum())


@pytest.mark.parametrize("side", [0.1, 1e-2, 1e-3])
def test_rays_go_through_a_pinhole_and_not_beside_it(side):
    rng = np.random.default_rng(0)
    count = 20_000
    origins = rng.uniform((0.05, 0.05, 0.05), (0.95, 0.95, 0.9), (count, 3))
    across = rng.uniform(-0.5, 0.5, (count, 2))
    rim = across / np.abs(across).max(axis=1, keepdims=True) / 2  # on the hole's edge, in units of its side
    scene = box_with_hole(side)
    with kernel_of(scene) as kernel:
        for scale, is_through in ((1 - 1e-3, True), (1 + 1e-3, False)):
            points = np.column_stack([0.5 + rim * side * scale, np.ones(count)])
            triangles, _ = kernel.closest_hits(origins, points - origins)
            # a thousandth of 1e-3 m is sixteen float32 at 0.5 m: no ray may round to the other side of the edge
            assert ((triangles < 0) == is_through).all()


# ---- boxes in boxes ----


def boxes_in_a_box(material):
    """Two boxes that stick in each other, in the middle of a closed room."""
    return [
        box((0, 0, 0), (2, 2, 2), inwards=True, material=material, name="room"),
        box((0.5, 0.5, 0.1), (1.1, 1.1, 0.7), material=material, name="one"),
        box((0.8, 0.8, 0.3), (1.4, 1.4, 1.2), material=material, name="other"),
    ]


def test_from_boxes_that_stick_in_each_other_no_ray_escapes_into_the_room_or_out_of_it():
    """Both sides of every face look into a closed space, but for the room's own backs."""
    scene = scene_of(boxes_in_a_box(BLACK))
    with kernel_of(scene, 2) as kernel:
        patches = subdivide(scene, kernel, 0.3, 1000, 0)
        sides = np.arange(2 * len(patches))
        is_outside = (patches.triangles[sides // 2] < 12) & (sides % 2 == 1)
        rows = MonteCarloFormFactors(kernel, 4096, 0).rows(sides)
    # float32 sums of 4096 equal shares
    assert rows[~is_outside].sum(axis=1) == pytest.approx(1, abs=2e-5)
    assert (rows[is_outside] == 0).all()
    assert (rows[:, is_outside] == 0).all()


def test_inside_another_box_a_box_has_no_light_of_the_room():
    """The top of one box, where it is inside the other: dark to the bit; and where it is not, lit."""
    panel = AreaLight("panel", (1.0, 1.0, 1.9), (0, 0.5, 0), (0.5, 0, 0), (30.0, 30.0, 30.0))
    scene = scene_of(boxes_in_a_box(BLACK), (panel,))
    top = np.flatnonzero((scene.corners[12:24, :, 2] == 0.7).all(axis=1)) + 12
    rng = np.random.default_rng(0)
    receivers = surface_receivers(scene, rng.choice(top, 2000).astype(np.int32), rng.dirichlet((1, 1, 1), 2000))
    is_inside = (receivers.positions[:, :2] > 0.8 + 1e-5).all(axis=1)
    is_outside = (receivers.positions[:, :2] < 0.8 - 1e-5).any(axis=1)
    with kernel_of(scene) as kernel:
        light, _, _ = kernel.direct(emitters_of(scene, kernel.centre), receivers, 256, 0)
    assert (light[is_inside] == 0).all()
    # the other box beside it hides a part of the lamp only
    assert (light[is_outside] > 0).all()


@pytest.mark.parametrize("solver", ["stochastic", "progressive"])
def test_around_boxes_that_stick_in_each_other_a_room_is_a_furnace_like_any_other(solver):
    """All glows with L, inside and out: E = pi L / (1 - rho) on the room's walls."""
    glow = Material("glow", (0.5,) * 3, radiance=(1.0, 2.0, 3.0))
    settings = BakeSettings(target="vertex", solver=solver, error=0.05, patch_size=0.2, threads=2)
    colours = bake(scene_of(boxes_in_a_box(glow)), settings).corner_colours
    found = colours[:12] / (2 * np.array(glow.radiance))
    # 36 corners of an error of 0.05 each; patches that are half in another box are dark in part
    assert found.mean() == pytest.approx(1, abs=0.02)
    assert np.sqrt(np.mean((found - 1) ** 2)) < 1.5 * 0.05


# ---- walls of one plane ----


def two_rooms(solver="stochastic", targets=("dark",)):
    """A lit and a dark room with nothing between but one plane; every wall of each is its own."""
    panel = AreaLight("panel", (0.5, 0.5, 0.9), (0, 0.2, 0), (0.2, 0, 0), (30.0, 30.0, 30.0))
    parts = [
        box((0, 0, 0), (1, 1, 1), inwards=True, without=("+x",), name="lit"),
        box((1, 0, 0), (2, 1, 1), inwards=True, without=("-x",), name="dark"),
        rectangle((1, 0, 0), (0, 1, 0), (0, 0, 1), name="wall"),  # its front is on the dark side
    ]
    return scene_of([part if part.name in targets else not_a_target(part) for part in parts], (panel,))


def not_a_target(part):
    return replace(part, is_target=False)


@pytest.mark.parametrize("solver", ["stochastic", "progressive", "direct"])
def test_a_wall_of_one_plane_keeps_the_dark_room_dark_to_the_bit(solver):
    scene = two_rooms(targets=("lit", "dark", "wall"))
    receivers = well_inside(scene, 400)
    light, solved = full_light(scene, receivers, solver=solver, error=0.1, patch_size=0.25)
    triangles = receivers.triangle_sides // 2
    assert (light.values[triangles >= 10] == 0).all()
    assert (light.values[triangles < 10] > 0).all()
    with kernel_of(scene) as kernel:
        owners = subdivide(scene, kernel, 0.25, 60000, 0).triangles
    assert len(owners) == len(solved.patches)
    fronts_of = solved.solution.radiosity.reshape(-1, 2, 3)[:, 0]
    assert (fronts_of[owners >= 10] == 0).all()
    assert (fronts_of[owners < 10] > 0).all()


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_no_texel_and_no_vertex_of_the_dark_room_is_lit(target):
    scene = two_rooms(targets=("dark", "wall"))
    result = bake(scene, BakeSettings(target=target, texels=2304, error=0.1, patch_size=0.25, threads=2))
    stored = result.lightmap.pixels if result.lightmap else result.corner_colours[10:]
    assert (stored == 0).all()


def test_no_direct_light_passes_under_a_wall_that_stands_on_one_floor():
    """One floor polygon through both rooms: of the lamp nothing gets to the dark part, to the bit."""
    panel = AreaLight("panel", (-1.0, 0, 2.9), (0, 0.5, 0), (0.5, 0, 0), (30.0, 30.0, 30.0))
    wall = rectangle((0, -2, 0), (0, 4, 0), (0, 0, 3))
    shell = box((-2, -2, 0), (2, 2, 3), inwards=True, without=("-z",))
    rng = np.random.default_rng(0)
    dark = np.column_stack([rng.uniform(1e-4, 1.9, 2000), rng.uniform(-1.9, 1.9, 2000), np.zeros(2000)])
    light, _ = direct_light((panel,), dark, (wall, shell))
    assert (light == 0).all()
    light, _ = direct_light((panel,), dark * [-1, 1, 1], (wall, shell))
    assert (light > 0).all()


# ---- dihedrals ----

DIHEDRALS = {
    0.01: 0.999825556593,
    1.0: 0.982997178575,
    30.0: 0.619028323091,
    90.0: 0.200043776075,
    150.0: 0.021345325413,
    179.0: 2.36087831150e-5,
    179.9: 2.36086654e-7,
}


@pytest.mark.parametrize("degrees", DIHEDRALS)
def test_squares_that_share_an_edge_at_any_angle(degrees):
    angle, exact, rays = np.radians(degrees), DIHEDRALS[degrees], 1 << 18
    turned = (np.cos(angle), 0, np.sin(angle))
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), rectangle((0, 0, 0), (0, 1, 0), turned)])
    found = factors(scene, rays)
    # nearer to the edge than a push over the slope, a ray starts beyond the other square and misses it
    lost = PUSH * 1.0 / np.tan(angle) if degrees < 45 else 0
    assert exact - lost - noise(exact, 2 * rays) <= found <= exact + noise(exact, 2 * rays)
