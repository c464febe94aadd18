"""The light of a unit cube whose floor glows, of the continuum: piecewise constant on a fine grid, then gathered.

All form factors are closed forms. By symmetry there are three grids of unknowns: the floor, the ceiling, and one wall.
"""

from __future__ import annotations

import functools

import numpy as np

from .case_scene import box
from .closed_forms import parallel_rectangles, perpendicular_rectangles
from .lambert import element_factors

CELLS = 16  # along an edge; with a final gather from them irradiance is right to 0.1 %
SETTLED = 1e-10  # change of an iteration at which the grids are done [W/m^2]


def cube_irradiance(points, faces, rho: float):
    """Irradiance (N,) [W/m^2] at points (N, 3) on faces (N,) (in case_scene.box's order), the floor emitting 1 W/m^2.

    Accuracy 1e-3, relative: that of the grid, whose light is gathered exactly.
    """
    cells, radiosity, owners = _lit_cells(rho)
    out, surfaces = np.zeros(len(points)), box((0, 0, 0), (1, 1, 1))
    for face, surface in enumerate(surfaces):
        here = np.flatnonzero(faces == face)
        a, b, c = surface.pieces[0][:3]
        normal = np.cross(b - a, c - a)
        for k in np.flatnonzero(owners != face):
            out[here] += radiosity[k] * element_factors(points[here], normal, cells[k])
    return out


@functools.lru_cache(maxsize=2)
def _lit_cells(rho):
    """Corners of all cells (6 n^2, 4, 3), their radiosities, and which face each is of."""
    floor, ceiling, wall = _grids(CELLS, rho)
    cells, values = [], []
    steps = np.arange(CELLS)
    for face, surface in enumerate(box((0, 0, 0), (1, 1, 1))):
        a, b, _, d = surface.pieces[0]
        u, v = (b - a) / CELLS, (d - a) / CELLS
        i, j = (x.ravel() for x in np.meshgrid(steps, steps, indexing="ij"))
        corners = a + i[:, None] * u + j[:, None] * v
        cells.append(corners[:, None] + np.stack([0 * u, u, u + v, v]))
        # a wall's light depends on height and on the distance from its middle, which is the same from either edge
        height = i if u[2] else j
        along = j if u[2] else i
        values.append((floor, ceiling)[face][i, j] if face < 2 else wall[along, height])
    return np.concatenate(cells), np.concatenate(values), np.repeat(np.arange(6), CELLS**2)


def _grids(count, rho):
    """Radiosity of floor [x, y], ceiling [x, y] and a wall [along, height], float64 (n, n) each."""
    across = _parallel_table(count)
    beside = _perpendicular_table(count)

    def from_walls(wall):
        """Irradiance of the floor, from all four walls."""
        one = np.einsum("ikjm,mk->ij", beside, wall)
        two = one + one[::-1]
        return two + two.T

    def irradiance(floor, ceiling, wall):
        walls = np.einsum("ikjm,ij->mk", beside, floor) + np.einsum("ikjm,ij->mk", beside, ceiling)[:, ::-1]
        corner = np.einsum("mnkl,nl->mk", beside, wall)
        walls = walls + np.einsum("ijkl,kl->ij", across, wall) + corner + corner[::-1]
        return (
            np.einsum("ijkl,kl->ij", across, ceiling) + from_walls(wall),
            np.einsum("ijkl,kl->ij", across, floor) + from_walls(wall[:, ::-1]),
            walls,
        )

    grids, change = (np.ones((count, count)), *np.zeros((2, count, count))), 1.0
    while change > SETTLED:
        arriving = irradiance(*grids)
        after = tuple(float(k == 0) + rho * light for k, light in enumerate(arriving))
        change = max(np.abs(a - b).max() for a, b in zip(after, grids))
        grids = after
    return grids


def _parallel_table(count):
    """F from cell [i, j] to cell [k, l] of the opposite face, float64 (n, n, n, n)."""
    offset = np.arange(count)
    x, y = np.meshgrid(offset, offset, indexing="ij")
    one = (0.0, 1.0)
    table = parallel_rectangles(one, one, (x, x + 1.0), (y, y + 1.0), float(count))
    apart = np.abs(offset[:, None] - offset)
    return table[apart[:, None, :, None], apart[None, :, None, :]]


def _perpendicular_table(count):
    """F from a cell i from the common edge, j along it, to one k from it, m along it: float64 [i, k, j, m]."""
    steps = np.arange(count)
    i, k, apart = np.meshgrid(steps, steps, steps, indexing="ij")
    table = perpendicular_rectangles((i, i + 1.0), (0.0, 1.0), (k, k + 1.0), (apart, apart + 1.0))
    return table[:, :, np.abs(steps[:, None] - steps)]
