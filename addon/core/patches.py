"""Patches: triangles cut into pieces of about one size, each with one unknown radiosity a side.

One triangle is never more than its share of all patches, so that a ground plane around the house does not take the
patches away from its rooms. A patch lies in one triangle, unless small ones are joined (joined.py). The layout is in
native/include/patchlight.h.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .kernel import KernelScene
from .scene import Scene
from .settings import SettingsError
from .textures import textured_colours
from .triangles import triangle_areas

TEXTURE_SAMPLES = 8  # points a patch on which its texture is averaged,
CUT_OUT_SAMPLES = 32  # and what an image cuts out of it: flux is divided by what is left
BLOCK = 1 << 16  # patches that are looked up at once
LARGEST_SHARE = 1 / 8  # of all patches that one triangle may take
MOST_PATCHES = 4_000_000


@dataclass(frozen=True, slots=True)
class Patches:
    """The pieces that carry radiosity; unknown 2 p is patch p's front, 2 p + 1 its back.

    Attributes
    ----------
    size : longest edge of a patch, about [m]
    areas : float64 (P,) [m^2]
    met : float64 (P,) the part of it that rays meet: of cloth that half of them pass it is half, of glass none [m^2]
    triangles : int32 (P,) which triangle each is part of, or the first of its pieces
    reflectance : float32 (P, 3) rho, the mean over the patch
    translucence : float32 (P, 3) the same of what leaves at the other side
    back_reflectance : float32 (P, 3) rho of the backs; None = the same as of the fronts
    bounds : float32 (P, 4) where each lies on its triangle: distance from the apex at its wide and its narrow end, and
        from the next corner to the one after at its first and its second side, all as shares
    apexes : uint8 (T,)
    cells : int32 (P,) which cell of its triangle's grid each is, or is part of, or the first of its pieces
    open_sides : bool (P, 2) which sides no ray meets; None = none of them all
    owners, pieces : int32 (Q,) which patch each of ``pieces`` (Q) is part of, where some were joined; these have the
        bounds then
    """

    size: float
    areas: np.ndarray
    met: np.ndarray
    triangles: np.ndarray
    reflectance: np.ndarray
    translucence: np.ndarray
    bounds: np.ndarray
    apexes: np.ndarray
    cells: np.ndarray
    back_reflectance: np.ndarray | None = None
    open_sides: np.ndarray | None = None
    owners: np.ndarray | None = None
    pieces: Patches | None = None

    def __len__(self) -> int:
        return len(self.areas)

    @property
    def side_areas(self):
        """Area of each unknown's side that rays meet, float64 (2 P,) [m^2]."""
        areas = np.repeat(self.met, 2)
        return areas if self.open_sides is None else np.where(self.open_sides.ravel(), 0.0, areas)

    @property
    def side_reflectance(self):
        """Reflectance of each unknown, float32 (2 P, 3); an open side sends out nothing."""
        reflectance = np.repeat(self.reflectance, 2, axis=0)
        if self.back_reflectance is not None:
            reflectance[1::2] = self.back_reflectance
        if self.open_sides is not None:
            reflectance[self.open_sides.ravel()] = 0
        return reflectance

    @property
    def has_like_sides(self) -> bool:
        """Whether the backs of all are as their fronts."""
        return self.back_reflectance is None and self.open_sides is None

    @property
    def is_translucent(self):
        """Which patches are, bool (P,)."""
        return self.translucence.any(axis=1)

    def scattered(self, irradiance):
        """Radiosity (2 P, 3) that sides send out of what arrives on them, and behind them (2 P, 3)."""
        radiosity = self.side_reflectance * irradiance
        through = np.flatnonzero(self.is_translucent)
        for side in (0, 1):
            radiosity[2 * through + side] += self.translucence[through] * irradiance[2 * through + 1 - side]
        return radiosity


def patch_size_for(scene: Scene, budget: int) -> float:
    """The patch size [m] at which the scene's triangles come to about ``budget`` patches."""
    areas = triangle_areas(scene.corners)
    low, high = 1e-9 * max(areas.max(initial=0.0), 1e-12), max(areas.sum(), 1e-12)
    for _ in range(60):
        middle = np.sqrt(low * high)
        pieces = np.minimum(areas / middle, budget * LARGEST_SHARE).sum()
        low, high = (middle, high) if pieces > budget else (low, middle)
    return float(np.sqrt(high))


@dataclass(frozen=True, slots=True)
class Grid:
    """How every triangle is cut into rows of cells, each about as long as wide.

    Attributes
    ----------
    size : longest edge of a cell, about [m]
    areas : float64 (T,) of the triangles [m^2]
    apexes : uint8 (T,)
    first_rows, first_cells : int32, as in native/include/patchlight.h
    """

    size: float
    areas: np.ndarray
    apexes: np.ndarray
    first_rows: np.ndarray
    first_cells: np.ndarray

    def __len__(self) -> int:
        return int(self.first_cells[-1])


def grid_of(scene: Scene, size: float, budget: int) -> Grid:
    """The grid of cells of at most about ``size`` [m]."""
    areas = triangle_areas(scene.corners)
    apexes, longest = _apexes(scene)
    # a triangle that would take more than its share gets larger cells; a sliver takes them along its length
    share = budget * LARGEST_SHARE
    sizes = np.maximum(size, np.maximum(np.sqrt(areas / share), longest / share))
    _require_few(size, areas / sizes**2, len(areas))
    rows = np.maximum(1, np.ceil(2 * areas / np.maximum(longest * sizes, 1e-300) - 1e-6)).astype(np.int64)
    first_rows = _offsets(rows)
    row_triangle = np.repeat(np.arange(len(areas)), rows)
    row = np.arange(first_rows[-1]) - first_rows[row_triangle]
    widths = longest[row_triangle] * (1 - row / rows[row_triangle])
    columns = np.maximum(1, np.ceil(widths / sizes[row_triangle] - 1e-6)).astype(np.int64)
    return Grid(size, areas, apexes, first_rows.astype(np.int32), _offsets(columns).astype(np.int32))


def cut(scene: Scene, kernel: KernelScene, grid: Grid, along, seed: int) -> Patches:
    """Patches of a grid, ``along`` (C,) of them along each side of every cell; the kernel is told of them."""
    return with_materials(scene, kernel, laid_out(kernel, grid, along), seed)


def laid_out(kernel: KernelScene, grid: Grid, along) -> Patches:
    """Patches of a grid as ``cut`` makes them, as if they were opaque and black."""
    first_pieces = _offsets(along**2)
    kernel.set_patches(grid.apexes, grid.first_rows, grid.first_cells, first_pieces.astype(np.int32))
    rows, columns = np.diff(grid.first_rows), np.diff(grid.first_cells)
    row_triangle = np.repeat(np.arange(len(rows)), rows)
    cell_row = np.repeat(np.arange(len(columns)), columns)
    cells = np.repeat(np.arange(len(grid)), along**2)
    parts, part = along[cells], np.arange(len(cells)) - first_pieces[cells]
    of_row = cell_row[cells]
    triangles = row_triangle[of_row]

    height, width = rows[triangles] * parts, columns[of_row] * parts
    row = (of_row - grid.first_rows[triangles]) * parts + part // parts
    column = (cells - grid.first_cells[of_row]) * parts + part % parts
    bounds = np.stack([1 - row / height, 1 - (row + 1) / height, column / width, (column + 1) / width], axis=1)
    # the width of a triangle falls linearly towards its apex, so area goes with the difference of squares
    shares = (bounds[:, 0] ** 2 - bounds[:, 1] ** 2) / width
    areas = grid.areas[triangles] * shares
    return Patches(
        size=grid.size,
        areas=areas,
        met=areas,
        triangles=triangles.astype(np.int32),
        reflectance=np.zeros((len(triangles), 3), np.float32),
        translucence=np.zeros((len(triangles), 3), np.float32),
        bounds=bounds.astype(np.float32),
        apexes=grid.apexes,
        cells=cells.astype(np.int32),
    )


def subdivide(scene: Scene, kernel: KernelScene, size: float, budget: int, seed: int) -> Patches:
    """Cut every triangle into patches of at most about ``size`` [m], all alike, and tell the kernel of them."""
    grid = grid_of(scene, size, budget)
    return cut(scene, kernel, grid, np.ones(len(grid), np.int64), seed)


def _require_few(size, pieces, triangle_count):
    """Refuse what no memory holds: a patch costs about a kilobyte while its light is measured."""
    count = float(pieces.sum())
    if count > max(MOST_PATCHES, 2 * triangle_count):
        raise SettingsError(f"patch_size is {size:g}: the scene would have {count:.3g} patches, at most {MOST_PATCHES}")


def patch_triangles(scene: Scene, patches: Patches, chosen):
    """Triangles that make up chosen patches (K,), wound as the scene's: corners float64 (M, 3, 3) [m], and of which
    of the chosen each is part, int64 (M,)."""
    which = np.arange(len(chosen))
    if patches.pieces is not None:
        place = np.full(len(patches), -1)
        place[chosen] = which
        chosen = np.flatnonzero(place[patches.owners] >= 0)
        which, patches = place[patches.owners[chosen]], patches.pieces
    wide, narrow, first, second = patches.bounds[chosen].astype(np.float64).T
    widths, shares = (wide, wide, narrow, narrow), (first, second, second, first)
    a, b, c, d = (_points(scene, patches, chosen, *at) for at in zip(widths, shares))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]), np.tile(which, 2)


def patch_middles(scene: Scene, patches: Patches, chosen):
    """A point well inside of each chosen piece (K,), float64 (K, 3) [m]."""
    wide, narrow, first, second = patches.bounds[chosen].astype(np.float64).T
    return _points(scene, patches, chosen, (wide + narrow) / 2, (first + second) / 2)


def _points(scene, patches, chosen, width, across):
    """Points of chosen pieces (K,): ``width`` from the apex, ``across`` from the next corner to the one after."""
    triangles = patches.triangles[chosen]
    corners, apexes, rows = scene.triangles[triangles], patches.apexes[triangles].astype(int), np.arange(len(triangles))
    apex, left, right = (scene.vertices[corners[rows, (apexes + k) % 3]] for k in range(3))
    width, across = width[:, None], across[:, None]
    return (1 - width) * apex + width * ((1 - across) * left + across * right)


def _apexes(scene):
    """The corner opposite to each triangle's longest edge, uint8 (T,), and that edge's length [m]."""
    corners = scene.corners
    edges = np.stack([np.linalg.norm(corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3], axis=1) for k in range(3)], 1)
    apexes = np.argmax(edges, axis=1) if len(edges) else np.zeros(0, np.int64)
    return apexes.astype(np.uint8), edges[np.arange(len(edges)), apexes]


def _offsets(counts):
    return np.concatenate([[0], np.cumsum(counts)])


def with_materials(scene: Scene, kernel: KernelScene, patches: Patches, seed: int) -> Patches:
    """The patches, as the kernel has them, with what their triangles' materials come to over each."""
    reflectance = _mean_over(scene, kernel, patches, "reflectance", TEXTURE_SAMPLES, seed)
    translucence, met = patches.translucence, patches.areas
    most = np.float32(1)
    if any(material.transmits or not material.meets_light for material in scene.materials):
        passing = _mean_over(scene, kernel, patches, "transmittance", CUT_OUT_SAMPLES, seed)
        share = _met_share(scene, patches, passing.mean(axis=1, dtype=np.float64))
        # what passes and what is sent on is no more than arrives, in any channel
        most = np.minimum(1, (1 - passing) / np.maximum(share, 1e-6)[:, None]).astype(np.float32)
        met = share * patches.areas
    reflectance = np.minimum(reflectance, most)
    back_reflectance = None
    if any(material.back is not None for material in scene.materials):
        of_backs = _mean_over(scene, kernel, patches, "reflectance", TEXTURE_SAMPLES, seed, of_back=True)
        back_reflectance = np.minimum(of_backs, most)
    if any(material.is_translucent for material in scene.materials):
        translucence = _mean_over(scene, kernel, patches, "translucence", TEXTURE_SAMPLES, seed)
        translucence = np.minimum(translucence, most - reflectance)
    return replace(
        patches,
        met=met,
        reflectance=reflectance,
        translucence=translucence,
        back_reflectance=back_reflectance,
        open_sides=_open_sides(scene, patches),
    )


def _open_sides(scene, patches):
    by_material = np.array([[m.open_side == side for side in ("front", "back")] for m in scene.materials], bool)
    return by_material[scene.triangle_materials[patches.triangles]] if by_material.any() else None


def _met_share(scene, patches, passing):
    """The share of rays that meet each patch (P,), of which ``passing`` (P,) of the light passes."""
    materials = scene.triangle_materials[patches.triangles]
    # rays may meet what no sample has: less than a sample's share would make too much of them
    least = np.array([1 / CUT_OUT_SAMPLES if m.transmittance_texture else 0.0 for m in scene.materials])
    is_met = np.array([m.stops_light for m in scene.materials], bool)
    return np.where(is_met[materials], np.maximum(1 - passing, least[materials]), 0.0)


def _mean_over(scene, kernel, patches, factor, samples, seed, of_back=False):
    """The mean over each patch of a material's ``factor``, of [0, 1], times its texture: float32 (P, 3)."""
    materials = scene.triangle_materials[patches.triangles]
    sides = [m.of_back if of_back else m for m in scene.materials]
    means = np.array([getattr(side, factor) for side in sides], np.float32).reshape(-1, 3)[materials]
    is_textured = np.array([getattr(side, f"{factor}_texture") is not None for side in sides], bool)[materials]
    textured = np.flatnonzero(is_textured)
    for part in np.array_split(textured, len(textured) // BLOCK + 1):
        points, barycentrics = kernel.patch_points(part, samples, seed)
        means[part] = (
            textured_colours(scene, points, barycentrics, factor, of_back).reshape(-1, samples, 3).mean(axis=1)
        )
    return np.clip(means, 0.0, 1.0)
