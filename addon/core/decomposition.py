"""Adaptive decomposition: cells are cut into more patches where the light changes over them, as far as patches go.

After Cohen, Greenberg, Immel & Brock 1986, "An efficient radiosity approach for realistic image synthesis": a first
solution on few patches says where they are too large. It pays where each patch costs a row of form factors.
"""

from __future__ import annotations

import numpy as np

from .patches import Grid, Patches

UNEVEN = 0.03  # of the light there and the typical: what changes less over a patch is left as it is
MOST_ALONG = 8  # patches along a side of a cell


def finer(grid: Grid, along, patches: Patches, irradiance, spread, most: int):
    """Patches along each side of every cell, int64 (C,), with twice as many where that tells most apart.

    Parameters
    ----------
    along : int64 (C,) those that there are
    irradiance : (2 P,) luminance of the light on each side
    spread : (2 P,) of the direct light within a side, as measured
    most : patches that there may be in all
    """
    change = np.maximum(_change_to_neighbours(grid, along, patches, irradiance), 0.5 * spread)
    typical = np.median(irradiance[irradiance > 0]) if (irradiance > 0).any() else 1.0
    is_uneven = change > UNEVEN * (irradiance + typical)
    # the flux that leaves from the wrong place
    misplaced = np.where(is_uneven, change, 0.0) * patches.side_areas * patches.side_reflectance.mean(axis=1)
    gain = np.bincount(np.repeat(patches.cells, 2), misplaced, len(grid))
    cost = 3 * along**2
    order = np.argsort(-gain / cost, kind="stable")
    order = order[(gain[order] > 0) & (along[order] < MOST_ALONG)]
    chosen = order[np.cumsum(cost[order]) <= most - len(patches)]
    doubled = along.copy()
    doubled[chosen] *= 2
    return doubled


def _change_to_neighbours(grid, along, patches, irradiance):
    """Half of the largest difference (2 P,) to what lies beside each on its triangle: from its middle to its border."""
    wide, narrow, first, second = patches.bounds.T.astype(np.float64)
    down, across = 1 - (wide + narrow) / 2, (first + second) / 2
    change, sides = np.zeros((len(patches), 2)), irradiance.reshape(-1, 2)
    for rows, columns in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        there = down + rows * (wide - narrow), across + columns * (second - first)
        beside = np.flatnonzero((np.minimum(*there) > 0) & (np.maximum(*there) < 1))
        other = patches_at(grid, along, patches.triangles[beside], there[0][beside], there[1][beside])
        change[beside] = np.maximum(change[beside], np.abs(sides[beside] - sides[other]) / 2)
    return change.ravel()


def patches_at(grid: Grid, along, triangles, down, across):
    """Patches (K,) of triangles (K,) at ``down`` from the edge opposite to the apex, ``across`` along it, in 0 .. 1."""
    first_rows, first_cells = grid.first_rows.astype(np.int64), grid.first_cells.astype(np.int64)
    rows = first_rows[triangles + 1] - first_rows[triangles]
    row, i = _part(down, rows)
    row += first_rows[triangles]
    column, j = _part(across, first_cells[row + 1] - first_cells[row])
    cells = first_cells[row] + column
    first_pieces = np.concatenate([[0], np.cumsum(along**2)])
    parts = along[cells]
    return first_pieces[cells] + _part(i, parts)[0] * parts + _part(j, parts)[0]


def _part(share, parts):
    """Which of so many equal parts, and where in it."""
    part = np.minimum((share * parts).astype(np.int64), parts - 1)
    return part, share * parts - part
