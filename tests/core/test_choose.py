"""What "auto" takes: by the scene's size and how much it reflects, and what is asked for before that."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core import choose as choices
from addon.core import conjugate_gradient, radiosity
from addon.core.choose import BRIGHT_ROOM, EXCHANGE_TRIANGLES, FEW_SIDES, choose
from addon.core.conjugate_gradient import EXCHANGE_LIMIT
from addon.core.emitters import emitters_of
from addon.core.radiosity import PATCH_BUDGETS, solve_radiosity
from addon.core.scene import Material, PointLight
from addon.core.settings import SOLVERS, BakeSettings, SettingsError
from tests.core.meshes import box, scene_of, sphere
from tests.scenes import LAMP, cube_room, kernel_of

AUTO, HEMICUBE = BakeSettings(), BakeSettings(method="hemicube")


@pytest.mark.parametrize(
    ("settings", "triangles", "sides", "reflectance", "solver"),
    [
        (AUTO, 12, 2500, 0.5, "stochastic"),
        (AUTO, EXCHANGE_TRIANGLES, FEW_SIDES, BRIGHT_ROOM, "conjugate-gradient"),
        (AUTO, 612, 3848, BRIGHT_ROOM, "stochastic"),
        (AUTO, 612, 3848, 0.98, "conjugate-gradient"),
        (AUTO, EXCHANGE_TRIANGLES + 1, 2500, 0.99, "stochastic"),
        (AUTO, 12, EXCHANGE_LIMIT + 2, 0.99999, "stochastic"),
        (HEMICUBE, 12, 2500, 0.5, "conjugate-gradient"),
        (HEMICUBE, EXCHANGE_TRIANGLES + 1, 9000, 0.5, "progressive"),
        (HEMICUBE, 12, EXCHANGE_LIMIT + 2, 0.5, "progressive"),
        (BakeSettings(solver="direct"), 10**6, 2 * 10**6, 0.99, "direct"),
    ],
)
def test_the_choice_and_its_reason(settings, triangles, sides, reflectance, solver):
    chosen, method, reason = choose(settings, triangles, sides, reflectance)
    assert chosen == solver
    assert method == ("hemicube" if settings.method == "hemicube" else "monte-carlo")
    assert reason.startswith(solver)


@pytest.mark.parametrize("method", ["auto", "hemicube"])
@pytest.mark.parametrize(("rings", "segments"), [(4, 40), (3, 70), (2, 140)])
def test_what_auto_chooses_can_be_solved(method, rings, segments, monkeypatch):
    """Of the brightness that files begin with, compact and thin triangles; all limits a tenth: time is their square."""
    most = EXCHANGE_LIMIT // 10
    monkeypatch.setattr(choices, "EXCHANGE_LIMIT", most)
    monkeypatch.setattr(choices, "FEW_SIDES", most)
    monkeypatch.setattr(conjugate_gradient, "EXCHANGE_LIMIT", most)
    monkeypatch.setitem(radiosity.MOST_PATCHES_OF, "conjugate-gradient", most // 2)
    monkeypatch.setitem(PATCH_BUDGETS, "conjugate-gradient", PATCH_BUDGETS["conjugate-gradient"] // 10)
    scene = scene_of(sphere(1.0, rings, segments, (0, 0, 1.2)), box((6, 6, 0.1)))
    lights = (PointLight("Lamp", (2, 2, 4), (9, 9, 9)),)
    scene = replace(scene, materials=(Material("grey", (0.8, 0.8, 0.8)),) * len(scene.materials), lights=lights)
    assert len(scene.triangles) <= EXCHANGE_TRIANGLES // 10
    settings = BakeSettings(target="vertex", method=method, error=0.5)
    with kernel_of(scene, threads=2) as kernel:
        solved = solve_radiosity(scene, kernel, emitters_of(scene, kernel.centre), settings, lambda done: None)
    assert np.isfinite(solved.solution.radiosity).all()
    assert solved.choice.startswith(solved.solution.solver)


@pytest.mark.parametrize("settings", [BakeSettings(solver="direct"), HEMICUBE])
def test_what_passes_in_a_colour_is_for_rays_alone(settings):
    chosen, method, reason = choose(AUTO, 12, 2500, 0.99, needs_rays="wine")
    assert (chosen, method) == ("stochastic", "monte-carlo")
    assert "'wine'" in reason
    with pytest.raises(SettingsError, match="'wine'"):
        choose(settings, 12, 2500, 0.99, needs_rays="wine")


def test_every_solver_has_its_number_of_patches():
    assert set(PATCH_BUDGETS) == set(SOLVERS) - {"auto"}


@pytest.mark.parametrize(
    ("target", "rho", "solver"),
    [
        ("vertex", 0.5, "stochastic"),
        ("vertex", 0.9, "conjugate-gradient"),
        ("lightmap", 0.9, "stochastic"),
        ("lightmap", 0.98, "conjugate-gradient"),
    ],
)
def test_the_scene_decides(target, rho, solver):
    """From triangles: a bright room and a grey one of the same shape; a lightmap's texels mend rough patches."""
    scene = cube_room((LAMP,), material=Material("wall", (0.3, rho, 0.3)))
    settings = BakeSettings(target=target, patch_size=0.5, error=0.2)
    with kernel_of(scene) as kernel:
        solved = solve_radiosity(scene, kernel, emitters_of(scene, kernel.centre), settings, lambda done: None)
    assert solved.solution.solver == solver
    assert solved.choice.startswith(solver)
