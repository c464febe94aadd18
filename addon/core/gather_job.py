"""What every step of a gather shares: the scene's light as far as it is known, and rays into it from receivers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .emitters import LUMINANCE
from .guides import Guides, no_guides
from .kernel import KernelScene
from .radiosity import Solved
from .receivers import Receivers
from .smoothing import TexelGrid
from .texel_light import NO_TEXEL_LIGHT, TexelLight

BLOCK = 1 << 16  # receivers whose replicates are taken apart at once: all would take more memory than all else does
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

    def seeing(self, grid: TexelGrid, direct, gathered) -> GatherJob:
        """The same whose rays see direct and gathered light (N, 3) on the texels."""
        radiosity = (grid.reflectance * (direct + gathered)).astype(np.float32)
        return replace(self, texel_light=self.texel_light.showing(radiosity))

    def direct(self, samples, seed, on_step=None, is_first=True):
        """Direct light of ``samples`` shadow rays each, as KernelScene.direct gives it."""
        return self.kernel.direct(self.solved.sources, self.receivers, samples, seed, on_step, is_first)

    def gather(self, selected, first, take, seed, sums, on_step=None) -> int:
        """Add each of R replicates' rays ``first`` to ``first + take`` to selected receivers' ``sums`` (N, R, 3)."""
        light = (self.solved.patches, self.texel_light, self.solved.sources)
        selected = np.ascontiguousarray(selected, np.uint32)
        return self.kernel.gather(
            *light, self.receivers, self.guides, selected, sums.shape[1], first, take, seed, sums, on_step
        )

    def glimpse(self, count, seed, on_step=None):
        """Light by ``count`` rays of each receiver in all, whatever its error (N, 3), and the rays traced."""
        sums = np.zeros((len(self.receivers), 1, 3), np.float32)
        rays = self.gather(np.arange(len(sums)), 0, count, seed, sums, on_step)
        return sums[:, 0] / np.float32(count), rays

    def gathered(self, count, seed, on_step=None):
        """Light by ``count`` rays of each replicate (N, 3), the variance of its luminance (N,), the rays traced."""
        sums = np.zeros((len(self.receivers), REPLICATES, 3), np.float32)
        rays = self.gather(np.arange(len(sums)), 0, count, seed, sums, on_step)
        return *estimate_of(sums, np.full(len(sums), count)), rays


def estimate_of(sums, taken):
    """What replicates' sums (N, R, 3) of so many rays each (N,) come to: their mean, and what it is uncertain by.

    Values float32 (N, 3), and the variance float64 (N,) of their luminance, by the replicates' spread.
    """
    values, variance = np.empty((len(sums), 3), np.float32), np.empty(len(sums))
    for first in range(0, len(sums), BLOCK):
        block = slice(first, first + BLOCK)
        means = sums[block] / taken[block, None, None].astype(np.float32)
        values[block] = means.mean(axis=1)
        variance[block] = (means @ LUMINANCE).var(axis=1, ddof=1) / means.shape[1]
    return values, variance
