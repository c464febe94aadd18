"""What a bake says of objects without light, without texels, and with UVs that overlap."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.bake import bake
from addon.core.settings import BakeSettings
from tests.scenes import lamp, rectangle, scene_of

QUICK = {"error": 0.5, "texels": 4096, "denoise": False}


def warnings_of(scene, **settings):
    return bake(scene, BakeSettings(**{**QUICK, **settings})).report.warnings


def with_uvs(scene, *uvs):
    """The scene whose objects have Lightmap UVs (4, 2) of their two triangles' corners each."""
    fans = [np.array(each, np.float32)[[[0, 1, 2], [0, 2, 3]]] for each in uvs]
    objects = tuple(replace(obj, lightmap_uvs=fan) for obj, fan in zip(scene.objects, fans))
    return replace(scene, objects=objects)


def two_floors():
    one = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), name="one")
    return scene_of([one, rectangle((2, 0, 0), (1, 0, 0), (0, 1, 0), name="two")], [lamp((1, 0.5, 1))])


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_what_looks_away_from_all_light_is_named(target):
    floor, away = (
        rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), name="floor"),
        rectangle((2, 0, 0), (0, 1, 0), (1, 0, 0), name="away"),
    )
    (warning,) = warnings_of(scene_of([floor, away], [lamp((1, 0.5, 1))]), target=target)
    assert "object away:" in warning
    assert "normals" in warning


def test_a_scene_without_light_says_nothing_of_it():
    assert warnings_of(replace(two_floors(), lights=())) == ()


def test_a_ground_plane_that_leaves_no_texels_is_named():
    ground = rectangle((-500, -500, 0), (1000, 0, 0), (0, 1000, 0), name="ground")
    tables = [rectangle((2 * k, 0, 1), (1, 0, 0), (0, 1, 0), name=f"table {k}") for k in range(3)]
    (warning,) = warnings_of(scene_of([ground, *tables], [lamp((1, 0.5, 30), intensity=(1e4,) * 3)]))
    assert warning.startswith("object ground: takes ")


SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        (0.1 + 0.3 * SQUARE, 0.6 + 0.3 * SQUARE, None),
        (0.1 + 0.3 * SQUARE, 0.1 + 0.3 * SQUARE, "object two: the UV layer 'Lightmap' overlaps"),
        (0.1 + 0.3 * SQUARE, 0.6 + 0 * SQUARE, "object two: the UV layer 'Lightmap' has no area"),
    ],
)
def test_kept_uvs_that_do_not_fit_are_named(first, second, said):
    found = warnings_of(with_uvs(two_floors(), first, second), keep_uvs=True)
    assert found == () if said is None else any(warning.startswith(said) for warning in found)
