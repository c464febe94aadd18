"""The report: plain for JSON, and what a bake costs."""

import dataclasses
import json

import pytest

from addon.core.bake import bake
from addon.core.report import STAGES_OF_A_BAKE, Energy, Report
from addon.core.settings import BakeSettings
from tests.scenes import cube_room


def test_a_report_goes_through_json_and_back():
    report = bake(cube_room(), BakeSettings(texels=256, error=0.3, patch_size=0.3)).report
    plain = report.as_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert set(plain) == {field.name for field in dataclasses.fields(Report)}
    assert plain["energy"]["shot"] == report.energy.shot


def test_a_bake_costs_what_its_stages_cost():
    report = Report(seconds={"unwrap": 10.0, "texels": 1.0, "solve": 2.0, "gather": 4.0})
    staged = report.with_stages({"load": 100.0, "read": 8.0, "write": 16.0})
    assert staged.seconds["bake"] == sum(staged.seconds[stage] for stage in STAGES_OF_A_BAKE) == 31.0
    assert staged.seconds["load"] == 100.0
    assert "bake" not in report.seconds


def test_a_report_does_not_change():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Report().patches = 3
    assert Energy().shot == 0
