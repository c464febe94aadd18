"""Small patches that are joined: which, that they are all still there, and that they exchange the same light."""

import numpy as np
import pytest

from addon.core.joined import SMALL, TURN, joined
from addon.core.laws import measured_laws
from addon.core.parted import finer_where_parted
from addon.core.patches import grid_of, patch_triangles
from addon.core.radiosity import solve_patches
from addon.core.scene import Material, Texture
from addon.core.triangles import triangle_areas
from tests.scenes import box, kernel_of, rectangle, scene_of, sphere

SIZE, BUDGET = 0.2, 10000
RED = Material("red", (0.8, 0.1, 0.1))


def ball_in_room(segments):
    ball = sphere((0.5, 0.5, 0.3), 0.2, segments // 2, segments, name="ball")
    return scene_of([box((0, 0, 0), (1, 1, 1), inwards=True, name="room"), ball])


def patches_of(scene, kernel, is_joined=True):
    grid = grid_of(scene, SIZE, BUDGET)
    pieces = finer_where_parted(scene, kernel, grid, BUDGET, 0)
    return joined(scene, kernel, grid, pieces) if is_joined else pieces


def test_a_ball_of_many_triangles_has_as_many_patches_as_one_of_few():
    counts = []
    for segments in (32, 128):
        scene = ball_in_room(segments)
        with kernel_of(scene) as kernel:
            counts.append(len(patches_of(scene, kernel)))
    # sixteen times the triangles: more of the cubes and turns have one in them
    assert counts[1] < 1.5 * counts[0]


def test_what_is_joined_is_small_near_and_of_one_object_material_and_turn():
    halves = [rectangle((x, 0, 0), (0.5, 0, 0), (0, 1, 0), cuts=(20, 40), name="floor") for x in (0, 0.5)]
    halves[1] = rectangle((0.5, 0, 0), (0.5, 0, 0), (0, 1, 0), cuts=(20, 40), material=RED, name="red floor")
    scene = scene_of(
        [*halves, sphere((0.5, 0.5, 0.5), 0.3, 32, 64, name="ball"), rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0))]
    )
    with kernel_of(scene) as kernel:
        patches = patches_of(scene, kernel)
    pieces, owners = patches.pieces, patches.owners
    objects = np.repeat(np.arange(len(scene.objects)), [obj.count for obj in scene.objects])
    corners = scene.corners
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    shared = np.bincount(owners)[owners] > 1
    assert shared.sum() > 1000
    assert (pieces.areas[shared] <= SMALL * SIZE**2).all()
    # all of a cube, and half a turn's step to either side; pieces reach beyond the cube that their middle lies in
    for values, width in (
        (objects[pieces.triangles], 0),
        (scene.triangle_materials[pieces.triangles], 0),
        *((normals[pieces.triangles, k], TURN) for k in range(3)),
        *((corners.mean(axis=1)[pieces.triangles, k], SIZE + 1e-9) for k in range(3)),
    ):
        highest, lowest = np.full(len(patches), -np.inf), np.full(len(patches), np.inf)
        np.maximum.at(highest, owners[shared], values[shared])
        np.minimum.at(lowest, owners[shared], values[shared])
        assert (highest - lowest).max() <= width + 1e-12


def test_areas_add_up_and_points_fall_on_each_triangle_by_its_area():
    scene = ball_in_room(24)
    with kernel_of(scene) as kernel:
        patches = patches_of(scene, kernel)
        triangles, _ = kernel.patch_points(np.arange(len(patches)), 1 << 12, 0)
    assert np.bincount(patches.owners, patches.pieces.areas) == pytest.approx(patches.areas, rel=1e-12)
    areas = triangle_areas(scene.corners)
    assert patches.areas.sum() == pytest.approx(areas.sum(), rel=1e-12)
    met = np.bincount(triangles, np.repeat(patches.areas, 1 << 12) / (1 << 12), len(areas))
    # stratified: two points of 4096 at the borders of each triangle's share, of patches of a few triangles
    assert met == pytest.approx(areas, abs=3 / (1 << 12) * patches.areas.max())
    corners, which = patch_triangles(scene, patches, np.arange(len(patches)))
    halves = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    # bounds are float32
    assert np.bincount(which, halves) == pytest.approx(patches.areas, rel=1e-5)


def test_reflectance_is_the_mean_by_area():
    """Pieces of all sizes, the left half of each texture lookup white, the right half black."""
    pixels = np.zeros((8, 8, 3), np.float32)
    pixels[:, :4] = 1.0
    material = Material("half", (1.0, 0.5, 0.25), reflectance_texture=Texture("half", pixels))
    floor = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), cuts=(30, 30), material=material, name="floor")
    scene = scene_of([floor])
    scene.vertices[:, :2] **= 1.5
    scene.uvs[:] = scene.corners[..., :2]
    with kernel_of(scene) as kernel:
        patches = patches_of(scene, kernel)
    pieces, owners = patches.pieces, patches.owners
    weights = pieces.areas[:, None] * pieces.reflectance
    expected = np.stack([np.bincount(owners, channel) for channel in weights.T], axis=1) / patches.areas[:, None]
    assert patches.reflectance == pytest.approx(expected, rel=1e-6)
    mixed = (patches.reflectance[:, 0] > 0.05) & (patches.reflectance[:, 0] < 0.95)
    assert mixed.any()
    plain = np.bincount(owners, pieces.reflectance[:, 0]) / np.bincount(owners)
    assert np.abs(plain - patches.reflectance[:, 0])[mixed].max() > 0.01


@pytest.mark.parametrize("bumps", [0.0, 1e-4, 3e-4, 1e-3])
@pytest.mark.parametrize("wall", [13, 25, 28])
def test_a_floor_of_small_triangles_is_not_joined_across_a_wall(bumps, wall):
    """On a row of edges, in the middle of a cube and near its end; smooth as a screed, and rough as a scan."""
    floor = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), cuts=(50, 50), name="floor")
    scene = scene_of([floor, rectangle((wall / 50, 0, -0.01), (0, 1, 0), (0, 0, 1), name="wall")])
    is_floor = np.unique(scene.triangles[:5000])
    scene.vertices[is_floor, 2] += bumps * np.random.default_rng(wall).standard_normal(len(is_floor))
    x = scene.corners.mean(axis=1)[:, 0]
    with kernel_of(scene) as kernel:
        patches = patches_of(scene, kernel)
    on_floor = patches.pieces.triangles < 5000
    is_beyond = on_floor & (x[patches.pieces.triangles] > wall / 50)
    beyond = np.bincount(patches.owners, patches.pieces.areas * is_beyond) / patches.areas
    assert (np.isclose(beyond, 0) | np.isclose(beyond, 1))[np.bincount(patches.owners, on_floor) > 0].all()
    # of 5000 pieces; rough ones come in a few turns
    assert np.bincount(patches.owners, on_floor).astype(bool).sum() < 200


def test_joined_patches_come_to_the_same_light():
    """A lit ceiling; what each side of the room's walls and the ball get is what they get from single triangles."""
    scene = ball_in_room(48)
    objects = np.repeat(np.arange(2), [obj.count for obj in scene.objects])
    means = []
    for is_joined in (False, True):
        with kernel_of(scene) as kernel:
            patches = patches_of(scene, kernel, is_joined)
            emitted = np.zeros((2 * len(patches), 3))
            heights = scene.corners[patches.triangles].mean(axis=1)[:, 2]
            emitted[::2][heights > 0.99] = 1.0
            solution = solve_patches(kernel, patches, emitted, "stochastic", "monte-carlo", 0.01, 0, lambda share: None)
            laws, _ = measured_laws(scene, kernel, patches, 0)
        on_ball = objects[patches.triangles] == 1
        parts = [on_ball & (heights > 0.3), on_ball & (heights < 0.3), ~on_ball & (heights < 0.01)]
        means.append([np.average(solution.radiosity[::2][part, 1], weights=patches.areas[part]) for part in parts])
        assert laws.closure < 1e-6
        # noise of 8192 rays a group: five times their 0.5 %
        assert laws.reciprocity < 0.03
    # what the halves of the ball get changes with which of its triangles count as its upper ones
    assert means[1] == pytest.approx(means[0], rel=0.03)
