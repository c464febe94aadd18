"""Files: opened or saved whole, or one clear sentence and nothing changed."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from addon.blender.files import FileError, open_blend, require_writable, save_blend, save_exr

pytestmark = pytest.mark.usefixtures("empty_file")


@pytest.mark.parametrize("content", [b"", b"not a scene", b"BLENDER-v405 and then nonsense"])
def test_what_is_no_blend_is_refused(tmp_path, content):
    path = tmp_path / "scene.blend"
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"scene\.blend"):
        open_blend(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileError, match=r"gone\.blend: there is no such file"):
        open_blend(tmp_path / "gone.blend")
    with pytest.raises(FileError):
        open_blend(tmp_path)


@pytest.mark.parametrize("compress", [True, False])
def test_saving_keeps_the_compression_and_leaves_no_other_file(tmp_path, add_cube, compress):
    add_cube("Room")
    source, copy = tmp_path / "source.blend", tmp_path / "copy.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(source), compress=compress)
    open_blend(source)
    save_blend(copy)
    assert copy.read_bytes().startswith(b"BLENDER") == (not compress)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["copy.blend", "source.blend"]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    open_blend(copy)
    assert "Room" in bpy.data.objects


def test_a_folder_that_cannot_be_written_is_named_before_the_work(tmp_path):
    for path in (tmp_path / "missing" / "out.blend", "/proc/out.blend", tmp_path):
        with pytest.raises(FileError):
            require_writable(path)
    require_writable(tmp_path / "out.blend")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_save_leaves_the_old_file(tmp_path, add_cube, monkeypatch):
    add_cube()
    path = tmp_path / "out.blend"
    path.write_bytes(b"the old one")

    def fails(*args):
        raise OSError("the disk is full")

    monkeypatch.setattr("os.replace", fails)
    with pytest.raises(FileError, match="the disk is full"):
        save_blend(path)
    assert path.read_bytes() == b"the old one"
    assert [p.name for p in tmp_path.iterdir()] == ["out.blend"]


def test_an_exr_holds_the_pixels_to_the_bit(tmp_path):
    pixels = np.ones((8, 16, 4), np.float32)
    pixels[..., :3] = 20 * np.random.default_rng(3).random((8, 16, 3), dtype=np.float32)
    image = bpy.data.images.new("Light", 16, 8, float_buffer=True, is_data=True)
    image.pixels.foreach_set(pixels.ravel())
    scenes = list(bpy.data.scenes)
    save_exr(image, tmp_path / "light.exr")
    assert list(bpy.data.scenes) == scenes
    loaded = bpy.data.images.load(str(tmp_path / "light.exr"))
    loaded.colorspace_settings.name = "Non-Color"
    values = np.empty(8 * 16 * 4, np.float32)
    loaded.pixels.foreach_get(values)
    np.testing.assert_array_equal(values.reshape(8, 16, 4), pixels)
