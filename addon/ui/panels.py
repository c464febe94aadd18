"""The sidebar of the 3D View, tab Patchlight: draws the options, decides nothing."""

from __future__ import annotations

import bpy


class _Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Patchlight"


class PATCHLIGHT_PT_bake(_Sidebar, bpy.types.Panel):
    """Target, quality, the Bake button, and how it went."""

    bl_label = "Patchlight"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        options, state = context.scene.patchlight, context.window_manager.patchlight

        column = layout.column()
        column.enabled = not state.is_baking
        column.prop(options, "target")
        column.prop(options, "method")
        column.prop(options, "error")
        if options.target == "lightmap":
            column.row().prop(options, "size_mode", expand=True)
            column.prop(options, "size" if options.size_mode == "SIZE" else "density")
            column.prop(options, "keep_uvs")
            column.prop(options, "denoise")
        else:
            column.prop(options, "smooth_angle")
            _optional(column, options, "use_subdivide", "subdivide")
        column.prop(options, "only_selected")
        column.prop(options, "apply_modifiers")

        layout.separator()
        if state.is_baking:
            layout.progress(
                factor=state.progress, text=f"{state.stage.capitalize()} {state.progress:.0%} (Esc cancels)"
            )
        else:
            row = layout.row()
            row.scale_y = 1.5
            row.operator("patchlight.bake", icon="LIGHT_AREA")
            layout.operator("patchlight.preview", icon="IMAGE_DATA")
        if state.has_result:
            _draw_result(layout, state)


class PATCHLIGHT_PT_patches(_Sidebar, bpy.types.Panel):
    """Size of the patches and the solver."""

    bl_label = "Patches"
    bl_parent_id = "PATCHLIGHT_PT_bake"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.enabled = not context.window_manager.patchlight.is_baking
        options = context.scene.patchlight
        layout.prop(options, "solver")
        _optional(layout, options, "use_patch_size", "patch_size")


class PATCHLIGHT_PT_limits(_Sidebar, bpy.types.Panel):
    """Time, threads, seed."""

    bl_label = "Limits"
    bl_parent_id = "PATCHLIGHT_PT_bake"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.enabled = not context.window_manager.patchlight.is_baking
        options = context.scene.patchlight
        _optional(layout, options, "use_time_limit", "time_limit")
        layout.prop(options, "threads")
        layout.prop(options, "seed")


def _optional(layout, options, switch, value):
    """A value behind a check box, as Blender's own panels have it."""
    row = layout.row(heading=options.bl_rna.properties[switch].name)
    row.prop(options, switch, text="")
    field = row.row()
    field.active = getattr(options, switch)
    field.prop(options, value, text="")


def _draw_result(layout, state):
    box = layout.box().column(align=True)
    box.label(text=f"Baked in {state.result_seconds:.1f} s", icon="CHECKMARK")
    box.label(text=f"Estimated error {state.result_error:.3f}", icon="BLANK1")
    if state.warning_count:
        noun = "warning" if state.warning_count == 1 else "warnings"
        box.label(text=f"{state.warning_count} {noun}, see the Info editor", icon="ERROR")


CLASSES = (PATCHLIGHT_PT_bake, PATCHLIGHT_PT_patches, PATCHLIGHT_PT_limits)
