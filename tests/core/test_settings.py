"""Settings are checked once, where they are made; the message names the setting, its value and what is allowed."""

import dataclasses

import pytest

from addon.core.settings import BakeSettings, SettingsError


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("target", "texture"),
        ("method", "analytic"),
        ("solver", "jacobi"),
        ("error", 0),
        ("error", 1.5),
        ("error", float("nan")),
        ("time_limit", 0),
        ("time_limit", -1.0),
        ("texels", 0),
        ("texels", 1 << 29),
        ("density", 0.0),
        ("density", float("nan")),
        ("patch_size", -0.1),
        ("smooth_angle_deg", 181),
        ("seed", -1),
        ("seed", 1 << 32),
        ("threads", -1),
    ],
)
def test_what_is_out_of_range_is_refused_by_name(name, value):
    with pytest.raises(SettingsError, match=name) as refused:
        BakeSettings(**{name: value})
    assert str(value) in str(refused.value)


def test_the_stochastic_solver_has_no_hemicubes():
    with pytest.raises(SettingsError, match="hemicube"):
        BakeSettings(method="hemicube", solver="stochastic")


def test_settings_do_not_change():
    with pytest.raises(dataclasses.FrozenInstanceError):
        BakeSettings().error = 0.5


def test_no_threads_asked_for_means_all_there_are():
    assert BakeSettings(threads=0).thread_count >= 1
    assert BakeSettings(threads=3).thread_count == 3
