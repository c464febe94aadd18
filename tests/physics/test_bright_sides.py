"""Sides so bright that receivers sample them as lights: the light is the same as when rays have to find them."""

from dataclasses import replace

import numpy as np
import pytest

from addon.core.emitters import emitters_of
from addon.core.gather_job import GatherJob
from addon.core.guides import no_guides
from addon.core.kernel import EVEN_SIDE, LIGHT_SIDE
from addon.core.luminance import LUMINANCE
from addon.core.radiosity import solve_radiosity
from addon.core.receivers import surface_receivers
from addon.core.scene import Material, PointLight
from addon.core.settings import BakeSettings
from addon.core.smoothing import texel_grid
from addon.core.texel_light import NO_TEXEL_LIGHT, texel_light
from addon.core.texels import texels
from addon.core.unwrap import unwrap
from tests.scenes import GREY, box, closed_box, kernel_of, rectangle, scene_of

# a cone of three degrees, straight down: a spot 10 cm wide
SPOT = PointLight("spot", (0.5, 0.5, 0.9), (40.0, 40.0, 40.0), cone_cosines=(0.9984, 0.9986))


def texels_of(scene):
    """A small lightmap's receivers, and what rays need to know of its texels; all light that they see is too near."""
    charts = unwrap(scene, BakeSettings(texels=1024))
    texel_map = texels(charts)
    receivers = surface_receivers(scene, texel_map.triangles, texel_map.barycentrics)
    grid = texel_grid(scene, charts, texel_map, receivers)
    light = texel_light(grid.uvs, grid.receivers, np.zeros(grid.receivers.shape, bool), reach=10.0)
    light.show(np.zeros((len(receivers), 3), np.float32))
    return receivers, light


def box_with_cloth():
    """A closed box, and in the beam a cloth that half of it passes."""
    cloth = Material("cloth", (0.8,) * 3, transmittance=(0.5,) * 3)
    walls = box((0, 0, 0), (1, 1, 1), inwards=True, material=GREY, name="box")
    return scene_of([walls, rectangle((0.2, 0.2, 0.4), (0.6, 0, 0), (0, 0.6, 0), material=cloth)], (SPOT,))


@pytest.mark.parametrize("scene", [closed_box(lights=(SPOT,)), box_with_cloth()], ids=["box", "cloth"])
@pytest.mark.parametrize("has_texels", [False, True], ids=["from patches", "from texel to texel"])
def test_bright_sides_as_lights_give_what_rays_find_of_them(has_texels, scene):
    with kernel_of(scene, 2) as kernel:
        emitters = emitters_of(scene, kernel.centre)
        solved = solve_radiosity(scene, kernel, emitters, BakeSettings(error=0.02), lambda done: None)
        patches = solved.patches
        assert (patches.kinds == LIGHT_SIDE).any()
        receivers, light = texels_of(scene)
        weights, nowhere = np.ones(len(receivers), np.float32), no_guides(len(receivers))
        job = GatherJob(kernel, solved, receivers, weights, nowhere, light if has_texels else NO_TEXEL_LIGHT)
        job = job.part(np.arange(0, len(receivers), 8))
        unlit = replace(patches, kinds=np.where(patches.kinds == LIGHT_SIDE, EVEN_SIDE, patches.kinds).astype(np.uint8))

        def light_of(job, rays):
            return (job.direct(256, 1)[0] + job.gathered(rays, 2)[0]) @ LUMINANCE

        sampled = light_of(job, 2048)
        found = light_of(replace(job, solved=replace(solved, patches=unlit, sources=emitters)), 16384)
    # some hundred receivers with 65536 rays each, of which one in some hundred finds the spot
    assert sampled.mean() == pytest.approx(found.mean(), rel=0.02)
