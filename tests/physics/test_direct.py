"""Direct light on a black floor against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.environment import Environment
from addon.core.luminance import LUMINANCE
from addon.core.receivers import surface_receivers
from addon.core.scene import AreaLight, Material, PointLight, SunLight
from tests.physics.lighting import SINGLE, direct_light, floor, floor_receivers, full_light, random_points
from tests.reference.polygon import point_to_polygon
from tests.scenes import BLACK, Part, closed_box, kernel_of, random_rotation, rectangle, scene_of

UP = np.array([0, 0, 1.0])
COLOUR = np.array([3.0, 2.0, 0.5])


@pytest.fixture
def points():
    return random_points(50, np.random.default_rng(0))


def cosine_law(points, position):
    """cos / d^2 on the floor."""
    to = np.asarray(position) - points
    distance = np.linalg.norm(to, axis=1)
    return to[:, 2] / distance**3


def test_a_point_light_gives_i_cos_over_d_squared(points):
    values, variance = direct_light([PointLight("lamp", (0.3, -0.2, 1.5), tuple(COLOUR))], points)
    assert values == pytest.approx(cosine_law(points, (0.3, -0.2, 1.5))[:, None] * COLOUR, rel=SINGLE)
    assert (variance == 0).all()


def test_a_sphere_light_above_the_horizon_is_a_point_light_to_the_floor(points):
    """A sphere of radiance I / (pi r^2) gives E = L pi sin^2 cos = I cos / d^2, exactly, while it is all above."""
    lamp = PointLight("lamp", (0.3, -0.2, 1.5), tuple(COLOUR), radius=0.5)
    values, variance = direct_light([lamp], points, samples=256)
    exact = cosine_law(points, lamp.position)
    scores = (values @ LUMINANCE - exact * (COLOUR @ LUMINANCE)) / np.maximum(np.sqrt(variance), 1e-6)
    # the two halves that state the variance are few: a median says more than the largest
    assert np.median(np.abs(scores)) < 2
    # 64 points or more of a Sobol sequence on an integrand that is a plane wave of less than half its mean
    assert values == pytest.approx(exact[:, None] * COLOUR, rel=0.02)
    assert values.sum() == pytest.approx((exact[:, None] * COLOUR).sum(), rel=2e-3)


def test_a_soft_lamp_is_a_disc_that_faces_the_receiver():
    """Below the middle of a disc of radiance I / (pi r^2): E = pi L sin^2 = I / (d^2 + r^2)."""
    lamp = PointLight("lamp", (0, 0, 1.0), tuple(COLOUR), radius=0.5, soft_falloff=True)
    values, _ = direct_light([lamp], [(0, 0, 0)], samples=1024)
    # a thousand points of a Sobol sequence on a smooth integrand
    assert values[0] == pytest.approx(COLOUR / 1.25, rel=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_rectangle_lamp_gives_pi_l_times_lamberts_form_factor(seed, points):
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(-0.5, 0.5, (2, 3))
    if np.cross(u, v)[2] > 0:  # look down
        u, v = v, u
    lamp = AreaLight("lamp", (0.1, 0.2, 1.6), tuple(u), tuple(v), tuple(COLOUR))
    values, variance = direct_light([lamp], points)
    centre, normal = np.array(lamp.centre), np.cross(u, v)
    corners = [centre + a * u + b * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    factors = [point_to_polygon(p, UP, corners) if (p - centre) @ normal > 0 else 0.0 for p in points]
    exact = np.pi * np.outer(factors, COLOUR)
    # receivers stand 1e-5 m off a floor of 10 m, which a lamp seen at a grazing angle notices
    assert values == pytest.approx(exact, rel=SINGLE, abs=1e-5 * exact.max())
    # a closed form has no noise where nothing hides the lamp
    assert variance == pytest.approx(0, abs=1e-10)


def test_an_area_lamp_lights_one_side_only(points):
    upwards = AreaLight("lamp", (0, 0, 1.0), (0.5, 0, 0), (0, 0.5, 0), (1.0, 1.0, 1.0))
    values, _ = direct_light([upwards], points)
    assert (values == 0).all()


@pytest.mark.parametrize("glows", [False, True], ids=["lamp", "mesh"])
@pytest.mark.parametrize("samples", [2, 8, 64])
@pytest.mark.parametrize("risen", [0.5, 0.1, 0.003])
def test_what_has_risen_of_a_lamp_shines_whole_however_little_that_is(glows, samples, risen):
    """A panel through the floor, 3 m wide and high: of samples all over it, one in a thousand would be above."""
    low, high = risen - 3, risen
    points = np.stack([np.linspace(0.02, 1, 40), np.linspace(-1.4, 1.6, 40), np.zeros(40)], axis=1)
    glow = Material("glow", (0, 0, 0), radiance=tuple(COLOUR))
    parts = [rectangle((0, -1.5, low), (0, 3, 0), (0, 0, 3), material=glow)] if glows else []
    lamp = AreaLight("lamp", (0, 0, low + 1.5), (0, 1.5, 0), (0, 0, 1.5), tuple(COLOUR))
    values, variance = direct_light([] if glows else [lamp], points, parts, samples=samples)
    corners = np.array([(0, -1.5, low), (0, 1.5, low), (0, 1.5, high), (0, -1.5, high)])
    exact = np.pi * np.outer([point_to_polygon(p, UP, corners) for p in points], COLOUR)
    # receivers stand 1e-5 m off a floor of 10 m, and the light of what has risen goes by the square of its height
    assert values == pytest.approx(exact, rel=2.5e-5 / risen + SINGLE)
    assert variance == pytest.approx(0, abs=1e-10)


def test_a_disc_lamp_overhead():
    """E = pi L r^2 / (r^2 + h^2) below its middle."""
    lamp = AreaLight("lamp", (0, 0, 1.0), (0, 0.5, 0), (0.5, 0, 0), tuple(COLOUR), is_ellipse=True)
    values, _ = direct_light([lamp], [(0, 0, 0)], samples=1024)
    # a thousand points of a Sobol sequence on a smooth integrand
    assert values[0] == pytest.approx(np.pi * COLOUR * 0.2, rel=2e-3)


def test_spread_narrows_the_beam():
    """A small lamp of full angle s: L A cos^2 / d^2 (tan(s/2) - tan(a)) / (tan(s/2) - s/2), nothing beyond s/2."""
    spread, half = np.pi / 3, 0.01
    lamp = AreaLight("lamp", (0, 0, 2.0), (0, half, 0), (half, 0, 0), tuple(COLOUR), spread=spread)
    x = np.array([0, 0.3, 0.8, 1.1, 1.2, 2.0])
    values, _ = direct_light([lamp], np.stack([x, 0 * x, 0 * x], axis=1), samples=256)
    tangent, squared = x / 2, x**2 + 4
    share = np.maximum(0, np.tan(spread / 2) - tangent) / (np.tan(spread / 2) - spread / 2)
    exact = 4 * half**2 * 4 / squared**2 * share
    # the lamp is 2 cm wide, 2 m away: 1e-2 of the tangent at the beam's edge
    assert values / COLOUR == pytest.approx(np.tile(exact[:, None], 3), rel=1e-2, abs=1e-2 * exact[0])
    assert (values[x / 2 > np.tan(spread / 2) + 0.01] == 0).all()


def test_a_spot_is_full_inside_none_outside_and_smoothstep_between():
    outer, inner = np.cos(np.radians(40)), np.cos(np.radians(20))
    spot = PointLight("spot", (0, 0, 2.0), tuple(COLOUR), direction=(0, 0, -1.0), cone_cosines=(outer, inner))
    angles = np.radians(np.array([0, 10, 19, 25, 30, 35, 39, 41, 60]))
    points = np.stack([2 * np.tan(angles), 0 * angles, 0 * angles], axis=1)
    values, _ = direct_light([spot], points)
    t = np.clip((np.cos(angles) - outer) / (inner - outer), 0, 1)
    exact = cosine_law(points, spot.position) * t * t * (3 - 2 * t)
    # float32 cosines of the cone, which count most where the smoothstep is nearly 0
    assert values == pytest.approx(exact[:, None] * COLOUR, rel=1e-4, abs=1e-5 * exact.max())
    assert (values[angles > np.radians(40)] == 0).all()


@pytest.mark.parametrize("is_ellipse", [False, True])
@pytest.mark.parametrize("spread", [0.0, 0.02, 0.3])
def test_a_narrow_beam_has_all_of_its_light(spread, is_ellipse):
    """pi L in its midst, where a point sees all directions of it, and the flux pi L A on the floor; slanted axes."""
    lamp = AreaLight("lamp", (0.1, 0, 0.5), (0, 0.5, 0), (0.4, 0.1, 0), tuple(COLOUR), is_ellipse, spread)
    values, _ = direct_light([lamp], [(0.1, 0, 0)], samples=1024)
    # a thousand points of a Sobol sequence on a cone's smooth hill
    assert values[0] == pytest.approx(np.pi * COLOUR, rel=0.01)
    rows = midpoints(-1, 1, 120)
    points = np.stack([*(axis.ravel() for axis in np.meshgrid(rows, rows)), np.zeros(120**2)], axis=1)
    values, _ = direct_light([lamp], points, samples=64)
    area = 4 * 0.5 * 0.4 * (np.pi / 4 if is_ellipse else 1)
    # squares of 17 mm over the beam's edge, of which there are some 200
    assert values.mean(axis=0) * 4 == pytest.approx(np.pi * area * COLOUR, rel=0.01)


@pytest.mark.parametrize("degrees", [0, 30, 75, 100])
@pytest.mark.parametrize("angle", [0.0, 0.01])
def test_a_sun_gives_its_irradiance_times_the_cosine(degrees, angle, points):
    direction = (np.sin(np.radians(degrees)), 0, -np.cos(np.radians(degrees)))
    values, _ = direct_light([SunLight("sun", direction, tuple(COLOUR), angle)], points)
    exact = max(np.cos(np.radians(degrees)), 0) * COLOUR
    # the sun's disc: its samples' cosines differ by the tangent times half its angle
    assert values == pytest.approx(np.tile(exact, (len(points), 1)), rel=SINGLE + 2 * angle, abs=1e-6)


@pytest.mark.parametrize("degrees", [0, 40, 80, 100])
@pytest.mark.parametrize("angle", [0.5, 1.6, 3.0, np.pi])
def test_a_wide_sun_is_a_disc_of_even_radiance(degrees, angle):
    """E at normal incidence is pi L sin^2, so L is E / (pi sin^2), of which what is above the horizon arrives."""
    direction = (np.sin(np.radians(degrees)), 0, -np.cos(np.radians(degrees)))
    values, _ = direct_light([SunLight("sun", direction, tuple(COLOUR), angle)], [(0.0, 0.0, 0.0)], samples=4096)
    cosines, turns = np.meshgrid(midpoints(np.cos(angle / 2), 1, 2000), midpoints(0, 2 * np.pi, 500))
    across = np.sin(np.radians(degrees)) * np.sqrt(1 - cosines**2) * np.cos(turns)
    heights = np.maximum(np.cos(np.radians(degrees)) * cosines + across, 0)
    solid_angle = 2 * np.pi * (1 - np.cos(angle / 2))
    exact = COLOUR / (np.pi * np.sin(angle / 2) ** 2) * solid_angle * heights.mean()
    # 4096 points of a Sobol sequence on an integrand that is smooth but for the horizon's kink; both sums have that
    assert values[0] == pytest.approx(exact, rel=2e-3, abs=1e-6)


def midpoints(low, high, count):
    return low + (np.arange(count) + 0.5) * (high - low) / count


@pytest.mark.parametrize("order", [(0, 1, 2), (0, 2, 1)], ids=["front", "back"])
def test_a_glowing_triangle_lights_from_both_sides(order, points):
    corners = np.array([(-0.3, -0.4, 1.2), (0.6, 0.1, 1.4), (-0.1, 0.5, 1.0)])
    glow = Part(corners[list(order)], [(0, 1, 2)], Material("glow", (0, 0, 0), radiance=tuple(COLOUR)))
    values, variance = direct_light([], points, [glow])
    factors = np.array([point_to_polygon(p, UP, corners) for p in points])
    # far ones by samples, near ones exactly: both use the closed form times the visible share
    assert values == pytest.approx(np.pi * np.outer(factors, COLOUR), rel=1e-4, abs=1e-6)
    assert variance == pytest.approx(0, abs=1e-10)


def test_a_glowing_mesh_of_many_triangles_is_their_sum(points):
    """100 quads, more than have a closed form together."""
    glow = rectangle(
        (-0.5, -0.5, 1.0), (0, 1, 0), (1, 0, 0), cuts=(10, 10), material=Material("glow", radiance=tuple(COLOUR))
    )
    values, variance = direct_light([], points, [glow], samples=128)
    corners = [(-0.5, -0.5, 1), (0.5, -0.5, 1), (0.5, 0.5, 1), (-0.5, 0.5, 1)]
    exact = np.pi * np.outer([point_to_polygon(p, UP, corners) for p in points], COLOUR)
    errors = (values - exact) @ LUMINANCE
    # stated by two halves each, so only the mean over 50 receivers is good, to a factor 1.4 or so
    assert np.sqrt(np.mean(errors**2)) < 1.6 * np.sqrt(variance.mean()) + 1e-4 * exact.max()
    assert values.mean() == pytest.approx(exact.mean(), rel=0.01)


@pytest.mark.parametrize("samples", [2, 8, 32])
def test_few_samples_lose_no_light(samples):
    """In a box whose walls all glow, each receiver's own wall gives it nothing and the others pi L, at any price."""
    scene = closed_box(Material("glow", radiance=(1.0, 1.0, 1.0)), (1, 1.3, 0.8))
    rng = np.random.default_rng(0)
    triangles = np.repeat(np.arange(12, dtype=np.int32), 100)
    receivers = surface_receivers(scene, triangles, rng.dirichlet((1, 1, 1), len(triangles)))
    with kernel_of(scene) as kernel:
        values, variance, _ = kernel.direct(emitters_of(scene, kernel.centre), receivers, samples, 0)
    # no bias: four standard errors of the mean, as stated, of 1200 receivers with noise of their own
    tolerance = 4 * np.sqrt(variance.mean() / len(triangles)) + 1e-3
    assert values[:, 0].mean() == pytest.approx(np.pi, abs=tolerance)
    assert values.max() < np.pi * (1 + 1e-3) + 10 * np.sqrt(variance.max())


def test_a_constant_sky_gives_pi_l_on_an_open_plane(points):
    scene = scene_of([floor()], world=tuple(COLOUR))
    light, _ = full_light(scene, floor_receivers(points), error=0.1)
    # every ray sees the sky
    assert light.values == pytest.approx(np.tile(np.pi * COLOUR, (len(points), 1)), rel=1e-5)
    # float32 sums of 1000 rays are good to about 1e-6 each; their differences are what is left here
    assert light.relative_error == pytest.approx(0, abs=1e-5)


def test_half_a_sky_gives_half_the_light():
    """A black wall, high and long, up from the receivers' line: half of the cosine hemisphere is dark."""
    wall = rectangle((0, -1e4, 0), (0, 2e4, 0), (0, 0, 1e4), material=BLACK)
    scene = scene_of([floor(), wall], world=(1.0, 1.0, 1.0))
    light, _ = full_light(scene, floor_receivers([(1.0, y, 0) for y in np.linspace(0.1, 1, 50)]), error=0.01)
    exact = np.pi / 2
    # 50 receivers with a relative error of 0.01 each, four standard errors of their mean
    assert light.values.mean() == pytest.approx(exact, rel=4 * 0.01 / np.sqrt(50))
    errors = light.values[:, 0] / exact - 1
    assert np.sqrt(np.mean(errors**2)) < 0.02


def test_light_passes_through_glass_and_takes_its_tint(points):
    tint = (0.9, 0.5, 0.1)
    pane = rectangle((-9, -9, 0.5), (18, 0, 0), (0, 18, 0), material=Material("glass", (0, 0, 0), transmittance=tint))
    lamp = PointLight("lamp", (0.3, -0.2, 1.5), tuple(COLOUR))
    behind, _ = direct_light([lamp], points, [pane])
    assert behind == pytest.approx(direct_light([lamp], points)[0] * tint, rel=1e-5)
    twice, _ = direct_light([lamp], points, [pane, replace(pane, vertices=pane.vertices + np.array([0, 0, 0.1]))])
    assert twice == pytest.approx(direct_light([lamp], points)[0] * np.square(tint), rel=1e-5)


def test_an_opaque_board_casts_the_shadow_that_geometry_says():
    """A point lamp 2 m up, a square board 1 m up: its shadow is twice its size, sharp."""
    board = rectangle((-0.25, -0.25, 1), (0.5, 0, 0), (0, 0.5, 0))
    x = np.linspace(-1, 1, 81) + 0.003
    points = np.stack([x, 0.1 + 0 * x, 0 * x], axis=1)
    values, _ = direct_light([PointLight("lamp", (0, 0, 2.0), tuple(COLOUR))], points, [board])
    assert ((values[:, 0] == 0) == (np.abs(x) < 0.5)).all()


def test_a_profile_and_a_power_of_the_distance_multiply_what_a_point_gives():
    """E = I p(direction) cos d^k / d^2 of a profile that varies slowly, turned: of a place and a radius of its own."""
    elevation, azimuth = np.meshgrid(*((np.arange(n) + 0.5) / n for n in (256, 512)), indexing="ij")
    unturned = Environment("plain", np.zeros((256, 512, 3), np.float32))
    seen = unturned.directions(256 * elevation - 0.5, 512 * azimuth - 0.5)

    def by_direction(towards):
        return 0.5 + 0.3 * towards[..., 0] + 0.2 * towards[..., 1] * towards[..., 2]

    turn = random_rotation(np.random.default_rng(5))
    pixels = np.repeat(by_direction(seen)[..., None], 3, axis=2).astype(np.float32)
    points, position = random_points(300, np.random.default_rng(4)), np.array([0.3, -0.2, 1.1])
    to = points - position
    distance = np.linalg.norm(to, axis=1)
    share = by_direction(to / distance[:, None] @ turn.T)
    plain = share * position[2] / distance**3
    for power in (0.0, 1.0, 2.0):
        for radius in (0.0, 1e-5):
            lamp = PointLight(
                "lamp", tuple(position), (3.0, 2.0, 1.0), radius, distance_power=power,
                profile=Environment("profile", pixels, tuple(map(tuple, turn))),
            )  # fmt: skip
            found, _ = direct_light([lamp], points)
            # two maps, bilinear: an eighth of the square of a texel, .025 rad, times the profile's second derivative
            expected = (plain * distance**power)[:, None] * (3.0, 2.0, 1.0)
            assert found == pytest.approx(expected, rel=3e-4 / share.min())
