"""Smooth surfaces and sharp edges: a far lamp and nothing else, so that irradiance is known."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.bake import bake
from addon.core.scene import Material, PointLight
from addon.core.settings import BakeSettings
from tests.core.baking import LUMINANCE, TEXELS, colours_of
from tests.scenes import BLACK, box, rectangle, scene_of, sphere, sphere_in_room

FAR = PointLight("far", (30.0, -20.0, 25.0), (1e4, 1e4, 1e4))


def exact_colours(points, normals):
    """E / pi of the far lamp on a convex black body."""
    to = np.asarray(FAR.position) - points
    distance = np.linalg.norm(to, axis=-1)
    return np.maximum((to * normals).sum(axis=-1), 0) / distance**3 * FAR.intensity[0] / np.pi


def ball_scene():
    return scene_of([sphere((0, 0, 0), 1, rings=24, segments=48, material=BLACK)], [FAR])


def test_a_smooth_sphere_is_smooth_in_vertex_colours():
    scene = ball_scene()
    colours, _ = colours_of(scene, error=0.05)
    normals = scene.corner_normals.astype(np.float64)
    exact = exact_colours(scene.corners, normals)
    step = np.pi / 24  # between neighbouring vertices [rad]
    full = exact.max()
    # the mean of the adjoining faces' receivers is that of a neighbourhood of a step, across the terminator, too
    assert np.abs(colours - exact).max() < 0.5 * step * full
    jumps = np.abs(colours[:, [0, 1, 2]] - colours[:, [1, 2, 0]])
    # E changes by at most full sin(angle) between neighbours: nothing may jump more than half as much again
    assert jumps.max() < 1.5 * step * full


def test_corners_of_a_smooth_vertex_share_their_colour():
    scene = ball_scene()
    colours = bake(scene, BakeSettings(target="vertex", error=0.3, patch_size=0.3)).corner_colours
    for vertex in range(0, len(scene.vertices), 37):
        shared = colours[scene.triangles == vertex]
        assert (shared == shared[0]).all()


def test_a_smooth_sphere_is_smooth_in_a_lightmap():
    scene = ball_scene()
    result = bake(scene, BakeSettings(texels=128 * 128, error=0.05, threads=2))
    pixels = result.lightmap.pixels @ LUMINANCE
    height, width = pixels.shape
    full = exact_colours(scene.corners, scene.corner_normals).max()
    weights = np.random.default_rng(0).dirichlet((3, 3, 3), len(scene.triangles))
    normals = np.einsum("tk,tkc->tc", weights, scene.corner_normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    uvs = np.einsum("tk,tkc->tc", weights, result.lightmap.uvs) * [width, height]
    found = pixels[uvs[:, 1].astype(int), uvs[:, 0].astype(int)]
    exact = exact_colours(normals, normals)
    texel = np.sqrt(4 * np.pi / (0.5 * height * width))  # [rad], where half of the image is used
    # the nearest texel is off by less than one, along which E changes by at most full sin(angle)
    assert np.abs(found - exact).max() < 1.5 * texel * full


def test_the_two_sides_of_a_cubes_edge_differ():
    cube = box((-1, -1, -1), (1, 1, 1), material=BLACK)
    scene = scene_of([cube], [FAR])
    exact = exact_colours(scene.corners, scene.corner_normals.astype(np.float64))
    colours, _ = colours_of(scene)
    # receivers stand up to 17 cm inside their faces; the lamp is 44 m away
    assert colours == pytest.approx(exact, rel=0.03, abs=1e-6)
    result = bake(scene, BakeSettings(texels=TEXELS, error=0.05))
    pixels = result.lightmap.pixels @ LUMINANCE
    height, width = pixels.shape
    # a little inside each corner of each triangle
    weights = np.eye(3) * 0.94 + 0.02
    places = np.einsum("ck,tkx->tcx", weights, result.lightmap.uvs) * [width, height]
    found = pixels[places[..., 1].astype(int), places[..., 0].astype(int)]
    assert found == pytest.approx(exact, rel=0.03, abs=1e-6)


def test_faces_in_one_plane_share_colours_but_not_across_an_edge_marked_sharp():
    """A sheet of two quads, the left one in the shadow of a board whose edge stands above the edge between them."""
    sheet = rectangle((0, 0, 0), (2, 0, 0), (0, 1, 0), cuts=(2, 1), material=BLACK)
    board = rectangle((0, -1, 0.5), (1, 0, 0), (0, 3, 0), is_target=False)
    scene = scene_of([sheet, board], [replace(FAR, position=(1.0, 0.5, 40.0))])
    triangles = scene.triangles[:4]
    middle = np.isin(triangles, [1, 4])
    sharp = middle & np.roll(middle, -1, axis=1)
    assert sharp.sum() == 2
    objects = (replace(scene.objects[0], sharp_edges=sharp), scene.objects[1])
    soft, marked = (colours_of(s)[0][:4] for s in (scene, replace(scene, objects=objects)))
    is_left = np.arange(4)[:, None] < 2
    assert marked[middle & is_left] == pytest.approx(0, abs=1e-12)
    # 40 m overhead, at a cosine within 1e-3 of 1
    assert marked[middle & ~is_left] == pytest.approx(1e4 / 40**2 / np.pi, rel=2e-3)
    for vertex in (1, 4):
        shared = soft[triangles == vertex]
        assert np.ptp(shared) < 1e-6 * shared.max()
        assert 0 < shared[0] < 1e4 / 40**2 / np.pi


def test_a_smooth_ball_in_a_closed_room_loses_no_light():
    """Furnace with a smooth ball: shading normals neither make nor lose light."""
    scene = sphere_in_room((), Material("glow", (0.5,) * 3, radiance=(1.0, 1.0, 1.0)))
    colours, _ = colours_of(scene, error=0.02)
    ball = scene.objects[1].span
    assert colours[ball].mean() == pytest.approx(2, rel=0.02)
    # near the facets' silhouettes a few rays graze their own ball
    assert np.abs(colours[ball] / 2 - 1).max() < 0.15
