"""Everything that direct light is sampled from, as the kernel's table: lamps, suns, and glowing triangles in groups."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .environment import from_octahedron
from .kernel import AREA, EXACT_TRIANGLES, LIGHT_FLOATS, MESH, POINT, PROFILE_SIDE, SUN
from .luminance import LUMINANCE
from .scene import AreaLight, PointLight, Scene, SunLight
from .textures import textured_colours
from .triangles import triangle_areas

PROFILE_AT = 13  # in a point's row: the number of its profile, 0 for none

MOST_GROUPS = 96  # groups of glowing triangles: each receiver weighs every group
# A triangle whose glow is an image is cut into pieces, each with the mean of what the image has at many points of it.
TEXTURE_CUTS = 8  # along a side, at the most
MOST_PIECES = 1 << 20  # of all triangles, about: where there are many, each is cut into fewer
MOST_FINER = 8  # points along a piece's side, at the most
TEXTURE_LOOKUPS = 1 << 22  # of all points, at the most


@dataclass(frozen=True, slots=True)
class Emitters:
    """Rows of the kernel's light table (native/include/patchlight.h, pl_lights), relative to the scene's centre."""

    kinds: np.ndarray  # int32 (L,)
    parameters: np.ndarray  # float32 (L, LIGHT_FLOATS)
    corners: np.ndarray  # float32 (N, 9) of glowing triangles
    radiances: np.ndarray  # float32 (N, 6) of front and back
    cumulative: np.ndarray  # float32 (N,) chance of the group's triangles before each
    profiles: np.ndarray  # float32 (K, PROFILE_SIDE^2) by direction

    def __len__(self) -> int:
        return len(self.kinds)

    def arrays(self) -> tuple:
        """In the kernel's order."""
        return self.kinds, self.parameters, self.corners, self.radiances, self.cumulative, self.profiles


def emitters_of(scene: Scene, centre) -> Emitters:
    """The scene's lights and glowing triangles; ``centre`` is what the kernel re-centred by [m]."""
    table = [_light_row(light, np.asarray(centre)) for light in scene.lights]
    parameters = _padded([row for _, row in table])
    parameters[:, -1] = [not light.casts_shadow for light in scene.lights]
    shaped = [row for row, light in enumerate(scene.lights) if getattr(light, "profile", None) is not None]
    parameters[shaped, PROFILE_AT] = 1 + np.arange(len(shaped))
    lamps = Emitters(
        kinds=np.array([kind for kind, _ in table], np.int32),
        parameters=parameters,
        corners=np.zeros((0, 9), np.float32),
        radiances=np.zeros((0, 6), np.float32),
        cumulative=np.zeros(0, np.float32),
        profiles=_profiles([scene.lights[row].profile for row in shaped]),
    )
    corners, radiances = _glowing_triangles(scene)
    return with_sources(lamps, corners, radiances, centre)


def with_sources(emitters: Emitters, corners, radiances, centre) -> Emitters:
    """The emitters and further glowing triangles: world corners (N, 3, 3) [m], radiance of front and back (N, 6)."""
    corners = corners - np.asarray(centre)
    order, groups = _groups(corners, radiances)
    corners, radiances = corners[order], radiances[order]
    cumulative, rows = np.zeros(len(corners)), []
    for first, count in groups:
        span = slice(first, first + count)
        row, cumulative[span] = _group_row(corners[span], radiances[span], len(emitters.corners) + first)
        rows.append(row)
    return Emitters(
        kinds=np.concatenate([emitters.kinds, np.full(len(rows), MESH, np.int32)]),
        parameters=np.concatenate([emitters.parameters, _padded(rows)]),
        corners=np.concatenate([emitters.corners, corners.reshape(-1, 9).astype(np.float32)]),
        radiances=np.concatenate([emitters.radiances, radiances.astype(np.float32)]),
        cumulative=np.concatenate([emitters.cumulative, cumulative.astype(np.float32)]),
        profiles=emitters.profiles,
    )


def _profiles(profiles):
    """Environments (K,) over an octahedron laid out flat, their first channel: float32 (K, PROFILE_SIDE^2)."""
    places = (np.arange(PROFILE_SIDE) + 0.5) / PROFILE_SIDE * 2 - 1
    y, x = (part.ravel() for part in np.meshgrid(places, places, indexing="ij"))
    directions = from_octahedron(x, y)
    rows = [profile.seen(directions)[:, 0] for profile in profiles]
    return np.array(rows, np.float32).reshape(-1, PROFILE_SIDE**2)


def _padded(rows):
    return np.array([[*row, *[0.0] * (LIGHT_FLOATS - len(row))] for row in rows], np.float32).reshape(-1, LIGHT_FLOATS)


def _light_row(light, centre):
    if isinstance(light, PointLight):
        position = np.asarray(light.position) - centre
        soft = float(light.soft_falloff and light.radius > 0)
        shape = [light.radius, soft, *light.direction, *light.cone_cosines]
        return POINT, [*position, *light.intensity, *shape, 0.0, light.distance_power, *light.cone_metric]
    if isinstance(light, AreaLight):
        position = np.asarray(light.centre) - centre
        shape = [float(light.is_ellipse), light.spread]
        return AREA, [*position, *light.radiance, *light.axis_u, *light.axis_v, *shape]
    if isinstance(light, SunLight):
        towards = -np.asarray(light.direction) / np.linalg.norm(light.direction)
        return SUN, [*towards, *light.irradiance, 0.5 * light.angle]
    raise TypeError(f"{type(light).__name__} is not a light")


def _glowing_triangles(scene):
    """World corners float64 (N, 3, 3) and radiance of front and back (N, 6) of all triangles that emit."""
    emits = np.array([m.emits for m in scene.materials], bool)
    is_image = np.array([any((m.radiance_texture, m.of_back.radiance_texture)) for m in scene.materials], bool)
    cut = np.flatnonzero((emits & is_image)[scene.triangle_materials])
    # at one place of its image a triangle has one colour
    cut = cut[(scene.uvs[cut] != scene.uvs[cut, :1]).any(axis=(1, 2))]
    plain = np.setdiff1d(np.flatnonzero(emits[scene.triangle_materials]), cut, assume_unique=True)
    weights = _cuts(int(np.clip((MOST_PIECES / max(len(cut), 1)) ** 0.5, 1, TEXTURE_CUTS)))

    pieces = np.einsum("pkb,tbc->tpkc", weights, scene.corners[cut]).reshape(-1, 3, 3)
    middles = np.full((len(plain), 3), 1 / 3, np.float32)
    corners = np.concatenate([scene.corners[plain], pieces])
    has_backs = any(m.back is not None for m in scene.materials)
    sides = [
        np.concatenate(
            [
                textured_colours(scene, plain, middles, "radiance", of_back),
                _glow_of_pieces(scene, cut, weights, of_back),
            ]
        )
        for of_back in ([False, True] if has_backs else [False])
    ]
    radiances = np.concatenate([sides[0], sides[-1]], axis=1)
    owners = np.concatenate([plain, np.repeat(cut, len(weights))])
    open_sides = np.array([m.open_side or "" for m in scene.materials])[scene.triangle_materials[owners]]
    radiances[open_sides == "front", :3] = 0
    radiances[open_sides == "back", 3:] = 0
    areas = triangle_areas(corners)
    keep = (areas > 0) & (radiances.max(axis=1, initial=0.0) > 0) & _is_first(corners)
    return corners[keep], radiances[keep]


def _glow_of_pieces(scene, triangles, weights, of_back):
    """Mean radiance (T * P, 3) of pieces of triangles (T,), of corner weights (P, 3, 3): at many points of each."""
    finer = int(np.clip((TEXTURE_LOOKUPS / max(len(triangles) * len(weights), 1)) ** 0.5, 1, MOST_FINER))
    points = np.einsum("sk,pkb->psb", _cuts(finer).mean(axis=1), weights).reshape(-1, 3).astype(np.float32)
    where = np.repeat(triangles, len(points)), np.tile(points, (len(triangles), 1))
    glow = textured_colours(scene, *where, "radiance", of_back)
    return glow.reshape(-1, finer**2, 3).mean(axis=1)


def _is_first(corners):
    """False for triangles (N, 3, 3) that lie where an earlier one does: one hides the other: they must not add up."""
    ordered = np.take_along_axis(corners, np.lexsort(np.moveaxis(corners, 2, 0), axis=1)[..., None], axis=1)
    is_first = np.zeros(len(corners), bool)
    is_first[np.unique(ordered.reshape(-1, 9), axis=0, return_index=True)[1]] = True
    return is_first


def _cuts(n):
    """A triangle cut into n^2 alike: corner weights (n^2, 3, 3)."""
    pieces = []
    for i in range(n):
        for j in range(n - i):
            pieces.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < n - 1:
                pieces.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    ij = np.array(pieces, float) / n
    return np.concatenate([1 - ij.sum(axis=2, keepdims=True), ij], axis=2)


def _groups(corners, radiances):
    """Order of the triangles, and (first, count) of each group in it: neighbours, split where the most light is."""
    middles = corners.mean(axis=1)
    flux = _flux(corners, radiances)
    waiting, done = ([np.arange(len(corners))] if len(corners) else []), []
    while waiting:
        waiting.sort(key=lambda group: flux[group].sum())
        group = waiting.pop()
        extent = np.ptp(middles[group], axis=0)
        if len(group) <= EXACT_TRIANGLES or len(waiting) + len(done) + 2 > MOST_GROUPS or extent.max() <= 0:
            done.append(group)
            continue
        ranked = group[np.argsort(middles[group, np.argmax(extent)], kind="stable")]
        waiting += [ranked[: len(ranked) // 2], ranked[len(ranked) // 2 :]]
    firsts = np.concatenate([[0], np.cumsum([len(group) for group in done])]).astype(int)
    order = np.concatenate(done) if done else np.zeros(0, int)
    return order, [(int(first), len(group)) for first, group in zip(firsts, done)]


def _flux(corners, radiances):
    """What a triangle's brighter side sends out, for choosing (N,)."""
    sides = radiances.reshape(-1, 2, 3)
    return triangle_areas(corners) * (sides @ LUMINANCE + 1e-6 * sides.max(axis=2, initial=0.0)).max(
        axis=1, initial=0.0
    )


def _group_row(corners, radiances, first):
    flux = _flux(corners, radiances)
    middle = 0.5 * (corners.reshape(-1, 3).min(axis=0) + corners.reshape(-1, 3).max(axis=0))
    radius = np.linalg.norm(corners.reshape(-1, 3) - middle, axis=1).max()
    cumulative = np.concatenate([[0.0], np.cumsum(flux)[:-1]]) / flux.sum()
    return [*middle, radius, flux.sum(), first, len(corners)], cumulative
