"""The light on a lightmap's own texels, as gather rays see it: finer than any patch."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, slots=True)
class TexelLight:
    """What rays take from the fronts that they hit, once it is about known (pl_texel_light of the kernel's header).

    Attributes
    ----------
    uvs : float32 (T, 3, 2) of the scene's triangles' corners, in texels; NaN without a place
    receivers : int32 (height, width) which receiver each texel is, -1 for none
    radiosity : float32 (N, 3) reflected radiosity of the receivers [W/m^2]
    reach : rays that hit from nearer go on [m]
    """

    uvs: np.ndarray
    receivers: np.ndarray
    radiosity: np.ndarray
    reach: float

    def looking_further(self, factor: float) -> TexelLight:
        """The same for rays that go on from further away."""
        return replace(self, reach=factor * self.reach)

    def arrays(self) -> tuple:
        """In the kernel's order, with the texels in a row (0 where no texel has a light of its own) and the reach."""
        return self.uvs, self.receivers, self.radiosity, self.receivers.shape[1], self.reach


NO_TEXEL_LIGHT = TexelLight(
    np.zeros((0, 3, 2), np.float32), np.zeros((0, 0), np.int32), np.zeros((0, 3), np.float32), 0.0
)
