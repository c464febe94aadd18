"""What stands for a smooth surface is where its triangles are to all that can be seen from them."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.receivers import surface_receivers
from addon.core.scene import PointLight, SunLight
from tests.physics.lighting import SINGLE
from tests.scenes import kernel_of, rectangle, scene_of, sphere

COLOUR = (3.0, 2.0, 0.5)


def bulging(parts, lights, degrees=25.0):
    """A square metre of two triangles, shaded as if it bulged: its corners' normals lean outwards."""
    scene = scene_of([rectangle((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0), name="top"), *parts], lights)
    normals = np.array(scene.corner_normals)
    for t in range(2):
        out = scene.corners[t] * (1, 1, 0)
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        normals[t] = np.sin(np.radians(degrees)) * out + np.cos(np.radians(degrees)) * np.array([0, 0, 1.0])
    return replace(scene, corner_normals=normals.astype(np.float32))


def light_on_top(scene, samples=64):
    """Direct light on points of the top, float64 (N, 3); the points in its plane, and their normals."""
    weights = np.random.default_rng(0).dirichlet((1, 1, 1), 200)
    weights = np.maximum(weights, 0.01) / np.maximum(weights, 0.01).sum(axis=1, keepdims=True)
    triangles = np.tile(np.arange(2, dtype=np.int32), 100)
    receivers = surface_receivers(scene, triangles, weights.astype(np.float32))
    points = np.einsum("nk,nkc->nc", weights, scene.corners[triangles])
    with kernel_of(scene) as kernel:
        values, _, _ = kernel.direct(emitters_of(scene, kernel.centre), receivers, samples, 0)
    return values.astype(np.float64), points, receivers.normals.astype(np.float64)


def test_a_lamp_is_as_far_as_from_the_triangle():
    """A lamp 10 cm above a top whose normals would have it bulge by 13 cm: E = I cos / d^2 from where the top is."""
    scene = bulging([], [PointLight("lamp", (0.1, 0.05, 0.1), COLOUR)])
    values, points, normals = light_on_top(scene)
    to = np.array([0.1, 0.05, 0.1]) - points
    distances = np.linalg.norm(to, axis=1)
    exact = np.maximum(np.einsum("nc,nc->n", to, normals), 0) / distances**3
    # normals in float32, and points that float32 weights have moved by 1e-7 m of a distance of 0.1
    assert values == pytest.approx(exact[:, None] * COLOUR, rel=2 * SINGLE, abs=2 * SINGLE * exact.max())


def test_what_stands_on_it_throws_its_shadow_there():
    """A sheet 5 cm above one half of the top, which would bulge through it."""
    sheet = rectangle((-0.5, -0.5, 0.05), (0.5, 0, 0), (0, 1, 0), name="sheet")
    values, points, _ = light_on_top(bulging([sheet], [PointLight("lamp", (0.0, 0.0, 2.0), COLOUR)]))
    # the lamp is in the middle above: rays to points of the half x < 0 pass the sheet's height at 39/40 of their x
    is_below = (points[:, 0] < 0) & (points[:, 0] > -0.49)
    assert (values[is_below] == 0).all()
    assert (values[points[:, 0] > 0] > 0).all()


def test_a_ball_of_few_faces_has_no_teeth_at_its_terminator():
    """A sun at the ball's side: a smooth ball has E cos up to its terminator, whatever its facets hide."""
    ball = sphere((0, 0, 0), 1.0, rings=12, segments=24, name="ball")
    scene = scene_of([ball], [SunLight("sun", (-1.0, 0, 0), COLOUR)])
    triangles = np.repeat(np.arange(len(scene.triangles), dtype=np.int32), 4)
    weights = np.random.default_rng(1).dirichlet((1, 1, 1), len(triangles)).astype(np.float32)
    receivers = surface_receivers(scene, triangles, weights)
    with kernel_of(scene) as kernel:
        values, _, _ = kernel.direct(emitters_of(scene, kernel.centre), receivers, 64, 0)
    exact = np.maximum(receivers.normals[:, 0].astype(np.float64), 0)
    # normals within a quarter of a degree of the facet's, a cosine of .99999, are taken to be that
    assert values == pytest.approx(exact[:, None] * COLOUR, rel=SINGLE, abs=0.0045 * max(COLOUR))
