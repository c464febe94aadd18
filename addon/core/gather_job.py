"""What every step of a gather shares: the scene's light as far as it is known, and rays into it from receivers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .gather_sums import GatherSums, no_sums
from .guides import Guides, no_guides
from .kernel import KernelScene
from .radiosity import Solved
from .receivers import Receivers
from .seen_light import SeenLight
from .smoothing import TexelGrid
from .texel_light import NO_TEXEL_LIGHT, TexelLight

REPLICATES = 4  # independent randomisations; their spread is the error estimate


@dataclass(frozen=True, slots=True)
class GatherJob:
    """Receivers, and the light that their rays see.

    Attributes
    ----------
    solved : the patches' reflected light, and what direct light is sampled from
    receivers : (N,)
    weights : float32 (N,) of their squared errors in the mean of all, of a mean of 1
    guides : where their rays go
    texel_light : what rays see where a lightmap's texels are known
    """

    kernel: KernelScene
    solved: Solved
    receivers: Receivers
    weights: np.ndarray
    guides: Guides
    texel_light: TexelLight = NO_TEXEL_LIGHT

    @property
    def seen_light(self) -> SeenLight:
        """What the rays see."""
        return SeenLight(self.solved.patches, self.solved.sources, self.texel_light)

    def part(self, chosen) -> GatherJob:
        """The same for some of the receivers."""
        return replace(
            self,
            receivers=self.receivers.part(chosen),
            weights=self.weights[chosen],
            guides=self.guides.part(chosen),
        )

    def at(self, receivers: Receivers) -> GatherJob:
        """The same light at other receivers."""
        weights = np.ones(len(receivers), np.float32)
        return replace(self, receivers=receivers, weights=weights, guides=no_guides(len(receivers)))

    def looking_further(self, factor) -> GatherJob:
        """The same with less taken for granted of what rays hit."""
        solved = replace(self.solved, patches=self.solved.patches.looking_further(factor))
        return replace(self, solved=solved, texel_light=self.texel_light.looking_further(factor))

    def show(self, grid: TexelGrid, direct, gathered) -> None:
        """From now on rays see direct and gathered light (N, 3) on the texels."""
        self.texel_light.show(grid.reflectance * (direct + gathered))

    def direct(self, samples, seed, on_step=None, is_first=True):
        """Direct light of ``samples`` shadow rays each, as KernelScene.direct gives it."""
        return self.kernel.direct(self.solved.sources, self.receivers, samples, seed, on_step, is_first)

    def gather(self, selected, first, take, seed, sums: GatherSums, on_step=None) -> int:
        """Add each replicate's rays ``first`` to ``first + take`` to the ``sums`` of selected receivers (K,)."""
        where = self.receivers, self.guides, np.ascontiguousarray(selected, np.uint32)
        return self.kernel.gather(self.seen_light, *where, first, take, seed, sums, on_step)

    def glimpse(self, count, seed, on_step=None):
        """Light by ``count`` rays of each receiver in all, whatever its error (N, 3), and the rays traced."""
        sums = no_sums(len(self.receivers), 1)
        rays = self.gather(np.arange(len(sums)), 0, count, seed, sums, on_step)
        return sums.means(count), rays

    def gathered(self, count, seed, on_step=None):
        """Light by ``count`` rays of each replicate (N, 3), the variance of its luminance (N,), the rays traced."""
        sums = no_sums(len(self.receivers), REPLICATES)
        rays = self.gather(np.arange(len(sums)), 0, count, seed, sums, on_step)
        return sums.means(count), sums.variances(count), rays
