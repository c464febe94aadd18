"""What guides are made from, by the definition: cosine rays through the cells of the unit square, float64."""

import numpy as np

SIDE = 8


def basis(normal):
    """Two unit vectors that complete a unit normal (Duff et al. 2017, listing 3)."""
    x, y, z = normal
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array([1 + sign * x * x * a, sign * b, -sign * x]), np.array([b, sign + y * y * a, -y])


def cell_directions(normal, cell, count, rng):
    """Cosine directions (count, 3) through one cell: x is the squared sine from the normal, y the turn about it."""
    u, v = basis(normal)
    row, column = divmod(cell, SIDE)
    x, y = (row + rng.random(count)) / SIDE, (column + rng.random(count)) / SIDE
    radius, angle = np.sqrt(x), 2 * np.pi * y
    across = radius[:, None] * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v)
    return across + np.sqrt(1 - x)[:, None] * np.asarray(normal)


def share_through_rectangle(point, directions, low, high, height):
    """Share of directions from a point that leave through the rectangle low..high (x, y) at z = height."""
    upward = directions[:, 2] > 0
    reach = (height - point[2]) / np.where(upward, directions[:, 2], 1.0)
    at = point[:2] + reach[:, None] * directions[:, :2]
    return float((upward & (at > low).all(axis=1) & (at < high).all(axis=1)).mean())
