"""Cases whose quantity is made of form factors: ``F(A->B)``, sums and lists of such, matrices, points, bodies."""

from __future__ import annotations

import re

import numpy as np

from . import case_scene as scenes
from .analytic import Surface, exchanges
from .bodies import Body, sphere
from .cases import Case, CaseError
from .polygon import distinct_corners
from .transport import Estimate

FACTOR = re.compile(r"F\(([^()]*?)->([^()]*?)\)")
BY_NUMBERS = re.compile(r"\bF_?(\d)_?(\d)\b")
SPHERE_PARTS = 3
ALL_FACES = re.compile(r"\ball\b|\brest\b")


def factors_in(quantity: str) -> list[tuple[str, str]]:
    """The pairs of names that a quantity asks factors of; ``F12`` is ``F(1->2)``."""
    return FACTOR.findall(BY_NUMBERS.sub(r"F(\1->\2)", quantity))


def combine(parts, weights=None) -> Estimate:
    """Sum of estimates, errors of independent ones added in squares, bounds added."""
    weights = np.ones(len(parts)) if weights is None else np.asarray(weights)
    value = sum(w * p.value for w, p in zip(weights, parts))
    error = np.sqrt(sum((w * p.standard_error) ** 2 for w, p in zip(weights, parts)))
    return Estimate(value, error, sum(np.abs(w) * p.bound for w, p in zip(weights, parts)))


def listed(parts) -> Estimate:
    """Estimates as one, in order."""
    return Estimate(*(np.concatenate([np.ravel(getattr(p, key)) for p in parts]) for key in Estimate.__slots__))


def at(found: Estimate, index) -> Estimate:
    """Some entries of an estimate of an array."""
    return Estimate(*(np.asarray(getattr(found, key))[index] for key in Estimate.__slots__))


# ---- polygons ----


def element_case(case: Case, estimator) -> Estimate:
    """``F(dA->B)``: an element at params point, normal."""
    scene = scenes.case_scene(case)
    point, normal = case.numbers("point").astype(float), case.numbers("normal").astype(float)
    if point.shape != (3,) or normal.shape != (3,) or not np.linalg.norm(normal) > 0:
        raise CaseError("point and normal must be three numbers each")
    normal = normal / np.linalg.norm(normal)
    parts = []
    for _, name in factors_in(case.quantity):
        target = scene.named(name.strip())
        parts.append(estimator.element(point, normal, target, scene.others(target)))
    return _summed_or_listed(case.quantity, parts)


def irradiance_case(case: Case, estimator) -> Estimate:
    """Irradiance at points: a template such as (x,0,0) with x in params, or a list of points; normal +z by default."""
    scene = scenes.case_scene(case)
    normal = case.numbers("normal") if "normal" in case.params else np.array([0.0, 0.0, 1.0])
    lamps = list(scene.surfaces.values())
    radiosity = case.number("B", 1.0)
    parts = []
    for point in _points(case):
        seen = [estimator.element(point, normal, lamp, scene.others(lamp)) for lamp in lamps]
        parts.append(combine(seen, [radiosity] * len(seen)))
    return listed(parts)


def _points(case):
    if "points" in case.params and not isinstance(case.params["points"][0], str):
        return case.numbers("points").reshape(-1, 3)
    template = re.search(r"\(([^(),]+),([^(),]+),([^(),]+)\)", case.quantity)
    if not template:
        raise CaseError("no points are given")
    axes = []
    for word in (part.strip() for part in template.groups()):
        try:
            axes.append(np.array([float(word)]))
        except ValueError:
            axes.append(case.numbers(word))
    return np.stack(np.broadcast_arrays(*axes), axis=1)


def polygons_case(case: Case, estimator) -> Estimate:
    """``F(A->B)`` between named surfaces; joined by + a sum, by commas a list; all others block."""
    scene = scenes.case_scene(case)
    parts = []
    for first, second in factors_in(case.quantity):
        emitter, target = scene.named(first.strip()), scene.named(second.strip())
        parts.append(estimator.factor(emitter, target, scene.others(emitter, target)))
    return _summed_or_listed(case.quantity, parts)


def _summed_or_listed(quantity, parts):
    if re.search(r"\)\s*\+\s*F\(", quantity):
        return combine(parts)
    return listed(parts) if len(parts) > 1 else parts[0]


def is_matrix(case: Case) -> bool:
    """Whether a case asks for a whole matrix, or for all its entries off the diagonal."""
    return "F matrix" in case.quantity or "i!=j" in case.quantity.replace(" ", "")


def matrix_case(case: Case, estimator) -> Estimate:
    """``F matrix``, in the order that the quantity gives, else in that of the file."""
    scene = scenes.case_scene(case)
    ordered = re.search(r"order\s+([^;]*)", case.quantity)
    names = [word.strip() for word in ordered.group(1).split(",")] if ordered else []
    if not names or not all(name in scene.surfaces for name in names):
        names = list(scene.surfaces)
    surfaces = [scene.named(name) for name in names] or scenes.room_named(case.id + " " + case.text)
    if not surfaces:
        raise CaseError("no surfaces are given")
    found = estimator.matrix(surfaces, [*(s for n, s in scene.surfaces.items() if n not in names), *scene.blockers])
    if np.ndim(case.exact) == 2:
        return found
    rest = ~np.eye(len(surfaces), dtype=bool)
    return at(found, rest)


# ---- nested bodies that params describe ----


def nested_boxes_case(case: Case, estimator) -> Estimate:
    """Cube of edge s in a cube of edge L: factors between one face, all faces, and the rest of either."""
    outer, inner = (case.number(name) / 2 * np.ones(3) for name in ("L", "s"))
    faces = {"outer": scenes.box(-outer, outer), "inner": scenes.box(-inner, inner, looks_in=False)}
    everything = faces["outer"] + faces["inner"]
    parts = []
    for first, second in factors_in(case.quantity):
        emitter = faces[_which(first, faces)][0]
        targets = [s for s in faces[_which(second, faces)] if s is not emitter]
        targets = targets if ALL_FACES.search(second) else targets[:1]
        seen = []
        for target in targets:
            others = [s for s in everything if s is not emitter and s is not target]
            seen.append(estimator.factor(emitter, target, others))
        parts.append(combine(seen))
    return listed(parts)


def _which(words, groups):
    for name in groups:
        if name in words:
            return name
    raise CaseError(f"{words.strip()!r} names none of {', '.join(groups)}")


# ---- bodies of revolution ----


def disks_case(case: Case, estimator) -> Estimate:
    """``F(disk1->disk2)``: coaxial parallel disks, params r1, r2, h."""
    bodies = scenes.coaxial_disks(case.number("r1"), case.number("r2"), case.number("h"))
    return _between_bodies(case, bodies, estimator)


def cylinder_case(case: Case, estimator) -> Estimate:
    """Factors between the disks and the side of a closed cylinder, params r, h."""
    return _between_bodies(case, scenes.cylinder_cavity(case.number("r"), case.number("h")), estimator)


def hemisphere_case(case: Case, estimator) -> Estimate:
    """Factors between a hemisphere and its base, params R."""
    return _between_bodies(case, scenes.hemisphere_cavity(case.number("R", 1.0)), estimator)


def _between_bodies(case, bodies, estimator):
    found = estimator.body_matrix(bodies)
    parts = []
    for first, second in factors_in(case.quantity):
        i = _body_index(first, bodies)
        j = _body_index(second, bodies)
        # "disk -> disk" means the other one: a flat disk does not see itself
        if i == j and len(bodies[i].rings) == 1 and len(bodies[i].rings[0].panels) == 1:
            j = next(k for k in range(len(bodies)) if k != i and bodies[k].name.startswith(bodies[i].name))
        parts.append(at(found, (i, j)))
    return listed(parts) if len(parts) > 1 else parts[0]


def _body_index(words, bodies):
    words = words.strip().lower()
    for k, body in enumerate(bodies):
        if body.name == words:
            return k
    for k, body in enumerate(bodies):
        if body.name.startswith(words[:4]) or words.startswith(body.name[:4]):
            return k
    raise CaseError(f"{words!r} names none of {', '.join(body.name for body in bodies)}")


def sphere_interior_case(case: Case, estimator) -> Estimate:
    """Ratio F_ij 4 pi R^2 / A_j over all pairs of parts of a sphere, which is 1; flat panels taken to their limit."""
    radius = case.number("R", 1.0)
    # the flat panels' error falls with the square of their size: two sizes give the limit (Richardson)
    coarse, fine = (_part_ratios(radius, rings, estimator) for rings in (12, 24))
    return combine([fine, coarse], [4 / 3, -1 / 3])


def _part_ratios(radius, rings, estimator):
    angles = np.linspace(0, np.pi, rings + 1)
    whole = sphere("sphere", radius, angles, 2 * rings, looks_in=True)
    size = rings // SPHERE_PARTS
    parts = [Body(f"part{k}", whole.rings[k * size : (k + 1) * size]) for k in range(SPHERE_PARTS)]
    areas = np.array([part.area for part in parts])
    ratio = areas.sum() / areas
    found = estimator.body_matrix(parts)
    return Estimate(*(getattr(found, key) * ratio for key in Estimate.__slots__))


def concentric_spheres_case(case: Case, estimator) -> Estimate:
    """Factors between an inner and an outer sphere, params r1, r2: what leaves the inner one all lands on the outer."""
    found = concentric_matrix(case.number("r1"), case.number("r2"), estimator)
    names = [("inner", "1"), ("outer", "2")]
    parts = []
    for first, second in factors_in(case.quantity):
        i, j = (
            next((k for k, words in enumerate(names) if any(w in name for w in words)), None)
            for name in (first, second)
        )
        if i is None or j is None:
            raise CaseError(f"F({first}->{second}) names neither inner nor outer")
        parts.append(at(found, (i, j)))
    return listed(parts)


def concentric_matrix(r1: float, r2: float, estimator) -> Estimate:
    """F of an inner sphere (0) and an outer one (1), float64 (2, 2): one panel of the inner one against all outer ones.

    The outer sphere's view of itself is what is left of 1: it is closed.
    """
    rings, sides = 8, 16
    angles = np.linspace(0, np.pi, rings + 1)
    inner = sphere("inner", r1, angles, sides, looks_in=False)
    outer = sphere("outer", r2, angles, sides, looks_in=True)
    panels = np.concatenate([ring.panels for ring in outer.rings])
    shares = []
    for ring in inner.rings:
        first = Surface("inner", (distinct_corners(ring.panels[0]),))
        shares.append(_to_all(first, panels, estimator))
    weights = np.array([ring.area for ring in inner.rings]) / inner.area
    there = combine(shares, weights)
    ratio = inner.area / outer.area
    parts = []
    for key, sign in (("value", 1.0), ("standard_error", 0.0), ("bound", 0.0)):
        x = float(getattr(there, key))
        parts.append(np.array([[0.0, x], [ratio * x, sign - ratio * x if sign else ratio * x]]))
    return Estimate(*parts)


def _to_all(first, panels, estimator):
    if estimator.name != "analytic":
        return estimator.factor(first, Surface("outer", tuple(distinct_corners(panel) for panel in panels)))
    value = np.asarray(exchanges(first.pieces[0], panels).sum() / first.area)
    return Estimate(value, np.zeros_like(value), 1e-6 * value)
