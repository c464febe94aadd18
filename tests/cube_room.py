"""The smallest interior: a closed grey cube that faces inwards, 2 m wide, with a lamp in the middle."""

import bpy

CORNERS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
INWARD_FACES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def build_cube_room():
    """Replace what is open by the room; returns its object, "room"."""
    empty_file()
    mesh = bpy.data.meshes.new("room")
    mesh.from_pydata(CORNERS, [], INWARD_FACES)
    room = bpy.data.objects.new("room", mesh)
    lamp = bpy.data.lights.new("lamp", "POINT")
    lamp.energy, lamp.shadow_soft_size = 100.0, 0.0
    for ob in (room, bpy.data.objects.new("lamp", lamp)):
        bpy.context.scene.collection.objects.link(ob)
    return room


def empty_file():
    """Open a file without objects."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
