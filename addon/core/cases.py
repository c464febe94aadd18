"""Exact cases: what a file of them says, and what its tolerance classes allow.

The schema: ``{"schema": "exact_cases/1", "cases": [...]}``; a case has an id, a quantity in words such as ``F(A->B)``,
its exact value (a number, or lists or an object of numbers), a tolerance class, params, and a geometry of named
polygons: ``surfaces``, ``occluders``, and others that only block.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


class CaseError(ValueError):
    """A file of cases that cannot be read, or a case that cannot be run; the message is one sentence for the user."""


@dataclass(frozen=True, slots=True)
class Case:
    """One quantity with its exact value.

    Attributes
    ----------
    id, quantity, source, tolerance_class : str
    exact : number, or nested lists or an object of numbers
    surfaces, occluders : name -> list of corners, in the file's order
    params : object
    text : quantity, source and notes, where params that are missing may stand as ``name=number``
    """

    id: str
    quantity: str
    exact: object
    tolerance_class: str
    surfaces: dict
    occluders: dict
    params: dict
    source: str
    text: str

    def number(self, name: str, default: float | None = None) -> float:
        """A parameter as a number: from params, else from the text; raises CaseError without a default."""
        value = self.params.get(name)
        if isinstance(value, (int, float, str)) and not isinstance(value, bool):
            try:
                return float(value)
            except ValueError:
                pass
        found = re.search(rf"(?<![\w.]){re.escape(name)}\s*=\s*({NUMBER})(?![\w.*/+-])", self.text)
        if found:
            return float(found.group(1))
        if default is not None:
            return default
        raise CaseError(f"parameter {name} is missing")

    def numbers(self, name: str) -> np.ndarray:
        """A parameter as numbers, float64 (N, ...); a single number is a list of one."""
        value = self.params.get(name)
        if value is None:
            return np.array([self.number(name)])
        try:
            return np.atleast_1d(np.array(value, np.float64))
        except (TypeError, ValueError) as error:
            raise CaseError(f"parameter {name} is not made of numbers") from error


@dataclass(frozen=True, slots=True)
class Tolerance:
    """What a tolerance class allows: |error| <= max(absolute, relative |exact|, sigmas * standard error).

    With ``complement``, 1 - F is held to that share, too, where it is 1.9e-3 or more (plates a thousandth apart). With
    ``stated``, the stated error is what is allowed, for a class that asks nothing else of a sampled method.
    """

    absolute: float = 0.0
    relative: float = 0.0
    sigmas: float = 0.0
    complement: float | None = None
    stated: bool = False

    def allowed(self, exact, standard_error=0.0, bound=0.0):
        """Largest allowed |error| of each exact value, array or number."""
        exact = np.asarray(exact, np.float64)
        allowed = np.maximum(self.absolute, self.relative * np.abs(exact))
        allowed = np.maximum(allowed, self.sigmas * np.asarray(standard_error))
        if self.stated:
            allowed = np.maximum(allowed, bound)
        if self.complement is None:
            return allowed
        rest = 1 - exact
        return np.where(rest >= 1.9e-3, np.minimum(allowed, self.complement * np.abs(rest)), allowed)


ANALYTIC = {
    "FF-SMOOTH": Tolerance(relative=1e-9),
    "POINT": Tolerance(relative=1e-10),
    "FF-TOUCHING": Tolerance(relative=1e-8),
    "FF-NEAR": Tolerance(absolute=1e-8),
    "FF-SLIVER": Tolerance(relative=1e-6),
    "FF-OFFSET": Tolerance(relative=1e-6),
    "FF-SCALE": Tolerance(relative=1e-6),
    "FF-CURVED": Tolerance(relative=1e-3),
    "FF-OCCLUDED": Tolerance(absolute=1e-4),
    "EXACT-ZERO": Tolerance(),
    "SOLUTION": Tolerance(relative=1e-3),
    "SOLUTION-CURVED": Tolerance(relative=1e-2),
    "INVARIANT": Tolerance(absolute=1e-6),
}
# sigmas only where the class itself allows them; a class that gives one number holds sampled methods to it, too
SAMPLED = {
    "FF-SMOOTH": Tolerance(absolute=1e-4, sigmas=4),
    "POINT": Tolerance(sigmas=4),
    "FF-TOUCHING": Tolerance(absolute=1e-4),
    "FF-NEAR": Tolerance(absolute=1e-3, complement=0.1),
    "FF-SLIVER": Tolerance(stated=True),  # the class only asks for a number
    "FF-OFFSET": Tolerance(relative=1e-6),
    "FF-SCALE": Tolerance(relative=1e-2),
    "FF-CURVED": Tolerance(relative=1e-3),
    "FF-OCCLUDED": Tolerance(absolute=1e-3),
    "EXACT-ZERO": Tolerance(),
    "SOLUTION": Tolerance(relative=1e-2),
    "SOLUTION-CURVED": Tolerance(relative=1e-2),
    "INVARIANT": Tolerance(absolute=1e-6),
}
HEMICUBE_POINT = Tolerance(absolute=1e-3)


def tolerance_of(case: Case, method: str) -> Tolerance:
    """The tolerance of a case's class for a method; an invariant that is zero must be zero."""
    if case.tolerance_class not in ANALYTIC:
        raise CaseError(f"tolerance class {case.tolerance_class!r} is not known")
    if case.tolerance_class == "INVARIANT" and not np.any(flat(case.exact)):
        return Tolerance()
    if method == "analytic":
        return ANALYTIC[case.tolerance_class]
    if method == "hemicube" and case.tolerance_class == "POINT":
        return HEMICUBE_POINT
    return SAMPLED[case.tolerance_class]


def flat(value) -> np.ndarray:
    """All numbers of a value, in order, float64 (N,): of a number, nested lists, or an object of such."""
    if isinstance(value, dict):
        return np.concatenate([flat(part) for part in value.values()]) if value else np.zeros(0)
    return np.array(value, np.float64).ravel()


# ---- reading ----


def load_cases(path: Path) -> list[Case]:
    """The cases of a file; raises CaseError with one sentence, naming the file and the case."""
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except UnicodeDecodeError as error:
        raise CaseError(f"{path} is not a text file") from error
    except json.JSONDecodeError as error:
        raise CaseError(f"{path} is not JSON: {error.msg} in line {error.lineno}") from error
    if not isinstance(content, dict) or not isinstance(content.get("cases"), list):
        raise CaseError(f"{path} holds no list of cases: expected an object with 'cases', schema exact_cases/1")
    schema = content.get("schema", "exact_cases/1")
    if schema != "exact_cases/1":
        raise CaseError(f"{path} has schema {schema!r}: this version reads exact_cases/1")
    return parse_cases(content["cases"], str(path))


def parse_cases(entries, name: str) -> list[Case]:
    """Cases from the entries of a list; ``name`` stands in messages."""
    if not entries:
        raise CaseError(f"{name} holds no case")
    cases = [_case(entry, f"{name}, case {number + 1}") for number, entry in enumerate(entries)]
    rooms = {case.id: case.surfaces for case in cases if case.surfaces}
    return [case if case.surfaces else replace(case, surfaces=_surfaces_as(case, rooms)) for case in cases]


def _surfaces_as(case, rooms):
    """The surfaces of the case that a quantity refers to by "as ID"; none where there is no such case."""
    named = re.search(r"\bas ([\w.+-]+)", case.quantity)
    return rooms.get(named.group(1), {}) if named else {}


def _case(entry, where):
    if not isinstance(entry, dict):
        raise CaseError(f"{where} is not an object")
    for key in ("id", "quantity", "value"):
        if key not in entry:
            raise CaseError(f"{where} has no {key!r}")
    where = f"{where} ({entry['id']})"
    try:
        finite = np.isfinite(flat(entry["value"])).all()
    except (TypeError, ValueError):
        finite = False
    if not finite:
        raise CaseError(f"{where}: its value is not made of numbers")
    geometry = entry.get("geometry") or {}
    if not isinstance(geometry, dict):
        raise CaseError(f"{where}: its geometry is not an object")
    groups = {key: _polygons(value, key, where) for key, value in geometry.items() if isinstance(value, (dict, list))}
    surfaces = groups.pop("surfaces", {})
    occluders = {name: corners for group in groups.values() for name, corners in group.items()}
    params = entry.get("params") or {}
    if not isinstance(params, dict):
        raise CaseError(f"{where}: its params are not an object")
    text = "; ".join(str(entry.get(key, "")) for key in ("quantity", "source", "notes"))
    return Case(
        id=str(entry["id"]),
        quantity=str(entry["quantity"]),
        exact=entry["value"],
        tolerance_class=str(entry.get("tolerance_class", "")),
        surfaces=surfaces,
        occluders=occluders,
        params=params,
        source=str(entry.get("source", "")),
        text=text + "; " + "; ".join(f"{k}={v}" for k, v in params.items() if isinstance(v, (int, float, str))),
    )


def _polygons(group, key, where):
    """Named polygons, float64 (K, 3) each; a missing number is not a number, so that the polygon is reported later."""
    named = group.items() if isinstance(group, dict) else ((f"{key}{k}", corners) for k, corners in enumerate(group))
    polygons = {}
    for name, corners in named:
        try:
            array = np.array([[np.nan if x is None else x for x in corner] for corner in corners], np.float64)
        except (TypeError, ValueError) as error:
            raise CaseError(f"{where}: {name} is not a list of corners") from error
        polygons[str(name)] = array.reshape(-1, 3) if array.size % 3 == 0 else array
    return polygons
