"""Seams are found where a surface goes on and its texels do not; stitched, both sides show the same, and little else
changes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.core import bake as bake_module
from addon.core.bake import bake
from addon.core.find_seams import find_seams
from addon.core.receivers import surface_receivers
from addon.core.scene import PointLight
from addon.core.seams import NO_SEAMS, STAY, Seams
from addon.core.settings import BakeSettings
from addon.core.texels import texels
from addon.core.unwrap import unwrap
from tests.scenes import Part, box, kernel_of, rectangle, scene_of, sphere

TEXELS = 1 << 14


def laid_out(scene):
    """The scene's charts, texels and seams."""
    charts = unwrap(scene, BakeSettings(texels=TEXELS))
    texel_map = texels(charts)
    with kernel_of(scene) as kernel:
        receivers = surface_receivers(scene, texel_map.triangles, texel_map.barycentrics)
        return charts, texel_map, find_seams(scene, kernel, receivers, charts.uvs, texel_map.cells)


def positions_of(scene, texel_map):
    corners = scene.corners[texel_map.triangles]
    return np.einsum("nk,nkc->nc", texel_map.barycentrics.astype(np.float64), corners)


def panels(*others, gap=0.0):
    """Two floor panels that meet at x = 1, one of them cut in two along y: a T-junction."""
    left = rectangle((0, 0, 0), (1, 0, 0), (0, 2, 0), name="left")
    right = rectangle((1 + gap, 0, 0), (1, 0, 0), (0, 2, 0), cuts=(1, 2), name="right")
    return scene_of([left, right, *others])


# ---- what is a seam ----


def test_panels_that_meet_have_a_seam_there_and_nowhere_else():
    scene = panels()
    _, texel_map, seams = laid_out(scene)
    places = positions_of(scene, texel_map)[seams.receivers]
    texel = 2 / np.sqrt(TEXELS)
    # half a texel of bilinear lookup, and the quarter that texels of the rim are moved inside
    assert np.abs(places[..., 0] - 1).max() < 1.5 * texel
    # a point a texel from each side, along two metres
    density = np.sqrt(TEXELS / 4)  # of four square metres; gutters take some
    assert len(seams.receivers) == pytest.approx(2 * 2 * density, rel=0.1)
    assert seams.shares.sum(axis=1) == pytest.approx(0.0, abs=1e-6)
    is_left = places[..., 0] < 1
    assert (is_left[:, :4].all(axis=1) ^ is_left[:, 4:].all(axis=1)).all(), "four texels of one side, four of the other"


def test_in_parts_no_point_is_lost(monkeypatch):
    whole = laid_out(panels())[2]
    monkeypatch.setattr("addon.core.find_seams.BLOCK", 20)
    parts = laid_out(panels())[2]
    # each part begins its own steps: up to one point more or less on each of some 20 of them
    assert len(parts.receivers) == pytest.approx(len(whole.receivers), abs=20)
    assert set(np.unique(parts.receivers)) == set(np.unique(whole.receivers))


@pytest.mark.parametrize(
    ("others", "is_parted"),
    [
        ([rectangle((1, 0, 0), (0, 2, 0), (0, 0, 1), name="wall")], True),
        ([rectangle((0.9, 0, 0.2), (0.2, 0, 0), (0, 2, 0), name="shelf")], False),
        ([rectangle((0, 0, 0), (0, 2, 0), (0, 0, 1), name="wall beside")], False),
    ],
    ids=["wall on it", "shelf above it", "wall elsewhere"],
)
def test_a_wall_on_a_seam_parts_it(others, is_parted):
    scene = panels(*(replace(part, is_target=False) for part in others))
    assert (len(laid_out(scene)[2].receivers) == 0) == is_parted


@pytest.mark.parametrize(("gap", "is_seam"), [(1e-4, True), (0.01, False)])
def test_a_gap_of_a_texel_is_no_seam(gap, is_seam):
    """A texel is 1.6 cm here; a ray looks a twentieth of that beyond the edge."""
    assert (len(laid_out(panels(gap=gap))[2].receivers) > 0) == is_seam


TEXEL = np.sqrt(8 / TEXELS)  # [m], of the floor below


def lit_on_the_left(*others):
    """A floor of two panels that meet at x = 1, and a lamp over the left one."""
    left = rectangle((-1, 0, 0), (2, 0, 0), (0, 2, 0), name="left")
    right = rectangle((1, 0, 0), (2, 0, 0), (0, 2, 0), name="right")
    others = (replace(part, is_target=False) for part in others)
    return scene_of([left, right, *others], [PointLight("lamp", (0.0, 1.0, 1.0), intensity=(1.0, 1.0, 1.0))])


def block(low, high):
    """A box by x and z of two corners, as long as the floor is wide."""
    return box((low[0], 0, low[1]), (high[0], 2, high[1]), name="block")


OBSTACLES = {
    "partition of 0.2": block((1 - 0.1 * TEXEL, 0), (1 + 0.1 * TEXEL, 1)),
    "partition of 0.6": block((1 - 0.3 * TEXEL, 0), (1 + 0.3 * TEXEL, 1)),
    "partition of 1.3": block((1 - 0.65 * TEXEL, 0), (1 + 0.65 * TEXEL, 1)),
    "partition 0.3 beside": block((1 + 0.3 * TEXEL, 0), (1 + 0.5 * TEXEL, 1)),
    "wall 0.2 beside": block((1 + 0.2 * TEXEL, 0), (1 + 6 * TEXEL, 1)),
    "wall 0.2 on the other side": block((1 - 6 * TEXEL, 0), (1 - 0.2 * TEXEL, 1)),
    "rug": block((1, 0), (2.5, 0.05 * TEXEL)),
    "thick rug beside": block((1 + 0.1 * TEXEL, 0), (2.5, 0.3 * TEXEL)),
    "cloth on the floor": rectangle((1, 0, 0.05 * TEXEL), (1.5, 0, 0), (0, 2, 0), name="cloth"),
    "door with a gap": block((1 - 0.1 * TEXEL, 0.6 * TEXEL), (1 + 0.1 * TEXEL, 1)),
    "shadow of a shelf": rectangle((0.5, 0, 0.5), (2, 0, 0), (0, 2, 0), name="shelf"),
}


@pytest.mark.parametrize("obstacle", OBSTACLES.values(), ids=OBSTACLES)
def test_what_parts_the_light_at_a_seam_is_not_stitched(obstacle, monkeypatch):
    """Stitched, what is lit beside it would go dark, and light come through."""
    scene, settings = lit_on_the_left(obstacle), BakeSettings(texels=TEXELS, error=0.2)
    stitched = bake(scene, settings)
    monkeypatch.setattr(bake_module, "find_seams", lambda *_: NO_SEAMS)
    plain = bake(scene, settings)
    before, after = plain.lightmap.pixels[..., 0], stitched.lightmap.pixels[..., 0]
    is_lit = before > 0.1 * before.max()
    assert np.abs(after[is_lit] / before[is_lit] - 1).max() < 0.01
    assert after[~is_lit].max() <= 1.01 * before[~is_lit].max()
    assert stitched.report.estimated_error < 1.1 * plain.report.estimated_error + 1e-4


def test_texels_of_another_chart_that_touches_are_left_alone():
    """Kept UVs without a margin: what is looked up on a rim is the neighbour's texel, too, of a wall far away."""
    scene = panels(rectangle((0, 5, 0), (2, 0, 0), (0, 0, 1), name="far"))
    charts, texel_map, seams = laid_out(scene)
    is_far = positions_of(scene, texel_map)[:, 1] > 4
    moved = np.flatnonzero(is_far)[: len(seams.receivers)]
    cells = texel_map.cells.copy()
    on_seam = np.unique(seams.receivers)[::2]
    cells[texel_map.rows[on_seam], texel_map.columns[on_seam]] = moved[np.arange(len(on_seam)) % len(moved)]
    receivers = surface_receivers(scene, texel_map.triangles, texel_map.barycentrics)
    with kernel_of(scene) as kernel:
        again = find_seams(scene, kernel, receivers, charts.uvs, cells)
    assert not is_far[again.receivers[again.shares != 0]].any()


@pytest.mark.parametrize("segments", [6, 8, 12, 64])
def test_a_smooth_column_has_its_seam_however_few_its_faces(segments):
    angle = 2 * np.pi * np.arange(segments + 1) / segments
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(segments + 1)], axis=1)
    points = np.concatenate([ring, ring + np.array([0, 0, 3])])
    faces = [(i, i + 1, i + 2 + segments, i + 1 + segments) for i in range(segments)]
    column = Part(points, faces, name="column", normals=np.concatenate([ring, ring]))
    # it ends where it begins, along three metres, and may be cut elsewhere, too
    assert len(laid_out(scene_of([column]))[2].receivers) > 50


def test_no_seam_where_a_room_bends():
    scene = scene_of([box((0, 0, 0), (1, 1, 1), inwards=True)])
    assert len(laid_out(scene)[2].receivers) == 0


def test_a_smooth_ball_has_seams_and_one_of_facets_has_none():
    ball = sphere((0, 0, 0), 1.0, rings=16, segments=32)
    assert len(laid_out(scene_of([ball]))[2].receivers) > 100
    assert len(laid_out(scene_of([replace(ball, normals=None)]))[2].receivers) == 0


def test_another_layer_is_not_what_goes_on():
    """A mat lies on the floor, as high as it: beyond the mat's edge is the floor, and below the mat, too."""
    floor = rectangle((0, 0, 0), (2, 0, 0), (0, 2, 0), name="floor")
    mat = rectangle((0.5, 0.5, 1e-6), (1, 0, 0), (0, 1, 0), name="mat")
    assert len(laid_out(scene_of([floor, mat]))[2].receivers) == 0


def test_what_is_not_baked_has_no_other_side():
    scene = scene_of(
        [
            rectangle((0, 0, 0), (1, 0, 0), (0, 2, 0), name="left"),
            rectangle((1, 0, 0), (1, 0, 0), (0, 2, 0), name="right", is_target=False),
        ]
    )
    assert len(laid_out(scene)[2].receivers) == 0


# ---- stitching ----


def test_stitched_is_the_least_change_by_least_squares():
    """Against a dense solver of the same problem, written from its definition."""
    rng = np.random.default_rng(1)
    shares = np.hstack([rng.dirichlet(np.ones(4), 9), -rng.dirichlet(np.ones(4), 9)])
    seams = Seams(rng.integers(0, 30, (9, 8)), shares)
    values = rng.lognormal(0, 0.3, (40, 3)).astype(np.float32)
    light = values.astype(float) @ [0.2126, 0.7152, 0.0722]
    rows = np.zeros((9, 40))
    for row, (receivers, weights) in enumerate(zip(seams.receivers, shares)):
        np.add.at(rows[row], receivers, weights)
    typical = np.sqrt(np.einsum("mk,mk->m", np.abs(shares) / 2, light[seams.receivers]))
    # |(rows (v + change)) / typical|^2 + STAY |change / sqrt(light)|^2
    system = np.vstack([rows / typical[:, None], np.sqrt(STAY) * np.diag(1 / np.sqrt(light))])
    wanted = np.vstack([-(rows @ values) / typical[:, None], np.zeros((40, 3))])
    change = np.linalg.lstsq(system, wanted, rcond=None)[0]
    assert (values + change > 0).all(), "nothing to clip"
    # conjugate gradients end at a thousandth of what is to do, by a norm in which STAY counts 20 times less than shares
    assert np.abs(seams.stitched(values) - values - change).max() < 0.02 * np.abs(change).max()


def test_light_that_goes_on_stays():
    """Where both sides are as bright there is nothing to change, but for rounding."""
    _, texel_map, seams = laid_out(panels())
    light = np.full((len(texel_map), 3), 2.0, np.float32)
    assert np.abs(seams.stitched(light) - light).max() < 1e-6


@given(st.integers(0, 1000), st.sampled_from([1e-30, 1e-3, 1.0, 1e20]))
def test_any_light_is_stitched_alike(seed, scale):
    rng = np.random.default_rng(seed)
    shares = np.hstack([rng.dirichlet(np.ones(4), 20), -rng.dirichlet(np.ones(4), 20)])
    seams = Seams(rng.integers(0, 100, (20, 8)), shares)
    values = (rng.lognormal(0, 2, (100, 3)) * (rng.random((100, 1)) < 0.9)).astype(np.float32)
    stitched = seams.stitched(values)
    assert np.isfinite(stitched).all()
    assert (stitched >= 0).all()
    elsewhere = np.setdiff1d(np.arange(100), seams.receivers)
    assert (stitched[elsewhere] == values[elsewhere]).all()
    scaled = seams.stitched((values * np.float32(scale)).astype(np.float32))
    assert scaled == pytest.approx(scale * stitched, rel=1e-3, abs=1e-5 * scale * float(values.max()))


def test_darkness_is_stitched_to_darkness():
    _, texel_map, seams = laid_out(panels())
    assert not seams.stitched(np.zeros((len(texel_map), 3), np.float32)).any()
    assert NO_SEAMS.stitched(np.ones((3, 3), np.float32)) == pytest.approx(1.0)


def test_a_baked_ball_and_floor_show_no_seams(monkeypatch):
    """A smooth ball over a floor of four objects: what both sides of seams show, with and without stitching."""
    floors = [rectangle((x, y, 0), (2, 0, 0), (0, 2, 0), name=f"floor {x} {y}") for x in (-2, 0) for y in (-2, 0)]
    room = box((-2, -2, 0), (2, 2, 3), inwards=True, without=("-z",), name="room")
    ball = sphere((0.3, 0.3, 0.7), 0.7, rings=24, segments=48, name="ball")
    scene = scene_of(
        [*floors, room, ball], [PointLight("lamp", (-0.6, 0.0, 2.7), radius=0.2, intensity=(5.0, 5.0, 5.0))]
    )
    settings = BakeSettings(texels=TEXELS, error=0.05)
    _, texel_map, seams = laid_out(scene)

    def found():
        result = bake(scene, settings)
        light = result.lightmap.pixels[texel_map.rows, texel_map.columns]
        jumps = np.abs(np.einsum("mk,mkc->mc", seams.shares, light[seams.receivers])).mean(axis=1) / np.einsum(
            "mk,mk->m", np.abs(seams.shares) / 2, light.mean(axis=1)[seams.receivers]
        )
        return np.quantile(jumps, 0.9), result.report.seen_error

    jump, error = found()
    monkeypatch.setattr(bake_module, "find_seams", lambda *_: NO_SEAMS)
    jump_before, error_before = found()
    assert jump_before > 0.02, "there is something to stitch"
    assert jump < 0.1 * jump_before
    # the mean of both sides is nearer to the truth; 512 points know an error to some 5 %
    assert error < 1.05 * error_before
