"""The cases that `patchlight verify` runs without a file: from closed forms and laws, each with its source."""

from __future__ import annotations

import numpy as np

from . import closed_forms as forms
from .cases import Case, parse_cases

UNIT = (0.0, 1.0)


def shipped_cases() -> list[Case]:
    """All of them, as they would be read from a file."""
    entries = [
        *_parallel(), *_perpendicular(), *_points(), *_curved(), *_matrices(), *_occluded(), *_hard(), *_robust(),
        *_solutions(),
    ]  # fmt: skip
    return parse_cases(entries, "the shipped set")


def _entry(name, quantity, value, source, tolerance_class, surfaces=None, occluders=None, params=None):
    geometry = {"surfaces": surfaces or {}, "occluders": occluders or {}}
    return {
        "id": name, "quantity": quantity, "value": value, "source": source, "tolerance_class": tolerance_class,
        "geometry": geometry, "params": params or {},
    }  # fmt: skip


# ---- rectangles ----


def _up(x, y, z):
    return [(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)]


def _down(x, y, z):
    return _up(x, y, z)[::-1]


def _facing_x(y, z, x):
    return [(x, y[0], z[0]), (x, y[1], z[0]), (x, y[1], z[1]), (x, y[0], z[1])]


def _pair(name, x, y, xi, eta, z, tolerance_class="FF-SMOOTH", source="Howell C-13"):
    surfaces = {"A": _up(x, y, 0.0), "B": _down(xi, eta, z)}
    value = forms.parallel_rectangles(x, y, xi, eta, z)
    return _entry(name, "F(A->B)", value, source, tolerance_class, surfaces)


def _corner_pair(name, x, y, xi, eta, tolerance_class):
    surfaces = {"A": _up(x, y, 0.0), "B": _facing_x(eta, xi, 0.0)}
    value = forms.perpendicular_rectangles(x, y, xi, eta)
    return _entry(name, "F(A->B)", value, "Howell C-15, C-14", tolerance_class, surfaces)


def _parallel():
    for width, depth, gap in ((1, 1, 1), (3, 2, 1), (1, 1, 0.4), (2, 5, 3), (10, 10, 1)):
        yield _pair(f"parallel_{width}x{depth}_at_{gap}", (0, width), (0, depth), (0, width), (0, depth), gap,
                    source="Howell C-11")  # fmt: skip
    yield _pair("parallel_shifted", (0, 1), (0, 2), (0.5, 2.5), (-1, 0.5), 1.5)


def _perpendicular():
    for width, height, length in ((1, 1, 1), (2, 1, 3), (0.5, 4, 1)):
        yield _corner_pair(f"perpendicular_{width}x{height}x{length}", (0, width), (0, length), (0, height),
                           (0, length), "FF-TOUCHING")  # fmt: skip
    yield _corner_pair("perpendicular_apart", (0.5, 2), (0, 1), (0.25, 1), (-1, 0.5), "FF-SMOOTH")


def _points():
    for a, b, c in ((1, 1, 1), (2, 0.5, 1), (10, 10, 1)):
        where = {"point": [0, 0, 0], "normal": [0, 0, 1]}
        yield _entry(f"element_under_corner_{a}x{b}_at_{c}", "F(dA->B)", forms.element_under_corner(a, b, c),
                     "Howell B-4", "POINT", {"B": _down((0, a), (0, b), c)}, params=where)  # fmt: skip
    half = {"edge": _up((-100, 0), (-100, 100), 1)}
    lamp = {"lamp": _down((-0.5, 0.5), (-0.5, 0.5), 2)}
    seen = 2 * forms.element_under_corner(0.5, 0.5, 2)
    yield _entry("penumbra_middle", "irradiance at floor points (x,0,0), lamp B=1", [0.0, seen],
                 "half the lamp is seen under its middle, nothing 1 m further; Howell B-4", "POINT", lamp, half,
                 {"x": [-1, 0]})  # fmt: skip


# ---- bodies ----


def _curved():
    for r1, r2, h in ((1, 1, 1), (0.5, 2, 1), (1, 1, 0.2)):
        yield _entry(f"disks_{r1}_{r2}_{h}", "F(disk1->disk2)", forms.coaxial_disks(r1, r2, h), "Howell C-41",
                     "FF-CURVED", params={"r1": r1, "r2": r2, "h": h})  # fmt: skip
    disk = forms.coaxial_disks(1, 1, 1.5)
    side = (1 - disk) / 3
    quantity, values = "F(disk->disk),F(disk->side),F(side->disk),F(side->side)", [disk, 1 - disk, side, 1 - 2 * side]
    yield _entry(
        "cylinder", quantity, values, "Howell C-41, closure, reciprocity", "FF-CURVED", params={"r": 1, "h": 1.5}
    )
    yield _entry("hemisphere", "F(base disk->hemisphere), F(hemi->base), F(hemi->hemi)", [1.0, 0.5, 0.5],
                 "closure, reciprocity", "FF-CURVED", params={"R": 1})  # fmt: skip
    yield _entry("sphere_inside", "F_ij = A_j/(4 pi R^2) for any two parts of a sphere", 1.0,
                 "cos cos / (pi r^2) = 1 / (4 pi R^2) for any two points", "FF-CURVED", params={"R": 1})  # fmt: skip


def _matrices():
    corners = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], float)
    faces = {}
    for k in range(4):
        face = np.delete(corners, k, axis=0)
        inward = np.cross(face[1] - face[0], face[2] - face[0]) @ face[0] < 0
        faces[f"f{k}"] = (face if inward else face[::-1]).tolist()
    yield _entry("tetrahedron", "F(face i->face j), i!=j", 1 / 3, "symmetry, closure", "FF-SMOOTH", faces)
    opposite = forms.parallel_rectangles(UNIT, UNIT, UNIT, UNIT, 1)
    matrix = np.full((6, 6), (1 - opposite) / 4)
    for k in range(6):
        matrix[k, k], matrix[k, k ^ 1] = 0, opposite
    yield _entry("cube", "F matrix, order zmin,zmax,ymin,ymax,xmin,xmax", matrix.tolist(), "Howell C-11, closure",
                 "FF-SMOOTH", _cube())  # fmt: skip


def _cube():
    return {
        "zmin": _up(UNIT, UNIT, 0), "zmax": _down(UNIT, UNIT, 1),
        "ymin": [(0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)], "ymax": [(0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1)],
        "xmin": _facing_x(UNIT, UNIT, 0), "xmax": _facing_x(UNIT, UNIT, 1)[::-1],
    }  # fmt: skip


# ---- partly hidden, hard, degenerate ----


def _occluded():
    plates = {"A": _up(UNIT, UNIT, 0), "B": _down(UNIT, UNIT, 1)}
    half = forms.parallel_rectangles((0, 0.5), UNIT, (0, 0.5), UNIT, 1)
    wall = {"wall": _facing_x(UNIT, UNIT, 0.5)}
    yield _entry("divider", "F(A->B)", half, "each half sees its own half: Howell C-11", "FF-OCCLUDED", plates, wall)
    clear = forms.parallel_rectangles(UNIT, UNIT, UNIT, UNIT, 1)
    yield _entry("half_hidden", "F(A->B)", clear / 2, "a half-plane half way up: by symmetry half of Howell C-11",
                 "FF-OCCLUDED", plates, {"O": _up((-50, 0.5), (-50, 50), 0.5)})  # fmt: skip
    yield _entry("all_hidden", "F(A->B)", 0.0, "a plate larger than both", "EXACT-ZERO", plates,
                 {"O": _up((-1, 2), (-1, 2), 0.5)})  # fmt: skip
    share = 1 / 4
    quantity = "F(outer face->inner cube all faces), F(inner face->outer all), F(outer face->outer rest)"
    yield _entry("nested_cubes", quantity, [share, 1.0, 1 - share], "convex body in a closed one, symmetry",
                 "FF-OCCLUDED", params={"L": 2, "s": 1})  # fmt: skip


def _hard():
    for gap in (1e-1, 1e-3, 1e-6):
        yield _pair(f"gap_{gap:g}", UNIT, UNIT, UNIT, UNIT, gap, "FF-NEAR", "Howell C-11")
        yield _pair(f"gap_shifted_{gap:g}", UNIT, UNIT, (0.5, 1.5), UNIT, gap, "FF-NEAR")
    yield _corner_pair("sliver", (0, 1e-4), UNIT, UNIT, UNIT, "FF-SLIVER")
    for offset in (1e3, 1e6):
        # 1/4 and 1/2 are exact in binary, so that moving them changes no shape
        x, y = (offset, offset + 0.25), (offset, offset + 0.5)
        surfaces = {"A": _up(x, y, offset), "B": _down(x, y, offset + 0.125)}
        value = forms.parallel_rectangles((0, 0.25), (0, 0.5), (0, 0.25), (0, 0.5), 0.125)
        yield _entry(f"offset_{offset:g}", "F(A->B)", value, "translation, Howell C-11", "FF-OFFSET", surfaces)
    lamp = {"lamp": _down((-5e-4, 5e-4), (-5e-4, 5e-4), 20.0), "floor": _up((-50, 50), (-50, 50), 0.0)}
    yield _entry("small_lamp", "F(lamp->floor)", 4 * forms.element_under_corner(50, 50, 20),
                 "Howell B-4; the lamp's size changes it by 1e-9", "FF-SCALE", lamp)  # fmt: skip


def _robust():
    clear = forms.parallel_rectangles(UNIT, UNIT, UNIT, UNIT, 1)
    below, above = _up(UNIT, UNIT, 0), _down(UNIT, UNIT, 1)
    yield _entry("duplicates", "F(A->B1)+F(A->B2)", clear, "Howell C-11", "INVARIANT",
                 {"A": below, "B1": above, "B2": above})  # fmt: skip
    bad = {"point": [(0.5, 0.5, 0.5)] * 3, "line": [(0, 0, 0.5), (0.5, 0, 0.5), (1, 0, 0.5)],
           "not finite": [(0, 0, 0.5), (None, 0, 0.5), (0, 1, 0.5)]}  # fmt: skip
    yield _entry("degenerate_blockers", "F(A->B)", clear, "faces without an area change nothing; Howell C-11",
                 "FF-SMOOTH", {"A": below, "B": above}, bad)  # fmt: skip
    yield _entry("no_reflectance", "B-E", 0.0, "rho = 0", "INVARIANT")


# ---- solutions ----


def _solutions():
    for rho in (0.5, 0.99):
        yield _entry(f"furnace_{rho}", "B everywhere", 1.0, "E = 1 - rho in a closed room", "SOLUTION",
                     params={"rho": rho, "E": 1 - rho})  # fmt: skip
    yield _entry("cube_mean", "B per face, order as cube", _lit_cube(0.8), "Howell C-11, symmetry", "SOLUTION",
                 params={"rho": [0.8] * 6, "E": [1, 0, 0, 0, 0, 0]})  # fmt: skip
    zones = [[0.1, 0.2, 1.0], [0.4, 0.6, 0.0], [0.5, 0.8, 0.5]]
    values = forms.integrating_sphere(*np.transpose(zones))
    yield _entry("sphere_zones", "irradiance H (uniform), then B per zone", values, "integrating sphere",
                 "SOLUTION-CURVED", params={"zones_areafraction_rho_E": zones})  # fmt: skip
    share = 0.25
    spheres = forms.two_surfaces(((0, 1), (share, 1 - share)), (0.5, 0.8), (1, 0))
    yield _entry("concentric_spheres", "B inner, B outer", spheres, "convex body in a closed one, r1=1, r2=2",
                 "SOLUTION-CURVED", params={"rho": [0.5, 0.8], "E": [1, 0]})  # fmt: skip
    f1, f2 = 1e-4, 1e-3
    port = forms.two_surfaces(((1 - f1, f1), (f2, 1 - f2)), (0.7, 0.6), (1, 0))
    yield _entry("two_spheres", "B1,B2,B2/B1", [*port, port[1] / port[0]], "a circular port shared by two spheres",
                 "SOLUTION-CURVED",
                 params={"f1": f1, "f2": f2, "rho1": 0.7, "rho2": 0.6, "E1": 1, "E2": 0})  # fmt: skip


def _lit_cube(rho):
    """Faces in three classes: lit, opposite, the four around; each class is one unknown."""
    a = forms.parallel_rectangles(UNIT, UNIT, UNIT, UNIT, 1)
    b = (1 - a) / 4
    system = np.eye(3) - rho * np.array([[0, a, 4 * b], [a, 0, 4 * b], [b, b, 2 * b + a]])
    lit, opposite, around = np.linalg.solve(system, [1.0, 0.0, 0.0])
    return [float(x) for x in (lit, opposite, *[around] * 4)]
