"""Objects that share a mesh: one layout of UVs, a place for each, and no texel that two of them look up."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.core.scene import SceneError
from addon.core.settings import BakeSettings
from addon.core.sound_faces import sound_faces
from addon.core.unwrap import unwrap
from tests.core.atlas_laws import areas, assert_places_are_sound, charts_per_texel_ring
from tests.core.meshes import box, rough_sheet, scene_of, sphere
from tests.core.test_unwrap import edge_lengths

ROUNDING = 1e-5  # of a block that may be a hundredth of the atlas: float32 UVs have 6e-8 of the atlas


def moved(mesh, scale=1.0, offset=(0.0, 0.0, 0.0)):
    points, faces = mesh
    return np.asarray(points) * scale + offset, faces


def sharing(scene, *groups):
    """The scene, in which the objects of each group have one mesh."""
    names = {number: f"mesh {k}" for k, group in enumerate(groups) for number in group}
    objects = (replace(obj, mesh=names.get(number)) for number, obj in enumerate(scene.objects))
    return replace(scene, objects=tuple(objects))


def mesh_uvs(charts, obj):
    """The UVs that the object's mesh has to have, by face corner (loops, 2)."""
    scale, offset = np.split(np.array(charts.rects[obj.name]), 2)
    out = np.full((obj.corners.max() + 1, 2), np.nan)
    out[obj.corners] = (charts.uvs[obj.span] - offset) / scale
    return out


def assert_layouts_are_shared(scene, charts):
    layouts = {}
    for obj in scene.objects:
        if obj.name in charts.rects:
            layouts.setdefault(obj.mesh, []).append(mesh_uvs(charts, obj))
    for first, *others in layouts.values():
        assert first.min() >= -ROUNDING
        assert first.max() <= 1 + ROUNDING
        for other in others:
            np.testing.assert_allclose(other, first, atol=ROUNDING)
    return layouts


def chairs():
    """Three alike, one of them turned, and a table of its own."""
    turned = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    points, faces = sphere(0.4)
    other = points @ turned.T + np.array([2, 0, 0])
    return scene_of((points, faces), (other, faces), moved((points, faces), 1.0, (0, 3, 0)), box((1, 2, 0.1)))


def test_alike_objects_have_one_layout_and_places_of_their_own():
    scene = sharing(chairs(), (0, 1, 2))
    charts = unwrap(scene, BakeSettings(texels=1 << 15))
    assert_places_are_sound(scene, charts, np.random.default_rng(0))
    assert charts_per_texel_ring(scene, charts) == 0
    assert set(charts.rects) == {"object 0", "object 1", "object 2"}
    assert len(assert_layouts_are_shared(scene, charts)["mesh 0"]) == 3
    sizes = {rect[:2] for rect in charts.rects.values()}
    assert len(sizes) == 1


def test_shared_meshes_are_as_dense_as_others():
    # a turned copy is as large: 40 texels a metre for all, a block's gutter for each
    scene = sharing(chairs(), (0, 1, 2))
    charts = unwrap(scene, BakeSettings(density=40.0))
    ratio = edge_lengths(charts.uvs) / (40.0 * edge_lengths(scene.corners))
    for obj in scene.objects[:3]:
        # a sphere cannot be flattened true to scale
        assert np.median(ratio[obj.span]) == pytest.approx(1, abs=0.02)
    assert ratio[scene.objects[3].span] == pytest.approx(1, abs=2e-3)


def test_sharing_costs_few_texels():
    alone = unwrap(chairs(), BakeSettings(texels=1 << 16))
    scene = sharing(chairs(), (0, 1, 2))
    shared = unwrap(scene, BakeSettings(texels=1 << 16))
    assert shared.width * shared.height <= 1 << 16

    def density(charts):
        return np.median(edge_lengths(charts.uvs) / edge_lengths(scene.corners))

    # blocks are rectangles around charts that would else lie closer, three of them
    assert density(shared) > 0.85 * density(alone)


@pytest.mark.parametrize("sides", [(1, 1), (1.57, 0.76, 0.37), (1, 0.5)])
def test_few_boxes_fill_the_lightmap_as_single_users_do(sides):
    scene = scene_of(*(moved(box(), side, (3 * k, 0, 0)) for k, side in enumerate(sides)))
    densities = []
    for charts in (unwrap(each, BakeSettings(texels=1 << 16)) for each in (scene, sharing(scene, range(len(sides))))):
        lengths = edge_lengths(charts.uvs) / edge_lengths(scene.corners)
        densities.append(np.average(lengths.mean(axis=1), weights=areas(scene)))
    # blocks for rectangles of 2 to 1 and the like, one of which leaves a corner of the atlas free
    assert densities[1] > 0.85 * densities[0]


def test_a_copy_has_texels_by_its_own_size():
    # a large one, one of half its size, and a speck of a hundredth
    scene = sharing(
        scene_of(
            box((4, 4, 2)), moved(box((4, 4, 2)), 0.5, (9, 0, 0)), moved(box((4, 4, 2)), 0.01, (9, 9, 0))
        ),
        (0, 1, 2),
    )  # fmt: skip
    charts = unwrap(scene, BakeSettings(density=50.0))
    assert_places_are_sound(scene, charts, np.random.default_rng(0))
    assert charts_per_texel_ring(scene, charts) == 0
    ratio = [np.median((edge_lengths(charts.uvs) / edge_lengths(scene.corners))[obj.span]) for obj in scene.objects]
    assert ratio[0] == pytest.approx(50, rel=1e-3)
    assert 50 * 0.999 < ratio[1] < 100
    taken = [np.prod(rect[:2]) for rect in charts.rects.values()]
    assert taken[1] < 0.3 * taken[0]
    # smaller gutters in the smallest would be larger ones in the others
    assert taken[2] < 0.1 * taken[0]


def test_a_layout_has_room_for_what_each_copy_needs_most():
    # one cube as floor, wall and post: each has its long sides elsewhere
    sizes = [(6, 6, 0.2), (6, 0.2, 3), (0.2, 0.2, 3)]
    scene = sharing(scene_of(*(moved(box(), size, (10 * k, 0, 0)) for k, size in enumerate(sizes))), (0, 1, 2))
    charts = unwrap(scene, BakeSettings(density=30.0))
    assert_places_are_sound(scene, charts, np.random.default_rng(0))
    assert_layouts_are_shared(scene, charts)
    own = areas(scene)
    flat = np.abs(np.cross(charts.uvs[:, 1] - charts.uvs[:, 0], charts.uvs[:, 2] - charts.uvs[:, 0])) / 2
    for obj in scene.objects:
        # by its surface, an object has about the texels that it would have alone: no less than two thirds
        mean = np.average(np.sqrt(flat[obj.span] / own[obj.span]), weights=own[obj.span])
        assert mean > 30 * 2 / 3
    # the post, 1/30 of the floor's surface, is not given a floor's texels
    taken = [np.prod(rect[:2]) for rect in charts.rects.values()]
    assert min(taken) < 0.3 * max(taken)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 6), st.sampled_from([1.0, 1e3]), st.integers(13, 17))
def test_copies_of_any_scale_lie_soundly(seed, count, spread, exponent):
    rng = np.random.default_rng(seed)
    sheet = rough_sheet(rng, 4, 1.0)
    scales = spread ** rng.uniform(-0.5, 0.5, (count, 3)) * rng.choice([-1, 1], (count, 3))
    meshes = [moved(sheet, scale, 5 * rng.normal(size=3)) for scale in scales]
    boxes = [moved(box(), scale, 5 * rng.normal(size=3)) for scale in scales[:2]]
    scene = scene_of(*meshes, *boxes, box((1, 2, 3)))
    scene = sharing(scene, range(count), (count, count + 1))
    charts = unwrap(scene, BakeSettings(texels=1 << exponent))
    assert charts.width * charts.height <= 1 << exponent
    assert_places_are_sound(scene, charts, rng)
    assert charts_per_texel_ring(scene, charts) == 0
    assert_layouts_are_shared(scene, charts)


def test_a_large_atlas_has_whole_blocks_of_copies():
    scene = sharing(scene_of(box((30, 20, 9)), moved(box(), 4.0), moved(box(), 4.0, (9, 0, 0))), (1, 2))
    charts = unwrap(scene, BakeSettings(texels=1 << 23))
    assert charts.width > 2048
    assert_layouts_are_shared(scene, charts)
    assert_places_are_sound(scene, charts, np.random.default_rng(0))


def test_who_alone_shows_a_mesh_needs_no_rectangle():
    scene = sharing(chairs(), (0,))
    assert unwrap(scene, BakeSettings(texels=1 << 14)).rects == {}
    scene = sharing(chairs(), (0, 1))
    objects = tuple(replace(obj, is_target=number != 1) for number, obj in enumerate(scene.objects))
    assert unwrap(replace(scene, objects=objects), BakeSettings(texels=1 << 14)).rects == {}


def test_a_mesh_without_face_corners_is_refused():
    with pytest.raises(SceneError, match="object object 0: one that shares a mesh needs polygons and corners"):
        replace(chairs().objects[0], mesh="mesh", corners=None)


def test_copies_that_lost_different_faces_are_refused():
    flat, thin = moved(box(), (1, 1, 0)), moved(box(), (1, 0, 1), (5, 0, 0))
    whole = sharing(scene_of(flat, thin, moved(box(), 1.0, (9, 0, 0))), (0, 1, 2))
    charts = unwrap(sound_faces(whole).scene, BakeSettings(texels=1 << 14))
    assert len(charts.rects) == 3
    with pytest.raises(SceneError, match=r"'object [01]' and 'object [01]' share a mesh, but not the faces"):
        unwrap(sound_faces(sharing(scene_of(flat, thin), (0, 1))).scene, BakeSettings(texels=1 << 14))
