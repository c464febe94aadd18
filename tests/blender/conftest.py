"""Scenes built by hand, from an empty file. Without bpy the folder is left out as a whole."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

if find_spec("bpy") is None:
    collect_ignore_glob = ["test_*.py"]
else:
    import bpy

    from addon.blender.read_scene import read_scene
    from tests.blender.node_trees import ROUNDING, baked_by_cycles, colours, image_node


@pytest.fixture
def empty_file():
    """No objects, no world, no materials; what every test of this folder that builds its own scene starts from."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


@pytest.fixture
def add_mesh():
    """Add an object of vertices and faces to the scene."""

    def add(name, vertices, faces, material=None):
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata([tuple(map(float, v)) for v in vertices], [], faces)
        if material is not None:
            mesh.materials.append(material)
        blender_object = bpy.data.objects.new(name, mesh)
        bpy.context.scene.collection.objects.link(blender_object)
        return blender_object

    return add


@pytest.fixture
def add_cube(add_mesh):
    """Add a cube of side 2 around the origin, faces outwards."""

    def add(name="Cube", material=None):
        vertices = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return add_mesh(name, vertices, faces, material)

    return add


@pytest.fixture
def add_lamp():
    """Add a lamp; keyword arguments are set on its data."""

    def add(kind, name="Lamp", location=(0, 0, 0), rotation=(0, 0, 0), **values):
        data = bpy.data.lights.new(name, kind)
        for key, value in values.items():
            setattr(data, key, value)
        lamp = bpy.data.objects.new(name, data)
        lamp.location, lamp.rotation_euler = location, rotation
        bpy.context.scene.collection.objects.link(lamp)
        return lamp

    return add


@pytest.fixture
def nodes():
    """A new material with an empty node tree: (material, new(type, **values), link(output, input))."""

    def make(name="Material", shader=None):
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        material.node_tree.nodes.clear()
        return material, NodeTree(material.node_tree)

    return make


class NodeTree:
    """Short words for building a shader tree."""

    def __init__(self, tree):
        self.tree = tree

    def new(self, kind, **inputs):
        """A node by the short name of its type; underscores in the inputs' names are spaces."""
        prefix = "Node" if kind in {"Reroute", "GroupInput", "GroupOutput"} else "ShaderNode"
        node = self.tree.nodes.new(prefix + kind)
        for name, value in inputs.items():
            node.inputs[name.replace("_", " ")].default_value = value
        return node

    def link(self, source, target, source_socket=0, target_socket=0):
        """Link two nodes' sockets by name or position."""
        self.tree.links.new(source.outputs[source_socket], target.inputs[target_socket])
        return target

    def show(self, shader):
        """Make a shader the surface."""
        return self.link(shader, self.new("OutputMaterial"), 0, "Surface")


@pytest.fixture
def add_image():
    """Add an image of given pixels, float32 (height, width, 3), stored as bytes or floats."""

    def add(pixels, name="Image", is_float=False, space="sRGB"):
        height, width = pixels.shape[:2]
        image = bpy.data.images.new(name, width, height, float_buffer=is_float)
        image.colorspace_settings.name = space
        rgba = np.ones((height, width, 4), np.float32)
        rgba[..., :3] = pixels
        image.pixels.foreach_set(rgba.ravel())
        image.update()
        return image

    return add


@pytest.fixture
def read_material(add_cube):
    """Read a material on a cube: (core material, warnings)."""

    def read(material):
        if not bpy.data.objects:
            add_cube().data.uv_layers.new(name="UVMap")
        bpy.data.objects[0].data.materials.clear()
        bpy.data.objects[0].data.materials.append(material)
        scene = read_scene(bpy.context.scene)
        return scene.materials[scene.triangle_materials[0]], scene.warnings

    return read


@pytest.fixture
def plane(add_mesh):
    """A unit square whose UVs are its x and y."""
    plane = add_mesh("Plane", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
    plane.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", [0, 0, 1, 0, 1, 1, 0, 1])
    return plane


@pytest.fixture
def compare(nodes, add_image, plane):
    """Hold the reading of ``make(tree, first image's node, second one's)``, a node, against Cycles' bake."""

    def check(make, socket=0, tolerance=ROUNDING, is_flat=False):
        material, tree = nodes()
        images = [image_node(tree, add_image(colours(k), is_float=True, space="Non-Color")) for k in (0, 1)]
        diffuse = tree.new("BsdfDiffuse")
        tree.link(make(tree, *images), diffuse, socket, "Color")
        tree.show(diffuse)
        plane.data.materials.append(material)
        scene = read_scene(bpy.context.scene)
        assert scene.warnings == ()
        found = scene.materials[scene.triangle_materials[0]]
        read = np.array(found.reflectance)
        if found.reflectance_texture is not None:
            read = read * found.reflectance_texture.pixels
        expected = np.clip(baked_by_cycles(plane, material), 0, 1)
        np.testing.assert_allclose(np.broadcast_to(read, expected.shape), expected, atol=tolerance)
        assert (np.ptp(expected) > 0.1) != is_flat

    return check
