"""The command line: what it takes, what it says when it cannot, what it leaves on disk."""

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from addon import cli, in_blender
from addon.cli_bake import bake_arguments, settings_from
from addon.progress import ProgressBar, clock_text, line, seconds_left

ROOT = Path(__file__).resolve().parents[1]
QUICK = ["--texels", "4096", "--error", "0.1"]


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


@pytest.fixture
def room_blend(tmp_path):
    bpy = pytest.importorskip("bpy")
    from tests.cube_room import build_cube_room

    build_cube_room()
    path = tmp_path / "room.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    return path


def fails_with_one_line(capsys, argv, *words):
    assert cli.main([str(word) for word in argv]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("patchlight: error: ")
    for word in words:
        assert str(word) in lines[0]


# ---- arguments ----


def test_help_waits_for_neither_blender_nor_numpy():
    script = (
        "import sys; from addon import cli; cli.parser().format_help(); "
        "print({'bpy', 'numpy'} & set(sys.modules) or 'light')"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "light"


@pytest.mark.parametrize(
    ("words", "name", "value"),
    [
        (["--target", "vertex"], "target", "vertex"),
        (["--method", "hemicube"], "method", "hemicube"),
        (["--solver", "progressive"], "solver", "progressive"),
        (["--solver", "conjugate-gradient"], "solver", "conjugate-gradient"),
        (["--error", "0.05"], "error", 0.05),
        (["--time-limit", "12"], "time_limit", 12.0),
        (["--texels", "65536"], "texels", 65536),
        (["--density", "32"], "density", 32.0),
        (["--keep-uvs"], "keep_uvs", True),
        (["--smooth-angle", "45"], "smooth_angle_deg", 45.0),
        (["--patch-size", "0.5"], "patch_size", 0.5),
        (["--seed", "7"], "seed", 7),
        (["--threads", "2"], "threads", 2),
    ],
)
def test_each_option_reaches_the_settings(words, name, value):
    settings = settings_from(bake_arguments(["in.blend", *words]))
    assert getattr(settings, name) == value


@pytest.mark.parametrize(
    "words",
    [[], ["bake"], ["bake", "in.blend", "--target", "wall"], ["bake", "in.blend", "--texels", "64", "--density", "8"]],
)
def test_wrong_usage_is_refused_by_the_parser(words, capsys):
    with pytest.raises(SystemExit) as refused:
        cli.main(words)
    assert refused.value.code == 2
    assert "usage: patchlight" in capsys.readouterr().err


# ---- errors: one sentence, exit code 1, nothing on disk ----


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--error", "0"], "error"),
        (["--threads", "-1"], "threads"),
        (["--time-limit", "0"], "time_limit"),
        (["--method", "hemicube", "--solver", "stochastic"], "stochastic"),
        (["--target", "vertex", "--exr", "."], "--exr"),
        (["--target", "vertex", "--keep-uvs"], "--keep-uvs"),
        (["--target", "vertex", "--density", "9"], "--density"),
        (["--smooth-angle", "20"], "--smooth-angle"),
    ],
)
def test_a_setting_out_of_range_is_named(words, named, capsys):
    fails_with_one_line(capsys, ["bake", "in.blend", *words], named)


def test_a_missing_file_is_named(tmp_path, capsys):
    pytest.importorskip("bpy")
    fails_with_one_line(capsys, ["bake", tmp_path / "none.blend"], "none.blend")
    assert contents(tmp_path) == {}


def test_a_file_that_is_no_blend_is_named(tmp_path, capsys):
    pytest.importorskip("bpy")
    (tmp_path / "notes.blend").write_text("just text")
    fails_with_one_line(capsys, ["bake", tmp_path / "notes.blend"], "notes.blend", "not a .blend")
    assert contents(tmp_path) == {"notes.blend": b"just text"}


@pytest.mark.parametrize("option", ["--output", "--report", "--exr"])
def test_an_output_folder_that_does_not_exist_is_named(option, room_blend, capsys):
    before = contents(room_blend.parent)
    fails_with_one_line(capsys, ["bake", room_blend, option, room_blend.parent / "no" / "where"], "no")
    assert contents(room_blend.parent) == before


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs a folder that not even root can write to")
@pytest.mark.parametrize("words", [["--output", "/proc/out.blend"], ["--report", "/proc/out.json"], ["--exr", "/proc"]])
def test_an_output_folder_that_cannot_be_written_is_named(words, room_blend, capsys):
    before = contents(room_blend.parent)
    fails_with_one_line(capsys, ["bake", room_blend, *words], "/proc")
    assert contents(room_blend.parent) == before


def test_a_file_with_nothing_to_bake_is_left_alone(tmp_path, capsys):
    bpy = pytest.importorskip("bpy")
    from tests.cube_room import empty_file

    empty_file()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "empty.blend"), copy=True)
    before = contents(tmp_path)
    fails_with_one_line(capsys, ["bake", tmp_path / "empty.blend", "--report", tmp_path / "r.json"])
    assert contents(tmp_path) == before


def test_an_object_that_is_not_there_is_named(room_blend, capsys):
    before = contents(room_blend.parent)
    fails_with_one_line(capsys, ["bake", room_blend, "--objects", "sofa"], "sofa")
    assert contents(room_blend.parent) == before


def test_ctrl_c_during_the_bake_leaves_nothing(room_blend, capsys, monkeypatch):
    from addon.core import bake as bake_module

    def interrupted_bake(*_args):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(30)  # the signal ends the sleep at once; without a handler the assertion below fails

    monkeypatch.setattr(bake_module, "bake", interrupted_bake)
    before = contents(room_blend.parent)
    assert cli.main(["bake", str(room_blend)]) == 130
    assert contents(room_blend.parent) == before
    assert "cancelled" in capsys.readouterr().err


def test_ctrl_c_while_blender_starts_is_kept_until_it_has(room_blend, capsys, monkeypatch):
    """In the middle of C code it would be lost, or worse."""
    started = []

    def start():
        os.kill(os.getpid(), signal.SIGINT)
        started.append(True)

    monkeypatch.setattr(in_blender, "_imported", start)
    before = contents(room_blend.parent)
    assert cli.main(["bake", str(room_blend)]) == 130
    assert started
    assert contents(room_blend.parent) == before
    assert "cancelled" in capsys.readouterr().err


def test_a_bug_keeps_its_traceback(room_blend, monkeypatch):
    from addon.core import bake as bake_module

    monkeypatch.setattr(bake_module, "bake", lambda *_args: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        cli.main(["bake", str(room_blend)])


# ---- success ----


def test_a_bake_writes_all_that_was_asked_for_and_nothing_else(room_blend, capfd):
    folder = room_blend.parent
    before = room_blend.read_bytes()
    words = [*QUICK, "--report", folder / "r.json", "--exr", folder / "exr"]
    assert cli.main(["bake", str(room_blend), *map(str, words)]) == 0
    assert set(contents(folder)) == {"room.blend", "room_baked.blend", "r.json"}
    assert set(contents(folder / "exr")) == {"room_baked.exr"}
    assert room_blend.read_bytes() == before

    seconds = json.loads((folder / "r.json").read_text())["seconds"]
    assert {"load", "read", "unwrap", "texels", "solve", "gather", "write", "save", "bake"} <= set(seconds)
    parts = sum(seconds[stage] for stage in ("read", "texels", "solve", "gather", "write"))
    assert seconds["bake"] == pytest.approx(parts)

    streams = capfd.readouterr()
    assert len(streams.out.splitlines()) == 1, "Blender's own messages are kept away"
    assert "\r" not in streams.err, "no progress bar where nobody looks"


def test_a_baked_file_holds_the_lightmap(room_blend):
    import bpy

    output = room_blend.with_name("lit.blend")
    assert cli.main(["bake", str(room_blend), "--output", str(output), *QUICK]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(output))
    room = bpy.data.objects["room"]
    assert "Lightmap" in room.data.uv_layers
    assert room["patchlight_lightmap"].packed_file is not None


def test_a_baked_file_holds_the_vertex_colours(room_blend):
    import bpy

    output = room_blend.with_name("lit.blend")
    words = ["--target", "vertex", "--subdivide", "0.5", "--output", str(output), *QUICK]
    assert cli.main(["bake", str(room_blend), *words]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(output))
    mesh = bpy.data.objects["room"].data
    assert mesh.color_attributes["Patchlight"].domain == "CORNER"
    # 2 m edges cut to at most 0.5 m: at least 4 x 4 faces on each of 6 walls
    assert len(mesh.polygons) >= 96


def test_modifiers_are_applied_where_that_is_asked_for(room_blend):
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(room_blend))
    bpy.data.objects["room"].modifiers.new("Subdivision", "SUBSURF").subdivision_type = "SIMPLE"
    bpy.ops.wm.save_mainfile()
    output = room_blend.with_name("lit.blend")
    words = ["bake", str(room_blend), "--output", str(output), *QUICK]
    assert cli.main(words) == 1
    assert cli.main([*words, "--apply-modifiers"]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(output))
    room = bpy.data.objects["room"]
    assert not room.modifiers
    assert len(room.data.polygons) == 6 * 4**2  # two levels, which a new modifier has for renders; one in the viewport
    assert "Lightmap" in room.data.uv_layers


def test_a_bake_that_fails_after_opening_keeps_an_older_result(room_blend, capsys):
    older = room_blend.with_name("room_baked.blend")
    older.write_bytes(b"older")
    fails_with_one_line(capsys, ["bake", room_blend, "--objects", "sofa"], "sofa")
    assert older.read_bytes() == b"older"


@pytest.mark.parametrize("name", ["room.blend", "room_baked.blend", "room_baked.exr"])
def test_the_report_is_no_other_file_of_the_bake(name, room_blend, capsys):
    before = contents(room_blend.parent)
    words = ["bake", room_blend, "--exr", room_blend.parent, "--report", room_blend.with_name(name)]
    fails_with_one_line(capsys, words, "--report", name)
    assert contents(room_blend.parent) == before


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="a device of Unix")
def test_a_device_is_no_file_to_save_as(room_blend, capsys):
    fails_with_one_line(capsys, ["bake", room_blend, "--output", "/dev/null"], "/dev/null", "device")
    assert Path("/dev/null").is_char_device()


def test_what_stands_where_the_exr_should_go_is_told_before_the_bake(room_blend, capsys):
    folder = room_blend.with_name("exr")
    folder.write_bytes(b"a file")
    fails_with_one_line(capsys, ["bake", room_blend, "--exr", folder], "exr", "is a file")
    assert folder.read_bytes() == b"a file"
    assert not room_blend.with_name("room_baked.blend").exists()


def test_a_result_is_saved_though_its_exr_cannot_be(room_blend, capsys, monkeypatch):
    from addon.blender import files

    def full_disk(image, path):
        raise files.FileError(f"{path}: cannot be saved (No space left on device)")

    monkeypatch.setattr(files, "save_exr", full_disk)
    folder, report = room_blend.with_name("exr"), room_blend.with_name("report.json")
    words = ["bake", room_blend, "--exr", folder, "--report", report, *QUICK]
    assert cli.main([str(word) for word in words]) == 1
    assert "No space left" in capsys.readouterr().err
    assert room_blend.with_name("room_baked.blend").exists()
    assert report.exists()


@pytest.mark.skipif(not Path("/dev/stdout").exists(), reason="needs a path that leads to stdout")
@pytest.mark.parametrize("is_file", [True, False])
def test_a_report_to_stdout_is_all_that_is_there(room_blend, is_file):
    words = ["bake", str(room_blend), *QUICK, "--report", "/dev/stdout"]
    command = [sys.executable, "-c", "import sys; from addon import cli; sys.exit(cli.main(sys.argv[1:]))", *words]
    out = room_blend.parent / "out.json"
    with out.open("w") if is_file else contextlib.nullcontext(subprocess.PIPE) as stdout:
        done = subprocess.run(command, stdout=stdout, stderr=subprocess.PIPE, text=True, cwd=ROOT, check=True)
    assert json.loads(out.read_text() if is_file else done.stdout)["target_error"]
    assert "baked in" in done.stderr


@pytest.mark.parametrize(
    "words", [["room.blend"], ["p.png", "--lightmap", "room.blend"], ["p.png", "--lightmap", "p.png"]]
)
def test_a_picture_is_no_other_file_of_its_command(room_blend, capsys, monkeypatch, words):
    monkeypatch.chdir(room_blend.parent)
    before = contents(room_blend.parent)
    fails_with_one_line(capsys, ["picture", "room.blend", *words], "one of its own")
    assert contents(room_blend.parent) == before


@pytest.mark.parametrize("path", [".", "", "/"])
def test_a_folder_is_no_scene(path, capsys):
    fails_with_one_line(capsys, ["bake", path])


def test_stdout_may_be_closed(room_blend):
    words = ["bake", str(room_blend), *QUICK]
    code = "import os, sys; os.close(1); sys.stdout = None; from addon import cli; sys.exit(cli.main(sys.argv[1:]))"
    subprocess.run([sys.executable, "-c", code, *words], cwd=ROOT, check=True, stderr=subprocess.PIPE)
    assert "room_baked.blend" in contents(room_blend.parent)


def test_a_lightmap_that_is_not_there_is_missed_before_the_render(room_blend, capsys):
    folder = room_blend.parent
    words = ["picture", room_blend, folder / "p.png", "--lightmap", folder / "l.png"]
    fails_with_one_line(capsys, words, "holds no lightmap")
    assert not (folder / "p.png").exists()


def test_a_picture_has_the_shape_of_the_scene(room_blend, capfd):
    import bpy

    folder = room_blend.parent
    assert cli.main(["bake", str(room_blend), *QUICK]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(folder / "room_baked.blend"))
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x, scene.render.resolution_y = 50, 100
    bpy.ops.wm.save_mainfile()
    words = ["picture", folder / "room_baked.blend", folder / "p.png", "--lightmap", folder / "l.png", "--bounces", "2"]
    assert cli.main([str(word) for word in words]) == 0
    picture = bpy.data.images.load(str(folder / "p.png"))
    assert tuple(picture.size) == (480, 960)
    assert max(list(picture.pixels)[::4]) > 0, "the room is lit"
    assert (folder / "l.png").exists()


def test_a_picture_of_what_is_not_baked_is_refused(room_blend, capsys):
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(room_blend))
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(scene.camera)
    bpy.ops.wm.save_mainfile()
    png = room_blend.parent / "p.png"
    fails_with_one_line(capsys, ["picture", room_blend, png], "no object that is rendered has a bake")
    fails_with_one_line(capsys, ["picture", room_blend, png, "--bounces", "-1"], "bounces is -1")


# ---- progress ----


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_is_silent_where_nobody_looks():
    stream = io.StringIO()
    with ProgressBar(stream) as progress:
        assert progress("solve", 0.5)
    assert stream.getvalue() == ""


def test_progress_on_a_terminal_is_one_line_that_goes_away():
    stream = Terminal()
    times = iter([0.0, 10.0, 10.01])
    with ProgressBar(stream, clock=lambda: next(times)) as progress:
        assert progress("solve", 0.25)
        assert progress("gather", 0.26), "drawn at most ten times a second"
    text = stream.getvalue()
    assert "25%  solve, about 0:30 left" in text
    assert "gather" not in text
    assert "\n" not in text
    assert text.endswith("\r\x1b[K")


def test_the_estimate_follows_the_work_done():
    assert seconds_left(0.5, 8.0) == 8.0
    assert seconds_left(0.01, 1.0) is None
    assert line("read", 0.0, 0.0) == f"[{'.' * 30}]   0%  read"
    assert (clock_text(59.6), clock_text(3725)) == ("1:00", "1:02:05")
