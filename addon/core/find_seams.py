"""Find the seams of a lightmap: rays look for what lies beyond the borders of its charts.

So that charts, objects and T-junctions are one, and what lies beside the surface or under it is not what goes on. Nor
is there a seam where a wall stands on it or beside it: what is looked up there is light of both sides of the wall.
"""

from __future__ import annotations

import numpy as np

from .kernel import KernelScene
from .lookup import bilinear
from .receivers import Receivers, surface_receivers
from .scene import Scene
from .seams import NO_SEAMS, Seams
from .triangles import unit_normals

SAME_UV = 1 / 1024  # texels: what edges of triangles that lie beside each other in a chart may differ by
BLOCK = 1 << 18  # triangles, or points on edges, at once
STEP = 1.0  # texels between points along a seam, from each side
MOST_POINTS = 1 << 20  # of all seams: where each face is a chart, points lie farther apart
# From beyond an edge a ray looks down for the other side.
BEYOND, LIFT = 0.05, 0.1  # texels beyond the edge, and above it, where the ray starts
DEPTH = 0.3  # texels that it looks down
LEVEL = 0.02  # texels that the edge may lie off the plane of what it finds
SAME_NORMAL = np.cos(np.radians(1.5))  # of the shading of both sides
# What is looked up on both sides must not be one, nor parted by anything.
APART = 0.5  # texels: what is looked up nearer to each other has no seam
NEAR = 3.0  # texels: what is looked up farther away is that of others, where charts touch
SIGHTS = (
    0.5,
    1.0,
)  # texels above the surface, from where the edge must see all texels that are looked up: lower, a
# ball of few texels hides its own
LYING = 0.02  # times the first of these: from so low rays go up, as they meet what lies flat


def find_seams(scene: Scene, kernel: KernelScene, receivers: Receivers, uvs, cells, poll=lambda: None) -> Seams:
    """The seams of a lightmap.

    ``uvs`` float32 (T, 3, 2) are those of the scene's triangles' corners, in texels, NaN without a place; ``cells``
    int32 (H, W) is the receiver that each texel is, -1 for none. ``poll()`` is called between parts of the work; what
    it raises ends it.
    """
    triangles, corners = _borders(uvs)
    until = np.cumsum(np.linalg.norm(_ahead(uvs, triangles, corners), axis=1))
    step = max(STEP, until[-1] / MOST_POINTS) if len(until) else STEP
    parts = until // (BLOCK * step)
    seams = [NO_SEAMS]
    for part in np.unique(parts):
        poll()
        edges = triangles[parts == part], corners[parts == part]
        seams.append(_seams_along(scene, kernel, receivers, uvs, cells, *edges, step))
    return Seams(*(np.concatenate([getattr(part, name) for part in seams]) for name in ("receivers", "shares")))


def _seams_along(scene, kernel, receivers, uvs, cells, triangles, corners, step) -> Seams:
    """The seams along edges, with a point in each step."""
    triangles, weights, outwards = _points_along(scene, uvs, triangles, corners, step)
    others, other_weights, found = _other_sides(scene, kernel, uvs, triangles, weights, outwards)
    triangles, weights = triangles[found], weights[found]
    here, there = _places(uvs, triangles, weights), _places(uvs, others, other_weights)
    points = surface_receivers(scene, triangles, weights)
    is_seam = np.einsum("nc,nc->n", points.normals, surface_receivers(scene, others, other_weights).normals)
    is_seam = (is_seam > SAME_NORMAL) & (((here - there) ** 2).sum(axis=1) > APART**2)
    (texels, shares), (other_texels, other_shares) = bilinear(cells, here[is_seam]), bilinear(cells, there[is_seam])
    texels, shares = np.hstack([texels, other_texels]), np.hstack([shares, -other_shares])
    texel_sizes = np.linalg.norm(outwards, axis=1)[found][is_seam]
    is_open = _see_all(kernel, points.part(is_seam), receivers, texels, shares, texel_sizes)
    return Seams(texels[is_open].astype(np.int32), shares[is_open].astype(np.float32))


def _see_all(kernel, points, receivers, texels, shares, sizes):
    """Whether each point (N,) sees all receivers (N, 8) that have a share in what is looked up, in texels that are so
    large (N,) [m], over what stands or lies there and below what hangs over it."""
    is_open = _is_free(kernel, points, sizes)
    for texel, share in zip(texels.T, shares.T):
        looked_up = receivers.part(texel)
        is_near = np.linalg.norm(looked_up.positions - points.positions, axis=1) < NEAR * sizes
        sees = is_near & _is_free(kernel, looked_up, sizes)
        for sight in SIGHTS:
            sees &= ~kernel.occluded(_above(points, sight * sizes), _above(looked_up, sight * sizes))
        is_open &= (share == 0) | sees
    return is_open


def _is_free(kernel, points, sizes):
    """Whether nothing lies on points (N,)."""
    lowest = SIGHTS[0] * sizes
    return ~kernel.occluded(_above(points, LYING * lowest), _above(points, lowest))


def _above(points, heights):
    return points.positions + heights[:, None] * points.normals


def _borders(uvs):
    """Edges that only one triangle has in the lightmap: triangles (E,), and the corners (E,) that they start from."""
    triangles = np.flatnonzero(np.isfinite(uvs).all(axis=(1, 2)))
    edges = np.empty((len(triangles), 3), np.uint64)
    for first in range(0, len(triangles), BLOCK):
        block = slice(first, first + BLOCK)
        places = np.round(uvs[triangles[block]].astype(np.float64) / SAME_UV).astype(np.int64)
        starts = _mixed((places[..., 0] << 32) + places[..., 1])
        ends = np.roll(starts, -1, axis=1)
        # of both, whichever comes first; one in 10^6 bakes of 10^7 edges takes two for one and leaves a point out
        edges[block] = np.where(starts == ends, 0, starts + ends)
    edges = edges.ravel()
    order = np.argsort(edges)
    differs = np.diff(edges[order]) != 0
    alone = np.sort(order[np.append(True, differs) & np.append(differs, True)] if len(order) else order)
    alone = alone[edges[alone] != 0]  # those without a length
    return triangles[alone // 3], alone % 3


def _mixed(numbers):
    """Numbers int64 as evenly spread ones, uint64 (the end of SplitMix64: Steele, Lea & Flood 2014)."""
    mixed = numbers.astype(np.uint64)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return mixed ^ (mixed >> np.uint64(31))


def _points_along(scene, uvs, triangles, corners, step):
    """Points on edges, so many texels apart over all of them: triangles (N,), barycentrics (N, 3), and a texel's length
    out of the triangle there (N, 3) [m]."""
    ends, lengths = (corners + 1) % 3, np.linalg.norm(_ahead(uvs, triangles, corners), axis=1)
    until = np.cumsum(lengths) / step
    begin = np.append(0.0, until[:-1])
    # one in the middle of every step along all edges end to end: short ones have some together
    first = np.ceil(begin - 0.5).astype(np.int64)
    counts = np.maximum(np.ceil(until - 0.5).astype(np.int64) - first, 0)
    edges = np.repeat(np.arange(len(triangles)), counts)
    steps = np.arange(len(edges)) - np.repeat(np.cumsum(counts) - counts, counts) + first[edges] + 0.5
    share = (steps - begin[edges]) / np.maximum(until - begin, 1e-300)[edges]
    weights = np.zeros((len(edges), 3))
    points = np.arange(len(edges))
    weights[points, corners[edges]], weights[points, ends[edges]] = 1 - share, share
    triangles = triangles[edges]
    at_corners = _corners(scene, triangles)
    along = at_corners[points, ends[edges]] - at_corners[points, corners[edges]]
    length = np.linalg.norm(along, axis=1)
    texel = length / np.maximum(lengths, 1e-300)[edges]
    outwards = np.cross(along / np.maximum(length, 1e-300)[:, None], _flat_normals(scene, triangles))
    return triangles, weights, texel[:, None] * outwards


def _other_sides(scene, kernel, uvs, triangles, weights, outwards):
    """What lies beyond the points (N,): triangles (M,), barycentrics (M, 3), and of which points (M,)."""
    normals = _flat_normals(scene, triangles)
    texel = np.linalg.norm(outwards, axis=1, keepdims=True)
    points = np.einsum("nk,nkc->nc", weights, _corners(scene, triangles))
    above = points + LIFT * texel * normals
    there = above + BEYOND * outwards
    others, hits = kernel.closest_hits(there, -normals)
    found = others >= 0
    found &= np.isfinite(uvs).all(axis=(1, 2))[others] & (others != triangles)
    found = np.flatnonzero(found & (hits[:, 2] < DEPTH * texel[:, 0]))
    height = points[found] - _corners(scene, others[found])[:, 0]
    height = np.einsum("nc,nc->n", height, _flat_normals(scene, others[found]))
    found = found[np.abs(height) < LEVEL * texel[found, 0]]
    # what lies on this side of the edge, too, is another layer and not what goes on
    inside = _weights_at(_corners(scene, others[found]), (points - BEYOND * outwards)[found])
    found = found[inside.min(axis=1) < 0]
    # a wall as thin as nothing
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


def _corners(scene, triangles):
    return scene.vertices[scene.triangles[triangles]]  # scene.corners are those of all


def _flat_normals(scene, triangles):
    return unit_normals(_corners(scene, triangles))


def _ahead(uvs, triangles, corners):
    """From corners to the next of their triangles (E, 2) [texels]."""
    return uvs[triangles, (corners + 1) % 3].astype(np.float64) - uvs[triangles, corners]


def _places(uvs, triangles, weights):
    return np.einsum("nk,nkc->nc", weights, uvs[triangles].astype(np.float64))
