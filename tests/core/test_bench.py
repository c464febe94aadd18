"""``patchlight bench`` on its smallest settings: rows are whole, errors fall as rays grow, files can be read."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from addon import cli
from addon.core.bench import BenchOptions, report, run_bench
from addon.core.bench_cube import cube_irradiance
from addon.core.bench_factors import factor_cases
from addon.core.bench_peers import installed_peers
from addon.core.bench_plot import save_plots
from addon.core.bench_row import HEADER, BenchRow, Outcome, measured, relative_error, row
from addon.core.bench_scenes import WHOLE, even_points, exact_scene
from addon.core.patches import subdivide
from addon.core.settings import SettingsError
from addon.core.transport import STUDENT_99
from tests.physics.systems import sampled
from tests.scenes import kernel_of

PEERS = ("pyviewfactor", "raystrack")
OPTIONS = BenchOptions(scenes=("cube",), is_quick=True, runs=1, threads=2)


@pytest.fixture(scope="module")
def bench():
    """Without peers, which compile for seconds where they are installed."""
    with pytest.MonkeyPatch.context() as patch:
        for name in PEERS:
            patch.setitem(sys.modules, name, None)
        return run_bench(OPTIONS)


def of(rows, **wanted):
    return [one for one in rows if all(getattr(one, name) == value for name, value in wanted.items())]


def test_every_method_and_solver_has_its_rows(bench):
    rows, _ = bench
    for case in factor_cases():
        methods = {one.method for one in of(rows, stage="factor", scene=case.name)}
        assert methods >= {"analytic", "hemicube", "monte-carlo"}
    assert {one.solver for one in of(rows, stage="solve")} == {
        "direct", "conjugate-gradient", "progressive", "stochastic",
    }  # fmt: skip
    assert {one.method for one in of(rows, stage="solve")} == {"hemicube", "monte-carlo"}
    assert of(rows, stage="bake", scene="cube", solver="auto")


def test_every_row_has_seconds_rays_and_error(bench):
    rows, _ = bench
    for one in rows:
        assert one.seconds > 0
        assert np.isfinite(one.error)
        assert one.error >= 0
        assert one.rays is None or one.rays > 0
        assert one.memory is None or one.memory >= 0
        if one.stage != "factor" or one.method in ("hemicube", "monte-carlo"):
            assert one.rays is not None, row(one)


def test_analytic_factors_are_exact(bench):
    for one in of(bench[0], stage="factor", method="analytic"):
        assert one.error < 1e-8


def test_monte_carlo_is_as_good_as_it_says(bench):
    # the bound is that of 99 %; twice it is six standard errors
    for one in of(bench[0], stage="factor", method="monte-carlo"):
        assert one.error <= 2 * one.stated_error, row(one)


@pytest.mark.parametrize("scene", [case.name for case in factor_cases()])
def test_monte_carlo_errors_fall_as_rays_grow(bench, scene):
    rows = of(bench[0], stage="factor", scene=scene, method="monte-carlo")
    rays, stated = [one.rays for one in rows], [one.stated_error for one in rows]
    assert rays == sorted(rays)
    assert stated == sorted(stated, reverse=True)
    # sixteen times the rays: the error is below what the fewest state, less what chance may add to the most
    assert rows[-1].error < stated[0] / STUDENT_99 + stated[-1]


def test_solvers_on_a_cube_are_near_the_exact_system(bench):
    for one in of(bench[0], stage="solve", scene="cube"):
        allowed = 0.01 if one.solver == "stochastic" else 0.1
        assert one.error < allowed, row(one)


def test_a_bake_is_near_the_continuum(bench):
    for one in of(bench[0], stage="bake"):
        assert one.error < 0.03, row(one)
        assert one.stated_error > 0


def test_the_table_lines_up(bench):
    assert {len(row(one)) for one in bench[0]} == {len(HEADER)}


def test_missing_peers_are_named(bench):
    rows, missing = bench
    assert not [one for one in rows if one.method in PEERS]
    assert [sentence.split(" was not measured")[0] for sentence in missing] == list(PEERS)


@pytest.mark.parametrize("name", PEERS)
def test_peers_agree_where_they_are_installed(name):
    peers = [peer for peer in installed_peers()[0] if peer.name == name]
    for peer in peers:
        value = peer.run(factor_cases()[0], peer.settings[-1], 0)[0]
        assert value == pytest.approx(factor_cases()[0].exact, rel=0.01)


def test_the_report_says_on_what(bench, tmp_path):
    rows, missing = bench
    told = json.loads(json.dumps(report(rows, OPTIONS, missing)))
    assert set(told) == {"schema", "machine", "commit", "versions", "threads", "quick", "rows", "missing"}
    assert told["threads"] == 2
    assert told["versions"]["numpy"] == np.__version__
    assert [BenchRow(**one) for one in told["rows"]] == rows


def test_the_plots_are_pictures(bench, tmp_path):
    paths = save_plots(bench[0], tmp_path)
    assert [path.name for path in paths] == ["bench_seconds.png", "bench_rays.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)


# ---- the scenes' truth ----


def test_the_cube_in_its_furnace():
    # by linearity and symmetry the six faces' means with one of them lit add up to what each has with all of them lit,
    # which is 1 / (1 - rho)
    scene = exact_scene("cube").scene
    triangles, barycentrics = even_points(scene, 3000, 0)
    points = np.einsum("nk,nkc->nc", barycentrics, scene.corners[triangles])
    irradiance = cube_irradiance(points, triangles // 2, 0.5)
    faces = [irradiance[triangles // 2 == face].mean() for face in range(6)]
    assert sum(faces) == pytest.approx(2.0, rel=5e-3)


def test_the_l_room_agrees_with_rays():
    exact = exact_scene("l-room")
    factors, areas = sampled(exact.scene, WHOLE, 1 << 16)
    with kernel_of(exact.scene) as kernel:
        patches = subdivide(exact.scene, kernel, exact.patch_size, 1000, 0)
    emitted = exact.emitted[patches.triangles]
    by_rays = np.linalg.solve(np.eye(len(areas)) - 0.5 * factors, emitted)
    arriving = (by_rays - emitted) / 0.5
    assert relative_error(arriving, (exact.system(patches) - emitted) / 0.5) < 0.01


# ---- how it is measured ----


def test_a_row_is_the_median_of_its_runs():
    outcomes = [
        Outcome(error, rays, error, seconds) for error, rays, seconds in ((3.0, 30, 9), (4.0, 10, 1), (0, 20, 5))
    ]
    one = measured(("solve", "s", "m", "-", "x"), 3, lambda turn: outcomes[turn])
    assert (one.seconds, one.rays, one.stated_error, one.runs, one.spread) == (5, 20, 3.0, 3, 8 / 5)
    assert one.error == pytest.approx((25 / 3) ** 0.5)


def test_memory_is_what_the_work_takes():
    one = measured(("solve", "s", "m", "-", "x"), 1, lambda turn: Outcome(float(np.ones(1 << 23).sum() * 0)))
    assert one.memory is None or (1 << 26) * 0.9 < one.memory < (1 << 26) * 1.5


@pytest.mark.parametrize("changes", [{"scenes": ("moon",)}, {"runs": 0}])
def test_bad_options_are_named(changes):
    with pytest.raises(SettingsError, match=next(iter(changes)).rstrip("s")):
        replace(OPTIONS, **changes)


# ---- the command ----


def test_a_blend_needs_its_reference(capsys):
    assert cli.main(["bench", "--blend", "room.blend"]) == 1
    assert capsys.readouterr().err.startswith("patchlight: error: --blend and --reference go together")


def test_plots_without_matplotlib_are_refused_at_once(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert cli.main(["bench", "--out", str(tmp_path / "out")]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "matplotlib" in err
