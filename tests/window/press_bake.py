"""The extension in a real Blender window: its zip is installed, Bake is pressed, watched, shown, undone, and cancelled.

    blender --factory-startup --enable-event-simulate --python tests/window/press_bake.py -- ZIP

Exits with 0 when every check held. It is no pytest module, as Blender brings none and the checks follow each other in
one window.
"""

from __future__ import annotations

import os
import sys
import time
import traceback
from itertools import pairwise
from pathlib import Path

import bpy

ZIP = Path(sys.argv[sys.argv.index("--") + 1]).resolve()
SECONDS = 300  # for all of it: a machine may be busy
LONGEST_PAUSE = 2.0  # [s] between two looks at a window that is alive while it bakes; they are 0.05 apart when idle
STARTING = 2.0  # [s] until the window is drawn
GAP = 0.01  # [m] between the cube and the floor


def steps():
    """What is done and held, one step after another; each yield gives the window time."""
    bpy.ops.extensions.package_install_files(filepath=str(ZIP), repo="user_default", enable_on_install=True)
    window, options = bpy.context.window_manager.windows[0], bpy.context.scene.patchlight
    window.event_simulate(type="ESC", value="PRESS")  # the splash screen
    yield from show_panel(window)
    options.size, options.error = 512, 0.02
    put_a_floor_under_the_cube()
    bpy.ops.ed.undo_push(message="room")
    before = contents()

    press_bake(window)
    yield from shown_while_baking(window)
    check("a bake writes a lightmap", lightmaps() == ["Cube", "Floor"])
    check("it tells how it went", state().has_result and state().result_seconds > 0)
    yield

    with in_3d_view(window):
        check("Preview renders", bpy.ops.patchlight.preview("INVOKE_DEFAULT", True) == {"FINISHED"})
    yield
    check("an Image Editor shows it", shown_images() == ["Patchlight Preview"])
    with in_3d_view(window):
        bpy.ops.ed.undo()
    yield

    with in_3d_view(window):
        bpy.ops.ed.undo()
    yield
    check("undo takes it all back", contents() == before and lightmaps() == [])

    press_bake(window)
    while not state().progress > 0:
        yield
    window.event_simulate(type="ESC", value="PRESS")
    while state().is_baking:
        yield
    check("Esc cancels and leaves everything as it was", contents() == before and lightmaps() == [])
    check("after that one may bake again", bpy.ops.patchlight.bake.poll())


def shown_while_baking(window):
    """Wait for the end of the bake: progress rises all the while, the window answers, a second press is refused."""
    seen, pauses, last = [], [], time.perf_counter()
    check("a second bake is refused", not bpy.ops.patchlight.bake.poll())
    while state().is_baking:
        seen.append(state().progress)
        yield
        pauses.append(time.perf_counter() - last)
        last = time.perf_counter()
    rising = all(later >= earlier for earlier, later in pairwise(seen))
    check(f"progress rises ({len(set(seen))} values)", rising and len(set(seen)) > 3)
    check(f"the window answers (longest pause {max(pauses):.2f} s)", max(pauses) < LONGEST_PAUSE)


def press_bake(window):
    """As the button does."""
    with in_3d_view(window):
        check("Bake starts", bpy.ops.patchlight.bake("INVOKE_DEFAULT") == {"RUNNING_MODAL"})


def in_3d_view(window):
    """The context of a click into the 3D View."""
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


def show_panel(window):
    """Our tab of the sidebar, which a window that is drawn has."""
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    area.spaces.active.show_region_ui = True
    yield
    next(region for region in area.regions if region.type == "UI").active_panel_category = "Patchlight"
    yield


def put_a_floor_under_the_cube():
    """Something for light to bounce off."""
    bpy.ops.mesh.primitive_plane_add(size=8, location=(0, 0, -1 - GAP))
    bpy.context.object.name = "Floor"


def contents():
    """How many there are of what a bake may leave behind."""
    kinds = ("images", "meshes", "materials", "objects", "scenes", "worlds", "cameras")
    uv_layers = sorted(layer.name for mesh in bpy.data.meshes for layer in mesh.uv_layers)
    return {kind: len(getattr(bpy.data, kind)) for kind in kinds}, uv_layers


def lightmaps():
    """Names of the objects that have one."""
    return sorted(ob.name for ob in bpy.data.objects if ob.get("patchlight_lightmap"))


def shown_images():
    """Names of what Image Editors show."""
    areas = [area for window in bpy.context.window_manager.windows for area in window.screen.areas]
    return [area.spaces.active.image.name for area in areas if area.type == "IMAGE_EDITOR"]


def state():
    """What the panel shows of a bake."""
    return bpy.context.window_manager.patchlight


def check(what, holds):
    """Say that it holds, or stop."""
    if not holds:
        raise AssertionError(what)
    print(f"ok: {what}")


def run():
    """Take one step after another, with Blender's own loop between them."""
    going, deadline = steps(), time.perf_counter() + SECONDS

    def step():
        try:
            if time.perf_counter() > deadline:
                raise TimeoutError(f"not done after {SECONDS} s")
            next(going)
            return 0.05
        except StopIteration:
            print(f"all held in a window of Blender {bpy.app.version_string}")
            code = 0
        except BaseException:  # whatever it is ends Blender, which would wait for a user
            traceback.print_exc()
            code = 1
        sys.stdout.flush()
        os._exit(code)  # quitting would ask whether to save

    bpy.app.timers.register(step, first_interval=STARTING)


run()
