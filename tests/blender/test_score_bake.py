"""Scores of a bake against a reference: the numbers by hand, and what is missing counts."""

import bpy
import numpy as np
import pytest

from addon import cli
from addon.blender.files import FileError
from addon.blender.score_bake import load_reference, score
from tests.cube_room import build_cube_room


def write_reference(path, irradiance, stderr=0.0):
    """A point in the middle of each loop triangle of the room, all with one irradiance and one standard error."""
    count = 12
    mesh = bpy.data.objects["room"].data
    mesh.calc_loop_triangles()
    corners = np.array([[mesh.vertices[v].co for v in t.vertices] for t in mesh.loop_triangles])
    np.savez(
        path, object=np.array(["room"] * count), triangle=np.arange(count), bary=np.full((count, 3), 1 / 3),
        position=corners.mean(axis=1), normal=np.zeros((count, 3)), irradiance=np.full((count, 3), irradiance),
        stderr=np.full((count, 3), stderr),
    )  # fmt: skip
    return path


@pytest.fixture
def baked(tmp_path):
    """A room whose lightmap is 2 / pi all over: E = 2."""
    room = build_cube_room()
    layer = room.data.uv_layers.new(name="Lightmap")
    layer.uv.foreach_set("vector", np.random.default_rng(0).random(2 * len(room.data.loops), np.float32))
    image = bpy.data.images.new("light", 8, 4, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.full(8 * 4 * 4, 2 / np.pi, np.float32))
    room["patchlight_lightmap"] = image
    return room


def test_what_is_right_has_no_error(baked, tmp_path):
    found = score(load_reference(write_reference(tmp_path / "r.npz", 2.0)))
    assert (found.error, found.bias, found.missing) == pytest.approx((0, 0, 0), abs=1e-6)
    assert found.points == 12


def test_the_error_is_relative_to_the_light_and_its_median(baked, tmp_path):
    found = score(load_reference(write_reference(tmp_path / "r.npz", 1.6)))
    assert found.error == pytest.approx(0.4 / (1.3 * 1.6), rel=1e-5)
    assert found.bias == pytest.approx(found.error)


def test_quantiles_tell_one_wrong_point_from_all(baked, tmp_path):
    irradiance = np.full((12, 1), 2.0)
    irradiance[5] = 1.6
    found = score(load_reference(write_reference(tmp_path / "r.npz", irradiance)))
    assert (found.p50, found.p95) == pytest.approx((0, 0.4 / (1.6 + 0.3 * 2)), abs=1e-6)


def test_the_noise_of_the_reference_is_taken_out(baked, tmp_path):
    found = score(load_reference(write_reference(tmp_path / "r.npz", 1.9, stderr=0.05)))
    assert found.error == pytest.approx((0.1**2 - 0.05**2) ** 0.5 / (1.3 * 1.9), rel=1e-5)


def test_what_is_not_baked_is_all_wrong(baked, tmp_path):
    del baked["patchlight_lightmap"]
    found = score(load_reference(write_reference(tmp_path / "r.npz", 2.0)))
    assert (found.error, found.missing) == (1, 1)


@pytest.mark.parametrize("content", [b"", b"no archive"])
def test_a_bad_reference_is_named(tmp_path, content):
    path = tmp_path / "bad.npz"
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"bad.npz: is no reference"):
        load_reference(path)


def test_the_bench_bakes_and_scores(tmp_path, capsys):
    build_cube_room()
    reference = write_reference(tmp_path / "r.npz", 5.0)
    blend = tmp_path / "room.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True)
    arguments = ["bench", "--quick", "--runs", "1", "--scenes", "--blend", str(blend), "--reference", str(reference)]
    assert cli.main(arguments) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("blend")]
    assert len(lines) == 1
    assert "error 0.1" in lines[0]
    assert list(tmp_path.glob("*.blend")) == [blend]
