"""The light of a scene does not hang on where it stands, how it is turned, its unit of length, or its numbering."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.bake import bake
from addon.core.scene import AreaLight, PointLight, Scene
from addon.core.settings import BakeSettings
from tests.scenes import moved, random_rotation, room_with_occluder

LAMPS = (
    PointLight("lamp", (0.3, 0.4, 1.7), (5.0, 4.0, 3.0), radius=0.05),
    AreaLight("panel", (0.5, 0.5, 1.9), (0, 0.2, 0), (0.2, 0, 0), (3.0, 3.0, 4.0)),
)
ERROR = 0.05


def room(lamps=LAMPS):
    return room_with_occluder(lamps, is_open=False)


def colours(scene, seed=0, **settings):
    """Corner colours (T, 3, 3) and the stated error."""
    width = np.linalg.norm(np.diff(scene.corners[0], axis=0), axis=1).min()  # of the room's first wall
    settings = {"target": "vertex", "error": ERROR, "patch_size": 0.15 * width, "threads": 2, **settings}
    result = bake(scene, BakeSettings(seed=seed, **settings))
    return result.corner_colours.astype(np.float64), result.report.estimated_error


def relative_rms(first, second):
    """As the report's error is defined: of E over E + 0.3 median E."""
    return np.sqrt(np.mean(((first - second) / (first + 0.3 * np.median(first))) ** 2))


@pytest.fixture(scope="module")
def seeds():
    """How much two seeds differ: by this much may two bakes of one scene."""
    values = [colours(room(), seed)[0] for seed in (1, 2, 3)]
    noise = max(relative_rms(values[a], values[b]) for a, b in ((0, 1), (0, 2), (1, 2)))
    return values[0], noise


@pytest.mark.parametrize("exponent", [-10, 10])
def test_another_unit_of_length_by_a_power_of_two_gives_the_same_light(seeds, exponent):
    values, _ = colours(moved(room(), scale=2.0**exponent), 1)
    # no length is special and powers of two round nothing: only logarithms and the like may
    assert values == pytest.approx(seeds[0], rel=1e-3)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_a_model_in_millimetres_or_kilometres_gives_the_same_light(seeds, scale):
    values, _ = colours(moved(room(), scale=scale), 1)
    # rounding may send single rays past an edge; nothing larger than what another seed would do
    assert relative_rms(seeds[0], values) < seeds[1]


def test_a_hundred_kilometres_from_the_origin_the_light_is_the_same(seeds):
    values, _ = colours(moved(room(), offset=(1e5, -2e5, 1e5)), 1)
    # doubles hold 1e-11 m there, and the kernel re-centres them before they become floats
    assert relative_rms(seeds[0], values) < seeds[1] / 2


@pytest.mark.parametrize("seed", range(3))
def test_a_turned_scene_gives_the_same_light(seeds, seed):
    values, _ = colours(moved(room(), random_rotation(np.random.default_rng(seed)), offset=(1e3, 0, 5)), 1)
    # other directions, so other samples: two bakes that are ERROR off at the most, and not the same way
    assert relative_rms(seeds[0], values) < 2**0.5 * ERROR
    assert values.mean() == pytest.approx(seeds[0].mean(), rel=0.02)


def test_the_order_of_triangles_does_not_matter(seeds):
    scene = room()
    order = np.concatenate([np.random.default_rng(0).permutation(o.count) + o.first for o in scene.objects])
    arrays = {
        name: getattr(scene, name)[order] for name in ("triangles", "corner_normals", "uvs", "triangle_materials")
    }
    values, _ = colours(replace(scene, **arrays), 1)
    back = np.empty_like(values)
    back[order] = values
    # other samples, so two bakes differ as two seeds do, which is one number of a chi distribution of many
    assert relative_rms(seeds[0], back) < 1.5 * seeds[1]


def test_twice_the_lamps_power_is_twice_the_light(seeds):
    lamps = tuple(
        replace(lamp, **{name: tuple(2 * np.array(getattr(lamp, name)))})
        for lamp, name in zip(LAMPS, ("intensity", "radiance"))
    )
    values, _ = colours(room(lamps), 1)
    # the same rays carry twice as much; a factor 2 rounds nothing, but thresholds near dark may
    assert values == pytest.approx(2 * seeds[0], rel=1e-3)


def test_the_light_of_two_lamps_is_the_sum_of_their_lights(seeds):
    alone = [colours(room((lamp,)), 1)[0] for lamp in LAMPS]
    # each of the three bakes has an error of its own
    assert relative_rms(seeds[0], alone[0] + alone[1]) < 1.5 * seeds[1]
    assert (alone[0] + alone[1]).mean() == pytest.approx(seeds[0].mean(), rel=0.02)


def test_channels_stand_for_themselves(seeds):
    """Red, green and blue exchanged in lamps come out exchanged; noise may differ, as rays go by luminance."""
    lamps = tuple(
        replace(lamp, **{name: tuple(np.array(getattr(lamp, name))[::-1])})
        for lamp, name in zip(LAMPS, ("intensity", "radiance"))
    )
    values, _ = colours(room(lamps), 1)
    assert relative_rms(seeds[0], values[..., ::-1]) < 1.5 * seeds[1]


def test_two_seeds_differ_by_what_is_stated(seeds):
    _, stated = colours(room(), 1)
    # vertices average several receivers, so they are better than the estimate, and never worse by half
    assert 0 < seeds[1] / np.sqrt(2) < 1.5 * max(stated, ERROR / 5)


def test_an_object_elsewhere_that_lights_and_hides_nothing_changes_nothing_but_noise(seeds):
    scene = room()
    assert isinstance(scene, Scene)
    far = room_with_occluder((), is_open=False)
    shifted = moved(far, offset=(5.0, 0, 0))
    both = Scene(
        vertices=np.concatenate([scene.vertices, shifted.vertices]),
        triangles=np.concatenate([scene.triangles, shifted.triangles + np.int32(len(scene.vertices))]),
        corner_normals=np.concatenate([scene.corner_normals, shifted.corner_normals]),
        uvs=np.concatenate([scene.uvs, shifted.uvs]),
        triangle_materials=np.concatenate([scene.triangle_materials, shifted.triangle_materials]),
        objects=(
            *scene.objects,
            *(replace(o, first=o.first + len(scene.triangles), name=f"far {o.name}") for o in shifted.objects),
        ),
        materials=scene.materials,
        lights=scene.lights,
    )
    values, _ = colours(both, 1, patch_size=0.15)
    count = len(scene.triangles)
    # the other room is closed: no light gets in
    assert (values[count:] == 0).all()
    assert relative_rms(seeds[0], values[:count]) < 1.5 * seeds[1]
