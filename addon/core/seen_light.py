"""What gather rays see: the light on patches, on texels where it is known, and the lamps that they sample anew."""

from __future__ import annotations

from typing import NamedTuple

from .emitters import Emitters
from .patch_solution import PatchSolution
from .texel_light import NO_TEXEL_LIGHT, TexelLight


class SeenLight(NamedTuple):
    """The light of native/include/patchlight.h, pl_gather_scene."""

    patches: PatchSolution
    sources: Emitters
    texels: TexelLight = NO_TEXEL_LIGHT

    def arrays(self) -> tuple:
        """In the kernel's order."""
        return self.patches.arrays(), self.texels.arrays(), self.sources.arrays()
