"""What "auto" takes: by the scene's size and how much it reflects, and what is asked for before that."""

import pytest

from addon.core.choose import BRIGHT_ROOM, EXCHANGE_TRIANGLES, choose
from addon.core.emitters import emitters_of
from addon.core.radiosity import PATCH_BUDGETS, solve_radiosity
from addon.core.scene import Material
from addon.core.settings import SOLVERS, BakeSettings
from tests.scenes import LAMP, cube_room, kernel_of

AUTO, HEMICUBE = BakeSettings(), BakeSettings(method="hemicube")


@pytest.mark.parametrize(
    ("settings", "triangles", "reflectance", "solver"),
    [
        (AUTO, 12, 0.5, "stochastic"),
        (AUTO, EXCHANGE_TRIANGLES, BRIGHT_ROOM, "conjugate-gradient"),
        (AUTO, EXCHANGE_TRIANGLES + 1, 0.99, "stochastic"),
        (HEMICUBE, 12, 0.5, "conjugate-gradient"),
        (HEMICUBE, EXCHANGE_TRIANGLES + 1, 0.5, "progressive"),
        (BakeSettings(solver="direct"), 10**6, 0.99, "direct"),
    ],
)
def test_the_choice_and_its_reason(settings, triangles, reflectance, solver):
    chosen, method, reason = choose(settings, triangles, reflectance)
    assert chosen == solver
    assert method == ("hemicube" if settings.method == "hemicube" else "monte-carlo")
    assert reason.startswith(solver)


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
