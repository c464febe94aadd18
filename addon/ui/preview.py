"""The Preview button: the camera's view of the bake, with mirrors and glass ray traced, in an Image Editor."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import IntProperty

from ..blender import picture

IMAGE_NAME = "Patchlight Preview"


class PATCHLIGHT_OT_preview(bpy.types.Operator):
    """Show the bake through the camera, with sharp mirrors and glass ray traced. The scene stays as it is"""

    bl_idname = "patchlight.preview"
    bl_label = "Preview"
    bl_options = {"REGISTER", "UNDO"}

    bounces: IntProperty(
        name="Bounces",
        description="Of rays from mirrors; 0 shows all surfaces as the bake lights them, and glass without refraction",
        default=4,
        min=0,
        max=picture.MOST_BOUNCES,
        soft_max=16,
    )

    @classmethod
    def poll(cls, context):
        if context.window_manager.patchlight.is_baking:
            cls.poll_message_set("A bake is running")
            return False
        if context.mode != "OBJECT":
            cls.poll_message_set("Switch to Object Mode first")
            return False
        if bpy.app.is_job_running("RENDER"):
            cls.poll_message_set("A render is running")
            return False
        if context.scene.camera is None:
            cls.poll_message_set("The scene has no camera")
            return False
        return True

    def execute(self, context):
        """Render and show; nothing but the image stays in the file, for as long as an Image Editor shows it."""
        path = Path(bpy.app.tempdir) / "patchlight_preview.png"
        path.unlink(missing_ok=True)
        if context.window:
            context.window.cursor_set("WAIT")
        try:
            picture.render(path, *picture.size_of(context.scene), bounces=self.bounces)
        except (picture.PictureError, RuntimeError) as error:  # Blender's own: a render that failed
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            if context.window:
                context.window.cursor_set("DEFAULT")
        if not path.exists():
            self.report({"ERROR"}, "Blender rendered nothing")
            return {"CANCELLED"}
        _show(context.window_manager, _image(path))
        return {"FINISHED"}


def _image(path):
    """The file as an image, packed, as it is gone with this Blender; in the place of an older one."""
    image, older = bpy.data.images.load(str(path)), bpy.data.images.get(IMAGE_NAME)
    image.pack()
    if older is not None:
        older.user_remap(image)
        bpy.data.images.remove(older)
    image.name = IMAGE_NAME
    return image


def _show(manager, image):
    """In an Image Editor that is open, or in the window that Blender shows renders in."""
    if not _editors(manager) and not bpy.app.background:
        bpy.ops.render.view_show("INVOKE_DEFAULT")
    for area in _editors(manager)[:1]:
        area.spaces.active.image = image


def _editors(manager):
    """Image Editors that are no UV Editors."""
    return [area for window in manager.windows for area in window.screen.areas if area.ui_type == "IMAGE_EDITOR"]


CLASSES = (PATCHLIGHT_OT_preview,)
