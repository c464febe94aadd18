"""What a case's names mean: its surfaces, or bodies that its params describe, and which of them a word names."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass

import numpy as np

from .analytic import Surface, cut_overlaps, surface
from .bodies import Body, cylinder, disk, equal_area_radius, sphere
from .cases import NUMBER, Case, CaseError

DISK_SIDES = 128
CYLINDER_RINGS = 4
SPHERE_RINGS, SPHERE_SIDES = 16, 32
BOX_ORDER = ("zmin", "zmax", "ymin", "ymax", "xmin", "xmax")


@dataclass(frozen=True, slots=True)
class CaseScene:
    """A case's polygons, cleaned.

    Attributes
    ----------
    surfaces : what the quantity may name, in the file's order; of coplanar ones the first keeps what they share
    blockers : what only blocks
    dropped : one sentence for each polygon without an area
    """

    surfaces: dict[str, Surface]
    blockers: tuple[Surface, ...]
    dropped: tuple[str, ...]

    def named(self, name: str) -> Surface:
        """The surface of this name; raises CaseError."""
        if name not in self.surfaces:
            raise CaseError(f"no surface is called {name!r}")
        return self.surfaces[name]

    def others(self, *used: Surface) -> list[Surface]:
        """All surfaces and blockers but these."""
        rest = [s for s in self.surfaces.values() if not any(s is one for one in used)]
        return [*rest, *self.blockers]


def case_scene(case: Case) -> CaseScene:
    """The polygons of a case; those without an area are dropped and reported, and change nothing else."""
    dropped: list[str] = []
    surfaces = _cleaned(case.surfaces, dropped)
    blockers = _cleaned(case.occluders, dropped)
    kept = cut_overlaps(list(surfaces.values()))
    return CaseScene(dict(zip(surfaces, kept)), tuple(blockers.values()), tuple(dropped))


def _cleaned(polygons, dropped):
    kept = {}
    for name, corners in polygons.items():
        try:
            kept[name] = surface(name, corners)
        except ValueError as error:
            dropped.append(str(error))
    return kept


# ---- closed rooms ----


def box(low, high, names=BOX_ORDER, looks_in: bool = True) -> list[Surface]:
    """Six rectangles of a box from corner to corner [m], in the order zmin, zmax, ymin, ymax, xmin, xmax."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    faces = [
        [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)],
        [(x0, y0, z1), (x0, y1, z1), (x1, y1, z1), (x1, y0, z1)],
        [(x0, y0, z0), (x0, y0, z1), (x1, y0, z1), (x1, y0, z0)],
        [(x0, y1, z0), (x1, y1, z0), (x1, y1, z1), (x0, y1, z1)],
        [(x0, y0, z0), (x0, y1, z0), (x0, y1, z1), (x0, y0, z1)],
        [(x1, y0, z0), (x1, y0, z1), (x1, y1, z1), (x1, y1, z0)],
    ]
    return [surface(name, face if looks_in else face[::-1]) for name, face in zip(names, faces)]


def l_room() -> list[Surface]:
    """A closed room with an L-shaped floor: floor, ceiling, six walls."""
    plan = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    floor = [(x, y, 0.0) for x, y in plan]
    walls = [[(*a, 0), (*a, 1), (*b, 1), (*b, 0)] for a, b in zip(plan, plan[1:] + plan[:1])]
    named = [surface(f"wall{k}", wall) for k, wall in enumerate(walls)]
    return [surface("floor", floor), surface("ceiling", [(x, y, 1.0) for x, y, _ in floor[::-1]]), *named]


def tetrahedron() -> list[Surface]:
    """A regular tetrahedron, seen from inside."""
    corners = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], float)
    faces = [np.delete(corners, k, axis=0) for k in range(4)]
    faces = [f if np.cross(f[1] - f[0], f[2] - f[0]) @ f[0] < 0 else f[::-1] for f in faces]
    return [surface(f"f{k}", face) for k, face in enumerate(faces)]


def room_named(words: str) -> list[Surface] | None:
    """The box that words such as "cube_6x6" or "room_4x3x2.5_6x6" name; None where they name none."""
    found = re.search(rf"({NUMBER})x({NUMBER})x({NUMBER})", words)
    if "room" in words and found:
        return box((0, 0, 0), [float(x) for x in found.groups()])
    return box((0, 0, 0), (1, 1, 1)) if "cube" in words else None


# ---- bodies of revolution ----


def coaxial_disks(r1: float, r2: float, h: float) -> list[Body]:
    """Disk 1 at z = 0 that looks up, disk 2 at z = h that looks down [m]."""
    first, second = (equal_area_radius(r, DISK_SIDES) for r in (r1, r2))
    return [disk("disk1", first, 0.0, DISK_SIDES, True), disk("disk2", second, h, DISK_SIDES, False)]


def cylinder_cavity(radius: float, height: float) -> list[Body]:
    """Bottom, side and top of a closed cylinder, seen from inside."""
    radius = equal_area_radius(radius, DISK_SIDES)
    return [
        disk("disk", radius, 0.0, DISK_SIDES, True),
        cylinder("side", radius, 0.0, height, DISK_SIDES, CYLINDER_RINGS),
        disk("disk top", radius, height, DISK_SIDES, False),
    ]


def hemisphere_cavity(radius: float) -> list[Body]:
    """Base disk and hemisphere above it, seen from inside."""
    angles = np.linspace(0, np.pi / 2, SPHERE_RINGS + 1)
    return [
        disk("base disk", radius, 0.0, 2 * SPHERE_SIDES, True),
        sphere("hemisphere", radius, angles, 2 * SPHERE_SIDES, looks_in=True),
    ]


def zone_angles(shares, rings: int = SPHERE_RINGS):
    """Polar angles of the borders between zones with these shares of a sphere's area, each cut into rings.

    Returns a list of float64 (n + 1,) [rad], one for each zone.
    """
    borders = np.arccos(np.clip(1 - 2 * np.concatenate([[0], np.cumsum(shares)]), -1, 1))
    count = [max(4, round(rings * (b - a) / np.pi)) for a, b in itertools.pairwise(borders)]
    return [np.linspace(a, b, n + 1) for a, b, n in zip(borders, borders[1:], count)]
