"""Every function of the kernel's door with arguments by chance: an exception, or numbers that are light.

Under `make sanitize` the kernel watches its own memory while these run.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.core import _kernel
from addon.core.kernel import LIGHT_FLOATS, PROFILE_SIDE, embree
from addon.core.luminance import LUMINANCE
from addon.core.texel_light import packed
from tests.random_scenes import placed_meshes

REFUSALS = (ValueError, TypeError, OverflowError, MemoryError)
counts = st.sampled_from((0, 1, 2, 5))
# of indices and ranges: most are fine, some are past every end
numbers = st.sampled_from((0, 0, 0, 1, 1, 2, 3, 7, -1, 1 << 30, -(1 << 31)))
lengths = st.sampled_from((0.0, 1e-30, 1e-7, 0.5, 1.0, -1.0, 1e7, 1e8, 1e30, np.nan, np.inf))
seeds = st.sampled_from((0, 1, 0xFFFFFFFF))


def arrays(draw, shape, dtype, elements):
    values = draw(st.lists(elements, min_size=1, max_size=7))
    with np.errstate(over="ignore", invalid="ignore"):
        return np.resize(np.array(values, np.float64), shape).astype(dtype)


@st.composite
def sound_meshes(draw):
    """Vertices and triangles that the kernel takes; now and then ones that it must refuse."""
    points, triangles = draw(placed_meshes())
    if draw(st.integers(0, 9)):
        with np.errstate(invalid="ignore"):
            points = np.where(np.abs(points) <= 1e8, points, 0.25)
    return points, np.ascontiguousarray(triangles.reshape(-1, 3), np.int32)


@st.composite
def clear_triangles(draw, count):
    """Glass and cloth, grey, and images on them, now and then ones that are not there."""
    shares = np.repeat(arrays(draw, (count, 1), np.float32, st.sampled_from((0, 0.5, 0.3, 1))), 3, axis=1)
    rays = arrays(draw, count, np.uint8, st.integers(0, 63))
    maps = arrays(draw, count, np.int32, st.sampled_from((-1, -1, 0, 1, 1, 5, -7)))
    shapes = np.int32([[0, 2, 3], [6, 1, 1]])[: draw(st.integers(0, 2))]
    shapes += arrays(draw, shapes.shape, np.int32, st.sampled_from((0, 0, 0, 0, 0, 0, -3, 1 << 30)))
    pixels = np.repeat(arrays(draw, (7, 1), np.float32, st.sampled_from((0, 0.5, 1))), 3, axis=1)
    return shares, rays, maps, arrays(draw, (count, 6), np.float32, lengths), shapes, pixels


def maps_are_there(clear):
    if clear is None:
        return True
    _, _, maps, _, shapes, pixels = clear
    first, height, width = shapes.astype(np.int64).T
    are_shapes = (first >= 0) & (height > 0) & (width > 0) & (first + height * width <= len(pixels))
    return are_shapes.all() and ((maps >= -1) & (maps < len(shapes))).all()


@st.composite
def kernels(draw):
    """(scene, patches, number of patches, of triangles), or None where the scene was refused."""
    points, triangles = draw(sound_meshes())
    clear = draw(clear_triangles(len(triangles))) if draw(st.integers(0, 2)) == 0 else None
    try:
        scene = _kernel.create_scene(embree(), points, triangles, clear)
    except ValueError:
        usable = np.abs(points) <= 1e8
        assert not usable.all() or not maps_are_there(clear)
        return None
    rows = np.resize([1, 2], len(triangles))
    first_rows = np.concatenate([[0], np.cumsum(rows)]).astype(np.int32)
    columns = np.resize([1, 3, 2], first_rows[-1])
    first_cells = np.concatenate([[0], np.cumsum(columns)]).astype(np.int32)
    first_pieces = np.concatenate([[0], np.cumsum(np.resize([1, 4, 1, 9], first_cells[-1]))]).astype(np.int32)
    apexes = np.resize(np.uint8([0, 1, 2]), len(triangles)).astype(np.uint8)
    layout, pieces = (apexes, first_rows, first_cells, first_pieces), int(first_pieces[-1])
    count = min(pieces, max(draw(st.sampled_from((pieces, pieces // 2, 1))), 1))
    owners = np.zeros(0, np.int32) if count == pieces else np.arange(pieces, dtype=np.int32) % count
    areas = np.resize(np.float32([1, 0, 1e-30, 1e30, np.nan]), len(owners))
    return scene, _kernel.create_patches(*layout, owners, areas, count), count, len(triangles)


def light_table(draw):
    """Rows of any kind with any numbers, and glowing triangles."""
    count, glowing = draw(counts), draw(counts)
    kinds = arrays(draw, count, np.int32, st.sampled_from((0, 1, 2, 3, 3, 0, 1, 2, 9)))
    table = arrays(draw, (count, LIGHT_FLOATS), np.float32, lengths)
    table[:, 5:7] = np.where(kinds[:, None] == 3, arrays(draw, (count, 2), np.float32, numbers), table[:, 5:7])
    table[:, 13] = np.where(
        kinds == 0, arrays(draw, count, np.float32, st.sampled_from((0, 0, 1, 2, -1))), table[:, 13]
    )
    corners, radiances = arrays(draw, (glowing, 9), np.float32, lengths), np.ones((glowing, 6), np.float32)
    profiles = np.full((draw(st.integers(0, 2)), PROFILE_SIDE**2), draw(lengths), np.float32)
    return kinds, table, corners, radiances, np.linspace(0, 1, glowing, endpoint=False, dtype=np.float32), profiles


def receivers(draw, sides, count):
    positions = arrays(draw, (count, 3), np.float64, lengths)
    normals = arrays(draw, (count, 3), np.float32, st.sampled_from((0.0, 1.0, -1.0)))
    choice = st.integers(0, max(sides - 1, 0)) if draw(st.integers(0, 4)) else numbers
    return positions, normals, arrays(draw, count, np.int32, choice)


@given(st.data())
def test_rays_from_anywhere_to_anywhere(data):
    kernel = data.draw(kernels())
    if kernel is None:
        return
    count = data.draw(counts)
    origins, directions = (arrays(data.draw, (count, 3), t, lengths) for t in (np.float64, np.float32))
    triangles, hits, hidden = np.empty(count, np.int32), np.empty((count, 3), np.float32), np.empty(count, np.uint8)
    _kernel.closest_hits(kernel[0], origins, directions, triangles, hits)
    _kernel.occluded(kernel[0], origins, directions.astype(np.float64), hidden)
    assert ((triangles >= -1) & (triangles < kernel[3])).all()
    assert (hits[triangles >= 0, 2] >= 0).all()
    assert (hidden <= 1).all()


@given(st.data())
def test_form_factors_of_any_sides(data):
    kernel = data.draw(kernels())
    if kernel is None:
        return
    scene, patches, count, _ = kernel
    sides = arrays(data.draw, data.draw(counts), np.int32, st.integers(0, max(2 * count - 1, 0)) | numbers)
    rows, seed = np.full((len(sides), 2 * count), np.nan), data.draw(seeds)
    rays, positions = data.draw(st.sampled_from((0, 1, 64))), data.draw(st.sampled_from((0, 1, 3)))
    is_sound = ((sides >= 0) & (sides < 2 * count)).all()
    for call, spent in (
        (_kernel.form_factors_monte_carlo, (rays,)),
        (_kernel.form_factors_hemicube, (data.draw(st.sampled_from((0, 1, 2, 7, 8))), positions)),
    ):
        try:
            call(scene, patches, sides, *spent, seed, rows)
        except ValueError:
            assert not is_sound or min(spent) == 0 or spent[0] % 2 == 1
            continue
        assert (rows >= 0).all()
        # float32 sums of a few hundred shares
        assert (rows.sum(axis=1) <= 1 + 1e-4).all()


@given(st.data())
def test_points_and_openness_of_any_patches(data):
    kernel = data.draw(kernels())
    if kernel is None:
        return
    scene, patches, count, _ = kernel
    chosen = arrays(data.draw, data.draw(counts), np.int32, st.integers(0, max(count - 1, 0)) | numbers)
    samples, first, many = data.draw(counts), data.draw(numbers), data.draw(numbers)
    triangles, weights = np.empty(len(chosen) * samples, np.int32), np.empty((len(chosen) * samples, 3), np.float32)
    try:
        _kernel.patch_points(patches, chosen, samples, data.draw(seeds), triangles, weights)
        # float32 weights of points on an edge
        assert ((weights >= -1e-6) & (weights <= 1 + 1e-6)).all()
    except ValueError:
        assert ((chosen < 0) | (chosen >= count)).any()
    reaches, out = arrays(data.draw, 2 * count, np.float32, lengths), np.full(2 * count, 0.5, np.float32)
    try:
        _kernel.openness(scene, patches, reaches, first, many, 4, data.draw(seeds), out)
        assert ((out >= 0) & (out <= 1)).all()
    except ValueError:
        assert first < 0 or many < 0 or first + many > 2 * count


@given(st.data())
def test_all_flux_that_is_shot_lands_or_leaves(data):
    kernel = data.draw(kernels())
    if kernel is None:
        return
    scene, patches, count, _ = kernel
    shooting = data.draw(counts)
    known = st.integers(0, max(2 * count - 1, 0))
    sides = arrays(data.draw, shooting, np.int32, known if data.draw(st.integers(0, 5)) else numbers)
    runs = arrays(data.draw, shooting, np.int64, st.sampled_from((0, 0, 1, 5)))
    first_rays = np.concatenate([[0], np.cumsum(runs)]).astype(np.uint64)
    if not data.draw(st.integers(0, 5)):
        first_rays[-1] = data.draw(st.sampled_from((1, 1000)))
    flux = np.full((shooting, 3), data.draw(st.sampled_from((0, 1, 1 << 40))), np.uint64)
    received, escaped = np.zeros((2 * count, 3), np.uint64), np.zeros((1, 3), np.uint64)
    first, many = (abs(data.draw(numbers)) for _ in range(2))
    used = arrays(data.draw, shooting, np.uint32, st.sampled_from((0, 3, (1 << 32) - 1)))
    try:
        _kernel.shoot(scene, patches, sides, used, flux, first_rays, first, many, data.draw(seeds), received, escaped)
    except ValueError:
        rises = first_rays[0] == 0 and (np.diff(first_rays.astype(np.int64)) >= 0).all()
        are_sides = ((sides >= 0) & (sides < 2 * count)).all()
        assert first + many > first_rays[-1] or not rises or not are_sides
        return
    shot = many * int(flux[0, 0]) if shooting else 0
    # tinted glass takes some
    assert int(received[:, 0].sum()) + int(escaped[0, 0]) <= shot


@given(st.data())
def test_direct_light_of_any_lights(data):
    kernel = data.draw(kernels())
    if kernel is None:
        return
    count = data.draw(counts)
    where = receivers(data.draw, 2 * kernel[2], count)
    out, variance = np.full((count, 3), np.nan, np.float32), np.full(count, np.nan, np.float32)
    first = data.draw(st.booleans())
    try:
        _kernel.direct(kernel[0], light_table(data.draw), where, 0, count, 64, first, data.draw(seeds), out, variance)
    except REFUSALS:
        return
    assert np.isfinite(out).all()
    assert (out >= 0).all()
    assert np.isfinite(variance).all()


def texel_light(draw, triangles):
    """A lightmap's light, any numbers among it, its triangles now and then of another scene."""
    width, height = draw(st.sampled_from((0, 0, 1, 4))), draw(st.sampled_from((0, 3)))
    places = st.sampled_from((-1.0, 0.0, 2.5, 1e9, np.nan))
    uvs = arrays(draw, (triangles + draw(st.sampled_from((0, 0, 0, 1))), 3, 2), np.float32, places)
    one = int(packed(np.ones((1, 3), np.float32))[0])
    light = arrays(draw, (height, width), np.uint64, st.sampled_from((0, one, one | 1 << 63, (1 << 64) - 1)))
    return uvs, light, width, draw(st.sampled_from((0.0, 0.5, np.inf)))


def guides_of(draw, many):
    """Guides of two groups, one of them narrow; a group now and then out of range."""
    even = np.full(64, 1 / 64, np.float32)
    narrow = np.full(64, 1e-6, np.float32)
    narrow[draw(st.integers(0, 63))] = 1 - 63e-6
    return arrays(draw, many, np.int32, st.sampled_from((-1, 0, 1, 1, 2))), np.stack([even, narrow])


@given(st.data())
def test_guides_are_learned_of_any_groups(data):
    kernel = data.draw(kernels())
    if kernel is None:
        return
    scene, patches, count, _ = kernel
    light = np.ones((2 * count, 3), np.float32)
    field = (light, light, light[:count], np.zeros(2 * count, np.uint8), light[:, 0].copy(), light[:1])
    many = data.draw(counts)
    where = receivers(data.draw, 2 * kernel[2], many)
    members = arrays(data.draw, many, np.uint32, st.integers(0, max(many, 1)))
    starts = arrays(data.draw, 3, np.uint32, st.integers(0, many + 1))
    moments = np.full((2, 64), np.nan, np.float32)
    texels = texel_light(data.draw, count)
    first, groups = data.draw(st.integers(-1, 2)), data.draw(st.integers(-1, 3))
    lamps, seed = light_table(data.draw), data.draw(seeds)
    try:
        _kernel.learn_guides(
            scene, patches, field, texels, lamps, where, members, starts, first, groups, 4, seed, moments
        )
    except REFUSALS:
        return
    assert np.isfinite(moments[first : first + groups]).all()
    assert (moments[first : first + groups] >= 0).all()


@given(st.data())
def test_gathered_light_of_any_solution(data):
    kernel = data.draw(kernels())
    if kernel is None:
        return
    scene, patches, count, _ = kernel
    values = st.sampled_from((0.0, 1.0, 1e17))
    radiosity = arrays(data.draw, (2 * count, 3), np.float32, values)
    field = (
        radiosity,
        radiosity * np.float32(data.draw(st.sampled_from((0.0, 1.0)))),
        np.full((count, 3), data.draw(st.sampled_from((0.0, 0.7, 1.0))), np.float32),
        arrays(data.draw, 2 * count, np.uint8, st.sampled_from((0, 1, 2))),
        arrays(data.draw, 2 * count, np.float32, st.sampled_from((0.0, 1.0, np.inf))),
        arrays(data.draw, (data.draw(st.sampled_from((0, 1, 1, 4, 5))), 3), np.float32, values),
    )
    many = data.draw(counts)
    where = receivers(data.draw, 2 * kernel[2], many)
    selected = arrays(data.draw, many, np.uint32, st.integers(0, max(many - 1, 0)))
    if not data.draw(st.integers(0, 5)):
        selected[:1] = 1 << 31
    sums = np.zeros((many, 3), np.float32), np.zeros((many, 2), np.float32)
    texels, guides = texel_light(data.draw, count), guides_of(data.draw, many)
    lamps, seed = light_table(data.draw), data.draw(seeds)
    try:
        _kernel.gather(scene, patches, field, texels, lamps, where, guides, selected, 2, 0, 8, seed, sums)
    except REFUSALS:
        return
    assert all(np.isfinite(part).all() and (part >= 0).all() for part in sums)
    # the same light in two ways, 16 rays of float32 each
    assert sums[1].sum(axis=1) == pytest.approx(sums[0] @ LUMINANCE, rel=1e-4)


@given(st.data())
def test_texels_of_any_uvs(data):
    width, height = (data.draw(st.sampled_from((-1, 0, 1, 3, 16))) for _ in range(2))
    uvs = arrays(data.draw, (data.draw(counts), 3, 2), np.float32, lengths)
    texels = max(width, 0) * max(height, 0)
    triangles, distances = np.empty(texels, np.int32), np.empty(texels, np.float32)
    weights = np.empty((texels, 3), np.float32)
    try:
        _kernel.rasterise_texels(uvs, width, height, triangles, distances, weights)
    except ValueError:
        assert min(width, height) < 1
        return
    found = triangles >= 0
    assert (triangles < len(uvs)).all()
    # less than 1 texel away along both axes
    assert (distances[found] <= 2**0.5).all()
    assert weights[found].sum(axis=1).tolist() == [1] * int(found.sum()) or np.allclose(weights[found].sum(axis=1), 1)


@given(st.data())
def test_places_of_any_charts(data):
    charts = data.draw(counts)
    sizes = arrays(data.draw, charts, np.int32, st.sampled_from((1, 1, 2, 0)))
    first = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32)
    uvs = arrays(data.draw, (int(first[-1]), 3, 2), np.float64, st.sampled_from((0.0, 0.3, 1.0, 5.0)) | lengths)
    density, width = data.draw(lengths), data.draw(st.sampled_from((-1, 0, 1, 64, 100, (1 << 31) - 1)))
    block, places = data.draw(st.sampled_from((-1, 0, 1, 3))), np.full((charts, 3), -9, np.int32)
    upright = data.draw(st.sampled_from((0, 1, charts, charts + 1, -1)))
    try:
        height = _kernel.pack_charts(uvs, first, upright, density, width, block, places)
    except REFUSALS:
        return
    assert (places[:, :2] >= 0).all()
    assert ((places[:, 2] == 0) | (places[:, 2] == 1)).all()
    assert (places[charts - upright :, 2] == 0).all()
    assert height >= 0


@given(st.data())
def test_smoothing_of_any_grid(data):
    width, height = (data.draw(st.sampled_from((0, 1, 4, -2))) for _ in range(2))
    many = data.draw(counts)
    grid = arrays(data.draw, max(width * height, 0), np.int32, st.integers(-1, max(many - 1, -1)) | numbers)
    where = receivers(data.draw, 1, many)
    values = arrays(data.draw, (many, 3), np.float32, st.sampled_from((0.0, 1.0, 1e17)))
    variances = arrays(data.draw, many, np.float32, st.sampled_from((0.0, 1.0, 1e34)))
    out, out_variances = np.zeros((many, 3), np.float32), np.zeros(many, np.float32)
    first, rows = data.draw(numbers), data.draw(numbers)
    step = data.draw(st.sampled_from((1, 8, 3, 0, -1, 1 << 20, 1 << 21)))
    spacing = data.draw(st.sampled_from((0.0, 1e-30, 1.0)))
    try:
        _kernel.smooth(grid, width, height, spacing, where, values, variances, step, 1, first, rows, out, out_variances)
        clamped = np.zeros_like(out)
        _kernel.clamp_outliers(grid, width, height, spacing, where, values, variances, first, rows, clamped)
    except REFUSALS:
        return
    for result in (out, clamped):
        assert np.isfinite(result).all()
        assert (result >= 0).all()


@given(st.data())
def test_smoothing_of_any_graph(data):
    many, edges = data.draw(counts), data.draw(counts)
    steps = arrays(data.draw, many, np.int32, st.integers(0, 3) | numbers)
    first_edges = np.append(0, np.cumsum(steps, dtype=np.int64)).astype(np.int32)
    edges = data.draw(st.sampled_from((edges, max(int(first_edges[-1]) % 100, 0))))
    neighbours = arrays(data.draw, edges, np.int32, st.integers(0, max(many - 1, 0)) | numbers)
    nearness = arrays(data.draw, edges, np.float32, st.sampled_from((0.0, 1.0, 1e-30)))
    values = arrays(data.draw, (many, 3), np.float32, st.sampled_from((0.0, 1.0, 1e17)))
    variances = arrays(data.draw, many, np.float32, st.sampled_from((0.0, 1.0, 1e34)))
    out, out_variances = np.zeros((many, 3), np.float32), np.zeros(many, np.float32)
    first, count = data.draw(numbers), data.draw(numbers)
    try:
        _kernel.smooth_graph(first_edges, neighbours, nearness, values, variances, 1, first, count, out, out_variances)
    except REFUSALS:
        return
    # a mean of some is none of more than the most
    assert (out >= 0).all()
    assert (out <= 1.01 * max(values.max(initial=0), 0)).all()


@given(kernel=kernels(), other=kernels())
def test_patches_of_another_scene_are_refused(kernel, other):
    if kernel is None or other is None:
        return
    scene, patches, count = kernel[0], other[1], other[2]
    out = np.zeros(2 * count, np.float32)
    try:
        _kernel.openness(scene, patches, out.copy(), 0, 2 * count, 1, 0, out)
    except ValueError as error:
        assert "patches" in str(error)  # noqa: PT017
    else:
        assert other[3] == kernel[3]
