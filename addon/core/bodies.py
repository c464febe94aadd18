"""Bodies of revolution about the z axis as flat panels: disks, cylinders, spheres.

A ring is one panel and how many times it goes around; by symmetry one panel stands for its ring.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from .analytic import Surface, exchange, exchanges
from .polygon import distinct_corners, polygon_area

PANEL_ERROR = 1e-3  # relative, of factors of flat panels for curved bodies: it falls with the square of their size


@dataclass(frozen=True, slots=True)
class Ring:
    """Panels that go around the axis: float64 (N, K, 3) [m], each the first one turned; a corner may repeat."""

    panels: np.ndarray

    @property
    def area(self) -> float:
        """Area of all panels [m^2]."""
        return len(self.panels) * polygon_area(self.panels[0])


@dataclass(frozen=True, slots=True)
class Body:
    """Rings that act as one surface.

    Attributes
    ----------
    name : str
    rings : tuple of Ring
    """

    name: str
    rings: tuple[Ring, ...]

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return sum(ring.area for ring in self.rings)

    def surface(self) -> Surface:
        """The body as a surface of many pieces."""
        return Surface(self.name, tuple(distinct_corners(panel) for ring in self.rings for panel in ring.panels))


def equal_area_radius(radius: float, sides: int) -> float:
    """Radius of the corners of a regular polygon with the area of a disk of this radius [m]."""
    angle = 2 * np.pi / sides
    return radius * np.sqrt(angle / np.sin(angle))


def disk(name: str, radius: float, height: float, sides: int, looks_up: bool) -> Body:
    """A disk of corner radius ``radius`` at z = ``height`` [m], one polygon."""
    circle = _circle(radius, height, sides)
    return Body(name, (Ring((circle if looks_up else circle[::-1])[None]),))


def cylinder(name: str, radius: float, low: float, high: float, sides: int, rings: int, looks_in: bool = True) -> Body:
    """The side of a cylinder from z = ``low`` to ``high`` [m] in ``rings`` rings."""
    heights = np.linspace(low, high, rings + 1)
    return Body(name, tuple(_ring((radius, a), (radius, b), sides, looks_in) for a, b in itertools.pairwise(heights)))


def sphere(name: str, radius: float, polar_angles, sides: int, looks_in: bool, centre: float = 0.0) -> Body:
    """Part of a sphere about (0, 0, centre), in rings between polar angles (n + 1,) from +z, ascending [rad]."""
    rho = radius * np.sin(polar_angles)
    rho[np.abs(rho) < 1e-15 * radius] = 0.0
    z = centre + radius * np.cos(polar_angles)
    return Body(name, tuple(_ring(*ends, sides, looks_in) for ends in zip(zip(rho[1:], z[1:]), zip(rho, z))))


def _circle(radius, height, sides):
    angles = 2 * np.pi * np.arange(sides) / sides
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(sides, height)], axis=1)


def _ring(lower, upper, sides, looks_in):
    low, high = _circle(*lower, sides), _circle(*upper, sides)
    quads = np.stack([low, np.roll(low, -1, axis=0), np.roll(high, -1, axis=0), high], axis=1)
    return Ring(quads[:, ::-1] if looks_in else quads)


def ring_exchange(first: Ring, second: Ring) -> float:
    """A_1 F_12 [m^2] of two rings between which nothing stands."""
    if len(first.panels) > len(second.panels):
        first, second = second, first
    # of two rings that turn together one panel stands for all; a single polygon is turned into itself
    if len(first.panels) == 1 and len(second.panels) > 1:
        return len(second.panels) * exchange(first.panels[0], distinct_corners(second.panels[0]))
    return len(first.panels) * float(exchanges(first.panels[0], second.panels).sum())


def ring_exchanges(rings):
    """A_i F_ij of all pairs of rings, symmetric, float64 (N, N) [m^2]; nothing stands between any two."""
    out = np.zeros((len(rings), len(rings)))
    for i, ring in enumerate(rings):
        for j in range(i + 1):
            out[i, j] = out[j, i] = ring_exchange(ring, rings[j])
    return out


def body_exchanges(bodies):
    """A_i F_ij of all pairs of bodies, symmetric, float64 (N, N) [m^2]; nothing stands between any two panels."""
    rings = [ring for body in bodies for ring in body.rings]
    owner = np.repeat(np.arange(len(bodies)), [len(body.rings) for body in bodies])
    member = (owner[:, None] == np.arange(len(bodies))).astype(float)
    return member.T @ ring_exchanges(rings) @ member
