"""``patchlight verify``: exit codes, table, report, and one line for what is wrong."""

import json

import pytest

from addon import cli
from tests.core.test_verify import C_11, entry


@pytest.fixture
def cases(tmp_path):
    def write(*entries):
        path = tmp_path / "cases.json"
        path.write_text(json.dumps({"schema": "exact_cases/1", "cases": list(entries)}))
        return str(path)

    return write


def test_a_good_file(cases, tmp_path, capsys):
    out = tmp_path / "out.json"
    assert cli.main(["verify", cases(entry()), "--report", str(out)]) == 0
    told = capsys.readouterr()
    assert "plates" in told.out
    assert "1 of 1 cases passed" in told.out
    assert told.err == ""
    assert json.loads(out.read_text())["cases"][0]["value"] == pytest.approx(C_11, rel=1e-12)


def test_a_failing_file(cases, capsys):
    assert cli.main(["verify", cases(entry(), entry(id="wrong", value=0.3))]) == 1
    told = capsys.readouterr()
    assert "1 of 2 cases passed" in told.out
    assert told.err == "patchlight: error: 1 of 2 cases failed, the first is wrong\n"


@pytest.mark.parametrize("content", ["", "[1, 2]", '{"cases": 3}', "\x00\x01"])
def test_a_bad_file(tmp_path, capsys, content):
    path = tmp_path / "bad.json"
    path.write_text(content)
    assert cli.main(["verify", str(path)]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("patchlight: error: ")


def test_no_file(tmp_path, capsys):
    assert cli.main(["verify", str(tmp_path / "none.json")]) == 1
    assert "none.json" in capsys.readouterr().err


def test_a_sampled_method(cases, capsys):
    assert cli.main(["verify", cases(entry()), "--method", "monte-carlo", "--seed", "3", "--threads", "1"]) == 0
    assert "monte-carlo" in capsys.readouterr().out


def test_the_report_does_not_take_the_place_of_the_cases(tmp_path, capsys):
    path = tmp_path / "cases.json"
    path.write_text("[]")
    assert cli.main(["verify", str(path), "--report", str(path)]) == 1
    assert "one of its own" in capsys.readouterr().err
    assert path.read_text() == "[]"
