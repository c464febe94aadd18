"""The only door to the native kernel: allocates outputs, states shapes, runs ranges on all cores."""

from __future__ import annotations

import functools
import importlib.util
import pathlib
import sys

import numpy as np

from .scene import Scene
from .workers import Workers

try:
    from . import _kernel
except ImportError as error:  # a source tree that has not been built, or a zip for another platform
    raise ImportError(
        f"Patchlight's native kernel cannot be loaded ({error}): install the zip of your platform, or run `make`"
    ) from error

ROWS = 16  # of a lightmap are smoothed at once, where neighbours are a texel apart
NO_OWNERS = np.zeros(0, np.int32)  # of pieces: each is a patch

# Numbers of native/include/patchlight.h.
POINT, AREA, SUN, MESH = _kernel.PL_LIGHT_POINT, _kernel.PL_LIGHT_AREA, _kernel.PL_LIGHT_SUN, _kernel.PL_LIGHT_MESH
LIGHT_FLOATS, PROFILE_SIDE = _kernel.PL_LIGHT_FLOATS, _kernel.PL_PROFILE_SIDE
EXACT_TRIANGLES, MANY_LIGHTS = _kernel.PL_EXACT_TRIANGLES, _kernel.PL_MANY_LIGHTS
EVEN_SIDE, MIXED_SIDE, LIGHT_SIDE = _kernel.PL_SIDE_EVEN, _kernel.PL_SIDE_MIXED, _kernel.PL_SIDE_LIGHT
GUIDE_CELLS = _kernel.PL_GUIDE_CELLS

LIBRARY_PATTERNS = {
    "linux": ("../embreex.libs/libembree4*.so*",),
    "win32": ("../embreex.libs/embree4*.dll", "embree4*.dll"),
    "darwin": (".dylibs/libembree4*.dylib",),
}


def embree_path() -> pathlib.Path:
    """Embree's library of the installed embreex wheel, found by pattern: its name carries a hash."""
    spec = importlib.util.find_spec("embreex")
    if spec is None or not spec.origin:
        raise ImportError("the package embreex is missing, which brings Embree: pip install embreex==4.4.0.post1")
    folder = pathlib.Path(spec.origin).parent
    for pattern in LIBRARY_PATTERNS.get(sys.platform, ()):
        head, _, name = pattern.rpartition("/")
        for path in sorted((folder / head).glob(name)):
            return path.resolve()
    raise ImportError(f"no Embree 4 library stands beside {folder}: pip install embreex==4.4.0.post1")


@functools.cache
def embree():
    """Embree, opened once in a process."""
    return _kernel.open_embree(str(embree_path()))


class KernelScene:
    """The scene's BVH, with its patches once they are set.

    Attributes
    ----------
    centre : float64 (3,) what positions are relative to inside the kernel [m]
    """

    def __init__(self, scene: Scene, workers: Workers):
        self.workers = workers
        self._scene = _kernel.create_scene(embree(), scene.vertices, scene.triangles, _clear(scene))
        self._patches = None
        self.centre = np.array(_kernel.scene_centre(self._scene))
        self.side_count = 0

    def closest_hits(self, origins, directions):
        """First opaque triangle along rays (N, 3): index int32 (N,), -1 = none; (u, v, distance) float32 (N, 3)."""
        triangles, hits = np.empty(len(origins), np.int32), np.empty((len(origins), 3), np.float32)
        _kernel.closest_hits(self._scene, _rows(origins, np.float64), _rows(directions, np.float32), triangles, hits)
        return triangles, hits

    def occluded(self, points_from, points_to):
        """Whether an opaque triangle lies between points (N, 3): bool (N,)."""
        points_from, points_to = _rows(points_from, np.float64), _rows(points_to, np.float64)
        if len(points_from) != len(points_to):
            raise ValueError(f"points_to has {len(points_to)} rows, points_from {len(points_from)}")
        out = np.empty(len(points_from), np.uint8)

        def call(start, stop):
            _kernel.occluded(self._scene, points_from[start:stop], points_to[start:stop], out[start:stop])

        self.workers.each_range(len(out), 1 << 16, call)
        return out.astype(bool)

    def set_patches(self, apexes, first_rows, first_cells, first_pieces, owners=NO_OWNERS, areas=None) -> None:
        """Cut the triangles into patches, of pieces that are joined by ``owners`` (native/include/patchlight.h)."""
        areas = _rows(np.zeros(len(owners)) if areas is None else areas, np.float32)
        count = int(owners.max()) + 1 if len(owners) else int(first_pieces[-1])
        self._patches = _kernel.create_patches(apexes, first_rows, first_cells, first_pieces, owners, areas, count)
        self.side_count = 2 * count

    def patch_points(self, patches, samples, seed):
        """Even points on patches (K,): triangles int32 (K * samples,), barycentrics float32 (K * samples, 3)."""
        patches = _rows(patches, np.int32)
        triangles = np.empty(len(patches) * samples, np.int32)
        barycentrics = np.empty((len(patches) * samples, 3), np.float32)
        _kernel.patch_points(self._patches, patches, samples, seed, triangles, barycentrics)
        return triangles, barycentrics

    def form_factors_monte_carlo(self, sides, rays, seed, on_step=None):
        """Rows of form factors, float32 (len(sides), side_count), by cosine rays."""

        def rows(part, out):
            _kernel.form_factors_monte_carlo(self._scene, self._patches, part, rays, seed, out)

        return self._form_factor_rows(sides, rows, on_step)

    def form_factors_hemicube(self, sides, resolution, positions, seed, on_step=None):
        """Rows of form factors, float32 (len(sides), side_count), by hemicubes."""

        def rows(part, out):
            _kernel.form_factors_hemicube(self._scene, self._patches, part, resolution, positions, seed, out)

        return self._form_factor_rows(sides, rows, on_step)

    def _form_factor_rows(self, sides, rows, on_step):
        sides = _rows(sides, np.int32)
        out = np.empty((len(sides), self.side_count), np.float32)

        def call(start, stop):
            # millions of small shares are summed: float32 sums would be off by 1e-5
            sums = np.empty((stop - start, self.side_count), np.float64)
            rows(sides[start:stop], sums)
            out[start:stop] = sums

        self.workers.each_range(len(sides), 8, call, on_step)
        return out

    def openness(self, reaches, rays, seed):
        """Share of each side's cosine rays that meet nothing within its reach (2 P,) [m]: float32 (2 P,)."""
        out = np.empty(self.side_count, np.float32)

        def call(start, stop):
            _kernel.openness(self._scene, self._patches, reaches, start, stop - start, rays, seed, out)

        self.workers.each_range(self.side_count, 4096, call)
        return out

    def shoot(self, sides, first_samples, ray_flux, first_rays, seed):
        """Shoot fixed-point flux along the rays of sides (K,): uint64 received (side_count, 3) and escaped (3,)."""
        received, escaped = np.zeros((self.side_count, 3), np.uint64), np.zeros((1, 3), np.uint64)

        def call(start, stop):
            _kernel.shoot(
                self._scene, self._patches, sides, first_samples, ray_flux, first_rays, start, stop - start, seed,
                received, escaped,
            )  # fmt: skip

        self.workers.each_range(int(first_rays[-1]), 1 << 16, call)
        return received, escaped[0]

    def learn_guides(self, light, receivers, members, first_members, rays, seed):
        """Mean squares of what groups of receivers see through each cell, float32 (G, GUIDE_CELLS), and the rays."""
        moments = np.empty((len(first_members) - 1, GUIDE_CELLS), np.float32)
        seen, where = light.arrays(), receivers.arrays()

        def call(start, stop):
            return _kernel.learn_guides(
                self._scene, self._patches, *seen, where, members, first_members, start, stop - start, rays, seed,
                moments,
            )  # fmt: skip

        return moments, sum(self.workers.each_range(len(moments), 64, call))

    def gather(self, light, receivers, guides, selected, first, count, seed, io_sums, on_step=None):
        """Add the radiosity that each selected receiver's rays see to io_sums, a gather_sums.GatherSums.

        Returns the rays traced. ``light`` is a seen_light.SeenLight, ``guides`` a guides.Guides.
        """
        seen, where, guiding, sums = (each.arrays() for each in (light, receivers, guides, io_sums))
        replicates = io_sums.luminances.shape[1]

        def call(start, stop):
            return _kernel.gather(
                self._scene, self._patches, *seen, where, guiding, selected[start:stop], replicates, first, count,
                seed, sums,
            )  # fmt: skip

        size = max(64, min(4096, (1 << 17) // (replicates * count)))
        return sum(self.workers.each_range(len(selected), size, call, on_step))

    def direct(self, emitters, receivers, samples, seed, on_step=None, is_first=True):
        """Direct irradiance float32 (N, 3) [W/m^2], variance of its luminance float32 (N,), shadow rays traced.

        ``is_first``: those that seem to see all or nothing of a light stop early.
        """
        irradiance, variance = np.zeros((len(receivers), 3), np.float32), np.zeros(len(receivers), np.float32)
        lights, where = emitters.arrays(), receivers.arrays()

        def call(start, stop):
            return _kernel.direct(
                self._scene, lights, where, start, stop - start, samples, is_first, seed, irradiance, variance
            )  # fmt: skip

        if not len(emitters):
            return irradiance, variance, 0
        return irradiance, variance, sum(self.workers.each_range(len(receivers), 2048, call, on_step))


def _clear(scene: Scene):
    """What passes straight through the scene's triangles, as the kernel takes it; None where all are opaque."""
    if all(material.is_opaque for material in scene.materials):
        return None
    textures = [material.transmittance_texture for material in scene.materials]
    images = {id(texture): texture.pixels for texture in textures if texture is not None}
    places = {key: place for place, key in enumerate(images)}
    maps = np.array([places.get(id(texture), -1) for texture in textures], np.int32)
    shapes = np.array([pixels.shape[:2] for pixels in images.values()], np.int32).reshape(-1, 2)
    ends = np.cumsum(shapes.prod(axis=1))
    return (
        np.array([m.transmittance for m in scene.materials], np.float32)[scene.triangle_materials],
        np.array([_clear_flags(m) for m in scene.materials], np.uint8)[scene.triangle_materials],
        maps[scene.triangle_materials],
        scene.uvs.reshape(-1, 6),
        np.column_stack([ends - shapes.prod(axis=1), shapes]).astype(np.int32),
        np.concatenate([np.zeros((0, 3), np.float32), *(pixels.reshape(-1, 3) for pixels in images.values())]),
    )


def _clear_flags(material):
    """A sum of pl_clear_flags."""
    flags = {
        _kernel.PL_RAYS_STOP: material.stops_light,
        _kernel.PL_RAYS_MISS: not material.meets_light,
        _kernel.PL_SHADOWS_MISS: not material.meets_shadow_rays,
        _kernel.PL_MAP_EXTENDS: material.textures_extend,
        _kernel.PL_FRONT_OPEN: material.open_side == "front",
        _kernel.PL_BACK_OPEN: material.open_side == "back",
    }
    return sum(flag for flag, is_set in flags.items() if is_set)


def smooth(workers, grid, receivers, values, variances, step, stops_on_value):
    """One level of edge-stopping smoothing: values float32 (N, 3), variances float32 (N,) of their luminance.

    ``grid`` is a smoothing.TexelGrid; what the arguments mean: native/include/patchlight.h, pl_smooth.
    """
    out_values, out_variances = np.zeros_like(values), np.zeros_like(variances)
    where, (height, width) = receivers.arrays(), grid.receivers.shape

    def call(start, stop):
        _kernel.smooth(
            grid.receivers, width, height, grid.spacing, where, values, variances, step, int(stops_on_value), start,
            stop - start, out_values, out_variances,
        )  # fmt: skip

    workers.each_range(height, max(ROWS, ROWS * step // 2), call)
    return out_values, out_variances


def clamp_outliers(workers, grid, receivers, values, variances):
    """Values float32 (N, 3), those that stand alone by their noise brought back among their neighbours.

    ``variances`` (N,): of their luminance before it was smoothed. See native/include/patchlight.h, pl_clamp_outliers.
    """
    out = np.zeros_like(values)
    where, (height, width) = receivers.arrays(), grid.receivers.shape

    def call(start, stop):
        _kernel.clamp_outliers(
            grid.receivers, width, height, grid.spacing, where, values, variances, start, stop - start, out
        )

    workers.each_range(height, ROWS, call)
    return out


def smooth_graph(workers, graph, values, variances, stops_on_value):
    """One round of edge-stopping smoothing: values float32 (V, 3), variances float32 (V,) of their luminance.

    ``graph`` is a vertex_graph.VertexGraph; what the arguments mean: native/include/patchlight.h, pl_smooth_graph.
    """
    out_values, out_variances, edges = np.empty_like(values), np.empty_like(variances), graph.arrays()

    def call(start, stop):
        _kernel.smooth_graph(
            *edges, values, variances, int(stops_on_value), start, stop - start, out_values, out_variances
        )

    # not many: each call looks at all edges, whether they lead somewhere
    workers.each_range(len(values), max(1 << 16, len(values) // 16), call)
    return out_values, out_variances


def sobol_points(first, count, seed):
    """Points of a 4-D Owen-scrambled Sobol sequence, from number ``first`` on: float32 (count, 4) in [0, 1)."""
    out = np.empty((count, 4), np.float32)
    _kernel.sobol_points(first, seed, out)
    return out


def rasterise_texels(uvs, width, height):
    """Receivers among the texels: triangles int32, distances float32 [texels], (height, width); barycentrics float32.

    ``uvs`` float32 (T, 3, 2) in texels; layout of the outputs: native/include/patchlight.h.
    """
    triangles, distances = np.empty((height, width), np.int32), np.empty((height, width), np.float32)
    barycentrics = np.empty((height, width, 3), np.float32)
    _kernel.rasterise_texels(_rows(uvs, np.float32), width, height, triangles, distances, barycentrics)
    return triangles, distances, barycentrics


def pack_charts(uvs, first_triangles, density, width, block, upright=0):
    """Places int32 (C, 3) (column, row, is turned) of charts in an atlas, and the rows that they take [texels].

    ``uvs`` float64 (T, 3, 2), triangles sorted by chart; chart c has ``first_triangles[c] : first_triangles[c + 1]``.
    So many charts as ``upright``, the last ones, are not turned.
    """
    places = np.empty((len(first_triangles) - 1, 3), np.int32)
    first_triangles = _rows(first_triangles, np.int32)
    height = _kernel.pack_charts(_rows(uvs, np.float64), first_triangles, upright, density, width, block, places)
    return places, height


def _rows(array, dtype):
    return np.ascontiguousarray(array, dtype)
