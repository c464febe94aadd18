"""Every solver where solving is hard: hardly anything absorbed, rooms hardly connected, many patches, all threads."""

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.patches import subdivide
from addon.core.radiosity import solve_radiosity
from addon.core.settings import SOLVERS, BakeSettings
from addon.core.stochastic import solve_stochastic
from tests.physics.systems import EXACT_SOLVERS, closed_room, l_room, sampled, solve, sphere_of_5000
from tests.reference.radiosity import by_series, cube, sphere, two_spheres, two_spheres_radiosity
from tests.scenes import HIGH_LAMP, cornell_box, kernel_of, room_with_occluder

EVERY_SOLVER = (*EXACT_SOLVERS, "stochastic")


@pytest.fixture(scope="module")
def systems():
    """Closed systems by name: exact form factors, and sampled ones repaired."""
    made = {"cube": cube(), "L": sampled(l_room(), 0.15, 256), "sphere of 5000": sampled(sphere_of_5000(), 9.0, 64, 1)}
    assert len(made["sphere of 5000"][1]) > 5000
    return made


@pytest.mark.parametrize("solver", EXACT_SOLVERS)
@pytest.mark.parametrize("name", ["cube", "L", "sphere of 5000"])
@pytest.mark.parametrize(("rho", "tolerance"), [(0.99, 1e-8), (0.9999, 1e-5)])
def test_furnace(systems, solver, name, rho, tolerance):
    """B = M / (1 - rho) on every patch of a closed mesh, whatever its form factors are."""
    solution = solve(solver, systems[name], [rho], [1.0], 0.1 * tolerance)
    # the relative error of the light is the share of flux that is unshot; ten times that is asked for, as it may be
    # uneven. In float64, rounding of sums of 5000 is 1e-13, and 1 / (1 - rho) times that is below either tolerance
    assert np.abs(solution.radiosity * (1 - rho) - 1).max() < tolerance
    assert solution.residuals[-1] <= 0.1 * tolerance


@pytest.mark.parametrize("solver", EXACT_SOLVERS)
@pytest.mark.parametrize("rho", [0.5, 0.99, 0.9999])
def test_one_lit_face_of_a_cube(solver, rho):
    """Exact form factors, given solution: a face's light where the mean is 1 / (6 (1 - rho))."""
    emitted = [1.0, 0, 0, 0, 0, 0]
    solution = solve(solver, cube(), [rho], emitted, 1e-11)
    exact = by_series(cube()[0], np.full(6, rho), emitted)
    # unshot 1e-11 of what was shot, and float64 in sums that 1 / (1 - rho) = 1e4 multiplies
    assert solution.radiosity[:, 1] == pytest.approx(exact, rel=1e-9)
    if rho == 0.99:  # 34-digit LU of the same matrix
        assert solution.radiosity[:3, 0] == pytest.approx(
            (17.362270472597263, 16.527425127721674, 16.527576099920267), rel=1e-9
        )


@pytest.mark.parametrize("solver", EXACT_SOLVERS)
def test_a_port_of_a_hundred_thousandth(solver):
    """Two spheres share 1e-5 of their walls: the second is 1e-5 times as bright."""
    exact = two_spheres_radiosity(1e-5, 0.5)
    assert exact[1] / exact[0] == pytest.approx(9.99990000099999e-6, rel=1e-12)
    solution = solve(solver, two_spheres(1e-5), [0.5], [1.0] * 3 + [0.0] * 3, 1e-11)
    # 1e-11 of the flux unshot, all of it in the second sphere, would be 1e-6 of its light, doubled by reflections
    assert solution.radiosity[:3] == pytest.approx(np.full((3, 3), exact[0]), rel=1e-9)
    assert solution.radiosity[3:] == pytest.approx(np.full((3, 3), exact[1]), rel=4e-6)


def test_a_port_of_a_hundred_thousandth_by_chance():
    """The same by stochastic Jacobi: 2e5 rays of 2e10 find the port, so 1 % is more than four of their deviations."""
    exact = two_spheres_radiosity(1e-5, 0.5)
    solution = solve("stochastic", two_spheres(1e-5), [0.5], [1.0] * 3 + [0.0] * 3, 1e-7, rays=10**10)
    assert solution.radiosity[3:] == pytest.approx(np.full((3, 3), exact[1]), rel=0.01)
    assert solution.radiosity[:3] == pytest.approx(np.full((3, 3), exact[0]), rel=1e-3)


@pytest.mark.parametrize("solver", ["direct", "conjugate-gradient"])
def test_two_rooms_that_absorb_next_to_nothing(solver):
    """Two modes that Jacobi would take 1e5 and 5000 steps for: rho = 0.9999, a port of 1e-3."""
    exact = two_spheres_radiosity(1e-3, 0.9999)
    solution = solve(solver, two_spheres(1e-3), [0.9999], [1.0] * 3 + [0.0] * 3, 1e-9)
    # what is unshot comes to 1e-9 of all light, and both spheres are about as bright
    assert solution.radiosity[:3] == pytest.approx(np.full((3, 3), exact[0]), rel=1e-7)
    assert solution.radiosity[3:] == pytest.approx(np.full((3, 3), exact[1]), rel=1e-7)


@pytest.mark.parametrize(("fraction", "rho"), [(0.01, 0.95), (0.1, 0.99)])
def test_two_bright_rooms_by_chance(fraction, rho):
    """By incremental shooting at 0.95; at 0.99 regular iterations go on until the rooms have stopped to fill up."""
    exact = two_spheres_radiosity(fraction, rho)
    solution = solve("stochastic", two_spheres(fraction), [rho], [1.0] * 3 + [0.0] * 3, 1e-6, rays=10**8)
    # 1e8 rays, 1e6 of which pass the port: 1e-3 of noise, tenfold as rooms exchange light and keep most
    assert solution.radiosity == pytest.approx(np.repeat(np.tile(exact, (3, 1)).T.reshape(6, 1), 3, 1), rel=0.005)


def test_stochastic_says_when_it_has_not_got_there():
    """Balanced fluxes alone would not show it: the second room takes 1e3 iterations to fill up."""
    exact = two_spheres_radiosity(1e-3, 0.9999)
    solution = solve("stochastic", two_spheres(1e-3), [0.9999], [1.0] * 3 + [0.0] * 3, 1e-3, rays=10**8)
    assert solution.radiosity[3, 0] < 0.5 * exact[1]
    assert solution.residuals[-1] > 0.01


def test_progressive_refinement_says_when_it_has_not_got_there():
    """Ambient light is one for the whole scene: what two such rooms differ by is slow, and the bound says so."""
    exact = two_spheres_radiosity(1e-3, 0.9999)
    solution = solve("progressive", two_spheres(1e-3), [0.9999], [1.0] * 3 + [0.0] * 3, 1e-9)
    off = np.abs(solution.radiosity - np.repeat(exact, 3)[:, None]).max()
    assert solution.residuals[-1] > 1e-9
    assert off <= solution.error_bound


@pytest.mark.parametrize("solver", EXACT_SOLVERS)
def test_channels_of_very_different_reflectance(solver):
    """Each channel is as it would be alone, black sides and white ones among them."""
    rng = np.random.default_rng(5)
    system = sphere(rng.uniform(0.1, 2.0, 40))
    reflectance = rng.uniform(0, 1, (40, 3)) * [0.1, 0.9, 0.9999]
    reflectance[:10] = 0.0
    emitted = rng.random((40, 3)) * (rng.random((40, 1)) < 0.5)
    solution = solve(solver, system, reflectance, emitted, 1e-11)
    for channel in range(3):
        exact = by_series(system[0], reflectance[:, channel], emitted[:, channel])
        assert solution.radiosity[:, channel] == pytest.approx(exact, rel=1e-8, abs=1e-10)


@pytest.mark.parametrize("solver", EVERY_SOLVER)
@pytest.mark.parametrize("escaping", [0.0, 0.2])
@pytest.mark.parametrize("rho", [0.5, 0.9999])
def test_the_balance_is_stated_alike(solver, escaping, rho):
    """shot = absorbed + escaped + unshot; what is absorbed and escapes are those of the radiosity itself."""
    matrix, areas = sphere(np.random.default_rng(6).uniform(0.1, 2.0, 30))
    system = (1 - escaping) * matrix, areas
    emitted = (np.arange(30) < 5) * np.linspace(1, 2, 30)
    solution = solve(solver, system, [rho], emitted, 1e-6)
    energy, flux = solution.energy, (areas[:, None] * solution.radiosity).sum()
    assert energy.shot == pytest.approx(3 * (areas * emitted).sum())
    # 1 / (1 - rho) times the rounding; stochastic counts in 2^-62 of the flux
    assert energy.absorbed + energy.escaped + energy.unshot == pytest.approx(energy.shot, rel=1e-9)
    # 1e-6 of the shot flux is not on its way yet; the stochastic radiosity is normalised by its own rays, as what they
    # carried is: it differs by what the last mean changed
    assert energy.escaped == pytest.approx(escaping * flux, rel=1e-4 if solver != "stochastic" else 0.02, abs=1e-9)
    assert energy.absorbed == pytest.approx(
        (1 - rho) * (1 - escaping) * flux, rel=0.02 if solver == "stochastic" else 1e-4
    )


@pytest.mark.parametrize("solver", EXACT_SOLVERS)
@pytest.mark.parametrize("rho", [0.5, 0.99])
def test_the_bound_holds_and_says_something(systems, solver, rho):
    system = systems["L"]
    emitted = (np.arange(len(system[1])) % 17 == 0).astype(float)
    exact = solve("direct", system, [rho], emitted, 0).radiosity
    solution = solve(solver, system, [rho], emitted, 1e-4)
    off = np.abs(solution.radiosity - exact).max()
    assert off <= solution.error_bound + 1e-12
    # the mean light's residual is amplified as the bound says, the rest less: not more than some hundred times
    assert solution.error_bound < 0.05 * exact.max()


@pytest.mark.parametrize("solver", EVERY_SOLVER[1:])
def test_a_room_that_absorbs_nothing_ends_without_a_bound(solver):
    """There is no steady state: the solver ends, and says by residual and bound that it has not found one."""
    solution = solve(solver, cube(), [1.0], [1.0, 0, 0, 0, 0, 0], 1e-3, rays=1 << 12)
    assert np.isfinite(solution.radiosity).all()
    assert solution.residuals[-1] > 0.5
    assert solution.error_bound == np.inf


# ---- through the kernel ----


@pytest.mark.parametrize("room", ["cube", "L"])
@pytest.mark.parametrize("rho", [0.99, 0.9999])
def test_furnace_by_rays(room, rho):
    """A hundred rays a patch at any reflectance: the mean is exact, the pattern as noisy as the rays that land."""
    scene, size = closed_room(room)
    with kernel_of(scene, 2) as kernel:
        patches = subdivide(scene, kernel, size, 10_000, 0)
        emitted = np.tile([[1.0] * 3, [0.0] * 3], (len(patches), 1))
        rays = 128 * len(patches)
        solution = solve_stochastic(
            kernel, np.full(emitted.shape, rho), emitted, patches.side_areas, rays, 1e-3, 0
        )  # fmt: skip
    relative = solution.radiosity[::2] * (1 - rho)
    # the flux balance sets the mean; a ray in ten million may slip through an edge, which 1e4 multiplies
    assert np.average(relative, weights=patches.areas, axis=0) == pytest.approx([1] * 3, rel=5e-3)
    # at least ten iterations of all rays are averaged, and a patch's arrivals are its share by area of those
    noise = 1 / np.sqrt(10 * rays * patches.areas.min() / patches.areas.sum())
    assert np.sqrt(np.mean((relative - 1) ** 2)) < noise
    assert solution.residuals[-1] <= 1e-3
    assert (
        solution.rays < 50 * rays
    )  # two or three windows; incremental shooting would take 1 / (1 - rho) times the first step's
    assert (solution.radiosity[1::2] == 0).all()


@pytest.mark.parametrize("rho", [0.5, 0.99])  # by incremental shooting, and by regular iterations
def test_the_standard_error_is_that_of_the_radiosities(systems, rho):
    """Against a dense solution of the same matrix, RMS error over RMS standard error is near 1."""
    system = systems["L"]
    emitted = (np.arange(len(system[1])) % 17 == 0).astype(float)
    exact = solve("direct", system, [rho], emitted, 0).radiosity
    solution = solve("stochastic", system, [rho], emitted, 1e-4, rays=64 * len(system[1]))
    areas = system[1][:, None]
    found = np.sqrt((areas * (solution.radiosity - exact) ** 2).sum() / (areas * solution.radiosity**2).sum())
    # two replicates: squares of one difference each, averaged over hundreds of patches that are correlated a little
    assert 0.75 < found / solution.relative_standard_error(system[1]) < 1.35


@pytest.mark.parametrize("solver", SOLVERS)
def test_any_number_of_threads_gives_the_same_bytes_from_triangles_to_radiosity(solver):
    scene = room_with_occluder((HIGH_LAMP,), is_open=True)
    found = []
    for threads in (1, 2, 4):
        settings = BakeSettings(solver=solver, error=0.1, patch_size=0.4, threads=threads)
        with kernel_of(scene, threads) as kernel:
            solved = solve_radiosity(scene, kernel, emitters_of(scene, kernel.centre), settings, lambda done: None)
        found.append((solved.solution.radiosity.tobytes(), solved.solution.residuals, solved.solution.energy))
        assert solved.solution.radiosity.any()
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize("solver", SOLVERS[1:])
def test_all_solvers_light_the_cornell_box_alike(solver):
    """From triangles to radiosity: all of them find the flux that direct finds, on patches of one size."""
    scene = cornell_box()
    flux = {}
    for name in ("direct", solver):
        settings = BakeSettings(solver=name, error=0.02, patch_size=0.25, threads=2)
        with kernel_of(scene, 2) as kernel:
            solved = solve_radiosity(scene, kernel, emitters_of(scene, kernel.centre), settings, lambda done: None)
        assert solved.solution.solver == name
        flux[name] = solved.solution.energy.absorbed
    assert flux[solver] == pytest.approx(flux["direct"], rel=0.01)  # noise of 256 rays a row, over hundreds of rows
