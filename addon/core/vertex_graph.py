"""The values that vertex colours are, their neighbours over the mesh, and smoothing over these.

What lightmaps have in their texels (smoothing.TexelGrid), vertices have in the edges of their faces: neighbours see
nearly the same light, so a few rays of each serve all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .gather_sums import LARGEST_VARIANCE
from .kernel import smooth_graph
from .receivers import Receivers
from .workers import Workers

ROUNDS = 2  # of smoothing: a third takes no more off than it washes out
COMMON = 1.5  # times what it is after each round: neighbours' means share what they are made of
BESIDE = 2 / 3  # what a neighbour counts in a mean: as in a lightmap, a texel away
LEAST_SHOWN, MOST_SHOWN = 1 / 4, 2.0  # times the mean surface, between which a value counts by its own: what few large
# faces come to would hang on the few probes there, and details are looked at closely
LEAST_COSINE = 0.9  # of two values' normals, to be of one surface


@dataclass(frozen=True, slots=True)
class VertexGraph:
    """How receivers inside the faces come together in the values that corners share, and which values are neighbours.

    Attributes
    ----------
    triangles : int32 (K,) triangles with corners to colour; receiver 3 k + c stands near corner c of triangles[k]
    owners : int64 (N,) the value that each receiver is part of, N = 3 K
    shares : float64 (N,) of each in its value; those of a value sum to 1
    first_edges, neighbours, nearness : the V values' edges, as of the kernel's pl_vertex_graph
    shown : float32 (N,) how much of the surface shows each value, shared by its receivers, relative to the mean
    """

    is_image: ClassVar[bool] = False
    triangles: np.ndarray
    owners: np.ndarray
    shares: np.ndarray
    first_edges: np.ndarray
    neighbours: np.ndarray
    nearness: np.ndarray
    shown: np.ndarray

    @property
    def value_count(self) -> int:
        """How many values are stored, V."""
        return len(self.first_edges) - 1

    def arrays(self) -> tuple:
        """In the kernel's order."""
        return self.first_edges, self.neighbours, self.nearness

    def corner_values(self, receiver_values):
        """Values per receiver (N, C) -> per corner (K, 3, C)."""
        return self.stored(receiver_values).reshape(len(self.triangles), 3, -1)

    def stored(self, receiver_values):
        """Values per receiver (N, C), each replaced by that of the value it is part of."""
        return self._means(receiver_values)[self.owners]

    def stitched(self, values, poll=None):
        """Irradiance (N, 3) as it is shown: corners of faces that go on have one value as it is."""
        return values

    def members(self, chosen):
        """Receivers of chosen values (M,), where each value's start among them (K,), and their shares in it (M,)."""
        members = np.flatnonzero(np.isin(self.owners, chosen))
        members = members[np.argsort(self.owners[members], kind="stable")]
        starts = np.flatnonzero(np.diff(self.owners[members], prepend=-1))
        return members, starts, self.shares[members]

    def pooled(self, workers: Workers, receivers: Receivers, of_one_ray):
        """Relative variances (N,) of one ray -> those of the values if each receiver has one, of neighbours' mean.

        Over neighbours' neighbours, too: who is next to a penumbra has all or nothing of a lamp by chance.
        """
        return self._pooled(workers, self._variances(of_one_ray), 2)[self.owners]

    def blurred(self, workers: Workers, receivers: Receivers, values):
        """Gathered light float32 (N, 3), averaged over values and their neighbours: float32 (N, 3)."""
        means, nothing = self._means(values), np.zeros(self.value_count, np.float32)
        return smooth_graph(workers, self, means, nothing, False)[0][self.owners]

    def smoothed(self, workers: Workers, receivers: Receivers, values, variances, scales, taken):
        """Gathered light (N, 3) smoothed by its variances (N,): values float32 (N, 3), variance of luminance (N,).

        ``scales`` (N,) are those of the light ``blurred``, ``taken`` (N,) how many rays each is of.
        """
        scales = np.square(self._means(scales[:, None])[:, 0], dtype=np.float64)
        taken = self._means(taken[:, None])[:, 0]
        # pooled relative to the light there, as the noise of what is bright says nothing of the calm beside it
        relative = self._pooled(workers, self._variances(variances) / scales * taken, 1) / taken
        means, left = self._means(values), np.minimum(relative * scales, LARGEST_VARIANCE).astype(np.float32)
        for _ in range(ROUNDS):
            means, left = smooth_graph(workers, self, means, left, True)
            left *= np.float32(COMMON)
        return means[self.owners], left[self.owners]

    def _means(self, values):
        """Values per receiver (N, C) -> of the V values, float32 (V, C)."""
        means = [np.bincount(self.owners, self.shares * channel, self.value_count) for channel in values.T]
        return np.stack(means, axis=1).astype(np.float32)

    def _variances(self, variances):
        """Of independent receivers (N,) -> of their means (V,)."""
        return np.bincount(self.owners, self.shares**2 * variances, self.value_count)

    def _pooled(self, workers, variances, rounds):
        """Variances of means (V,), averaged over neighbours as those of one receiver are, so many rounds."""
        alone = self._variances(np.ones(len(self.owners)))
        pooled = np.minimum(variances / alone, LARGEST_VARIANCE).astype(np.float32)
        for _ in range(rounds):
            in_channels = np.repeat(pooled[:, None], 3, axis=1)
            pooled = smooth_graph(workers, self, in_channels, pooled, False)[0][:, 0].copy()
        return pooled * alone


def vertex_graph(triangles, owners, weights, areas, receivers: Receivers, pairs) -> VertexGraph:
    """The graph of triangles' corners.

    Parameters
    ----------
    triangles : int32 (K,)
    owners : int64 (3 K,) which value each corner takes, from 0 on
    weights : (3 K,) of each corner in its value
    areas : (3 K,) of the corners' triangles
    receivers : (3 K,) beside the corners
    pairs : int64 (M, 2) corners that are neighbours
    """
    count = int(owners.max(initial=-1)) + 1
    shares = weights / np.bincount(owners, weights, count)[owners]
    first_edges, neighbours, nearness = _edges(owners, shares, receivers, pairs, count)
    surface = np.bincount(owners, areas, count)
    shown = np.clip(surface / max(surface.sum() / max(count, 1), 1e-300), LEAST_SHOWN, MOST_SHOWN)
    shown = (shown / np.bincount(owners, minlength=count))[owners]
    shown *= len(owners) / max(shown.sum(), 1e-300)
    return VertexGraph(triangles, owners, shares, first_edges, neighbours, nearness, shown.astype(np.float32))


def _edges(owners, shares, receivers: Receivers, pairs, count):
    """Runs of each value's edges, int32 (V + 1,), where they lead, int32 (E,), and what that counts, float32 (E,)."""
    pairs = owners[pairs]
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    low, high = np.divmod(np.unique(pairs.min(axis=1) * count + pairs.max(axis=1)), max(count, 1))
    here, there = np.concatenate([low, high]), np.concatenate([high, low])
    order = np.argsort(here, kind="stable")
    here, there = here[order], there[order]

    def mean(arrays):
        return np.stack([np.bincount(owners, shares * axis, count) for axis in arrays.T], axis=1)

    positions, normals = mean(receivers.positions), mean(receivers.normals)
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    apart = positions[there] - positions[here]
    squared = np.einsum("nc,nc->n", apart, apart)
    weights = _of_one_surface(apart, squared, normals[here], normals[there])
    used = np.flatnonzero(weights > 0)
    here, there, squared, weights = here[used], there[used], squared[used], weights[used]
    usual = np.bincount(here, np.sqrt(squared), count) / np.maximum(np.bincount(here, minlength=count), 1)
    # what is far is less alike
    weights *= BESIDE * np.minimum(usual[here] ** 2 / np.maximum(squared, 1e-300), 1.0)
    first_edges = np.searchsorted(here, np.arange(count + 1)).astype(np.int32)
    return first_edges, there.astype(np.int32), weights.astype(np.float32)


def _of_one_surface(apart, squared, normals, other_normals):
    """How far neighbours ``apart`` (E, 3) are samples of one smooth surface, (E,): 0 across creases and steps."""
    cosines = np.einsum("nc,nc->n", normals, other_normals)
    heights = np.einsum("nc,nc->n", apart, normals) ** 2 / np.maximum(squared, 1e-300)
    return np.where(cosines >= LEAST_COSINE, cosines**8 * np.maximum(1 - heights, 0.0) ** 8, 0.0)
