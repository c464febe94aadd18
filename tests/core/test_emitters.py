"""The light table: one row a light, glowing triangles in groups that keep all light."""

import numpy as np
import pytest

from addon.core.emitters import MOST_GROUPS, TEXTURE_CUTS, emitters_of
from addon.core.kernel import AREA, LIGHT_FLOATS, MESH, POINT, SUN
from addon.core.scene import AreaLight, Material, PointLight, SunLight, Texture
from tests.scenes import BLACK, cornell_box, lamp, rectangle, scene_of

GLOW = Material("glow", (0, 0, 0), radiance=(3.0, 2.0, 1.0))


def table_of(parts, lights=(), centre=(0, 0, 0)):
    return emitters_of(scene_of(parts, lights), centre)


def flux(emitters):
    corners = emitters.corners.reshape(-1, 3, 3).astype(float)
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    front, back = np.moveaxis(emitters.radiances.reshape(-1, 2, 3), 1, 0)
    assert (front == back).all()  # materials glow on both sides
    return (areas[:, None] * front).sum(axis=0)


def test_one_row_a_lamp_in_order_with_its_kind():
    lights = (
        PointLight("point", (1, 2, 3), (4, 5, 6), radius=0.5),
        AreaLight("area", (1, 2, 3), (1, 0, 0), (0, 1, 0), (7, 8, 9)),
        SunLight("sun", (0, 0, -2), (1, 1, 1), 0.01),
    )
    emitters = table_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), material=BLACK)], lights, (1, 1, 1))
    assert emitters.kinds.tolist() == [POINT, AREA, SUN]
    assert emitters.parameters.shape == (3, LIGHT_FLOATS)
    assert emitters.parameters[0, :7] == pytest.approx((0, 1, 2, 4, 5, 6, 0.5))
    assert emitters.parameters[1, :6] == pytest.approx((0, 1, 2, 7, 8, 9))
    # towards the sun, and the radius of its disc
    assert emitters.parameters[2, :7] == pytest.approx((0, 0, 1, 1, 1, 1, 0.005))


def test_glowing_triangles_stand_in_groups_that_cover_them_once():
    emitters = table_of([rectangle((0, 0, 0), (3, 0, 0), (0, 1, 0), cuts=(30, 10), material=GLOW)])
    assert (emitters.kinds == MESH).all()
    assert 1 < len(emitters) <= MOST_GROUPS
    firsts, counts = emitters.parameters[:, 5].astype(int), emitters.parameters[:, 6].astype(int)
    covered = np.concatenate([np.arange(f, f + c) for f, c in zip(firsts, counts)])
    assert sorted(covered) == list(range(600))
    assert flux(emitters) == pytest.approx((9, 6, 3), rel=1e-5)
    for row, first, count in zip(emitters.parameters, firsts, counts):
        corners = emitters.corners[first : first + count].reshape(-1, 3)
        # float32 centres of metres
        assert np.linalg.norm(corners - row[:3], axis=1).max() <= row[3] * (1 + 1e-5)
        chances = emitters.cumulative[first : first + count]
        assert chances[0] == 0
        assert (np.diff(chances) > 0).all()
        assert chances[-1] < 1


def test_a_glow_that_is_an_image_keeps_its_light_and_its_place():
    pixels = np.zeros((32, 32, 3), np.float32)
    pixels[:, :16] = (1, 1, 1)
    glow = Material("picture", (0, 0, 0), radiance=(2.0, 2.0, 2.0), radiance_texture=Texture("picture", pixels))
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), material=glow)])
    scene.uvs[:] = scene.corners[..., :2]
    emitters = emitters_of(scene, (0, 0, 0))
    # the seam runs along pieces' edges; half a pixel beside it is interpolated, as it is at the end of what repeats
    assert flux(emitters) == pytest.approx((1, 1, 1), rel=1e-3)
    middles = emitters.corners.reshape(-1, 3, 3).mean(axis=1)[:, 0]
    is_lit = (middles > 1 / 8) & (middles < 3 / 8)
    assert (emitters.radiances[is_lit] == 2).all()
    assert (emitters.radiances[(middles > 5 / 8) & (middles < 7 / 8)] == 0).all()


def test_a_glow_that_is_a_fine_image_keeps_its_light():
    """Noise of 64 x 64 pixels: a piece's middle alone would tell little of the 128 that it has."""
    pixels = np.random.default_rng(0).uniform(0, 1, (64, 64, 3)).astype(np.float32) ** 8
    glow = Material("picture", (0, 0, 0), radiance=(2.0, 2.0, 2.0), radiance_texture=Texture("picture", pixels))
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), material=glow)])
    scene.uvs[:] = scene.corners[..., :2]
    # 64 points of a piece for 32 pixels: what interpolation between these leaves
    assert flux(emitters_of(scene, (0, 0, 0))) == pytest.approx(2 * pixels.mean(axis=(0, 1)), rel=0.01)


def test_many_triangles_that_glow_by_an_image_are_cut_into_fewer_pieces_each(monkeypatch):
    pixels = np.random.default_rng(0).uniform(0, 1, (8, 8, 3)).astype(np.float32)
    glow = Material("picture", (0, 0, 0), radiance=(2.0, 2.0, 2.0), radiance_texture=Texture("picture", pixels))
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), cuts=(5, 5), material=glow)])
    scene.uvs[:] = scene.corners[..., :2]
    whole = emitters_of(scene, (0, 0, 0))
    monkeypatch.setattr("addon.core.emitters.MOST_PIECES", 250)
    few = emitters_of(scene, (0, 0, 0))
    assert len(whole.corners) == 50 * TEXTURE_CUTS**2
    assert len(few.corners) == 50 * 4
    # each has the mean of 64 points of what is interpolated between 8 x 8 pixels
    assert flux(few) == pytest.approx(flux(whole), rel=0.01)


def test_what_neither_glows_nor_has_an_area_is_left_out():
    sliver = rectangle((0, 0, 0), (1, 1, 1), (2, 2, 2), material=GLOW)
    plain = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))
    assert len(table_of([sliver, plain])) == 0
    assert len(table_of([sliver, plain], [lamp()])) == 1


def test_positions_are_relative_to_the_centre():
    scene = cornell_box()
    here, there = emitters_of(scene, (0, 0, 0)), emitters_of(scene, (0.5, 0.5, 0.5))
    shifted = there.corners.reshape(-1, 3) + np.float32(0.5)
    assert shifted == pytest.approx(here.corners.reshape(-1, 3), abs=1e-6)


def test_an_unknown_kind_of_light_is_named():
    with pytest.raises(TypeError, match="dict"):
        table_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))], [{}])
