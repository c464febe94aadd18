"""Where the part of a polygon that others hide is not smooth, as the point that looks at it moves over another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .polygon import extent, unit_normal


@dataclass(frozen=True, slots=True)
class Kinks:
    """Segments in the plane of the positions across which the hidden factor is not smooth.

    Attributes
    ----------
    origins, normals : float64 (M, 3) the planes that cut the positions' plane along them
    along : float64 (M, 3) their directions, unit
    low, high : float64 (M,) where they start and stop, as points . along; infinite where they do not
    """

    origins: np.ndarray
    normals: np.ndarray
    along: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def __len__(self) -> int:
        return len(self.origins)

    def evenness(self, cell):
        """How evenly each divides a cell (K, 3): the smaller of two heights over their sum, 0 where it misses it."""
        heights = ((cell[None] - self.origins[:, None]) * self.normals[:, None]).sum(axis=2)
        after = np.roll(heights, -1, axis=1)
        crosses = heights * after < 0
        share = heights / np.where(crosses, heights - after, 1.0)
        positions = cell @ self.along.T
        crossings = positions.T + share * (np.roll(positions, -1, axis=0) - positions).T
        low = np.where(crosses, crossings, np.inf).min(axis=1)
        high = np.where(crosses, crossings, -np.inf).max(axis=1)
        size = extent(cell)
        meets = np.minimum(high, self.high) - np.maximum(low, self.low) > 1e-9 * size
        top, bottom = heights.max(axis=1), -heights.min(axis=1)
        return np.where(meets, np.minimum(top, bottom) / np.maximum(top + bottom, 1e-300), 0.0)


def kinks_of(first, second, occluders) -> Kinks:
    """Where lines through a corner of an occluder and an edge of the target, or the other way round, meet ``first``.

    And where the plane of an occluder does: there it is seen edge-on, and what is seen beside it changes.
    """
    normal, columns = unit_normal(first), []
    for occluder in occluders:
        for corners, edges in ((occluder, second), (second, occluder)):
            corner, edge = (grid.ravel() for grid in np.meshgrid(np.arange(len(corners)), np.arange(len(edges))))
            at, start, stop = corners[corner], edges[edge], edges[(edge + 1) % len(edges)]
            is_target_edge = edges is second
            ends = [_projected(at, end, first[0], normal, is_target_edge) for end in (start, stop)]
            columns.append((start, np.cross(stop - start, at - start), *ends[0], *ends[1]))
        nowhere = np.full((1, 3), np.nan)
        columns.append(
            (occluder[:1], unit_normal(occluder)[None], nowhere, np.array([True]), nowhere, np.array([False]))
        )
    start, across, p, is_p, q, is_q = (np.concatenate(part) for part in zip(*columns))
    along = np.cross(across, normal)
    lengths, widths = np.linalg.norm(along, axis=1), np.linalg.norm(across, axis=1)
    kept = (lengths > 1e-12 * widths) & (widths > 0) & (is_p | is_q)
    start, across, along = start[kept], across[kept] / widths[kept, None], along[kept] / lengths[kept, None]
    a, b = (np.where(ok[kept], (point[kept] * along).sum(axis=1), np.nan) for point, ok in ((p, is_p), (q, is_q)))
    is_whole = is_p[kept] & is_q[kept]
    low, high = np.where(is_whole, np.minimum(a, b), -np.inf), np.where(is_whole, np.maximum(a, b), np.inf)
    kinks = Kinks(start, across, along, low, high)
    used = np.flatnonzero(kinks.evenness(first) > 1e-9)
    return Kinks(*(getattr(kinks, name)[used] for name in Kinks.__slots__))


def _projected(corners, ends, origin, normal, is_target_edge):
    """Where lines from the target through the occluder meet the plane of the positions: points, and whether they do.

    ``corners`` are the occluder's and ``ends`` the target's where ``is_target_edge``, else the other way round.
    """
    near, far = (corners, ends) if is_target_edge else (ends, corners)
    height_near, height_far = (near - origin) @ normal, (far - origin) @ normal
    meets = height_far > height_near
    fall = np.where(meets, height_far - height_near, 1.0)
    return far + (near - far) * (height_far / fall)[:, None], meets
