"""The light on a lightmap's own texels, as gather rays see it: finer than any patch."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .kernel import KernelScene
from .receivers import Receivers

LIFT = 0.1  # texels above the surface, where it is looked for what stands on it
SPREAD = 2  # texels that light is blurred over before rays see it
BAND = 256  # rows of the grid at once
BUT_SIGN = np.uint32((1 << 31) - 1)
NO_LIGHT, SPLIT = np.uint64((1 << 64) - 1), np.uint64(1 << 63)
TOUCHING = 2.0  # texels: receivers that are further apart are not neighbours, though their texels are


@dataclass(frozen=True, slots=True)
class TexelLight:
    """What rays take from the fronts that they hit, once it is about known (pl_texel_light of the kernel's header).

    Attributes
    ----------
    uvs : float32 (T, 3, 2) of the scene's triangles' corners, in texels; NaN without a place
    receivers : int32 (height, width) which receiver each texel is, -1 for none
    is_split : bool (height, width) whether rays that hit it go on, from however far they come
    light : uint64 (height, width) reflected radiosity of the texels that was shown last, as the kernel has it [W/m^2]
    reach : rays that hit from nearer go on [m]
    """

    uvs: np.ndarray
    receivers: np.ndarray
    is_split: np.ndarray
    light: np.ndarray
    reach: float

    def show(self, radiosity) -> None:
        """From now on rays see the reflected radiosity float32 (N, 3) of the receivers [W/m^2]."""
        # in place: to all that look, the light last shown is the one that counts, and two images would take the room
        of_all = np.append(packed(radiosity), NO_LIGHT)
        for top in range(0, len(self.light), BAND):
            band = slice(top, top + BAND)
            self.light[band] = of_all[self.receivers[band]]
        self.light[self.is_split] |= SPLIT

    def looking_further(self, factor: float) -> TexelLight:
        """The same for rays that go on from further away."""
        return replace(self, reach=factor * self.reach)

    def arrays(self) -> tuple:
        """In the kernel's order, with the texels in a row (0 where no texel has a light of its own) and the reach."""
        return self.uvs, self.light, self.light.shape[1], self.reach


def texel_light(uvs, receivers, is_split, reach: float) -> TexelLight:
    """Texels without light as yet."""
    return TexelLight(uvs, receivers, is_split, np.full(receivers.shape, NO_LIGHT), reach)


NO_TEXEL_LIGHT = texel_light(
    np.zeros((0, 3, 2), np.float32), np.zeros((0, 0), np.int32), np.zeros((0, 0), bool), reach=0.0
)


def packed(light):
    """Light float32 (N, 3), none below 0, in one number each, uint64 (N,): floats without sign and last 10 bits.

    Rounded to 6e-5 of it, half to either side.
    """
    # the sign of -0.0 must not mark the texel, nor reach into the next channel
    bits = np.ascontiguousarray(light, np.float32).view(np.uint32) & BUT_SIGN
    bits += np.uint32(1 << 9)
    bits >>= np.uint32(10)
    red, green, blue = bits.T
    return red | green.astype(np.uint64) << np.uint64(21) | blue.astype(np.uint64) << np.uint64(42)


def split_where_blocked(kernel: KernelScene, cells, receivers: Receivers, spacing: float):
    """Which texels of a grid ``cells`` of receivers have another receiver's light but not its view: bool (H, W).

    A wall as thin as nothing that stands on a floor keeps a lit texel's light from the dark one beside it, but not from
    rays that hit the lit one's dark half, nor from those that hit where light was blurred over both.
    """
    is_split = np.zeros(cells.shape, bool)
    for top in range(0, len(cells), BAND):
        # with the first row of the next band
        band = slice(top, top + BAND + 1)
        for step in ((1, 0), (0, 1)):
            rows, columns = _blocked(kernel, cells[band], step, receivers, spacing)
            is_split[top + rows, columns] = True
            is_split[top + rows + step[0], columns + step[1]] = True
    return _widened(_widened(is_split, 0), 1) & (cells >= 0)


def _blocked(kernel, cells, step, receivers, spacing):
    """Texels of a band that do not see the one a ``step`` (rows, columns) on: their rows and columns."""
    height, width = cells.shape
    first, second = cells[: height - step[0], : width - step[1]], cells[step[0] :, step[1] :]
    rows, columns = np.nonzero((first >= 0) & (second >= 0))
    one, other = first[rows, columns], second[rows, columns]
    start, end = receivers.positions[one], receivers.positions[other]
    near = ((end - start) ** 2).sum(axis=1) <= (TOUCHING * spacing) ** 2
    start, end = start[near], end[near]
    start += LIFT * spacing * receivers.normals[one[near]]
    end += LIFT * spacing * receivers.normals[other[near]]
    blocked = kernel.occluded(start, end)
    return rows[near][blocked], columns[near][blocked]


def _widened(marks, axis):
    """Marks (H, W), with those up to SPREAD beside them along an axis."""
    padded = np.pad(marks, [(SPREAD, SPREAD) if k == axis else (0, 0) for k in (0, 1)])
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * SPREAD + 1, axis).any(axis=-1)
