"""The Bake button: reads the scene, bakes on a thread while Blender stays alive, writes the result at the end."""

from __future__ import annotations

import time
from functools import partial

import bpy

from ..blender import bake_scene
from ..blender.denoiser_library import denoiser_library
from ..core.bake import bake
from ..core.scene import SceneError
from ..core.settings import BakeCancelled, SettingsError
from .job import BakeJob

# Their message is meant for a person; anything else is a bug and keeps its traceback.
EXPECTED_ERRORS = (BakeCancelled, SettingsError, SceneError, OSError, MemoryError)

SECONDS_BETWEEN_POLLS = 0.1
NEVER_BAKED = {"LIGHT", "CAMERA", "EMPTY", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}  # whatever one might expect
# While a bake runs these still reach Blender, so that one can look around; nothing that changes the scene does.
PASSED_ON = {
    *("MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "MOUSEROTATE", "MOUSESMARTZOOM"),
    *("MOUSEMOVE", "INBETWEEN_MOUSEMOVE", "TIMER", "TIMER_REPORT", "TIMER_REGION", "WINDOW_DEACTIVATE", "NDOF_MOTION"),
}

# The one bake that runs in this Blender, or None.
_running: PATCHLIGHT_OT_bake | None = None


class PATCHLIGHT_OT_bake(bpy.types.Operator):
    """Bake the diffuse light of the scene. Esc cancels and leaves everything as it was"""

    bl_idname = "patchlight.bake"
    bl_label = "Bake"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if _running is not None:
            cls.poll_message_set("A bake is running already")
            return False
        if context.mode != "OBJECT":
            cls.poll_message_set("Switch to Object Mode first")
            return False
        return True

    def invoke(self, context, _event):
        """Start the thread and go modal; in background, where no events come, bake at once."""
        if bpy.app.background or context.window is None:
            return self.execute(context)
        if not self._prepare(context):
            return {"CANCELLED"}
        self._job.start()
        manager = context.window_manager
        self._timer = manager.event_timer_add(SECONDS_BETWEEN_POLLS, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        """Bake and come back when it is done."""
        if not self._prepare(context):
            return {"CANCELLED"}
        self._job.run()
        return self._end(context)

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self._job.cancel()
        if event.type == "TIMER":
            if not self._job.is_running:
                return self._end(context)
            self._show(context)
        return {"PASS_THROUGH"} if event.type in PASSED_ON else {"RUNNING_MODAL"}

    def cancel(self, _context):
        """Blender is closing this window or loading a file."""
        self.abandon()

    def _prepare(self, context):
        """Read the scene and make the job; False after an error, which is reported."""
        global _running
        self._timer, self._is_abandoned = None, False
        began = time.perf_counter()
        try:
            scene = context.scene
            options = scene.patchlight
            settings, subdivide = options.to_settings(scene.unit_settings.scale_length), options.edge_length
            names = _names_to_bake(context)
            self._prepared = bake_scene.prepare(scene, settings, names, subdivide, options.apply_modifiers)
            library = denoiser_library()
        except EXPECTED_ERRORS as error:
            self.report({"ERROR"}, _sentence(error))
            return False
        self._read_seconds = time.perf_counter() - began
        self._job = BakeJob(partial(bake, denoiser_library=library), self._prepared.scene, settings)
        _running = self
        state = context.window_manager.patchlight
        state.is_baking, state.progress, state.stage = True, 0.0, "start"
        return True

    def _end(self, context):
        """Write the result, or discard it, and tell how it went."""
        self._leave(context)
        if self._is_abandoned:
            return {"CANCELLED"}
        error = self._job.error
        if error is None:
            try:
                began = time.perf_counter()
                bake_scene.write(self._prepared, self._job.result)
                self._tell(context, time.perf_counter() - began)
                return {"FINISHED"}
            except EXPECTED_ERRORS as failure:
                error = failure
        bake_scene.discard(self._prepared)
        if isinstance(error, BakeCancelled):
            self.report({"INFO"}, "Bake cancelled, nothing changed")
        elif isinstance(error, EXPECTED_ERRORS):
            self.report({"ERROR"}, _sentence(error))
        else:
            raise error
        return {"CANCELLED"}

    def _tell(self, context, write_seconds):
        report = self._job.result.report.with_stages({"read": self._read_seconds, "write": write_seconds})
        seconds = report.seconds["bake"]
        for warning in report.warnings:
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, f"Baked in {seconds:.1f} s, estimated error {report.estimated_error:.3f}")
        state = context.window_manager.patchlight
        state.has_result = True
        state.result_seconds, state.result_error = seconds, report.estimated_error
        state.warning_count = len(report.warnings)

    def _show(self, context):
        state = context.window_manager.patchlight
        state.progress = min(max(self._job.fraction, 0.0), 1.0)
        state.stage = "cancelling" if self._job.is_cancelled else self._job.stage
        context.workspace.status_text_set(f"Patchlight: {state.stage} {state.progress:.0%}   (Esc cancels)")
        _redraw_sidebars(context.window_manager)

    def _leave(self, context):
        """Give back the timer, the status bar and the place of the one running bake."""
        global _running
        _running = None
        state = context.window_manager.patchlight
        state.is_baking = False
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
            context.workspace.status_text_set(None)
            _redraw_sidebars(context.window_manager)

    def abandon(self):
        """Nobody will see the end of this bake: stop it and forget it."""
        global _running
        if self._is_abandoned:
            return
        self._is_abandoned = True
        _running = None
        self._job.cancel()
        self._job.wait()
        bake_scene.discard(self._prepared)
        bpy.context.window_manager.patchlight.is_baking = False

    def leave_and_abandon(self):
        """The same while its window stays: what it shows there goes."""
        self._leave(bpy.context)
        self.abandon()


def cancel_running():
    """End a bake that still runs and wait for its thread; for when the add-on goes."""
    if _running is not None:
        _running.leave_and_abandon()


def _names_to_bake(context):
    if not context.scene.patchlight.only_selected:
        return None
    # lamps and cameras are selected with the room that they stand in
    names = [ob.name for ob in context.selected_objects if ob.type not in NEVER_BAKED]
    if not names:
        raise SceneError("nothing to bake: no mesh object is selected")
    return names


def _sentence(error):
    return "Not enough memory for this bake" if isinstance(error, MemoryError) else str(error)


def _redraw_sidebars(manager):
    for window in manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


CLASSES = (PATCHLIGHT_OT_bake,)
