"""The demo scenes: the Cornell box as published, and a room that light enters by its window only."""

import bpy
import numpy as np
import pytest

from addon.blender import demo, demo_room

# Blender keeps coordinates as float32: seven digits
FLOAT32 = 1e-6


@pytest.fixture(scope="module")
def cornell():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    demo.build_cornell_box()
    return {obj.name: _triangles(obj) for obj in _meshes()}


@pytest.fixture(scope="module")
def _room():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    demo.build_room()


def _meshes():
    return [obj for obj in bpy.context.scene.objects if obj.type == "MESH"]


def _triangles(obj):
    """World positions of an object's triangles, (T, 3, 3)."""
    mesh = obj.data
    mesh.calc_loop_triangles()
    index = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    mesh.loop_triangles.foreach_get("vertices", index)
    points = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", points)
    world = np.array(obj.matrix_world)
    return (points.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3])[index].reshape(-1, 3, 3)


def _area_vectors(triangles):
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2


def _area(triangles):
    return np.linalg.norm(_area_vectors(triangles), axis=1).sum()


class TestCornellBox:
    # trapezia and rectangles computed by hand from the published corners
    @pytest.mark.parametrize(
        ("name", "square_mm"),
        [
            ("floor", (552.8 + 549.6) / 2 * 559.2),
            ("ceiling", 556 * 559.2),
            ("back wall", (549.6 + 556) / 2 * 548.8),
            ("right wall", 559.2 * 548.8),
            ("light", 130 * 105),
        ],
    )
    def test_areas_are_the_published_ones(self, cornell, name, square_mm):
        assert _area(cornell[name]) == pytest.approx(square_mm * 1e-6, rel=FLOAT32)

    # area of the published top by the shoelace formula, times the height
    @pytest.mark.parametrize(("name", "cubic_mm"), [("short block", 27633 * 165), ("tall block", 27626.5 * 330)])
    def test_block_volumes_are_the_published_ones(self, cornell, name, cubic_mm):
        # flux of (0, 0, z): the missing bottom lies at z = 0 and adds none; positive only if the faces look outwards
        triangles = cornell[name]
        volume = (triangles[..., 2].mean(axis=1) * _area_vectors(triangles)[:, 2]).sum()
        assert volume == pytest.approx(cubic_mm * 1e-9, rel=1e-5)  # a difference of areas: two digits of float32 lost

    @pytest.mark.parametrize("name", ["floor", "ceiling", "back wall", "right wall", "left wall", "light"])
    def test_walls_face_the_inside(self, cornell, name):
        middle = np.array([0.278, -0.28, 0.274])
        towards_middle = middle - cornell[name].mean(axis=1)
        assert ((_area_vectors(cornell[name]) * towards_middle).sum(axis=1) > 0).all()

    def test_the_light_hangs_just_below_the_ceiling(self, cornell):
        gap = cornell["ceiling"][..., 2].min() - cornell["light"][..., 2].max()
        assert gap == pytest.approx(demo.LIGHT_DROP, abs=FLOAT32)

    def test_red_is_left_and_green_is_right_in_the_published_camera(self, cornell):
        camera = bpy.context.scene.camera
        assert np.degrees(camera.data.angle) == pytest.approx(39.31, abs=0.005)  # published to two decimals
        to_camera = np.linalg.inv(np.array(camera.matrix_world))
        seen = {name: to_camera[:3, :3] @ cornell[name].mean(axis=(0, 1)) + to_camera[:3, 3] for name in cornell}
        assert seen["left wall"][0] < 0 < seen["right wall"][0]
        assert seen["floor"][1] < 0 < seen["ceiling"][1]
        assert all(position[2] < 0 for position in seen.values())  # a camera looks along its -z
        colours = {name: bpy.data.objects[name].active_material.name for name in ("left wall", "right wall")}
        assert colours == {"left wall": "red", "right wall": "green"}


@pytest.mark.usefixtures("_room")
class TestRoom:
    def test_light_enters_by_the_window_only(self):
        scene = bpy.context.scene
        depsgraph = bpy.context.evaluated_depsgraph_get()
        eye = np.array([2.1, 1.2, 1.9])
        through = 0
        for direction in _directions(4000):
            hit = scene.ray_cast(depsgraph, eye.tolist(), direction.tolist())[0]
            if not hit:
                assert _passes_the_window(eye, direction)
                through += 1
        assert through > 0

    def test_solid_things_are_closed_and_face_outwards(self):
        shell = {"floor", "ceiling", "back wall", "right wall", "camera wall", "window wall", "facade"}
        for obj in _meshes():
            if obj.name not in shell:
                assert _is_solid(obj), obj.name

    def test_the_shell_faces_the_room(self):
        centre = np.array([demo_room.WIDTH, demo_room.DEPTH, demo_room.HEIGHT]) / 2
        for name in ("floor", "ceiling", "back wall", "right wall", "camera wall"):
            triangles = _triangles(bpy.data.objects[name])
            inwards = ((centre - triangles.mean(axis=1)) * _area_vectors(triangles)).sum(axis=1)
            assert (inwards > 0).all(), name

    def test_everything_stands_inside_the_shell(self):
        high = np.array([demo_room.WIDTH, demo_room.DEPTH, demo_room.HEIGHT])
        for obj in _meshes():
            points = _triangles(obj).reshape(-1, 3)
            assert (points >= [-demo_room.WALL - FLOAT32, -FLOAT32, -FLOAT32]).all(), obj.name
            assert (points <= high + FLOAT32).all(), obj.name

    def test_size(self):
        counts = [len(_triangles(obj)) for obj in _meshes()]
        assert 20 <= len(counts) <= 45
        assert 2_000 <= sum(counts) <= 15_000


@pytest.mark.parametrize("build", [demo.build_cornell_box, demo.build_room])
def test_materials_are_diffuse_and_physical(build):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    build()
    for material in bpy.data.materials:
        inputs = material.node_tree.nodes["Principled BSDF"].inputs
        assert max(inputs["Base Color"].default_value[:3]) <= 0.9, material.name
        assert inputs["Roughness"].default_value == 1.0, material.name
        assert inputs["Specular IOR Level"].default_value == 0.0, material.name
    for image in bpy.data.images:
        pixels = _pixels(image)[..., :3]
        linear = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
        assert linear.max() <= 0.9, image.name


def _pixels(image):
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)


def test_the_demo_file_holds_both_scenes_each_with_its_camera():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    demo.build_demo()
    assert bpy.context.scene.name == "room"
    assert {scene.name for scene in bpy.data.scenes} == {"room", "cornell box"}
    for scene in bpy.data.scenes:
        assert scene.camera.name in scene.objects


def test_saved_scenes_open_with_their_textures(tmp_path):
    paths = demo.save_demo(tmp_path / "demo")
    assert [path.name for path in paths] == ["cornell.blend", "room.blend"]
    bpy.ops.wm.open_mainfile(filepath=str(paths[1]))
    names = {"oak boards", "painting", "rug"}
    assert names <= {image.name for image in bpy.data.images if image.packed_file}
    for name in names:
        assert _pixels(bpy.data.images[name])[..., :3].std() > 0.01, name  # a lost image is one colour


def _directions(count):
    """Evenly spread unit vectors: a Fibonacci spiral on the sphere."""
    i = np.arange(count) + 0.5
    z = 1 - 2 * i / count
    turn = np.pi * (1 + 5**0.5) * i
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)


def _passes_the_window(eye, direction):
    y0, z0, y1, z1 = demo_room.WINDOW
    places = [eye + direction * ((x - eye[0]) / direction[0]) for x in (0.0, -demo_room.WALL)]
    return direction[0] < 0 and all(y0 <= y <= y1 and z0 <= z <= z1 for _, y, z in places)


def _is_solid(obj):
    import bmesh  # found only once bpy is loaded

    solid = bmesh.new()
    try:
        solid.from_mesh(obj.data)
        closed = all(edge.is_manifold and edge.is_contiguous for edge in solid.edges)
        return closed and solid.calc_volume(signed=True) > 0
    finally:
        solid.free()
