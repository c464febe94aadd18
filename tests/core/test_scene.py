"""A scene's arrays are checked once, at its birth; pi stands in two functions."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.environment import Environment
from addon.core.scene import (
    Material,
    PointLight,
    SceneError,
    SceneObject,
    SunLight,
    Texture,
    exitance_from_radiance,
    radiance_from_exitance,
)
from tests.scenes import closed_box, cornell_box


def test_exitance_is_radiance_over_the_cosine_hemisphere_and_back():
    assert exitance_from_radiance((1, 2, 0)) == pytest.approx([np.pi, 2 * np.pi, 0])
    assert radiance_from_exitance(exitance_from_radiance([0.3])) == pytest.approx([0.3])


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("vertices", lambda a: a.astype(np.float32)),
        ("vertices", lambda a: a[:, :2]),
        ("vertices", lambda a: a.tolist()),
        ("triangles", lambda a: a.astype(np.int64)),
        ("triangles", lambda a: a[:, :2]),
        ("corner_normals", lambda a: a[:-1]),
        ("uvs", lambda a: a.astype(np.float64)),
        ("triangle_materials", lambda a: a[1:]),
    ],
)
def test_arrays_of_another_type_or_shape_are_refused_by_name(name, change):
    scene = closed_box()
    with pytest.raises(SceneError, match=f"^{name}: expected"):
        replace(scene, **{name: change(getattr(scene, name))})


@pytest.mark.parametrize("name", ["triangles", "triangle_materials"])
@pytest.mark.parametrize("bad", [-1, 99])
def test_indices_out_of_range_are_refused_with_their_row(name, bad):
    scene = closed_box()
    indices = getattr(scene, name).copy()
    indices[5] = bad
    with pytest.raises(SceneError, match=rf"{name}\[5\]"):
        replace(scene, **{name: indices})


NUMBERS_OUT_OF_RANGE = [
    (Material, {"reflectance": (0.5, 1.5, 0.5)}, "material it: reflectance"),
    (Material, {"reflectance": (np.nan, 0.5, 0.5)}, "material it: reflectance"),
    (Material, {"radiance": (-1.0, 0.0, 0.0)}, "material it: radiance"),
    (
        Material,
        {"radiance": (0.0, 1e8, 0.0), "radiance_texture": Texture("image", np.full((1, 1, 3), 1e8, np.float32))},
        "material it: radiance times its texture is \\(0, 1e\\+16, 0\\): allowed is 0 ... 1e\\+15",
    ),
    (Material, {"transmittance": (0.0, 2.0, 0.0)}, "material it: transmittance"),
    (PointLight, {"position": (0, 0, np.inf), "intensity": (1, 1, 1)}, "light it: position"),
    (PointLight, {"position": (0, 0, 0), "intensity": (1, 1e30, 1)}, "light it: intensity"),
    (PointLight, {"position": (0, 0, 0), "intensity": (1, 1, 1), "radius": -1.0}, "light it: radius"),
    (PointLight, {"position": (0, 0, 0), "intensity": (1, 1, 1), "direction": (0, 0, 0)}, "light it: direction"),
    (PointLight, {"position": (0, 0), "intensity": (1, 1, 1)}, "light it: position"),
    (SunLight, {"direction": (np.nan, 0, 1), "irradiance": (1, 1, 1)}, "light it: direction"),
    (SunLight, {"direction": (0, 0, 1), "irradiance": (1, 1, 1), "angle": 7.0}, "light it: angle"),
    (Texture, {"pixels": np.full((1, 1, 3), np.nan, np.float32)}, "image it: 1 pixels"),
    (Texture, {"pixels": np.zeros((0, 1, 3), np.float32)}, "image it: expected"),
    (Texture, {"pixels": np.zeros((1, 1, 3))}, "image it: expected"),
    (Environment, {"pixels": np.full((1, 2, 3), -1.0, np.float32)}, "environment it: 2 pixels"),
    (Environment, {"pixels": np.ones((1, 2, 3), np.float32), "to_image": 2 * np.eye(3)}, "it: to_image is not a rot"),
]


@pytest.mark.parametrize(("kind", "fields", "message"), NUMBERS_OUT_OF_RANGE)
def test_numbers_out_of_range_are_refused_with_their_owner(kind, fields, message):
    with pytest.raises(SceneError, match=message):
        kind("it", **fields)


def test_an_environment_may_not_be_brighter_than_light_may_be():
    sky = Environment("sky", np.full((1, 2, 3), 1e8, np.float32))
    with pytest.raises(SceneError, match=r"the world: radiance times its environment is \(1e\+16, 0, 0\)"):
        replace(closed_box(), world_radiance=(1e8, 0.0, 0.0), environment=sky)


def test_arrays_of_an_object_have_a_row_a_triangle():
    with pytest.raises(SceneError, match="object it: polygons: expected"):
        SceneObject("it", 0, 2, polygons=np.zeros(3, np.int32))


def test_objects_are_runs_without_gaps():
    scene = closed_box()
    with pytest.raises(SceneError, match="object late starts at triangle 1: expected 0"):
        replace(scene, objects=(SceneObject("late", 1, 11),))
    with pytest.raises(SceneError, match="11 of 12"):
        replace(scene, objects=(SceneObject("short", 0, 11),))


def test_spans_pick_an_objects_triangles():
    scene = cornell_box()
    assert sum(obj.count for obj in scene.objects) == len(scene.triangles)
    block = scene.objects[3]
    assert block.name == "tall block"
    assert scene.corners[block.span].reshape(-1, 3).max(axis=0) == pytest.approx((0.45, 0.8, 0.6))


def test_what_emits_and_what_transmits():
    assert not Material("plain").emits
    assert not Material("plain").transmits
    assert Material("lamp", radiance=(0, 0, 1)).emits
    assert Material("pane", transmittance=(0, 0.1, 0)).transmits
