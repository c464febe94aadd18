"""Seams: where a surface goes on and its place in the lightmap does not.

Both sides are looked up between texels of their own, whose noise differs and of which those on the rim stand for points
a little inside. What is seen is a line along the seam. The texels there are changed by as little as makes both sides
show the same, by least squares: Iwanicki 2013, "Lighting technology of The Last of Us". There the seams are edges that
meshes share; here rays find what lies beyond the edge, so that charts, objects and T-junctions are one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .emitters import luminance_of
from .kernel import KernelScene
from .lookup import bilinear
from .receivers import surface_receivers
from .scene import Scene

SAME_UV = 1 / 1024  # texels: what edges of triangles that lie beside each other in a chart may differ by
STEP = 1.0  # texels between points along a seam, from each side
BEYOND, LIFT = 0.05, 0.1  # texels beyond the edge and above it, from where a ray looks for the other side,
LEVEL = 0.02  # which lies as high as this, up or down,
SAME_NORMAL = np.cos(np.radians(1.5))  # and faces the same way
APART = 0.5  # texels; what is looked up nearer to each other has no seam
STAY = 0.05  # what a texel's change costs, beside a difference between the sides, both by the light there: with this
# a fortieth is left of differences; with less, texels swing to and fro along the seam
LEAST_LIGHT = 1e-3  # of the median: what is darker is as easily changed
MOST_STEPS, PRECISE = 100, 1e-4  # of conjugate gradients: these end at so much of what there was to do


@dataclass(frozen=True, slots=True)
class Seams:
    """Points on seams, each looked up from both sides.

    Attributes
    ----------
    receivers : int64 (M, 8) four texels of one side and four of the other
    shares : float64 (M, 8) of them in what is seen, of the other side less than 0: they sum to 0
    """

    receivers: np.ndarray
    shares: np.ndarray

    def jumps(self, values):
        """What is seen on one side more than on the other, of values (N, C): (M, C)."""
        return np.einsum("mk,mkc->mc", self.shares, values[self.receivers])

    def stitched(self, values):
        """Irradiance (N, 3) with the least change after which both sides show the same, float32 (N, 3)."""
        if not len(self.receivers):
            return values
        texels, unknowns = np.unique(self.receivers, return_inverse=True)
        unknowns = unknowns.reshape(self.receivers.shape)
        before = values[texels].astype(np.float64)
        light = luminance_of(before)
        least = LEAST_LIGHT * np.median(light[light > 0]) if (light > 0).any() else 1.0
        # twice the light may change by the root of two more: by as much, what is dark would hardly, and pull down
        easy = np.sqrt(np.maximum(light, least))
        typical = np.sqrt(np.maximum(np.einsum("mk,mk->m", np.abs(self.shares) / 2, light[unknowns]), least))
        shares = self.shares * easy[unknowns] / typical[:, None]
        changes = _least_changes(unknowns, shares, self.jumps(values) / typical[:, None], len(texels))
        out = values.copy()
        out[texels] = np.maximum(before + easy[:, None] * changes, 0.0)
        return out


NO_SEAMS = Seams(np.zeros((0, 8), np.int64), np.zeros((0, 8)))


def find_seams(scene: Scene, kernel: KernelScene, uvs, cells) -> Seams:
    """The seams of a lightmap: ``uvs`` float32 (T, 3, 2) of the scene's triangles' corners, in texels, NaN without a
    place; ``cells`` int32 (H, W) is the receiver that each texel is, -1 for none."""
    triangles, corners = _borders(uvs)
    triangles, weights, outwards = _points_along(scene, uvs, triangles, corners)
    others, other_weights, found = _other_sides(scene, kernel, uvs, triangles, weights, outwards)
    triangles, weights = triangles[found], weights[found]
    normal = surface_receivers(scene, triangles, weights).normals
    other_normal = surface_receivers(scene, others, other_weights).normals
    here, there = _places(uvs, triangles, weights), _places(uvs, others, other_weights)
    is_seam = np.einsum("nc,nc->n", normal, other_normal) > SAME_NORMAL
    is_seam &= ((here - there) ** 2).sum(axis=1) > APART**2
    receivers, shares = bilinear(cells, here[is_seam])
    other_receivers, other_shares = bilinear(cells, there[is_seam])
    return Seams(np.hstack([receivers, other_receivers]), np.hstack([shares, -other_shares]))


def _borders(uvs):
    """Edges that only one triangle has in the lightmap: triangles (E,), and the corners (E,) that they start from."""
    triangles = np.flatnonzero(np.isfinite(uvs).all(axis=(1, 2)))
    keys = np.round(uvs[triangles].astype(np.float64) / SAME_UV).astype(np.int64)
    starts = (keys[..., 0] << 32) + keys[..., 1]
    ends = np.roll(starts, -1, axis=1)
    edges = np.stack([np.minimum(starts, ends).ravel(), np.maximum(starts, ends).ravel()], axis=1)
    order = np.lexsort(edges.T)
    is_new = np.append(True, (edges[order[1:]] != edges[order[:-1]]).any(axis=1))
    is_alone = is_new & np.append(is_new[1:], True)
    alone = np.sort(order[is_alone])
    alone = alone[edges[alone, 0] != edges[alone, 1]]
    return triangles[alone // 3], alone % 3


def _points_along(scene, uvs, triangles, corners):
    """Points on edges, a texel or so apart over all of them: triangles (N,), barycentrics (N, 3), and a texel's length
    out of the triangle there (N, 3) [m]."""
    rows = np.arange(len(triangles))
    ends = (corners + 1) % 3
    ahead = uvs[triangles, ends].astype(np.float64) - uvs[triangles, corners]
    until = np.cumsum(np.linalg.norm(ahead, axis=1)) / STEP
    begin = np.append(0.0, until[:-1])
    # one in the middle of every step along all edges end to end: short ones have some together
    first = np.ceil(begin - 0.5).astype(np.int64)
    counts = np.maximum(np.ceil(until - 0.5).astype(np.int64) - first, 0)
    edges = np.repeat(rows, counts)
    steps = np.arange(len(edges)) - np.repeat(np.cumsum(counts) - counts, counts) + first[edges] + 0.5
    share = (steps - begin[edges]) / np.maximum(until - begin, 1e-300)[edges]
    weights = np.zeros((len(edges), 3))
    points = np.arange(len(edges))
    weights[points, corners[edges]], weights[points, ends[edges]] = 1 - share, share
    triangles = triangles[edges]
    along = scene.corners[triangles][points, ends[edges]] - scene.corners[triangles][points, corners[edges]]
    length = np.linalg.norm(along, axis=1)
    texel = length / np.maximum(np.linalg.norm(ahead, axis=1), 1e-300)[edges]
    outwards = np.cross(along / np.maximum(length, 1e-300)[:, None], _flat_normals(scene, triangles))
    return triangles, weights, texel[:, None] * outwards


def _other_sides(scene, kernel, uvs, triangles, weights, outwards):
    """What lies beyond the points (N,): triangles (M,), barycentrics (M, 3), and of which points (M,)."""
    normals = _flat_normals(scene, triangles)
    texel = np.linalg.norm(outwards, axis=1, keepdims=True)
    points = np.einsum("nk,nkc->nc", weights, scene.corners[triangles])
    above = points + LIFT * texel * normals
    there = above + BEYOND * outwards
    others, hits = kernel.closest_hits(there, -normals)
    found = others >= 0
    found &= np.isfinite(uvs).all(axis=(1, 2))[others] & (others != triangles)
    found &= np.abs(hits[:, 2] - LIFT * texel[:, 0]) < LEVEL * texel[:, 0]
    found = np.flatnonzero(found)
    # what lies on this side of the edge, too, is another layer and not what goes on
    inside = _weights_at(scene.corners[others[found]], (points - BEYOND * outwards)[found])
    found = found[inside.min(axis=1) < 0]
    # a wall on the seam parts the light
    found = found[~kernel.occluded((above - BEYOND * outwards)[found], there[found])]
    others, hits = others[found], hits[found].astype(np.float64)
    return others, np.stack([1 - hits[:, 0] - hits[:, 1], hits[:, 0], hits[:, 1]], axis=1), found


def _weights_at(corners, points):
    """Barycentrics (N, 3) of points' feet in the planes of triangles (N, 3, 3)."""
    u, v, ahead = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    uu, uv, vv, au, av = (np.einsum("nc,nc->n", a, b) for a, b in ((u, u), (u, v), (v, v), (ahead, u), (ahead, v)))
    determinant = np.maximum(uu * vv - uv * uv, 1e-300)
    second, third = (vv * au - uv * av) / determinant, (uu * av - uv * au) / determinant
    return np.stack([1 - second - third, second, third], axis=1)


def _flat_normals(scene, triangles):
    corners = scene.corners[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)


def _places(uvs, triangles, weights):
    return np.einsum("nk,nkc->nc", weights, uvs[triangles].astype(np.float64))


def _least_changes(unknowns, shares, jumps, count):
    """Changes x (count, C) that minimise |shares x + jumps|^2 + STAY |x|^2, by conjugate gradients, all channels in
    one: shares (M, 8) of the unknowns (M, 8)."""
    order = np.argsort(unknowns, axis=None, kind="stable")
    rows = order // unknowns.shape[1]
    sorted_shares = shares.ravel()[order][:, None]
    starts = np.searchsorted(unknowns.ravel()[order], np.arange(count))

    def back(differences):
        return np.add.reduceat(sorted_shares * differences[rows], starts, axis=0)

    def product(x):
        return back(np.einsum("mk,mkc->mc", shares, x[unknowns])) + STAY * x

    diagonal = np.add.reduceat(sorted_shares**2, starts, axis=0) + STAY
    x, left = np.zeros((count, jumps.shape[1])), -back(jumps)
    ahead = left / diagonal
    size = first = float((left * ahead).sum())
    for _ in range(MOST_STEPS):
        if size <= PRECISE**2 * first:
            break
        image = product(ahead)
        length = size / float((ahead * image).sum())
        x += length * ahead
        left -= length * image
        scaled = left / diagonal
        size, before = float((left * scaled).sum()), size
        ahead = scaled + size / before * ahead
    return x
