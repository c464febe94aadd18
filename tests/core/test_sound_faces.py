"""Bad faces are left out with their number and owner, and change no bit of what is left."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.bake import bake
from addon.core.scene import SceneError
from addon.core.settings import BakeSettings
from addon.core.sound_faces import sound_faces
from tests.scenes import GREY, LAMP, Part, box, rectangle, scene_of

ROOM = box((0, 0, 0), (1, 1, 1), inwards=True, name="room")
PLATE = rectangle((0.3, 0.3, 0.4), (0.4, 0, 0), (0, 0.4, 0), name="plate")
# none can be met by a ray; 0.2, 0.4 and 0.8 are no float32, so their line is one to rounding only
BAD_FACES = {
    "NaN": ((0.1, 0.1, np.nan), (0.5, 0.1, 0.5), (0.1, 0.5, 0.5)),
    "infinite": ((0.1, 0.1, np.inf), (0.5, 0.1, -np.inf), (0.1, 0.5, 0.5)),
    "1e30": ((1e30, 0, 0), (0, 1e30, 0), (0, 0, 1e30)),
    "1e-30": ((0.0, 0.0, 0.0), (1e-30, 0.0, 0.0), (0.0, 1e-30, 0.0)),
    "line": ((0.2, 0.2, 0.5), (0.4, 0.4, 0.5), (0.8, 0.8, 0.5)),
    "point": ((0.3, 0.3, 0.3),) * 3,
}


def bad_part(kinds, name="bad"):
    points = np.array([BAD_FACES[kind] for kind in kinds]).reshape(-1, 3)
    return Part(points, np.arange(len(points)).reshape(-1, 3).tolist(), GREY, name)


def baked(parts, target):
    settings = BakeSettings(target=target, texels=1024, error=0.2, patch_size=0.2, threads=2)
    result = bake(scene_of(parts, (LAMP,)), settings)
    light = (result.lightmap.pixels, result.lightmap.uvs) if result.lightmap else (result.corner_colours,)
    return light, result.report


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
@pytest.mark.parametrize("kind", BAD_FACES)
def test_a_bad_face_changes_no_bit_of_the_others_and_is_named(kind, target):
    """Between two objects, where its index and its vertices come before those of the plate."""
    clean, _ = baked([ROOM, PLATE], target)
    found, report = baked([ROOM, bad_part([kind, kind]), PLATE], target)
    bad = slice(12, 14)
    for before, after in zip(clean, found):
        if len(after) != len(before):  # a row a triangle
            assert np.isnan(after[bad]).all()
            after = np.delete(after, np.r_[bad], axis=0)
        assert after.tobytes() == before.tobytes()
    assert any(w.startswith("object bad: 2 of 2 triangles") and "left out" in w for w in report.warnings)


def test_rounding_in_a_large_hall_does_not_open_a_line():
    # as float32 about the middle of a kilometre its corners lie 3e-5 off, and what is no area has one
    hall = box((0, 0, 0), (1000, 1000, 1000), inwards=True, name="hall")
    line = Part([(1.2, 1.35, 1.7), (1.4, 1.55, 1.7), (1.8, 1.95, 1.7)], [(0, 1, 2)], name="line")
    assert sound_faces(scene_of([hall, line])).kept.tolist() == [True] * 12 + [False]


def test_each_kind_of_fault_is_told_with_its_number():
    scene = scene_of([ROOM, bad_part(["NaN", "1e30", "line", "point", "infinite"])])
    warnings = sound_faces(scene).scene.warnings
    assert [w for w in warnings if "2 of 5 triangles are not finite" in w]
    assert [w for w in warnings if "1 of 5 triangles are farther than 1e+08 m" in w]
    assert [w for w in warnings if "2 of 5 triangles have no area" in w]
    assert len(warnings) == 3


def test_a_sound_scene_stays_as_it_is():
    scene = scene_of([ROOM, PLATE])
    sound = sound_faces(scene)
    assert sound.kept.all()
    assert sound.scene.warnings == ()
    assert (sound.scene.vertices == scene.vertices).all()
    values = np.zeros((14, 3, 2))
    assert sound.spread(values) is values


def test_a_corner_on_a_straight_edge_gets_the_colour_of_its_polygon():
    """A fan whose first triangle is a line: its middle loop is in no other triangle, yet it is a corner to colour."""
    points = [(0, 0, 0.5), (0.5, 0, 0.5), (1, 0, 0.5), (1, 1, 0.5)]
    pentagon = Part(points, [(0, 1, 2, 3)], name="pentagon")
    (colours,), report = baked([ROOM, pentagon], "vertex")
    line, rest = colours[12], colours[13]
    assert any(w.startswith("object pentagon: 1 of 2") for w in report.warnings)
    assert (line[0] == rest[0]).all()
    assert (line[2] == rest[1]).all()
    assert np.isfinite(line[1]).all()
    assert np.ptp(rest, axis=0).max() >= (line[1] - rest.min(axis=0)).max() >= 0


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_nothing_but_bad_faces_is_refused_with_the_reason(target):
    with pytest.raises(SceneError, match=r"nothing to bake.*object bad: 1 of 1 triangles have no area"):
        baked([bad_part(["line"])], target)


def test_the_reason_is_that_of_what_was_to_be_baked():
    scene = scene_of([bad_part(["NaN"], "stand"), bad_part(["line"], "floor")], (LAMP,))
    scene = replace(scene, objects=(replace(scene.objects[0], is_target=False), scene.objects[1]))
    with pytest.raises(SceneError, match=r"nothing to bake.*: object floor: 1 of 1 triangles have no area"):
        bake(scene, BakeSettings(texels=1024))


def test_shading_normals_and_uvs_that_are_no_numbers_are_ignored_and_named():
    scene = scene_of([ROOM, PLATE], (LAMP,))
    scene.corner_normals[13, 1] = np.nan
    scene.uvs[12, 0] = np.inf
    warnings = sound_faces(scene).scene.warnings
    assert any(w.startswith("object plate: shading normals of 1 triangles") for w in warnings)
    assert any(w.startswith("object plate: texture coordinates of 1 triangles") for w in warnings)
    assert np.isfinite(sound_faces(scene).scene.corner_normals).all()
