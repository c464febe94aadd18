"""Thousands of scenes by chance, baked whole: an error that names the thing, or light that is light.

A few hundred in `make test`, ten thousand in `make fuzz`.
"""

import faulthandler
import os
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from hypothesis import event, given
from hypothesis import strategies as st

from addon.core.bake import bake
from addon.core.packing import MOST_TEXELS
from addon.core.patches import triangle_areas
from addon.core.scene import SceneError
from addon.core.settings import BakeSettings, SettingsError
from addon.core.sound_faces import sound_faces
from tests.random_scenes import scenes

HANG = 120  # [s]; the slowest of these bakes takes a few, so this is no bake but a loop without an end
ONE_EACH, MANY_PATCHES = 1e9, 1000  # [m]: a triangle is one patch; about so many are cut at the most
ROUTES = (
    ("auto", "auto"),
    ("monte-carlo", "stochastic"),
    ("monte-carlo", "progressive"),
    ("monte-carlo", "direct"),
    ("hemicube", "progressive"),
    ("hemicube", "direct"),
)


@st.composite
def bake_settings(draw):
    method, solver = draw(st.sampled_from(ROUTES))
    return BakeSettings(
        target=draw(st.sampled_from(("lightmap", "vertex"))),
        method=method,
        solver=solver,
        error=draw(st.sampled_from((0.5, 1.0))),
        texels=draw(st.sampled_from((64, 256, 1024))),
        density=draw(st.sampled_from((None, None, None, 1e-9, 3.0, 1e9))),
        keep_uvs=draw(st.sampled_from((False, False, True))),
        patch_size=draw(st.sampled_from((ONE_EACH, ONE_EACH, 0.5))),
        smooth_angle_deg=draw(st.sampled_from((0.0, 30.0, 180.0))),
        seed=draw(st.sampled_from((0, 1, (1 << 32) - 1))),
        threads=1,
    )


@contextmanager
def watched():
    """A test that hangs cannot fail: the process ends with a traceback of all threads instead."""
    terminal = int(os.environ["PATCHLIGHT_TEST_STDERR"])  # tests/conftest.py
    faulthandler.dump_traceback_later(HANG, exit=True, file=terminal)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


@given(scene=scenes(), asked=bake_settings())
def test_any_mesh_bakes_to_light_or_is_refused_by_name(scene, asked):
    result, refusal = bake_or_refusal(scene, affordable(scene, asked))
    event("refused" if refusal else "baked")
    if refusal:
        assert refusal.split()[0] in {"nothing", "object", "density", "texels", "solver"}
    else:
        require_light(scene, result)
        require_named(scene, result.report)


def affordable(scene, asked):
    """Without a density or a patch size that is allowed, but too slow to do ten thousand times.

    Millions of texels; a hundred thousand patches, which a closed room that absorbs nothing needs hundreds of times.
    """
    sound = sound_faces(scene).scene
    wanted = np.array([obj.is_target for obj in sound.objects for _ in range(obj.count)], bool)
    areas = triangle_areas(sound.corners)
    texels = areas[wanted].sum() * (asked.density or 0) ** 2
    if 1e4 < texels < 4 * MOST_TEXELS:
        asked = replace(asked, density=None)
    return replace(asked, patch_size=ONE_EACH) if areas.sum() > MANY_PATCHES * asked.patch_size**2 else asked


def bake_or_refusal(scene, asked):
    """The result, or else the message."""
    # a number that is lost on the way is a bug, even where it does no harm at the end
    with watched(), np.errstate(over="raise", divide="raise", invalid="raise"):
        try:
            return bake(scene, asked), None
        except (SceneError, SettingsError) as error:
            return None, str(error)


def require_light(scene, result):
    """No value is NaN, infinite or negative, and every sound face of a target has one."""
    kept = sound_faces(scene).kept
    wanted = np.zeros(len(scene.triangles), bool)
    for obj in scene.objects:
        wanted[obj.span] = obj.is_target
    if result.lightmap is not None:
        pixels, uvs = result.lightmap.pixels, result.lightmap.uvs
        assert np.isfinite(pixels).all()
        assert (pixels >= 0).all()
        placed = uvs[wanted & kept]
        assert np.isfinite(placed).all()
        assert ((placed >= 0) & (placed <= 1)).all()
    else:
        colours = result.corner_colours
        assert np.isfinite(colours[wanted & kept]).all()
        assert (np.nan_to_num(colours) >= 0).all()
        assert np.isnan(colours[~wanted]).all()
    assert np.isfinite(result.report.estimated_error)
    assert result.report.estimated_error >= 0
    energy = result.report.energy
    assert np.isfinite([energy.shot, energy.absorbed, energy.escaped, energy.unshot]).all()


def require_named(scene, report):
    """Every object that lost faces is named with their number."""
    kept = sound_faces(scene).kept
    for obj in scene.objects:
        lost = int((~kept[obj.span]).sum())
        named = [w for w in report.warnings if w.startswith(f"object {obj.name}: ") and "are left out" in w]
        assert sum(int(w.split(": ")[1].split()[0]) for w in named) == lost
