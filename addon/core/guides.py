"""Guides: where light comes from, learned for groups of neighbouring receivers, so that their rays go there.

An interior is lit through a window, by a sunlit floor, from under a shade: most plain cosine rays find little, and what
few find much is the noise. Neighbours see nearly the same, so a few of them look for all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .kernel import GUIDE_CELLS, KernelScene
from .receivers import Receivers
from .seen_light import SeenLight
from .z_order import z_order

GROUPS = 1024  # of receivers that share a guide, about; each with as many as
LEAST_GROUP, MOST_GROUP = 256, 1024  # at the least, and at the most: of a fine lightmap more are near each other
LEARNERS = 32  # of a group, that look for all
LEARNING_RAYS = 32  # of each
EVEN = 0.25  # of the rays go everywhere alike: what the learners missed keeps a bounded weight
WIDEST = 1 / 8  # of the scene: groups that reach further have no view in common
NORMAL_CELLS = 3  # each axis of a normal is cut into so many: receivers that look elsewhere are no neighbours


@dataclass(frozen=True, slots=True)
class Guides:
    """How often rays leave through each cell of the square that they are drawn from.

    Attributes
    ----------
    groups : int32 (N,) the receivers' groups, -1 = plain cosine rays
    shares : float32 (G, GUIDE_CELLS) above 0, sum 1
    """

    groups: np.ndarray
    shares: np.ndarray

    def arrays(self) -> tuple:
        """In the kernel's order."""
        return self.groups, self.shares

    def part(self, chosen) -> Guides:
        """The same for some of the receivers."""
        return Guides(self.groups[chosen], self.shares)


def no_guides(count: int) -> Guides:
    """Plain cosine rays for ``count`` receivers."""
    return Guides(np.full(count, -1, np.int32), np.zeros((0, GUIDE_CELLS), np.float32))


def learn_guides(kernel: KernelScene, light: SeenLight, receivers: Receivers, seed: int) -> tuple[Guides, int]:
    """Guides for receivers, and the rays that it took to learn them."""
    if not len(receivers):
        return no_guides(0), 0
    order, starts, ends = _neighbours(receivers)
    groups = np.full(len(receivers), -1, np.int32)
    groups[order[_runs(starts, ends)]] = np.repeat(np.arange(len(starts), dtype=np.int32), ends - starts)
    members, first_members = _learners(order, starts, ends)
    moments, rays = kernel.learn_guides(light, receivers, members, first_members, LEARNING_RAYS, seed)
    return Guides(groups, guide_shares(moments)), rays


def guide_shares(moments):
    """The density that makes the variance least is the root of the mean square [Kahn & Marshall 1953]."""
    # squares of what is as bright as may be leave float32
    roots = np.sqrt(np.minimum(moments, np.finfo(np.float32).max).astype(np.float64))
    total = roots.sum(axis=1, keepdims=True)
    found = np.where(total > 0, roots / np.maximum(total, 1e-300), 1 / GUIDE_CELLS)
    return ((1 - EVEN) * found + EVEN / GUIDE_CELLS).astype(np.float32)


def _neighbours(receivers):
    """Receivers in an order in which neighbours are near, and where each group starts and ends in it, (G,)."""
    # axis by axis, as three at once would take more memory than the receivers do
    extent = max(float(np.ptp(receivers.positions, axis=0).max()), 1e-30)
    cells = [np.clip((axis - axis.min()) / extent * 1023, 0, 1023).astype(np.uint16) for axis in receivers.positions.T]
    way = np.zeros(len(receivers), np.uint64)
    for axis in receivers.normals.T:
        facing = np.clip((axis + 1) * (0.5 * NORMAL_CELLS), 0, NORMAL_CELLS - 1)
        way = way * np.uint64(NORMAL_CELLS) + facing.astype(np.uint64)
    order = np.argsort(way << np.uint64(30) | z_order(*cells), kind="stable")
    # a group ends where its receivers look elsewhere, or when it is full
    turns = np.flatnonzero(np.diff(way[order], prepend=way[order][:1] + np.uint64(1)))
    cuts = [np.arange(turn, end, group_size(len(order))) for turn, end in zip(turns, np.append(turns[1:], len(order)))]
    starts = np.concatenate(cuts)
    ends = np.append(starts[1:], len(order))
    is_narrow = np.ones(len(starts), bool)
    for axis in receivers.positions.T:
        ordered = axis[order]
        is_narrow &= np.maximum.reduceat(ordered, starts) - np.minimum.reduceat(ordered, starts) <= WIDEST * extent
    return order, starts[is_narrow], ends[is_narrow]


def group_size(count: int) -> int:
    """How many of so many receivers share a guide, at the most."""
    return min(max(count // GROUPS, LEAST_GROUP), MOST_GROUP)


def _runs(starts, ends):
    """All places of the runs from starts to ends, one after the other."""
    counts = ends - starts
    before = np.cumsum(counts) - counts
    return np.arange(counts.sum()) + np.repeat(starts - before, counts)


def _learners(order, starts, ends):
    """Some receivers of each group, evenly through it: their indices, and where each group's start."""
    sizes = ends - starts
    counts = np.minimum(sizes, LEARNERS)
    first_members = np.append(0, np.cumsum(counts))
    group = np.repeat(np.arange(len(sizes)), counts)
    place = np.arange(first_members[-1]) - first_members[group]
    members = order[starts[group] + place * sizes[group] // np.maximum(counts[group], 1)]
    return members.astype(np.uint32), first_members.astype(np.uint32)
