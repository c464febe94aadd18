"""Run exact cases: each quantity by the handler that understands its words, held against its exact value."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import numpy as np

from . import case_factors, case_solutions, case_spheres
from .case_scene import case_scene
from .cases import Case, CaseError, flat, tolerance_of
from .sampled import SampledEstimator


@dataclass(frozen=True, slots=True)
class CaseResult:
    """One case as it came out.

    Attributes
    ----------
    id, quantity, tolerance_class : str
    value, exact : the entry with the largest error in units of its tolerance; None where nothing came out
    error : |value - exact| there
    tolerance : what was allowed there
    stated_error : what the estimator says its error stays below there
    covered : whether it does, in all entries; None where no error is stated
    seconds : float
    passed : bool
    message : why it failed, or what was dropped
    """

    id: str
    quantity: str
    tolerance_class: str
    value: float | None
    exact: float | None
    error: float | None
    tolerance: float | None
    stated_error: float | None
    covered: bool | None
    seconds: float
    passed: bool
    message: str

    def as_dict(self) -> dict:
        """For a report in JSON."""
        return asdict(self)


Handler = Callable[[Case, object], object]


def handler_of(case: Case) -> Handler | None:
    """The function that computes a case's quantity, by its words and params; None where none understands it."""
    for understands, handler in (*FACTOR_HANDLERS, *SOLUTION_HANDLERS):
        if understands(case):
            return handler
    return None


def _says(*patterns, params=()):
    """Whether the quantity matches all patterns, and these params are there or stand in the text."""

    def understands(case):
        words = case.quantity.lower()
        return all(re.search(p, words) for p in patterns) and all(_has(case, name) for name in params)

    return understands


def _has(case, name):
    try:
        case.number(name)
    except CaseError:
        return name in case.params
    return True


def _names_surfaces(case):
    found = case_factors.factors_in(case.quantity)
    return bool(found) and all(name.strip() in case.surfaces for pair in found for name in pair)


def _names_element(case):
    found = case_factors.factors_in(case.quantity)
    return bool(found) and all(first.strip() == "dA" for first, _ in found)


# the first that understands a case runs it
FACTOR_HANDLERS: tuple[tuple[Callable[[Case], bool], Handler], ...] = (
    (_names_element, case_factors.element_case),
    (_names_surfaces, case_factors.polygons_case),
    (case_factors.is_matrix, case_factors.matrix_case),
    (_says(r"f\(disk1->disk2\)|f\(disk2->disk1\)"), case_factors.disks_case),
    (_says(r"f\(.*disk.*side|f\(.*side", params=("r", "h")), case_factors.cylinder_case),
    (_says(r"f\(.*hemi"), case_factors.hemisphere_case),
    (_says(r"f\(.*inner|f\(.*outer", params=("L", "s")), case_factors.nested_boxes_case),
    (_says(r"f\(.*inner|f\(.*outer|f\([12]->[12]\)|\bf_?[12]_?[12]\b", params=("r1", "r2")),
     case_factors.concentric_spheres_case),
    (_says(r"f_ij.*sphere"), case_factors.sphere_interior_case),
    (_says(r"^irradiance at"), case_factors.irradiance_case),
)  # fmt: skip
SOLUTION_HANDLERS: tuple[tuple[Callable[[Case], bool], Handler], ...] = (
    (lambda case: "continuum" in case.id + case.quantity and "cube" in case.id, case_solutions.continuum_case),
    (_says(r"^b everywhere"), case_solutions.furnace_case),
    (_says(r"^b per face", params=("rho", "E")), case_solutions.faces_case),
    (_says(r"^b\s*-\s*e$"), case_solutions.zero_albedo_case),
    (_says(r"b floor.*hole|b .*escaping.*hole"), case_solutions.pinhole_case),
    (lambda case: isinstance(case.exact, dict) and "slit" in case.surfaces, case_solutions.slit_case),
    (_says(r"max b in room 2"), case_solutions.divided_rooms_case),
    (lambda case: any(key.startswith("zones") for key in case.params), case_spheres.zones_case),
    (_says(r"^b wall.*escaped", params=("f", "rho")), case_spheres.cavity_case),
    (_says(r"b wall.*b cap|b cap.*b wall", params=("f", "rho")), case_spheres.lit_cap_case),
    (_says(r"b1.*b2", params=("f1", "f2")), case_spheres.port_case),
    (_says(r"b inner.*b outer"), case_spheres.concentric_case),
    (lambda case: bool(re.search(r"b1\s*,\s*b2", case.quantity.lower())) and "plate" in (case.text + case.id).lower(),
     case_solutions.plates_case),
)  # fmt: skip

# times as many rays where a class is narrow for what is seen of many small pieces, each of which takes a share of them
MORE_RAYS = {"FF-CURVED": 4}


def run_case(case: Case, estimator, method: str) -> CaseResult:
    """Compute one case and judge it; what it cannot do is a failure with a message."""
    started = time.perf_counter()
    try:
        tolerance = tolerance_of(case, method)
        handler = handler_of(case)
        if handler is None:
            raise CaseError("the quantity is not understood")
        if isinstance(estimator, SampledEstimator):
            more = MORE_RAYS.get(case.tolerance_class, 1)
            estimator = replace(estimator, ray_limit=more * estimator.ray_limit)
            if any(handler is solves for _, solves in SOLUTION_HANDLERS):
                estimator = estimator.coarser()
        found = handler(case, estimator)
        judged = _judge(found, case, tolerance)
    except CaseError as error:
        return _failure(case, str(error), time.perf_counter() - started)
    except (ValueError, ArithmeticError, IndexError, KeyError, TypeError, np.linalg.LinAlgError) as error:
        # a case of a shape that nobody thought of must not stop the others
        return _failure(case, f"{type(error).__name__}: {error}", time.perf_counter() - started)
    dropped = "; ".join(case_scene(case).dropped)
    return CaseResult(
        case.id, case.quantity, case.tolerance_class, *judged[:-1], time.perf_counter() - started, judged[-1],
        f"dropped {dropped}" if dropped else "",
    )  # fmt: skip


def _judge(found, case, tolerance):
    """value, exact, error, tolerance, stated error at the worst entry; whether all is covered; whether it passed."""
    found = _as_one(found, case.exact)
    exact = flat(case.exact)
    value, deviation, bound = (np.ravel(x).astype(float) for x in (found.value, found.standard_error, found.bound))
    if len(exact) not in (1, len(value)):
        raise CaseError(f"{len(value)} numbers came out and the exact value has {len(exact)}")
    exact = np.broadcast_to(exact, len(value))
    error = np.abs(value - exact)
    allowed = tolerance.allowed(exact, deviation, bound)
    excess = np.where(np.isfinite(error), error - allowed, np.inf)
    worst = int(np.argmax(np.where(error == 0, -1.0, error / np.maximum(allowed, 1e-300))))
    covered = bool((error <= bound).all())
    passed = bool((excess <= 0).all())
    return (*(float(x[worst]) for x in (value, exact, error, allowed, bound)), covered, passed)


def _as_one(found, exact):
    if not isinstance(found, dict):
        return found
    return case_factors.listed([found[key] for key in exact])


def _failure(case, message, seconds):
    return CaseResult(
        case.id, case.quantity, case.tolerance_class, None, None, None, None, None, None, seconds, False, message
    )


def run_cases(cases, estimator, method: str, on_result: Callable[[CaseResult], None] | None = None):
    """All cases in order; each result is told as soon as it is there."""
    results = []
    for case in cases:
        results.append(run_case(case, estimator, method))
        if on_result:
            on_result(results[-1])
    return results


# ---- the table ----

HEADER = f"{'case':34s} {'value':>19s} {'exact':>19s} {'error':>9s} {'allowed':>9s} {'stated':>9s} {'seconds':>8s}"


def row(result: CaseResult) -> str:
    """One line of the table."""
    mark = "" if result.passed else "  FAILED"
    if result.value is None:
        return f"{result.id:34s} {result.message}{mark}"
    numbers = f"{result.value:19.12g} {result.exact:19.12g} {result.error:9.1e} {result.tolerance:9.1e}"
    note = f"  {result.message}" if result.message else ""
    return f"{result.id:34s} {numbers} {result.stated_error:9.1e} {result.seconds:8.2f}{mark}{note}"


def summary(results, method: str, setting: str) -> str:
    """How many passed, in which time."""
    passed = sum(r.passed for r in results)
    seconds = sum(r.seconds for r in results)
    return f"{method} ({setting}): {passed} of {len(results)} cases passed, {seconds:.1f} s"


def report(results, method: str, setting: str) -> dict:
    """All results for a file of JSON."""
    covered = [r.covered for r in results if r.covered is not None]
    return {
        "method": method,
        "setting": setting,
        "passed": sum(r.passed for r in results),
        "failed": sum(not r.passed for r in results),
        "share_covered_by_stated_error": sum(covered) / max(len(covered), 1),
        "seconds": sum(r.seconds for r in results),
        "cases": [r.as_dict() for r in results],
    }
