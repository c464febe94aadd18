"""Cutting long edges for vertex colours: short edges, no gaps, the same surface with all it carries."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon.blender.bake_scene import discard, prepare, write
from addon.core.settings import BakeSettings

pytestmark = pytest.mark.usefixtures("empty_file")

VERTEX = BakeSettings(target="vertex")
ROUNDING = 1 + 1e-5  # float32 positions


def lit(prepared):
    return SimpleNamespace(corner_colours=np.ones((len(prepared.scene.triangles), 3, 3), np.float32))


def subdivided(metres):
    prepared = prepare(bpy.context.scene, VERTEX, subdivide=metres)
    write(prepared, lit(prepared))
    discard(prepared)
    return prepared


def world_edge_lengths(blender_object):
    matrix, vertices = blender_object.matrix_world, blender_object.data.vertices
    ends = [[matrix @ vertices[v].co for v in edge.vertices] for edge in blender_object.data.edges]
    return np.array([(a - b).length for a, b in ends])


def area_vector(mesh):
    return sum(np.array(p.normal) * p.area for p in mesh.polygons), sum(p.area for p in mesh.polygons)


SHAPES = {
    "quad": ([(0, 0, 0), (3, 0, 0), (3, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)]),
    "trapezium": ([(0, 0, 0), (3, 0, 0), (2, 1, 0), (1, 1, 0)], [(0, 1, 2, 3)]),
    "arrow": ([(0, 0, 0), (2, 0, 0), (0.5, 0.5, 0), (0, 2, 0)], [(0, 1, 2, 3)]),
    "triangle": ([(0, 0, 0), (3, 0, 0), (0, 1, 0)], [(0, 1, 2)]),
    "disc": ([(np.cos(a), np.sin(a), 0) for a in np.arange(40) * np.pi / 20], [tuple(range(40))]),
    "needle": ([(0, 0, 0), (3, 0, 0), (1.5, 1e-6, 0)], [(0, 1, 2)]),
    "line": ([(0, 0, 0), (3, 0, 0), (1, 0, 0)], [(0, 1, 2)]),
    "strip and neighbours": (
        [(0, 0, 0), (3, 0, 0), (3, 0.1, 0), (0, 0.1, 0), (1, 2, 0), (2, -2, 0)],
        [(0, 1, 2, 3), (3, 2, 4), (0, 5, 1)],
    ),
    "two discs": (
        [(np.cos(a), np.sin(a), 0) for a in np.arange(5) * np.pi / 2.5] + [(9, 0, 0), (9.1, 0, 0), (9, 0.1, 0)],
        [(5, 6, 7), tuple(range(5))],
    ),
}


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("metres", [0.3, 1.01])
def test_edges_are_short_and_the_surface_is_the_same(add_mesh, shape, metres):
    piece = add_mesh("Piece", *shape)
    borders = boundary_length(piece.data)
    normal, area = area_vector(piece.data)
    subdivided(metres)
    assert world_edge_lengths(piece).max() <= metres * ROUNDING
    cut_normal, cut_area = area_vector(piece.data)
    np.testing.assert_allclose(cut_normal, normal, atol=1e-5)  # float32 areas
    assert cut_area == pytest.approx(area, abs=1e-5)
    # a T-junction would add its edge to the boundary, once from each side
    assert boundary_length(piece.data) == pytest.approx(borders, rel=1e-5)


def boundary_length(mesh):
    uses = Counter(loop.edge_index for loop in mesh.loops)
    ends = [[mesh.vertices[v].co for v in mesh.edges[edge].vertices] for edge, count in uses.items() if count == 1]
    return sum((a - b).length for a, b in ends)


def test_a_wall_becomes_a_grid_of_quads(add_mesh):
    wall = add_mesh("Wall", [(0, 0, 0), (4, 0, 0), (4, 2, 0), (0, 2, 0)], [(0, 1, 2, 3)])
    subdivided(0.5)
    assert Counter(len(p.vertices) for p in wall.data.polygons) == {4: 32}
    assert len(wall.data.vertices) == 9 * 5


def test_the_world_decides_the_length(add_cube):
    cube = add_cube()  # side 2, scaled to 6 x 2 x 0.2
    cube.scale = (3, 1, 0.1)
    subdivided(1.0)
    assert world_edge_lengths(cube).max() <= ROUNDING
    assert len(cube.data.polygons) == 2 * (8 * 2 + 8 * 1 + 2 * 1)  # halves: 6 m in 8, 2 m in 2, 0.2 m in 1


def test_materials_uvs_sharpness_and_names_come_along(add_mesh):
    vertices = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (4, 0, 1), (4, 2, 1)]
    piece = add_mesh("Piece", vertices, [(0, 1, 2, 3), (1, 4, 5, 2)])
    for name in ("Red", "Green"):
        piece.data.materials.append(bpy.data.materials.new(name))
    piece.data.polygons[1].material_index = 1
    piece.data.shade_smooth()
    piece.data.polygons[1].use_smooth = False
    sharp = next(e for e in piece.data.edges if set(e.vertices) == {0, 1})
    sharp.use_edge_sharp = True
    for name in ("Texture", "Other"):
        piece.data.uv_layers.new(name=name)
    piece.data.uv_layers["Texture"].uv.foreach_set(
        "vector", np.array([vertices[loop.vertex_index][:2] for loop in piece.data.loops], np.float32).ravel()
    )
    piece.data.uv_layers["Other"].active_render = True
    piece.data["note"] = "kept"
    prepared = subdivided(0.5)
    mesh = piece.data
    assert (mesh.name, mesh["note"], len(bpy.data.meshes)) == ("Piece", "kept", 1)
    assert [m.name for m in mesh.materials] == ["Red", "Green"]
    for polygon in mesh.polygons:
        is_second = polygon.center.x > 2
        assert polygon.material_index == is_second
        assert polygon.use_smooth == (not is_second)
    positions = np.array([mesh.vertices[loop.vertex_index].co for loop in mesh.loops])
    uvs = np.array([item.vector for item in mesh.uv_layers["Texture"].uv])
    np.testing.assert_allclose(uvs, positions[:, :2], atol=1e-6)  # float32
    assert mesh.uv_layers["Other"].active_render
    for edge in mesh.edges:
        first, second = (mesh.vertices[v].co for v in edge.vertices)
        assert edge.use_edge_sharp == (first.y == second.y == 0 and max(first.x, second.x) <= 2)
    assert set(prepared.scene.objects[0].polygons) <= set(range(len(mesh.polygons)))
    np.testing.assert_allclose(
        np.array([v.co for v in mesh.vertices])[
            np.array([loop.vertex_index for loop in mesh.loops])[prepared.scene.objects[0].corners]
        ],
        prepared.scene.corners,
        atol=1e-6,  # float32
    )


def test_nothing_is_cut_that_is_short_enough(add_cube):
    cube = add_cube()
    mesh = cube.data
    subdivided(2.0)
    assert cube.data == mesh


def test_objects_with_modifiers_are_not_cut_and_named(add_cube):
    cube = add_cube("Bent")
    cube.modifiers.new("Bend", "SIMPLE_DEFORM")
    prepared = subdivided(0.5)
    assert len(cube.data.polygons) == 6
    assert any("'Bent' has modifiers or shape keys: it is not subdivided" in w for w in prepared.scene.warnings)


def test_a_broken_mesh_is_left_out_as_without_subdivision(add_cube):
    add_cube("Room")
    add_cube("Broken").data.vertices[0].co.x = np.nan
    prepared = subdivided(0.5)
    assert [o.name for o in prepared.scene.objects] == ["Room"]
    assert any("'Broken'" in warning for warning in prepared.scene.warnings)
