"""Unwrap: every triangle has a place of its own, polygons whole, true to scale, in no more texels than asked."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.core.charts import FlatCharts
from addon.core.packing import Surface, pack
from addon.core.scene import SceneError
from addon.core.settings import BakeSettings, SettingsError
from addon.core.texels import texels
from addon.core.unwrap import unwrap
from tests.core.atlas_laws import areas, assert_loops_have_one_uv, assert_places_are_sound, charts_per_texel_ring
from tests.core.meshes import box, rough_sheet, scene_of, sphere


def room(seed=0):
    """A few objects of many sizes: what an interior is made of."""
    rng = np.random.default_rng(seed)
    return scene_of(box((4, 3, 2.5)), sphere(0.4), box((0.02, 1, 0.02)), rough_sheet(rng), box((1, 1, 1), (9, 0, 0)))


def soup(rng, count, size):
    """Triangles that share corners at random: non-manifold, doubled and degenerate ones among them."""
    points = rng.normal(0, size, (count + 2, 3))
    return points, [tuple(rng.integers(0, len(points), 3)) for _ in range(count)]


def edge_lengths(corners):
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def test_a_furnished_room_is_unwrapped_soundly():
    scene = room()
    charts = unwrap(scene, BakeSettings(texels=1 << 16))
    assert_places_are_sound(scene, charts, np.random.default_rng(1))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.sampled_from([1e-3, 1.0, 1e4]), st.integers(12, 17))
def test_any_mesh_is_unwrapped_soundly(seed, count, size, exponent):
    rng = np.random.default_rng(seed)
    scene = scene_of(soup(rng, count, size), soup(rng, 7, 1.0), box((1, 2, 3)))
    charts = unwrap(scene, BakeSettings(texels=1 << exponent))
    assert charts.width * charts.height <= 1 << exponent
    assert_places_are_sound(scene, charts, rng)
    assert charts_per_texel_ring(scene, charts) == 0


def test_a_free_texel_lies_between_charts():
    scene = room()
    assert charts_per_texel_ring(scene, unwrap(scene, BakeSettings(texels=1 << 15))) == 0


@pytest.mark.parametrize("count", [1 << 12, 100_000, 1 << 18])
def test_the_size_is_at_most_what_was_asked_and_near_it(count):
    charts = unwrap(room(), BakeSettings(texels=count))
    assert 0.9 * count <= charts.width * charts.height <= count


def test_boxes_fill_most_of_the_lightmap():
    scene = scene_of(*(box((1, 1 + k / 10, 2), (5 * k, 0, 0)) for k in range(20)))
    charts = unwrap(scene, BakeSettings(texels=1 << 18))
    # 120 rectangles of about 50 x 45 texels: gutters take 5 %, a good packing leaves a tenth
    assert len(texels(charts)) > 0.85 * charts.width * charts.height


@pytest.mark.parametrize("density", [3.0, 40.0])
def test_density_is_texels_per_metre(density):
    scene = scene_of(box((2, 3, 4)), sphere(1.0), box((0.5, 0.5, 0.01)))
    charts = unwrap(scene, BakeSettings(density=density))
    ratio = edge_lengths(charts.uvs) / (density * edge_lengths(scene.corners))
    flat = np.zeros(len(scene.triangles), bool)
    flat[scene.objects[0].span] = flat[scene.objects[2].span] = True
    # plane charts are exact, but for UVs stored as float32 in an atlas a few hundred texels wide
    assert ratio[flat] == pytest.approx(1, abs=2e-3)
    # a sphere cannot be flattened true to scale
    assert np.median(ratio) == pytest.approx(1, abs=0.01)


def test_too_dense_a_lightmap_is_refused():
    with pytest.raises(SettingsError, match="density is 1e\\+06 texels/m: the lightmap would have"):
        unwrap(scene_of(box()), BakeSettings(density=1e6))


def test_too_few_texels_for_the_charts_are_refused():
    boxes = [box(centre=(2 * k, 0, 0)) for k in range(20)]
    with pytest.raises(SettingsError, match="texels is 64: 120 charts of the target objects need at least"):
        unwrap(scene_of(*boxes), BakeSettings(texels=64))


def test_bent_polygons_stay_whole():
    rng = np.random.default_rng(3)
    # a fan of a star that is bent out of its plane: xatlas sees triangles that it would part
    angle = 2 * np.pi * np.arange(10) / 10
    star = np.stack([np.cos(angle), np.sin(angle), 0.8 * rng.normal(size=10)], axis=1)
    scene = scene_of((star, [tuple(range(10))]), rough_sheet(rng, 5, 1.5), box())
    charts = unwrap(scene, BakeSettings(texels=1 << 14))
    for obj in scene.objects:
        for polygon in np.unique(obj.polygons):
            assert len(np.unique(charts.charts[obj.span][obj.polygons == polygon])) == 1
    assert_loops_have_one_uv(scene, charts)


def test_a_triangle_without_an_area_follows_its_polygon():
    # a quad with a fifth corner on its edge: one triangle of the fan is a line
    points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)]
    scene = scene_of((points, [(0, 1, 2, 3, 4)]))
    assert areas(scene)[0] == 0
    charts = unwrap(scene, BakeSettings(texels=1 << 12))
    assert (charts.charts == 0).all()
    # in the middle of the edge, to float32
    first, middle, last = charts.uvs[0].astype(float)
    assert middle == pytest.approx((first + last) / 2, abs=1e-4)


def test_other_objects_get_no_place():
    scene = scene_of(box(), box((2, 2, 2)), targets={1})
    charts = unwrap(scene, BakeSettings(texels=1 << 12))
    assert np.isnan(charts.uvs[:12]).all()
    assert (charts.charts[12:] >= 0).all()


@pytest.mark.parametrize(
    "scene",
    [
        scene_of(box(), targets=set()),
        scene_of(([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])),
    ],
    ids=["no target", "no area"],
)
def test_nothing_to_bake_is_said(scene):
    with pytest.raises(SceneError, match="nothing to bake"):
        unwrap(scene, BakeSettings())


def test_huge_and_tiny_and_doubled_things_together():
    points, faces = box((1e-3, 1e-3, 1e-3), (5e3, 0, 0))
    scene = scene_of(box((1e4, 1e4, 1e4)), (points, faces + faces), ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
    charts = unwrap(scene, BakeSettings(texels=1 << 14))
    assert_places_are_sound(scene, charts, np.random.default_rng(0))


def test_needles_get_a_texel():
    scene = scene_of(([(0, 0, 0), (10, 0, 0), (10, 1e-7, 0)], [(0, 1, 2)]), box())
    charts = unwrap(scene, BakeSettings(texels=1 << 12))
    assert (texels(charts).triangles == 0).any()
    assert_places_are_sound(scene, charts, np.random.default_rng(0))


def test_many_objects():
    scene = scene_of(*(box((1, 1, 0.1 + k % 7), (3 * k, 0, 0)) for k in range(850)))
    charts = unwrap(scene, BakeSettings(texels=1 << 18))
    assert len(np.unique(charts.charts)) == 850 * 6
    assert_places_are_sound(scene, charts, np.random.default_rng(0))


def test_same_input_same_bytes():
    runs = [unwrap(room(), BakeSettings(texels=1 << 15)) for _ in range(3)]
    for other in runs[1:]:
        assert other.uvs.tobytes() == runs[0].uvs.tobytes()
        assert other.charts.tobytes() == runs[0].charts.tobytes()


def test_a_large_atlas_is_packed_in_blocks():
    scene = scene_of(*(box((1, 1 + k / 10, 2), (5 * k, 0, 0)) for k in range(4)))
    charts = unwrap(scene, BakeSettings(texels=3000 * 3000))
    assert charts.width > 2048
    assert charts_per_texel_ring(scene, charts) == 0
    assert_places_are_sound(scene, charts, np.random.default_rng(0))


def test_a_small_chart_finds_the_hole_of_a_large_one():
    # a frame 20 m wide with a border of 1 m, and a plate that fits into its opening
    frame = [[(0, 0), (20, 0), (20, 1)], [(0, 0), (20, 1), (0, 1)], [(0, 19), (20, 19), (20, 20)]]
    frame += [[(0, 19), (20, 20), (0, 20)], [(0, 0), (1, 0), (1, 20)], [(0, 0), (1, 20), (0, 20)]]
    frame += [[(19, 0), (20, 0), (20, 20)], [(19, 0), (20, 20), (19, 20)]]
    plate = [[(0, 0), (12, 0), (12, 12)], [(0, 0), (12, 12), (0, 12)]]
    flat = FlatCharts(np.arange(10), np.array(frame + plate, float), np.array([0, 8, 10], np.int32))
    packed = pack(Surface(flat, ()), 10, BakeSettings(density=1.0))
    # the rows of the frame are all there are: 20 m, begun and ended within a texel
    assert packed.height == 22
    inside = packed.uvs[8:].reshape(-1, 2)
    assert ((inside > 2) & (inside < 19)).all()


def keeping(uvs):
    scene = scene_of(([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)]))
    kept = None if uvs is None else np.float32(uvs)
    return replace(scene, objects=(replace(scene.objects[0], lightmap_uvs=kept),))


KEEP = BakeSettings(texels=100, keep_uvs=True)
LEFT, RIGHT = [[0, 0], [0.5, 0], [0.5, 0.5]], [[0.6, 0.6], [1, 1], [0.6, 1]]


def test_kept_uvs_decide():
    charts = unwrap(keeping([LEFT, RIGHT]), KEEP)
    assert (charts.width, charts.height) == (10, 10)
    # ten texels to the unit, in float32
    assert charts.uvs == pytest.approx(10 * np.array([LEFT, RIGHT]), abs=1e-5)
    assert charts.charts.tolist() == [0, 1]


def test_kept_uvs_that_hang_together_are_one_chart():
    charts = unwrap(keeping([LEFT, [[0, 0], [0.5, 0.5], [0, 0.5]]]), KEEP)
    assert charts.charts.tolist() == [0, 0]


def test_a_density_decides_how_many_texels_kept_uvs_lie_in():
    """A square metre in a quarter of the layout: 20 texels a metre are 400 there and 1600 in all."""
    charts = unwrap(keeping([LEFT, [[0, 0], [0.5, 0.5], [0, 0.5]]]), replace(KEEP, density=20))
    assert (charts.width, charts.height) == (40, 40)
    with pytest.raises(SettingsError, match="density is 1e\\+06 texels/m"):
        unwrap(keeping([LEFT, RIGHT]), replace(KEEP, density=1e6))
    without_area = np.zeros((2, 3, 2))
    with pytest.raises(SceneError, match="have no area"):
        unwrap(keeping(without_area), replace(KEEP, density=20))


@pytest.mark.parametrize(
    ("uvs", "message"),
    [
        (None, 'object object 0 has no UV layer "Lightmap" to keep'),
        ([LEFT, [[0, 0], [1.5, 0], [0, 1]]], "leaves the square from 0 to 1 on 1 of 2 triangles"),
        ([LEFT, [[0, 0], [np.nan, 0], [0, 1]]], "leaves the square from 0 to 1 on 1 of 2 triangles"),
    ],
)
def test_uvs_that_cannot_be_kept_are_refused(uvs, message):
    with pytest.raises(SceneError, match=message):
        unwrap(keeping(uvs), KEEP)


def test_missing_xatlas_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "xatlas", None)
    with pytest.raises(SettingsError, match="unwrapping needs the package xatlas"):
        unwrap(scene_of(box()), BakeSettings())


def test_progress_rises_and_can_stop_the_work():
    heard = []
    unwrap(scene_of(box()), BakeSettings(texels=1 << 12), heard.append)
    assert heard == sorted(heard)
    assert heard[-1] == 1.0

    def stop(done):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        unwrap(scene_of(box()), BakeSettings(texels=1 << 12), stop)
