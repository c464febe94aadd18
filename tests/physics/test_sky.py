"""Light from an environment image, against sums over the sphere and against the sun that the image shows."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.environment import Environment
from addon.core.gather_sums import no_sums
from addon.core.guides import no_guides
from addon.core.kernel import EVEN_SIDE
from addon.core.luminance import LUMINANCE
from addon.core.patch_solution import PatchSolution
from addon.core.patches import subdivide
from addon.core.receivers import Receivers
from addon.core.scene import SunLight
from addon.core.seen_light import SeenLight
from addon.core.sky import BRIGHT, MOST_SUNS, sky_map, with_suns
from tests.physics.lighting import floor, floor_receivers, full_light, random_points
from tests.reference.sky import irradiance, octahedron_texel, sphere
from tests.scenes import BLACK, kernel_of, rectangle, scene_of

ROWS = 128
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # a rotation, to the last digit
NORMALS = [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, -1, 0), (0.48, -0.6, 0.64), (-0.8, 0.36, -0.48)]


def colourful(directions):
    """A smooth sky without any symmetry (..., 3): a lobe of its own in each channel, and one of all."""
    lobes = np.maximum(directions @ np.array([[0.6, 0.8, 0], [-0.64, 0.48, 0.6], [0, -0.28, -0.96]]).T, 0)
    return 0.2 + 2 * lobes**2 + np.maximum(directions @ (0.28, -0.6, 0.75), 0)[..., None]


def open_plane(normal, count=50):
    """A black square that looks to ``normal``, and receivers on it."""
    across = np.cross(normal, (0.3, 0.5, 0.8))
    across /= np.linalg.norm(across)
    up = np.cross(normal, across)
    plane = rectangle(tuple(-5 * across - 5 * up), tuple(10 * across), tuple(10 * up), material=BLACK)
    # all within the first triangle: right of the diagonal
    places = np.random.default_rng(1).uniform(1, 4, (count, 2)) * (1, -1)
    normals = np.tile(np.float32(normal), (count, 1))
    return plane, Receivers(places @ np.stack([across, up]), normals, np.zeros(count, np.int32))


def under(environment, parts, radiance=(1.0, 1.0, 1.0)):
    return with_suns(replace(scene_of(parts, world=radiance), environment=environment))


@pytest.mark.parametrize("turn", [np.eye(3), TURN, TURN @ np.diag([-1, 1, 1])], ids=["as it is", "turned", "mirrored"])
@pytest.mark.parametrize("normal", NORMALS)
def test_an_open_plane_gets_what_its_half_of_the_sky_sends(normal, turn):
    directions, solid_angles = sphere(ROWS, turn)
    radiance = colourful(directions)
    plane, receivers = open_plane(np.array(normal))
    scene = under(Environment("sky", radiance.astype(np.float32), turn), [plane], (2.0, 1.0, 0.5))
    light, _ = full_light(scene, receivers, error=0.01)
    exact = irradiance(radiance * (2.0, 1.0, 0.5), directions, solid_angles, normal)
    # 50 receivers of a relative error of 0.01, in channels that may have more, six standard errors of their mean;
    # the map's texels are a degree
    assert light.values.mean(axis=0) == pytest.approx(exact, rel=6 * 0.01 / np.sqrt(50))


def test_the_map_is_an_octahedron_laid_out_flat():
    """Each ray that leaves sees the texel that the definition names: one receiver's few rays come to their mean."""
    side, rng = 4, np.random.default_rng(0)
    sky = rng.uniform(0.1, 1, (side * side, 3)).astype(np.float32)
    normal = np.array((0.48, -0.6, 0.64))
    plane, receivers = open_plane(normal, 1)
    scene = scene_of([plane])
    sums = gathered(scene, receivers, sky, 1 << 16)
    # the same mean by the definition, over the hemisphere
    directions, solid_angles = sphere(256)
    texels = np.array([octahedron_texel(d, side) for d in directions.reshape(-1, 3)])
    seen = sky[texels[:, 0] * side + texels[:, 1]].reshape(*solid_angles.shape, 3)
    exact = irradiance(seen, directions, solid_angles, normal) / np.pi
    # 65536 stratified rays, and edges of texels in 32768 pixels
    assert sums[0] / (1 << 16) == pytest.approx(exact, rel=2e-3)


def gathered(scene, receivers, sky, rays):
    """Sums (N, 3) of what so many cosine rays of each receiver see of a sky map, past black surfaces."""
    with kernel_of(scene) as kernel:
        patches = subdivide(scene, kernel, 10.0, 16, 0)
        nothing, sides = np.zeros((2 * len(patches), 3), np.float32), 2 * len(patches)
        field = PatchSolution(
            nothing, nothing, nothing, np.full(sides, EVEN_SIDE, np.uint8), np.zeros(sides, np.float32), sky
        )
        sums = no_sums(len(receivers), 1)
        everyone = np.arange(len(receivers), dtype=np.uint32)
        emitters = emitters_of(scene, kernel.centre)
        guides = no_guides(len(receivers))
        kernel.gather(SeenLight(field, emitters), receivers, guides, everyone, 0, rays, 0, sums)
    return sums.light


def test_an_image_of_one_colour_is_a_world_of_one_colour():
    points = floor_receivers(random_points(20, np.random.default_rng(2)))
    wall = rectangle((0, -9, 0), (0, 18, 0), (0, 0, 3), material=BLACK)
    plain, _ = full_light(scene_of([floor(), wall], world=(1.0, 2.0, 3.0)), points, error=0.05)
    grey = Environment("grey", np.full((8, 16, 3), 0.5, np.float32))
    shown, _ = full_light(under(grey, [floor(), wall], (2.0, 4.0, 6.0)), points, error=0.05)
    assert shown.values == pytest.approx(plain.values, rel=1e-5)  # the same rays; float32


def sunny(radiance=4e4, row=ROWS * 3 // 4, column=20):
    """A dim sky, and two by two pixels of a sun 45 degrees up."""
    pixels = np.full((ROWS, 2 * ROWS, 3), 0.5, np.float32)
    pixels[row : row + 2, column : column + 2] = np.float32((1.0, 0.9, 0.7)) * radiance
    return Environment("sunny", pixels)


def test_a_sun_in_the_image_becomes_a_sun_and_all_light_is_kept():
    environment = sunny()
    directions, solid_angles = sphere(ROWS)
    scene = under(environment, [floor()], (2.0, 1.0, 0.5))
    (sun,) = scene.lights
    is_sun = environment.pixels[..., 0] > 1
    middle = (directions * (solid_angles * is_sun)[..., None]).sum(axis=(0, 1))
    assert sun.direction == pytest.approx(-middle / np.linalg.norm(middle), abs=1e-5)  # the reference's middle rule
    # two pixels wide, and round
    assert 2 * np.pi / ROWS == pytest.approx(sun.angle, rel=0.2)
    rng = np.random.default_rng(3)
    for normal in rng.standard_normal((50, 3)):
        normal /= np.linalg.norm(normal)
        whole = irradiance(environment.pixels * np.array((2.0, 1.0, 0.5)), directions, solid_angles, normal)
        rest = irradiance(scene.environment.pixels * np.array((2.0, 1.0, 0.5)), directions, solid_angles, normal)
        by_sun = max(-np.dot(normal, sun.direction), 0) * np.array(sun.irradiance)
        # the reference's middle rule over rows of 1.4 degrees; and where the disc is cut by the horizon
        assert rest + by_sun == pytest.approx(whole, rel=2e-3, abs=0.01 * max(sun.irradiance))


def test_the_sun_of_an_image_throws_a_shadow_without_noise():
    environment = sunny()
    points = np.array([(-4.0, y, 0) for y in np.linspace(-1, 1, 20)] + [(4.0, y, 0) for y in np.linspace(-1, 1, 20)])
    (sun,) = under(environment, [floor()]).lights
    # the sun is at (-x, y): a wall that hides it from points on its other side
    assert sun.direction[0] > 0.5
    wall = rectangle((0, -40, 0), (0, 80, 0), (0, 0, 8), material=BLACK)
    light, _ = full_light(under(environment, [floor(), wall]), floor_receivers(points), error=0.02)
    lit, hidden = light.values[:20].mean(axis=0), light.values[20:].mean(axis=0)
    directions, solid_angles = sphere(ROWS)
    by_sun = irradiance(np.where(environment.pixels > 1, environment.pixels, 0), directions, solid_angles, (0, 0, 1))
    # both sides see a little less than the half of the dim sky that the wall does not cover
    assert lit - hidden == pytest.approx(by_sun, rel=0.01)
    assert (hidden < 0.5 * np.pi).all()
    assert light.relative_error < 0.02


def test_a_sky_without_a_sun_is_left_as_it_is():
    directions, _ = sphere(ROWS)
    sky = Environment("sky", np.float32(colourful(directions)))
    scene = replace(scene_of([floor()], world=(1.0, 1.0, 1.0)), environment=sky)
    assert with_suns(scene) is scene
    black = replace(scene, world_radiance=(0.0, 0.0, 0.0), environment=sunny())
    assert with_suns(black) is black
    assert (sky_map(black) == 0).all()


def test_of_many_bright_spots_the_brightest_become_suns_and_none_is_lost():
    rng, pixels = np.random.default_rng(4), np.full((ROWS, 2 * ROWS, 3), 0.01, np.float32)
    spots = rng.permutation([(row, column) for row in range(20, 108, 8) for column in range(0, 256, 16)])[:40]
    for k, (row, column) in enumerate(spots):
        pixels[row, column] = 100.0 * (k + 10)
    scene = under(Environment("lamps", pixels), [floor()])
    suns, rest = scene.lights, scene.environment.pixels
    assert all(isinstance(sun, SunLight) for sun in suns)
    directions, solid_angles = sphere(ROWS)
    most = BRIGHT * ((pixels @ LUMINANCE) * solid_angles).sum() / (4 * np.pi)
    above = np.maximum(pixels @ LUMINANCE - most, 0) * solid_angles
    brightest = np.sort(above.ravel())[::-1][:MOST_SUNS]
    assert [np.dot(LUMINANCE, sun.irradiance) for sun in suns] == pytest.approx(brightest, rel=1e-3)  # middle rule
    shown = directions.reshape(-1, 3)[np.argsort(-above.ravel())[:MOST_SUNS]]
    assert np.array([sun.direction for sun in suns]) == pytest.approx(-shown, abs=1e-6)
    kept = ((rest @ LUMINANCE) * solid_angles).sum() + sum(np.dot(LUMINANCE, sun.irradiance) for sun in suns)
    assert kept == pytest.approx(((pixels @ LUMINANCE) * solid_angles).sum(), rel=1e-3)  # the reference's middle rule


def test_a_hot_pixel_and_glints_leave_the_sun_a_sun():
    """Glints as bright as the sun, each of a fifth of its light at the most; a pixel at the pole is next to nothing."""
    environment = sunny()
    pixels = environment.pixels.copy()
    is_sun = pixels[..., 0] > 1
    pixels[0, 3] = 1e6
    for column in range(0, 240, 8):
        pixels[30, column] = pixels[is_sun][0]
    scene = under(replace(environment, pixels=pixels), [floor()])
    (alone,) = under(environment, [floor()]).lights
    strongest = scene.lights[0]
    assert len(scene.lights) == MOST_SUNS
    # what is above the mean, which the glints have raised
    assert strongest.irradiance == pytest.approx(alone.irradiance, rel=0.1)
    assert strongest.direction == pytest.approx(alone.direction, abs=1e-6)
    assert scene.environment.pixels[0, 3, 0] == 1e6
