"""Exact cases: what is read, what is understood, how it is judged; the shipped set passes."""

import json

import numpy as np
import pytest

from addon.core.analytic import surface
from addon.core.cases import CaseError, load_cases, parse_cases, tolerance_of
from addon.core.estimators import make_estimator
from addon.core.shipped_cases import shipped_cases
from addon.core.verify import handler_of, report, row, run_case, run_cases, summary
from addon.core.workers import Workers
from tests.reference import closed_forms as howell

PLATES = {
    "A": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    "B": [[0, 0, 1], [0, 1, 1], [1, 1, 1], [1, 0, 1]],
}
C_11 = howell.c11(1, 1, 1)


def entry(**changes):
    return {
        "id": "plates", "quantity": "F(A->B)", "value": C_11, "tolerance_class": "FF-SMOOTH",
        "geometry": {"surfaces": PLATES},
    } | changes  # fmt: skip


def run(method="analytic", **changes):
    case = parse_cases([entry(**changes)], "test")[0]
    with Workers(2) as workers:
        return run_case(case, make_estimator(method, workers), method)


# ---- the shipped set ----


def test_every_shipped_case_is_understood():
    cases = shipped_cases()
    assert len(cases) > 40
    assert len({case.id for case in cases}) == len(cases)
    for case in cases:
        assert handler_of(case) is not None, case.id
        assert case.source, case.id
        tolerance_of(case, "analytic")


def test_the_shipped_cases_pass():
    slow = {"nested_cubes", "sphere_inside", "furnace_0.5", "furnace_0.99"}  # other tests hold these laws
    results = run_cases(
        [case for case in shipped_cases() if case.id not in slow], make_estimator("analytic", None), "analytic"
    )
    assert [row(result) for result in results if not result.passed] == []


# ---- judging ----


def test_a_right_value_passes_and_a_wrong_one_does_not():
    assert run().passed
    wrong = run(value=C_11 * (1 + 1e-8))
    assert not wrong.passed
    assert wrong.error == pytest.approx(1e-8 * C_11, rel=1e-3)
    assert "FAILED" in row(wrong)


@pytest.mark.parametrize("quantity", ["phase of the moon", "F(A->C)", ""])
def test_what_is_not_understood_fails_and_says_so(quantity):
    result = run(quantity=quantity)
    assert not result.passed
    assert result.message


def test_an_unknown_class_fails():
    assert "FF-NONE" in run(tolerance_class="FF-NONE").message


def test_sums_lists_and_occluders():
    doubled = PLATES | {"B2": PLATES["B"]}
    assert run(quantity="F(A->B)+F(A->B2)", geometry={"surfaces": doubled}, tolerance_class="INVARIANT").passed
    assert run(quantity="F(A->B),F(B->A)", value=[C_11, C_11]).passed
    hidden = {"O": [[-1, -1, 0.5], [2, -1, 0.5], [2, 2, 0.5], [-1, 2, 0.5]]}
    assert run(value=0.0, tolerance_class="EXACT-ZERO", geometry={"surfaces": PLATES, "occluders": hidden}).passed


def test_degenerate_faces_are_reported_and_change_nothing():
    bad = {"point": [[0.5, 0.5, 0.5]] * 3, "nan": [[None, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5]]}
    result = run(geometry={"surfaces": PLATES, "extra_faces": bad})
    assert result.passed
    assert result.value == run().value
    assert "point: no area" in result.message
    assert "nan: " in result.message


def test_an_invariant_that_is_zero_must_be_zero():
    case = parse_cases([entry(value=0.0, tolerance_class="INVARIANT")], "test")[0]
    assert tolerance_of(case, "analytic").allowed(np.array([0.0])) == 0


@pytest.mark.parametrize("method", ["hemicube", "monte-carlo"])
def test_sampled_methods_state_an_error_that_covers(method):
    # FF-SMOOTH, sampled: the larger of 1e-4 and four standard errors
    result = run(method)
    assert result.passed
    assert result.covered
    assert 0 < result.stated_error < 1e-3


def far_plates(distance):
    return PLATES | {"B": [[x, y, distance] for x, y, _ in PLATES["B"]]}


def test_what_is_all_hidden_is_never_certain():
    screen = [[-9, -9, 0.5], [9, -9, 0.5], [9, 9, 0.5], [-9, 9, 0.5]]
    result = run("hemicube", value=0.0, geometry={"surfaces": PLATES, "occluders": {"screen": screen}})
    assert result.value == 0
    assert result.stated_error > 0
    assert result.covered


def test_hemicubes_see_what_is_smaller_than_a_pixel():
    result = run("hemicube", value=howell.c11(1, 1, 100), geometry={"surfaces": far_plates(100.0)})
    assert result.covered
    assert result.error < 1e-5 * result.exact


@pytest.mark.parametrize("distance", [1e2, 1e5])
def test_what_lies_between_the_rays_of_whole_hemicubes_is_covered(distance):
    """A target smaller than a pixel that none of 340 hemicubes hits: each pixel there stands for 1 / 201 of a row."""
    plates = [surface(name, corners) for name, corners in far_plates(distance).items()]
    with Workers(2) as workers:
        found = make_estimator("hemicube", workers).matrix(plates)
    assert found.bound[0, 1] > 0
    # Howell C-11 far away: 1 / (pi c^2)
    assert abs(found.value[0, 1] - 1 / (np.pi * distance**2)) <= found.bound[0, 1]


def test_a_report_is_plain_numbers():
    results = [run(), run(value=1.0)]
    content = json.loads(json.dumps(report(results, "analytic", "x")))
    assert (content["passed"], content["failed"]) == (1, 1)
    assert "1 of 2" in summary(results, "analytic", "x")


# ---- reading ----


def load(tmp_path, content):
    path = tmp_path / "cases.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return load_cases(path)


def test_a_file_is_read_in_order(tmp_path):
    cases = load(tmp_path, {"schema": "exact_cases/1", "cases": [entry(id="a"), entry(id="b")]})
    assert [case.id for case in cases] == ["a", "b"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", "not JSON"),
        ([], "no list of cases"),
        ({"cases": []}, "holds no case"),
        ({"schema": "other/9", "cases": [entry()]}, "other/9"),
        ({"cases": [3]}, "case 1"),
        ({"cases": [{"id": "x", "quantity": "F"}]}, "no 'value'"),
        ({"cases": [entry(value="many")]}, "not made of numbers"),
        ({"cases": [entry(geometry={"surfaces": {"A": 3}})]}, "not a list of corners"),
        ({"cases": [entry(geometry=[1])]}, "geometry is not an object"),
        ({"cases": [entry(params=[1])]}, "params are not an object"),
    ],
)
def test_a_bad_file_is_one_sentence(tmp_path, content, words):
    with pytest.raises(CaseError, match=words) as caught:
        load(tmp_path, content)
    assert "\n" not in str(caught.value)


def test_numbers_come_from_params_or_from_the_text():
    case = parse_cases([entry(params={"a": "2.5"}, source="with r1=1, r2 = 0.5; E=1-rho")], "test")[0]
    assert case.number("a") == 2.5
    assert case.number("r1") == 1
    assert case.number("r2") == 0.5
    with pytest.raises(CaseError, match="E is missing"):
        case.number("E")
