"""The only file that registers: classes in order, their properties, and the command of `blender --command`."""

from __future__ import annotations

import bpy

from .ui import operators, panels, preview, properties

CLASSES = (*properties.CLASSES, *operators.CLASSES, *preview.CLASSES, *panels.CLASSES)

# Handles of commands, to give back at unregister: Blender identifies a command by the handle alone.
_commands = []


def register():
    """Add everything; an exception stops the add-on from being enabled and is shown by Blender."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    properties.add_to_types()
    _commands.append(bpy.utils.register_cli_command("patchlight", _run_command))


def unregister():
    """Take everything away in the opposite order; a running bake is cancelled first."""
    operators.cancel_running()
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
    properties.remove_from_types()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)


def _run_command(argv):
    from .cli import main

    return main(argv)
