"""Form factors between surfaces by the kernel's rays, with an error from independent replicates.

The emitter is cut into parts, each at the origin of a scene of its own: near what it faces, float32 would lose the gap.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .aimed import PUSH, aimed_exchanges, pairs_apart
from .analytic import Surface
from .bodies import PANEL_ERROR, Body
from .hemicube import hemicube_exchanges, pairs_seen
from .kernel import KernelScene
from .patches import subdivide
from .polygon import (
    are_coplanar,
    bisect,
    distance_to,
    extent,
    fault_of,
    heights_above,
    polygon_area,
    tangents,
    unit_normal,
)
from .quadrature import fan
from .scene import Material, Scene, SceneObject
from .transport import REPLICATES, Estimate, HemicubeFormFactors, MonteCarloFormFactors, estimate, replicated
from .workers import Workers

PUSH_ALLOWED = 2e-5  # share of the emitter whose rays may start beyond what they should hit
CLOSE_PARTS = 16  # into which a surface is cut, about, where something is near
CLOSE = 5.0  # distance in sizes below which one hemicube cannot stand for a part
PARTS_LIMIT = 512
WHOLE_PIECES = 8  # a surface of more pieces is not cut: its pieces are small already
COARSE_RAYS = 1 << 22  # of a row, where only a solution is wanted: its errors average out
FIRST_RAYS = 1 << 18  # of all replicates together
AIMED_WANTED = 4e-7  # bound of the error at which aimed rays stop
AIMED_SHARE = 1e-2  # of the value, which it must be as well: a small bound of a smaller value may be of luck
GRAZED = 1e-5  # of what nothing would hide: a value below this may be of rays that slip past an edge
AIMED_RAYS = 1 << 22  # after which they stop, unless with the next ones ...
AIMED_LIMIT = 1 << 25  # ... up to these they come to what is wanted
SMOOTH = 1.2  # the error of aimed rays falls with this power of their number where nothing is half hidden


@dataclass(frozen=True, slots=True)
class SampledEstimator:
    """By the kernel's rays, in independent replicates, with more rays until the error is small enough.

    Attributes
    ----------
    name : "hemicube" or "monte-carlo"
    workers : threads
    wanted : bound of the error at which it stops
    ray_limit : rays of one row, all replicates together
    resolution : pixels along a hemicube's top face
    seed : int
    """

    name: str
    workers: Workers
    wanted: float = 1e-4
    ray_limit: int = 1 << 25
    resolution: int = 16
    seed: int = 0

    @property
    def setting(self) -> str:
        """What is the same for every case, in words."""
        how = (
            f"hemicubes of {self.resolution}^2, over one target until {AIMED_WANTED:g} or 2^{_log2(AIMED_RAYS)}"
            if self.name == "hemicube"
            else f"cosine rays, rays aimed at what stands apart until {AIMED_WANTED:g} or 2^{_log2(AIMED_RAYS)}"
        )
        limit = _log2(self.ray_limit)
        return f"{how}, {REPLICATES} replicates, rays until the 99 % bound is {self.wanted:g}, at most 2^{limit}"

    def factor(self, emitter: Surface, target: Surface, blockers=()) -> Estimate:
        """F from emitter to target among blockers; from the smaller of the two, by reciprocity."""
        if not target.pieces or not emitter.pieces:
            # a duplicate, all of which another surface covers
            return Estimate(*(np.zeros(()) for _ in Estimate.__slots__))
        share = 1.0
        if target.area < emitter.area:
            share = target.area / emitter.area
            emitter, target = target, emitter
        pairs = self._pairs(emitter, target, blockers)
        if pairs is not None:
            return self._aimed(emitter, target, blockers, pairs, share)
        row = self._row(emitter, [target, *blockers], self.wanted / share)
        return Estimate(*(np.asarray(getattr(row, key)[0] * share) for key in Estimate.__slots__))

    def element(self, point, normal, target: Surface, blockers=()) -> Estimate:
        """F from an element to target among blockers: a triangle so small that F is the same all over it."""
        near = min(distance_to(point, piece) for piece in target.pieces)
        return self.factor(Surface("dA", (_triangle_at(point, normal, 1e-5 * near),)), target, blockers)

    def matrix(self, surfaces, blockers=()) -> Estimate:
        """F of all pairs, float64 (N, N); what is much smaller than the emitter by reciprocity from its own side."""
        rows = []
        for k, emitter in enumerate(surfaces):
            row = self._row(emitter, [*surfaces[:k], *surfaces[k + 1 :], *blockers], self.wanted, own=k)
            rows.append([getattr(row, key)[: len(surfaces)] for key in Estimate.__slots__])
        parts = [np.stack(part) for part in zip(*rows)]
        areas = np.array([s.area for s in surfaces])
        is_small = areas[None, :] < areas[:, None] / 16
        there = [part.T * areas[None, :] / areas[:, None] for part in parts]
        return Estimate(*(np.where(is_small, far, near) for near, far in zip(parts, there)))

    def body_matrix(self, bodies: list[Body]) -> Estimate:
        """F of all pairs of bodies, float64 (N, N)."""
        found = self.matrix([body.surface() for body in bodies])
        return replace(found, bound=found.bound + PANEL_ERROR * np.abs(found.value))

    def _pairs(self, emitter, target, blockers):
        """Pairs of parts of two surfaces between which rays can be aimed; None where they cannot."""
        if self.name == "monte-carlo":
            return pairs_apart(emitter.pieces, target.pieces)
        # rays start off their surface: the target may be nearer than that, a blocker would hide nothing
        is_close = any(_lies_on(p, piece) for piece in emitter.pieces for blocker in blockers for p in blocker.pieces)
        return None if is_close else pairs_seen(emitter.pieces, target.pieces)

    def _aimed(self, emitter, target, blockers, pairs, share) -> Estimate:
        """F from a surface to another by rays at it alone, times ``share``, refined until its bound is as wanted."""
        if not pairs:
            return Estimate(*(np.zeros(()) for _ in Estimate.__slots__))
        origin = emitter.pieces[0][0]
        triangles, owners = _triangles([target, emitter, *blockers])
        kernel = KernelScene(_scene_about(origin, triangles), self.workers)
        pairs = [(a - origin, b - origin) for a, b in pairs]
        seeds, scale = [self.seed + k for k in range(REPLICATES)], share / emitter.area
        rays_each = 1 if self.name == "monte-carlo" else self.resolution**2
        points = max(1, FIRST_RAYS // (REPLICATES * len(pairs) * rays_each))
        points, done, sums, traced = 1 << (points - 1).bit_length(), 0, 0.0, 0
        while True:
            # a whole power of two is even all over: the first points and as many again
            exchanged, rays = self._exchanges(kernel, owners == 0, pairs, points, done, seeds)
            sums, traced = sums + points * scale * exchanged, traced + rays
            done += points
            points = done
            work = REPLICATES * len(pairs) * done * rays_each
            seen, unhidden = np.moveaxis(sums / done, 1, 0)
            # what no ray has found to be hidden is a share of what is not
            found = estimate(seen, max(traced, 1) / max(unhidden.mean(), 1e-300))
            is_large = found.bound > AIMED_SHARE * found.value and found.value > GRAZED * unhidden.mean()
            hoped = found.bound * (work / AIMED_LIMIT) ** SMOOTH
            limit = AIMED_LIMIT if hoped <= AIMED_WANTED * share else AIMED_RAYS
            if (found.bound <= AIMED_WANTED * share and not is_large) or 2 * work > limit:
                # blockers' edges are as good as float32
                slipped = PUSH * unhidden.mean() if (seen < unhidden).any() else 0.0
                return replace(found, bound=found.bound + slipped)

    def _exchanges(self, kernel, is_target, pairs, points, first, seeds):
        if self.name == "monte-carlo":
            return aimed_exchanges(kernel, is_target, pairs, points, first, seeds)
        return hemicube_exchanges(kernel, is_target, pairs, self.resolution, points, first, seeds)

    def _row(self, emitter, others, wanted, own=None) -> Estimate:
        """F from a surface to each of the others, float64 (N,), refined until its bound is as wanted.

        With ``own`` the emitter itself is among the targets, at that index: a body can see itself.
        """
        is_coarse = self.ray_limit <= COARSE_RAYS
        parts = [list(emitter.pieces)] if is_coarse else emitting_parts(emitter, others, self.name)
        scenes = [_PartScene(part, len(parts) == 1, emitter, others, own, self.workers) for part in parts]
        weights = np.array([_area(part) for part in parts]) / emitter.area
        bias = min(1.0, sum(w * min(1.0, part_push(p, others)) for w, part in zip(weights, parts) for p in part[:1]))
        spent, turn = FIRST_RAYS // REPLICATES, 0
        while True:
            replicates, rays, equal_rays = 0.0, 0, 0
            for k, (weight, scene) in enumerate(zip(weights, scenes)):
                # parts must not share a sequence: their errors would add up
                first, share = REPLICATES * (turn * len(parts) + k), max(1, spent // (len(parts) * len(scene.sides)))
                found, traced = self._replicates(scene, share, first)
                replicates, rays, equal_rays = replicates + weight * found, rays + traced[0], equal_rays + traced[1]
            if estimate(replicates, equal_rays).bound.max() <= wanted or 4 * rays > self.ray_limit:
                return estimate(replicates, equal_rays, bias)
            spent, turn = 4 * spent, turn + 1

    def coarser(self) -> SampledEstimator:
        """The same for the form factors of a solution."""
        return replace(self, ray_limit=COARSE_RAYS)

    def _replicates(self, scene, rays, first):
        """Factors of a part (REPLICATES, N), with ``rays`` or more from each of its sides; the rays traced, and what
        these are worth in rays of equal shares."""
        if self.name == "monte-carlo":
            chosen = MonteCarloFormFactors(scene.kernel, 1 << (rays - 1).bit_length(), self.seed)
        else:
            positions = max(1, round(rays / (3 * self.resolution**2)))
            chosen = HemicubeFormFactors(scene.kernel, self.resolution, positions, self.seed)
        found = replicated(chosen, scene.sides, scene.reduce, first)
        rows = REPLICATES * len(scene.sides)
        return found, (rows * chosen.rays_per_row, rows * chosen.equal_rays_per_row)


def _log2(count):
    return count.bit_length() - 1


def _area(part):
    return sum(polygon_area(piece) for piece in part)


def nearest(piece, others) -> float:
    """Distance from a piece's centre to the nearest other surface that is not coplanar with it [m]."""
    centre = piece.mean(axis=0)
    near = (distance_to(centre, p) for s in others for p in s.pieces if not are_coplanar(p, piece))
    return max(min(near, default=np.inf), 1e-300)


def part_push(piece, others) -> float:
    """How far off a piece its rays start, in distances from its centre to what is nearest, doubled."""
    return 2 * PUSH * np.abs(piece - piece.mean(axis=0)).max() / nearest(piece, others)


def _lies_on(blocker, piece) -> bool:
    """Whether a piece's rays start beyond too much of a blocker, which rises too little over its plane."""
    rise = heights_above(blocker, piece[0], unit_normal(piece)).max()
    return 0 < PUSH_ALLOWED * rise < 2 * PUSH * np.abs(piece - piece.mean(axis=0)).max()


def emitting_parts(emitter: Surface, others, method: str):
    """A surface as parts, lists of pieces, small where it comes near others: for float32, and for hemicubes, of which
    one stands for a part only where nothing is near."""
    pieces = [piece for piece in emitter.pieces if fault_of(piece) is None]
    if len(pieces) > WHOLE_PIECES:
        return [pieces]

    def lost(piece):
        return polygon_area(piece) / emitter.area * min(1.0, part_push(piece, others)) / PUSH_ALLOWED

    if method == "hemicube":
        while len(pieces) < CLOSE_PARTS and any(nearest(p, others) < CLOSE * extent(p) for p in pieces):
            pieces = [half for piece in pieces for half in bisect(piece) if len(half)]
    losses = [lost(piece) for piece in pieces]
    while sum(losses) > 1 and len(pieces) < PARTS_LIMIT:
        worst = int(np.argmax(losses))
        losses.pop(worst)
        halves = [half for half in bisect(pieces.pop(worst)) if len(half)]
        pieces += halves
        losses += [lost(half) for half in halves]
    return [[piece] for piece in pieces]


class _PartScene:
    """A part of the emitter, what is not in its plane of the rest, and the others; the part's centre is the origin."""

    def __init__(self, part, is_whole, emitter, others, own, workers):
        targets = list(others)
        place = len(targets) if own is None else own
        if is_whole:
            # it emits as it is, and may see itself
            targets.insert(place, emitter)
        else:
            rest = tuple(p for p in emitter.pieces if not are_coplanar(p, part[0]))
            targets.insert(place, Surface(emitter.name, rest))
            place = len(targets)
            targets.append(Surface("part", tuple(part)))
        centre = np.concatenate(part).mean(axis=0)
        triangles, owners = _triangles(targets)
        scene = _scene_about(centre, triangles)
        self.kernel = KernelScene(scene, workers)
        patches = subdivide(scene, self.kernel, 1e30, 8 * len(triangles), 0)
        owners = owners[patches.triangles]
        self.sides = 2 * np.flatnonzero(owners == place)
        self._weights = patches.areas[owners == place] / patches.areas[owners == place].sum()
        self._member = (owners[:, None] == np.arange(len(targets))).astype(np.float64)

    def reduce(self, rows):
        """Rows (K, 2 P) as factors to the fronts of the targets (N,)."""
        return self._weights @ (rows[:, ::2].astype(np.float64) @ self._member)


def _triangles(surfaces):
    triangles, owners = [], []
    for k, one in enumerate(surfaces):
        for piece in one.pieces:
            parts = fan(piece)
            parts = parts[[polygon_area(part) > 0 for part in parts]]
            triangles.append(parts)
            owners += [k] * len(parts)
    return np.concatenate(triangles), np.array(owners)


def _scene_about(centre, triangles):
    """A scene whose kernel origin is ``centre``: two vertices that no triangle uses even out its bounds."""
    corners = triangles.reshape(-1, 3) - centre
    reach = np.abs(corners).max(axis=0)
    count = len(triangles)
    return Scene(
        vertices=np.concatenate([corners, [reach, -reach]]),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        corner_normals=np.zeros((count, 3, 3), np.float32),
        uvs=np.zeros((count, 3, 2), np.float32),
        triangle_materials=np.zeros(count, np.int32),
        objects=(SceneObject("surfaces", 0, count),),
        materials=(Material("black"),),
    )


def _triangle_at(point, normal, size):
    u, v = tangents(normal)
    turns = 2 * np.pi * np.arange(3) / 3
    return point + size * (np.cos(turns)[:, None] * u + np.sin(turns)[:, None] * v)
