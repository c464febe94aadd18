"""The backs of translucent surfaces: what arrives there shows at the front, so it is gathered as well."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .effort import Effort
from .gather import Irradiance, gather_irradiance
from .kernel import KernelScene
from .receivers import Receivers
from .scene import Scene
from .smoothing import TexelGrid
from .textures import scattered_shares
from .triangles import unit_normals
from .vertex_graph import VertexGraph
from .vertices import BESIDE_CORNERS, vertex_receivers


@dataclass(frozen=True, slots=True)
class Backs:
    """Receivers behind others.

    Attributes
    ----------
    chosen : (M,) the receivers that they are behind
    shares : float32 (M, 3) of the light that these show, how much comes by the back
    receivers, grid : (M,), as those before them
    """

    chosen: np.ndarray
    shares: np.ndarray
    receivers: Receivers
    grid: TexelGrid | VertexGraph


def translucent_backs(
    scene: Scene, kernel: KernelScene, receivers: Receivers, grid: TexelGrid | VertexGraph, smooth_angle_deg: float
) -> Backs | None:
    """The backs of those receivers (N,) that lie on what is translucent; None where none does."""
    is_translucent = np.array([m.is_translucent for m in scene.materials], bool)[scene.triangle_materials]
    if not is_translucent[receivers.triangle_sides // 2].any() or (grid.is_image and grid.translucence is None):
        return None
    if grid.is_image:
        chosen = np.flatnonzero(grid.translucence.any(axis=1))
        before, grid = receivers.part(chosen), grid.part(chosen)
        reflectance, translucence = grid.reflectance, grid.translucence
    else:
        before, own_grid = vertex_receivers(_only_objects_with(scene, is_translucent), kernel, smooth_angle_deg)
        places = np.searchsorted(grid.triangles, own_grid.triangles)
        chosen, grid = (3 * places[:, None] + np.arange(3)).ravel(), own_grid
        beside = np.tile(BESIDE_CORNERS, (len(own_grid.triangles), 1))
        reflectance, translucence = scattered_shares(scene, np.repeat(own_grid.triangles, 3), beside)
    shares = translucence / np.maximum(reflectance + translucence, 1e-30)
    return Backs(chosen, shares.astype(np.float32), _behind(scene, before), grid)


def with_backs(front: Irradiance, backs: Backs, kernel, solved, effort: Effort) -> Irradiance:
    """The irradiance of the fronts, where they are translucent mixed with that of the backs as they show it:
    (rho E_front + tau E_back) / (rho + tau). The error that is seen stays that of the fronts, and
    of seams theirs alone are stitched: what an opaque surface has no part in begins there.
    """
    behind = gather_irradiance(kernel, solved, backs.receivers, backs.grid, None, effort)
    values = front.values.copy()
    values[backs.chosen] += backs.shares * (behind.values - values[backs.chosen])
    return replace(
        front,
        values=values,
        relative_error=max(front.relative_error, behind.relative_error),
        target_reached=front.target_reached and behind.target_reached,
        stopped=front.stopped or behind.stopped,
        rays={stage: rays + behind.rays[stage] for stage, rays in front.rays.items()},
    )


def _only_objects_with(scene: Scene, is_wanted):
    """The scene with those objects as targets of which some triangles are wanted, bool (T,)."""
    objects = [replace(obj, is_target=obj.is_target and bool(is_wanted[obj.span].any())) for obj in scene.objects]
    return replace(scene, objects=tuple(objects))


def _behind(scene: Scene, receivers: Receivers) -> Receivers:
    """The same points in the planes of their triangles, looking the other way: a smooth surface bulges to one side."""
    corners = scene.corners[receivers.triangle_sides // 2]
    normals = unit_normals(corners)
    heights = np.einsum("nc,nc->n", receivers.positions - corners[:, 0], normals)
    positions = receivers.positions - heights[:, None] * normals
    return Receivers(positions, -receivers.normals, receivers.triangle_sides ^ 1)
