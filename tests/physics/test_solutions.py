"""The radiosity of patches, by every solver: furnace, energy, linearity, seeds, threads."""

import numpy as np
import pytest

from addon.core.dense import solve_direct
from addon.core.patches import subdivide
from addon.core.progressive import solve_progressive
from addon.core.radiosity import UNSHOT_LIMIT
from addon.core.scene import Material
from addon.core.stochastic import solve_stochastic
from addon.core.transport import HemicubeFormFactors, MonteCarloFormFactors
from tests.scenes import box, closed_box, cornell_box, kernel_of, rectangle, room_with_occluder, scene_of

RAYS = 1024  # of a row of form factors
SHOT_RAYS = 1 << 18  # of stochastic's first step
CHOICES = ["direct", "progressive", "stochastic", "direct by hemicube"]


def solve(scene, choice, emitted=None, reflectance=None, seed=0, threads=1, size=0.25, limit=UNSHOT_LIMIT):
    """Patches and Solution; by default every side emits 1 in front and nothing at its back."""
    with kernel_of(scene, threads) as kernel:
        patches = subdivide(scene, kernel, size, 10_000, seed)
        if emitted is None:
            emitted = np.tile([[1.0] * 3, [0.0] * 3], (len(patches), 1))
        elif callable(emitted):
            emitted = emitted(patches)
        rho = patches.side_reflectance if reflectance is None else np.full((2 * len(patches), 3), reflectance)
        if choice == "stochastic":
            solution = solve_stochastic(kernel, rho, emitted, patches.side_areas, SHOT_RAYS, limit, seed)
            return patches, solution
        estimator = MonteCarloFormFactors(kernel, RAYS, seed)
        if choice == "direct by hemicube":
            estimator = HemicubeFormFactors(kernel, 12, 4, seed)
        if choice == "progressive":
            return patches, solve_progressive(estimator, rho, emitted, patches.side_areas, limit)
        rows = estimator.rows(np.arange(kernel.side_count))
        return patches, solve_direct(rows, rho, emitted, patches.side_areas)


def noise_of_arrivals(patches, choice):
    """Relative standard deviation of what a patch receives when independent rays land on it in proportion to area."""
    if choice.startswith("direct"):
        return 0.0  # a row sums to 1 whatever its entries are
    rays = SHOT_RAYS if choice == "stochastic" else RAYS * len(patches)
    return 1 / np.sqrt(rays * patches.met.min() / patches.met.sum())


def one_lit_wall(patches):
    """Emission of the fronts of the first triangle's patches."""
    emitted = np.zeros((2 * len(patches), 3))
    emitted[::2][patches.triangles == 0] = (3.0, 2.0, 1.0)
    return emitted


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("rho", [0.5, 0.8])
def test_furnace(choice, rho):
    """In a closed box of one emission and reflectance, B = M / (1 - rho) everywhere."""
    patches, solution = solve(closed_box(size=(1, 1.5, 0.8)), choice, reflectance=rho)
    exact = 1 / (1 - rho)
    fronts = solution.radiosity[::2]
    mean = np.average(fronts, weights=patches.areas, axis=0)
    # what is not shot yet would add at most limit / (1 - rho) of the first flux
    assert mean == pytest.approx([exact] * 3, abs=UNSHOT_LIMIT * exact + 1e-4)
    # each patch: the reflected part with the noise of all bounces, less than rho / (1 - rho) times one bounce's
    sigma = rho * exact * noise_of_arrivals(patches, choice)
    assert np.sqrt(np.mean((fronts - exact) ** 2)) < sigma + UNSHOT_LIMIT * exact + 1e-4
    assert (solution.radiosity[1::2] == 0).all()  # no light gets behind the walls


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("scene", [cornell_box(), room_with_occluder()], ids=["cornell", "occluder"])
def test_what_is_shot_is_absorbed_or_escapes_or_is_not_shot_yet(choice, scene):
    _, solution = solve(scene, choice, one_lit_wall)
    energy = solution.energy
    assert energy.shot > 0
    assert energy.absorbed > 0
    assert energy.escaped > 0
    # float64 sums; stochastic counts in 2^-62 of the flux, rounded down a ray
    assert energy.absorbed + energy.escaped + energy.unshot == pytest.approx(energy.shot, rel=1e-6)
    # a dense system leaves nothing unshot, but its sampled form factors are reciprocal to their noise only, about 1 %
    limit = 0.01 if choice.startswith("direct") else 1.001 * UNSHOT_LIMIT
    assert abs(energy.unshot) <= limit * energy.shot


@pytest.mark.parametrize("choice", ["progressive", "stochastic"])
def test_tinted_glass_takes_its_share_in_the_balance(choice):
    """A glass pane that absorbs half of what passes: the balance holds for scenes with glass, too."""
    pane = rectangle(
        (0, 0, 0.5), (1, 0, 0), (0, 1, 0), material=Material("glass", (0, 0, 0), transmittance=(0.5, 0.5, 0.5))
    )
    plates = [rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0))]
    _, solution = solve(scene_of([*plates, pane]), choice, one_lit_wall)
    energy = solution.energy
    assert energy.absorbed + energy.escaped + energy.unshot == pytest.approx(energy.shot, rel=1e-6)


@pytest.mark.parametrize("choice", CHOICES)
def test_a_closed_box_lets_nothing_escape(choice):
    _, solution = solve(closed_box(), choice, one_lit_wall)
    # float32 sums of rows; stochastic counts exactly
    assert solution.energy.escaped == pytest.approx(0, abs=1e-5 * solution.energy.shot)


@pytest.mark.parametrize("choice", CHOICES)
def test_twice_the_emission_is_twice_the_light(choice):
    _, once = solve(closed_box(), choice, one_lit_wall)
    _, twice = solve(closed_box(), choice, lambda patches: 2 * one_lit_wall(patches))
    # the same rays carry twice as much, and a factor 2 rounds nothing
    assert (twice.radiosity == 2 * once.radiosity).all()


@pytest.mark.parametrize("choice", ["direct", "progressive"])
def test_the_light_of_two_emitters_is_the_sum_of_their_lights(choice):
    def other(patches):
        emitted = np.zeros((2 * len(patches), 3))
        emitted[::2][patches.triangles == 7] = (0.5, 1.0, 4.0)
        return emitted

    alone = [solve(closed_box(), choice, emitted, limit=1e-7)[1].radiosity for emitted in (one_lit_wall, other)]
    _, both = solve(closed_box(), choice, lambda patches: one_lit_wall(patches) + other(patches), limit=1e-7)
    # the same form factors; progressive leaves 1e-7 of the flux, on 12 triangles of half a square metre
    assert both.radiosity == pytest.approx(alone[0] + alone[1], abs=1e-5)


@pytest.mark.parametrize("choice", CHOICES)
def test_channels_do_not_mix(choice):
    def red(patches):
        return one_lit_wall(patches) * [1, 0, 0]

    _, solution = solve(closed_box(), choice, red)
    assert (solution.radiosity[:, 0] > 0).any()
    assert (solution.radiosity[:, 1:] == 0).all()


@pytest.mark.parametrize("choice", CHOICES)
def test_any_number_of_threads_gives_the_same_bytes(choice):
    first, *others = (solve(cornell_box(), choice, one_lit_wall, threads=threads)[1] for threads in (1, 2, 4))
    for other in others:
        assert other.radiosity.tobytes() == first.radiosity.tobytes()
        assert other.residuals == first.residuals


@pytest.mark.parametrize("choice", CHOICES)
def test_the_same_seed_gives_the_same_bytes_and_another_seed_other_ones(choice):
    first, again, other = (solve(cornell_box(), choice, one_lit_wall, seed=seed)[1].radiosity for seed in (3, 3, 4))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


@pytest.fixture(scope="module")
def solutions():
    """The box with one lit wall by every solver, at four seeds."""
    scene = closed_box()
    found = {
        choice: [solve(scene, choice, one_lit_wall, seed=s, limit=1e-5)[1].radiosity for s in range(4)]
        for choice in CHOICES
    }
    return solve(scene, "stochastic", one_lit_wall)[0], found


@pytest.mark.parametrize("choice", CHOICES[1:])
def test_all_solvers_find_the_same_light(solutions, choice):
    patches, found = solutions
    first, second = (np.array(found[c])[:, ::2, 0] for c in ("direct", choice))
    difference = first.mean(axis=0) - second.mean(axis=0)
    noise = np.sqrt((first.var(axis=0, ddof=1) + second.var(axis=0, ddof=1)) / 4)
    # both sides are estimated over some hundred patches; a hemicube's fixed pixels leave a little more
    assert np.sqrt(np.mean(difference**2)) < 1.5 * np.sqrt(np.mean(noise**2)) + 1e-4
    areas = patches.areas
    # the flux of all patches together is known better: 1 % bounds the noise of each solver's four means
    assert np.average(second.mean(axis=0), weights=areas) == pytest.approx(
        np.average(first.mean(axis=0), weights=areas), rel=0.01
    )


@pytest.mark.parametrize("choice", CHOICES)
def test_a_wall_of_no_thickness_keeps_its_sides_apart(choice):
    """Two rooms that share one plane, light in one: not a photon in the other."""
    left = box((0, 0, 0), (1, 1, 1), inwards=True, without=("+x",), name="lit room")
    right = box((1, 0, 0), (2, 1, 1), inwards=True, without=("-x",), name="dark room")
    scene = scene_of([left, right, rectangle((1, 0, 0), (0, 1, 0), (0, 0, 1), name="partition")])
    patches, solution = solve(scene, choice, one_lit_wall)
    partition = len(scene.triangles) - 2
    in_right = (patches.triangles >= 10) & (patches.triangles < partition)
    assert (solution.radiosity[::2][in_right] == 0).all()
    front, back = (solution.radiosity[side::2][patches.triangles >= partition] for side in (0, 1))
    assert (front == 0).all()  # looks at the dark room
    assert (back > 0).any()
