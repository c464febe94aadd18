"""Copies of faces, and faces that overlap in their plane, count once."""

import pytest

from addon.core.scene import Material
from tests.physics.lighting import direct_light
from tests.physics.plates import factors, noise
from tests.physics.test_form_factors import C_11
from tests.scenes import rectangle, scene_of


def test_two_copies_of_a_plate_take_what_one_takes_whichever_is_hit():
    upper = rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0), name="upper")
    plates = [rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), name="lower"), upper, upper]
    assert factors(scene_of(plates), to=(1, 2)) == pytest.approx(C_11, abs=noise(C_11, 2 << 16))
    # and a copy of the plate that shoots hides nothing
    assert factors(scene_of([plates[0], upper, plates[0]])) == pytest.approx(C_11, abs=noise(C_11, 2 << 16))


def test_plates_that_overlap_in_a_plane_take_what_their_union_takes():
    first = rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0), name="first")
    second = rectangle((0.5, 0, 1), (0, 1, 0), (1, 0, 0), name="second")
    scene = scene_of([rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), name="lower"), first, second])
    exact = 0.25994218054770134  # of the union, [0, 1.5] x [0, 1]
    assert factors(scene, to=(1, 2)) == pytest.approx(exact, abs=noise(exact, 2 << 16))


@pytest.mark.parametrize("turned", [False, True], ids=["same side", "back to back"])
def test_two_copies_of_a_glowing_face_shine_as_one(turned):
    glow = Material("glow", (0.0,) * 3, radiance=(2.0, 1.0, 0.5))
    one = rectangle((-0.5, -0.5, 1), (0, 1, 0), (1, 0, 0), material=glow)
    other = rectangle((-0.5, -0.5, 1), (1, 0, 0), (0, 1, 0), material=glow) if turned else one
    points = [(0.0, 0.0, 0.0), (0.7, -0.4, 0.0)]
    single, _ = direct_light((), points, (one,))
    double, _ = direct_light((), points, (one, other))
    # the copies' triangles have another diagonal, so other samples of what is not hidden anywhere: closed form
    assert double == pytest.approx(single, rel=1e-5)
