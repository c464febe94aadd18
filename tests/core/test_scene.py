"""A scene's arrays are checked once, at its birth; pi stands in two functions."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.scene import Material, SceneError, SceneObject, exitance_from_radiance, radiance_from_exitance
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


@pytest.mark.parametrize("name", ["vertices", "corner_normals"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused_with_their_row(name, bad):
    scene = closed_box()
    numbers = getattr(scene, name).copy()
    numbers[3] = bad
    with pytest.raises(SceneError, match=rf"{name}\[3\] is not finite"):
        replace(scene, **{name: numbers})


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
