"""What a bake comes upon that looks fine in every number: objects without light, without texels, UVs that overlap."""

from __future__ import annotations

import numpy as np

from .charts import Charts
from .receivers import Receivers
from .scene import Scene
from .sound_faces import named
from .texels import TexelMap
from .triangles import triangle_areas

MOST_SHARE, FEW_TEXELS = 0.9, 64  # of the texels that one object may take while most others have no more than so few
LEAST_OWNED = 0.8  # of the texels that an object's UVs cover: it has more, along the rims of charts, where none overlap
FLAT = 1e-6  # square texels, the area in UVs of a triangle that has none,
MOST_FLAT = 0.01  # and the share of an object's surface that such may have


def of_texels(scene: Scene, charts: Charts, texel_map: TexelMap, keeps_uvs: bool) -> tuple[str, ...]:
    """Sentences about how a lightmap's texels are shared out."""
    targets = [obj for obj in scene.objects if obj.is_target and obj.count]
    owned = _counts(targets, texel_map.triangles)
    return (*_crowded_out(targets, owned), *(_unfit_uvs(scene, charts, targets, owned) if keeps_uvs else ()))


def of_light(scene: Scene, receivers: Receivers, values) -> tuple[str, ...]:
    """A sentence about targets that no light at all reaches, while others have some; ``values`` (N, 3) irradiance."""
    targets = [obj for obj in scene.objects if obj.is_target and obj.count]
    triangles = receivers.triangle_sides // 2
    owned, lit = _counts(targets, triangles), _counts(targets, triangles[values.any(axis=1)])
    dark = [obj.name for obj, some, light in zip(targets, owned, lit) if some and not light]
    if not dark or len(dark) == np.count_nonzero(owned):
        return ()
    return (f"{named(dark)}: no light reaches the side that its normals look to, it is black",)


def _counts(targets, triangles):
    """How many of ``triangles`` (N,) each object has."""
    starts, counts = np.array([obj.first for obj in targets]), np.array([obj.count for obj in targets])
    places = np.searchsorted(starts, triangles, side="right") - 1
    is_own = triangles < (starts + counts)[places]
    return np.bincount(places[is_own], minlength=len(targets))


def _crowded_out(targets, owned):
    largest = int(np.argmax(owned))
    others = np.delete(owned, largest)
    if len(others) and owned[largest] > MOST_SHARE * owned.sum() and np.median(others) <= FEW_TEXELS:
        yield (
            f"object {targets[largest].name}: takes {owned[largest] / owned.sum():.0%} of the lightmap's texels, most "
            f"others have {int(np.median(others))} or fewer: bake it apart from them"
        )


def _unfit_uvs(scene, charts, targets, owned):
    overlapping, flat, surfaces = [], [], triangle_areas(scene.corners)
    for obj, texels in zip(targets, owned):
        uvs = charts.uvs[obj.span].astype(np.float64)
        covered = triangle_areas(np.pad(uvs, ((0, 0), (0, 0), (0, 1))))
        surface = surfaces[obj.span]
        if texels < LEAST_OWNED * covered.sum():
            overlapping.append(obj.name)
        if surface[covered <= FLAT].sum() > MOST_FLAT * surface.sum():
            flat.append(obj.name)
    if overlapping:
        yield f"{named(overlapping)}: the UV layer 'Lightmap' overlaps itself or others: one light stands for several"
    if flat:
        yield f"{named(flat)}: the UV layer 'Lightmap' has no area on faces that have some: one light stands for each"
