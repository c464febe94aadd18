"""The add-on inside Blender: registration, options that last, the Bake operator."""

import threading

import pytest

bpy = pytest.importorskip("bpy")

from addon import registration  # noqa: E402 - needs bpy
from addon.blender import picture  # noqa: E402
from addon.blender.bake_scene import discard, prepare  # noqa: E402
from addon.core.settings import METHODS, SOLVERS, TARGETS, BakeCancelled, BakeSettings  # noqa: E402
from addon.ui.job import BakeJob  # noqa: E402
from addon.ui.properties import PATCHLIGHT_PG_settings  # noqa: E402
from tests.cube_room import build_cube_room, empty_file  # noqa: E402


@pytest.fixture
def registered():
    registration.register()
    yield
    registration.unregister()


@pytest.fixture
def room(registered):
    ob = build_cube_room()
    options = bpy.context.scene.patchlight
    options.size, options.error = 64, 0.1
    return ob


# ---- registration ----


def test_registers_and_unregisters_twice():
    for _ in range(2):
        registration.register()
        assert all(cls.is_registered for cls in registration.CLASSES)
        assert hasattr(bpy.types, "PATCHLIGHT_PT_bake")
        registration.unregister()
        assert not any(cls.is_registered for cls in registration.CLASSES)
        assert not hasattr(bpy.types.Scene, "patchlight")
        assert not hasattr(bpy.types.WindowManager, "patchlight")


def test_the_panel_stands_in_the_sidebar_of_the_3d_view(registered):
    panel = bpy.types.PATCHLIGHT_PT_bake
    assert (panel.bl_space_type, panel.bl_region_type, panel.bl_category) == ("VIEW_3D", "UI", "Patchlight")


def test_every_option_has_a_tooltip(registered):
    properties = PATCHLIGHT_PG_settings.bl_rna.properties
    missing = [p.identifier for p in properties if p.identifier not in ("rna_type", "name") and not p.description]
    assert missing == []


# ---- options ----


def test_the_defaults_are_those_of_the_core(registered):
    empty_file()
    settings = bpy.context.scene.patchlight.to_settings(1.0)
    # Blender keeps floats in 32 bits: 24 bits of mantissa, 6e-8 relative
    assert settings.error == pytest.approx(BakeSettings().error, rel=1e-7)
    assert settings.smooth_angle_deg == pytest.approx(BakeSettings().smooth_angle_deg, rel=1e-6)
    for name in ("target", "method", "solver", "time_limit", "texels", "density", "keep_uvs", "patch_size", "seed"):
        assert getattr(settings, name) == getattr(BakeSettings(), name), name


@pytest.mark.parametrize(("name", "choices"), [("target", TARGETS), ("method", METHODS), ("solver", SOLVERS)])
def test_the_menus_offer_what_the_core_knows(registered, name, choices):
    items = PATCHLIGHT_PG_settings.bl_rna.properties[name].enum_items
    assert tuple(item.identifier for item in items) == choices


@pytest.mark.parametrize("metres_per_unit", [1.0, 0.01])
def test_lengths_are_those_of_the_scene_whatever_its_unit_scale(registered, metres_per_unit):
    empty_file()
    options = bpy.context.scene.patchlight
    options.use_patch_size, options.use_subdivide, options.target = True, True, "vertex"
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    # a quarter of the cube's edge, as Blender shows and keeps it: in units of the scene
    options.patch_size = options.subdivide = 0.25
    settings = options.to_settings(metres_per_unit)
    assert settings.patch_size == 0.25
    prepared = prepare(bpy.context.scene, settings, None, options.edge_length, False)
    # 4 x 4 squares a side, of which cutting leaves two triangles each
    assert len(prepared.scene.triangles) == 6 * 16 * 2
    discard(prepared)


def test_a_density_is_per_metre_as_shown(registered):
    empty_file()
    options = bpy.context.scene.patchlight
    options.size_mode, options.density = "DENSITY", 64.0
    # one unit is a centimetre, and shows 64 texels a metre as 0.64
    assert options.to_settings(0.01).density == pytest.approx(0.64, rel=1e-6)


def test_options_that_do_not_belong_to_the_target_are_left_out(registered):
    empty_file()
    options = bpy.context.scene.patchlight
    options.size_mode, options.keep_uvs, options.use_subdivide = "DENSITY", True, True
    assert options.edge_length is None
    options.target = "vertex"
    assert options.to_settings(1.0).density is None
    assert options.to_settings(1.0).keep_uvs is False


def test_options_survive_saving_and_loading(registered, tmp_path):
    empty_file()
    options = bpy.context.scene.patchlight
    options.target, options.size, options.use_time_limit, options.time_limit = "vertex", 512, True, 12.0
    path = str(tmp_path / "options.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    empty_file()
    assert bpy.context.scene.patchlight.target == "lightmap"
    bpy.ops.wm.open_mainfile(filepath=path)
    options = bpy.context.scene.patchlight
    assert (options.target, options.size, options.use_time_limit, options.time_limit) == ("vertex", 512, True, 12.0)


# ---- the operator, which blocks in background ----


@pytest.mark.parametrize("call", ["EXEC_DEFAULT", "INVOKE_DEFAULT"])
def test_bakes_a_lightmap(room, call):
    assert bpy.ops.patchlight.bake(call) == {"FINISHED"}
    assert room["patchlight_lightmap"].size[0] > 0
    assert "Lightmap" in room.data.uv_layers
    state = bpy.context.window_manager.patchlight
    assert state.has_result
    assert state.result_seconds > 0
    assert not state.is_baking


def test_bakes_vertex_colours(room):
    bpy.context.scene.patchlight.target = "vertex"
    assert bpy.ops.patchlight.bake() == {"FINISHED"}
    colours = room.data.color_attributes["Patchlight"]
    assert all(max(entry.color[:3]) > 0 for entry in colours.data)


def test_applies_modifiers_where_that_is_ticked(room):
    room.modifiers.new("Subdivision", "SUBSURF").subdivision_type = "SIMPLE"
    with pytest.raises(RuntimeError, match=r"Subdivision modifier on .* bake with Apply Modifiers"):
        bpy.ops.patchlight.bake()
    bpy.context.scene.patchlight.apply_modifiers = True
    assert bpy.ops.patchlight.bake() == {"FINISHED"}
    assert not room.modifiers
    assert "patchlight_lightmap" in room


def test_bakes_twice_in_a_row(room):
    assert bpy.ops.patchlight.bake() == {"FINISHED"}
    assert bpy.ops.patchlight.bake() == {"FINISHED"}
    assert [layer.name for layer in room.data.uv_layers] == ["Lightmap"]


def test_nothing_to_bake_is_an_error_that_changes_nothing(registered):
    empty_file()
    with pytest.raises(RuntimeError, match="bake"):
        bpy.ops.patchlight.bake()
    assert len(bpy.data.images) == 0
    assert bpy.ops.patchlight.bake.poll(), "the place of the running bake is free again"


def test_a_selected_lamp_is_no_object_to_bake(room):
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT"))
    bpy.context.scene.collection.objects.link(lamp)
    lamp.select_set(True)
    room.select_set(True)
    bpy.context.scene.patchlight.only_selected = True
    assert bpy.ops.patchlight.bake() == {"FINISHED"}
    assert room["patchlight_lightmap"] is not None


def test_only_selected_without_a_selection_is_an_error(room):
    bpy.context.scene.patchlight.only_selected = True
    room.select_set(False)
    with pytest.raises(RuntimeError, match="bake"):
        bpy.ops.patchlight.bake()
    assert "patchlight_lightmap" not in room


def test_options_that_contradict_each_other_are_an_error(room):
    options = bpy.context.scene.patchlight
    options.method, options.solver = "hemicube", "stochastic"
    with pytest.raises(RuntimeError, match="stochastic"):
        bpy.ops.patchlight.bake()


def test_a_bug_in_the_bake_is_not_called_finished(room, monkeypatch):
    from addon.ui import operators

    monkeypatch.setattr(operators, "bake", lambda *_args, **_options: 1 / 0)
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        bpy.ops.patchlight.bake()
    assert "patchlight_lightmap" not in room
    assert bpy.ops.patchlight.bake.poll()


def test_waits_for_object_mode(room):
    bpy.context.view_layer.objects.active = room
    bpy.ops.object.mode_set(mode="EDIT")
    assert not bpy.ops.patchlight.bake.poll()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.ops.patchlight.bake.poll()


# ---- the thread ----


def test_a_job_goes_on_beside_its_starter_and_can_be_cancelled():
    entered = threading.Event()

    def endless_bake(_scene, _settings, on_progress):
        entered.set()
        while on_progress("solve", 0.5):
            pass
        raise BakeCancelled

    job = BakeJob(endless_bake, None, None)
    job.start()
    assert entered.wait(timeout=60)
    assert job.is_running
    job.cancel()
    job.wait()
    assert not job.is_running
    assert isinstance(job.error, BakeCancelled)
    assert (job.stage, job.fraction) == ("solve", 0.5)


def test_a_job_hands_over_its_result():
    job = BakeJob(lambda scene, settings, on_progress: (scene, settings), "scene", "settings")
    job.run()
    assert job.result == ("scene", "settings")
    assert job.error is None


# ---- preview ----


def test_a_preview_shows_the_bake_and_is_not_saved(room):
    _add_camera()
    assert bpy.ops.patchlight.bake() == {"FINISHED"}
    objects = len(bpy.data.objects)
    for bounces in (0, 2):
        assert bpy.ops.patchlight.preview(bounces=bounces) == {"FINISHED"}
        image = bpy.data.images["Patchlight Preview"]
        assert (max(image.size), image.users) == (picture.LONGER_SIDE, 0)
        assert image.packed_file is not None, "an Image Editor that shows it saves it"
        assert max(image.pixels[:4000]) > 0
    assert len(bpy.data.objects) == objects
    assert [image.name for image in bpy.data.images].count("Patchlight Preview") == 1


def test_a_preview_of_nothing_is_refused(room):
    assert not bpy.ops.patchlight.preview.poll(), "no camera"
    _add_camera()
    with pytest.raises(RuntimeError, match="has nothing to show"):
        bpy.ops.patchlight.preview()


def _add_camera():
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(scene.camera)
