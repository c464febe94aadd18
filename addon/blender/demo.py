"""The demo scenes, built by script from nothing: the Cornell box and a small furnished room.

bpy.ops.wm.read_factory_settings(use_empty=True)
build_room()
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from .demo_room import build_room
from .demo_shapes import add_object, diffuse, shape
from .files import save_blend

__all__ = ["build_cornell_box", "build_demo", "build_room", "save_demo"]

# Cornell University Program of Computer Graphics, the Cornell box data: measured geometry and spectra.
# Millimetres, y up, z into the box; every quadrilateral as published.
CORNELL_QUADS = {
    "floor": [[(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)]],
    "ceiling": [[(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)]],
    "back wall": [[(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)]],
    "right wall": [[(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)]],
    "left wall": [[(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)]],
    "light": [[(343, 548.8, 227), (343, 548.8, 332), (213, 548.8, 332), (213, 548.8, 227)]],
    "short block": [
        [(130, 165, 65), (82, 165, 225), (240, 165, 272), (290, 165, 114)],
        [(290, 0, 114), (290, 165, 114), (240, 165, 272), (240, 0, 272)],
        [(130, 0, 65), (130, 165, 65), (290, 165, 114), (290, 0, 114)],
        [(82, 0, 225), (82, 165, 225), (130, 165, 65), (130, 0, 65)],
        [(240, 0, 272), (240, 165, 272), (82, 165, 225), (82, 0, 225)],
    ],
    "tall block": [
        [(423, 330, 247), (265, 330, 296), (314, 330, 456), (472, 330, 406)],
        [(423, 0, 247), (423, 330, 247), (472, 330, 406), (472, 0, 406)],
        [(472, 0, 406), (472, 330, 406), (314, 330, 456), (314, 0, 456)],
        [(314, 0, 456), (314, 330, 456), (265, 330, 296), (265, 0, 296)],
        [(265, 0, 296), (265, 330, 296), (423, 330, 247), (423, 0, 247)],
    ],
}

# The published spectra under CIE 1931, 2 degrees, as linear Rec.709: reflectances under D65 with white = 1, the light's
# emission as it is. The light is published as a Lambertian reflector of 0.78.
CORNELL_REFLECTANCE = {
    "white": (0.7384, 0.7358, 0.7399),
    "green": (0.0686, 0.3979, 0.0867),
    "red": (0.4936, 0.0492, 0.0512),
    "light": (0.78, 0.78, 0.78),
}
CORNELL_RADIANCE = (20.7139, 10.8544, 2.7709)  # [W/(m^2 sr)] up to the scale of the published relative spectrum
CORNELL_MATERIALS = {"right wall": "green", "left wall": "red", "light": "light"}  # all else is white

LIGHT_DROP = 1e-4  # [m]; the published light lies in the plane of the ceiling, where neither would be in front


def build_cornell_box():
    """Fill the current, empty scene with the Cornell box: eight objects and the published camera."""
    strength = max(CORNELL_RADIANCE)
    hue = tuple(channel / strength for channel in CORNELL_RADIANCE)
    materials = {
        name: diffuse(name, colour, emission=hue if name == "light" else None, strength=strength)
        for name, colour in CORNELL_REFLECTANCE.items()
    }
    for name, quads in CORNELL_QUADS.items():
        form = _cornell_shape(quads)
        if name == "light":
            form = form.moved((0, 0, -LIGHT_DROP))
        add_object(name, form, materials[CORNELL_MATERIALS.get(name, "white")])

    scene = bpy.context.scene
    scene.camera = _cornell_camera()
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = 540


def _cornell_shape(quads):
    corners = cornell_to_blender(np.asarray(quads, float).reshape(-1, 3))
    points, index = np.unique(corners.round(9), axis=0, return_inverse=True)
    return shape(points, index.reshape(-1, 4))


def cornell_to_blender(positions):
    """Published millimetres, y up, to metres, z up: a rotation about x, so left stays left."""
    positions = np.asarray(positions, float)
    return np.stack([positions[..., 0], -positions[..., 2], positions[..., 1]], axis=-1) / 1000


def _cornell_camera():
    camera = bpy.data.cameras.new("camera")
    camera.lens = 35.0  # [mm], on a film of 25 x 25 mm
    camera.sensor_width = camera.sensor_height = 25.0
    camera.clip_start = 0.01
    obj = bpy.data.objects.new("camera", camera)
    # right, up and back of a camera that looks along the published +z
    obj.matrix_world = Matrix(((-1, 0, 0, 0.278), (0, 0, 1, 0.800), (0, 1, 0, 0.273), (0, 0, 0, 1)))
    bpy.context.scene.collection.objects.link(obj)
    return obj


def build_demo():
    """Fill the current, empty file with both: scene "room", which stays the active one, and scene "cornell box"."""
    window = bpy.context.window
    room = window.scene
    room.name = "room"
    build_room()
    window.scene = bpy.data.scenes.new("cornell box")
    build_cornell_box()
    window.scene = room


def save_demo(folder):
    """Write ``cornell.blend`` and ``room.blend`` into a folder; return their paths.

    Replaces the file that is open in this Blender.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, build in (("cornell", build_cornell_box), ("room", build_room)):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        build()
        paths.append(folder / f"{name}.blend")
        save_blend(paths[-1])
    return tuple(paths)
