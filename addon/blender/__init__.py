"""Blender data-blocks to arrays and back: imports bpy and core, never ui."""
