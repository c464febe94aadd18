"""Shading normals over edges that are none of a smooth surface, against the shapes that they are of."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.shading_normals import without_steep_normals
from addon.core.sound_faces import sound_faces
from addon.core.triangles import area_vectors, unit_normals
from tests.core.meshes import box, rough_sheet, scene_of, sphere


def prism(sides, height=1.0):
    """A prism of many sides about the z axis, with a polygon at either end."""
    turns = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    after = np.roll(np.arange(sides), -1)
    faces = [(k, a, sides + a, sides + k) for k, a in enumerate(after)]
    faces += [tuple(range(sides, 2 * sides)), tuple(range(sides))[::-1]]
    return np.concatenate([ring, ring + np.array([0, 0, height])]), faces


def shaded_smooth(*meshes):
    """All corners of a vertex with the mean of all faces about it, as Shade Smooth has them, by area."""
    scene = scene_of(*meshes)
    vectors = np.repeat(area_vectors(scene.corners), 3, axis=0)
    sums = np.zeros_like(scene.vertices)
    np.add.at(sums, scene.triangles.ravel(), vectors)
    sums /= np.linalg.norm(sums, axis=1, keepdims=True)
    return replace(scene, corner_normals=sums[scene.triangles].astype(np.float32))


def flat_normals(scene):
    return np.repeat(unit_normals(scene.corners)[:, None], 3, axis=1)


def test_a_box_that_is_shaded_smooth_is_a_box():
    scene = shaded_smooth(box())
    normals, is_changed = without_steep_normals(scene)
    assert normals == pytest.approx(flat_normals(scene), abs=1e-6)  # float32
    assert is_changed.all()


@pytest.mark.parametrize("sides", [6, 32])
def test_a_prism_has_round_sides_and_flat_ends(sides):
    scene = shaded_smooth(prism(sides))
    normals, _ = without_steep_normals(scene)
    is_end = np.abs(unit_normals(scene.corners)[:, 2]) > 0.5
    assert normals[is_end] == pytest.approx(flat_normals(scene)[is_end], abs=1e-6)
    out = scene.corners[~is_end] * (1, 1, 0)
    # one triangle of a quad has its whole angle at a corner, and two have half of it each: any two sides weigh the same
    assert normals[~is_end] == pytest.approx(out / np.linalg.norm(out, axis=2, keepdims=True), abs=1e-6)


@pytest.mark.parametrize("mesh", [sphere(), rough_sheet(np.random.default_rng(0), height=0.1)], ids=["ball", "sheet"])
def test_what_is_smooth_keeps_its_normals_to_the_bit(mesh):
    scene = shaded_smooth(mesh)
    normals, is_changed = without_steep_normals(scene)
    assert normals is scene.corner_normals
    assert not is_changed.any()


def test_faces_that_are_shaded_flat_stay_flat():
    """A box of which one side only is shaded smooth."""
    scene = shaded_smooth(box())
    flat = flat_normals(scene).astype(np.float32)
    flat[:2] = scene.corner_normals[:2]
    normals, is_changed = without_steep_normals(replace(scene, corner_normals=flat))
    assert is_changed.tolist() == [True] * 2 + [False] * 10
    assert (normals[2:] == flat[2:]).all()


def test_normals_that_stand_for_the_face_are_left():
    scene = scene_of(box())  # all are 0
    normals, is_changed = without_steep_normals(scene)
    assert normals is scene.corner_normals
    assert not is_changed.any()


def test_many_faces_about_a_vertex_and_many_vertices_are_no_more_than_their_sum(monkeypatch):
    """A cone of a thousand sides, of which the tip has no normal; the same in parts as at once."""
    sides = 1000
    points, _ = prism(sides)
    cone = np.concatenate([points[:sides], [(0, 0, 3)]]), [(k, (k + 1) % sides, sides) for k in range(sides)]
    scene = shaded_smooth(cone, box(centre=(5, 0, 0)))
    normals, is_changed = without_steep_normals(scene)
    flat = flat_normals(scene)
    # fifteen degrees from the axis the sides' mean at the tip is the axis itself: each side keeps its own there
    assert normals[:sides, 2] == pytest.approx(flat[:sides, 2], abs=1e-6)
    assert normals[sides:] == pytest.approx(flat[sides:], abs=1e-6)
    assert is_changed.all()
    monkeypatch.setattr("addon.core.shading_normals.AT_ONCE", 7)
    assert (without_steep_normals(scene)[0] == normals).all()


def test_it_is_told_and_of_which_object():
    told = "shading normals more than 40 degrees off a face, as over sharp edges: they are baked with those of the "
    smooth = shaded_smooth(box(), sphere(centre=(3, 0, 0)))
    (warning,) = sound_faces(smooth).scene.warnings
    assert warning.startswith(f"object object 0: 12 triangles have {told}")
    many = shaded_smooth(*(box(centre=(3 * k, 0, 0)) for k in range(5)))
    (warning,) = sound_faces(many).scene.warnings
    assert warning.startswith(f"objects object 0, object 1, object 2 and 2 more: 60 triangles have {told}")


def test_what_is_not_baked_is_left_and_not_told():
    smooth = shaded_smooth(box(), sphere(centre=(3, 0, 0)))
    others = replace(smooth, objects=(replace(smooth.objects[0], is_target=False), smooth.objects[1]))
    assert sound_faces(others).scene.warnings == ()
    assert without_steep_normals(others)[0] is others.corner_normals


@pytest.mark.parametrize("others", ["flat", "parted"])
def test_faces_that_were_parted_are_not_smoothed_together(others):
    """Of a prism of eight sides one is smooth over its rims, beside flat ones, or all are, parted by sharp edges."""
    scene = scene_of(prism(8))
    flat = flat_normals(scene)
    # each side has the mean of itself and the end that it meets
    ends = np.sign(scene.corners[..., 2:] - 0.5) * (0, 0, 1)
    smooth = slice(0, 2 if others == "flat" else 16)
    normals = np.array(flat)
    normals[smooth] = (flat[smooth] + ends[smooth]) / 2**0.5
    found, is_changed = without_steep_normals(replace(scene, corner_normals=normals.astype(np.float32)))
    assert is_changed[smooth].all()
    assert found == pytest.approx(flat, abs=1e-6)
