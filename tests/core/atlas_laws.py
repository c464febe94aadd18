"""What must hold for the charts of any scene."""

import numpy as np

from addon.core.charts import Charts
from addon.core.texels import texels


def areas(scene):
    corners = scene.corners
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def loops(scene):
    """A number for each face corner that is unique in the scene, (T, 3)."""
    offset, found = 0, []
    for obj in scene.objects:
        found.append(obj.corners + offset)
        offset += obj.corners.max(initial=-1) + 1
    return np.concatenate(found)


def assert_places_are_sound(scene, charts: Charts, rng):
    """All that a bake relies on."""
    is_target = np.zeros(len(scene.triangles), bool)
    for obj in scene.objects:
        is_target[obj.span] = obj.is_target
    has_place = charts.charts >= 0
    assert has_place[is_target & (areas(scene) > 0)].all()
    assert not has_place[~is_target].any()
    assert (np.isfinite(charts.uvs).all(axis=(1, 2)) == has_place).all()
    # half a texel of rim: bilinear lookup at the border does not wrap around
    assert (charts.uvs[has_place] >= 0.5).all()
    assert (charts.uvs[has_place] <= (charts.width - 0.5, charts.height - 0.5)).all()
    assert_loops_have_one_uv(scene, charts)
    assert_lookups_touch_own_receivers_only(scene, charts, rng)


def assert_loops_have_one_uv(scene, charts):
    placed = charts.charts >= 0
    numbers, uvs = loops(scene)[placed].reshape(-1), charts.uvs[placed].reshape(-1, 2)
    order = np.argsort(numbers, kind="stable")
    same = np.diff(numbers[order]) == 0
    # float32 coordinates up to 2^14 texels, rotated in double
    assert np.abs(np.diff(uvs[order], axis=0))[same].max(initial=0) < 2e-3


def assert_lookups_touch_own_receivers_only(scene, charts, rng):
    texel_map = texels(charts)
    owner = np.full((charts.height, charts.width), -1)
    owner[texel_map.rows, texel_map.columns] = charts.charts[texel_map.triangles]
    placed = np.flatnonzero(charts.charts >= 0)
    weights = rng.dirichlet((0.5, 0.5, 0.5), (len(placed), 20))
    weights[:, :3] = np.eye(3)
    points = np.einsum("nsk,nkx->nsx", weights, charts.uvs[placed].astype(float)) - 0.5
    corner = np.floor(points).astype(int)
    fraction = points - corner
    for right in (0, 1):
        for up in (0, 1):
            weight = np.abs(1 - right - fraction[..., 0]) * np.abs(1 - up - fraction[..., 1])
            # a weight below what float32 UVs resolve changes no pixel
            rows, columns = np.nonzero(weight > 1e-3)
            texel = corner[rows, columns] + (right, up)
            assert (owner[texel[:, 1], texel[:, 0]] == charts.charts[placed][rows]).all()


def charts_per_texel_ring(scene, charts):
    """Pairs of neighbouring receivers, diagonals included, of different charts."""
    texel_map = texels(charts)
    owner = np.full((charts.height + 1, charts.width + 2), -1)
    owner[texel_map.rows, texel_map.columns + 1] = charts.charts[texel_map.triangles]
    here = owner[:-1, 1:-1]
    pairs = [owner[:-1, 2:], owner[1:, :-2], owner[1:, 1:-1], owner[1:, 2:]]
    return sum(int(((here >= 0) & (there >= 0) & (here != there)).sum()) for there in pairs)
