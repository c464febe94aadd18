"""The faces that rays can meet: what is not finite, too far away or without an area is left out, and named.

A scene with bad faces is baked as if they had never been there, to the bit; the results are spread over all faces at
the end, so that nobody else has to know.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .ranges import LARGEST_COORDINATE
from .scene import Scene
from .shading_normals import STEEPEST, without_steep_normals

MOST_NAMES = 3  # of objects in one sentence
# Twice the area over the two sides' lengths: the sine between them. Below this it is rounding, in float32 (scene.c).
LEAST_SINE = np.float32(2.4e-7)


@dataclass(frozen=True, slots=True)
class SoundFaces:
    """The scene without its bad faces.

    Attributes
    ----------
    scene : Scene, what is left; its warnings name what is not
    kept : bool (T,) which of the whole scene's triangles are left
    whole : Scene, as it was
    target_faults : a sentence for each fault of a target's faces
    """

    scene: Scene
    kept: np.ndarray
    whole: Scene
    target_faults: tuple[str, ...]

    def spread(self, values):
        """Values per corner of the sound triangles (K, 3, C) -> of all (T, 3, C).

        A face that was left out has the values that its loops have in other triangles of its polygon, or else a value
        of its polygon; NaN where none of it is left.
        """
        if self.kept.all():
            return values
        out = np.full((len(self.kept), *values.shape[1:]), np.nan, values.dtype)
        out[self.kept] = values
        for obj in self.whole.objects:
            if obj.polygons is not None and obj.corners is not None and not self.kept[obj.span].all():
                out[obj.span] = _filled(out[obj.span], self.kept[obj.span], obj.corners, obj.polygons)
        return out


def sound_faces(scene: Scene) -> SoundFaces:
    """The faces of a scene that can be baked, with vertices that no other face has left out as well."""
    corners = scene.corners
    # the largest number of a triangle; NaN stays NaN
    reach = np.abs(corners).max(axis=(1, 2), initial=0.0)
    is_far = reach > LARGEST_COORDINATE
    is_unusable = ~(reach < np.inf)
    kept = ~(is_far | is_unusable)
    kept[kept] = _have_area(corners[kept])
    faults = (
        ("are not finite", is_unusable),
        (f"are farther than {LARGEST_COORDINATE:g} m from the origin", is_far & ~is_unusable),
        ("have no area", ~(kept | is_far | is_unusable)),
    )
    found = [(obj, _warning(obj, what, bad[obj.span])) for what, bad in faults for obj in scene.objects]
    found = [(obj, sentence) for obj, sentence in found if sentence]
    sound = scene if kept.all() else _only(scene, kept)
    sound, more = _finite_attributes(_used_vertices(sound))
    sound, edges = _with_gentle_normals(sound)
    warnings = (*scene.warnings, *(sentence for _, sentence in found), *filter(None, [*more, *edges]))
    target_faults = tuple(sentence for obj, sentence in found if obj.is_target)
    return SoundFaces(replace(sound, warnings=warnings), kept, scene, target_faults)


def _have_area(corners):
    """Which triangles (N, 3, 3) are more than a line, as they are and once they are float32 relative to their middle,
    bool (N,)."""
    if not len(corners):
        return np.zeros(0, bool)
    flat = corners.reshape(-1, 3)
    rounded = (corners - 0.5 * (flat.min(axis=0) + flat.max(axis=0))).astype(np.float32)
    # rounding may open a line as well as close a triangle
    return _are_open(corners) & _are_open(rounded)


def _are_open(corners):
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas, first, second = (np.linalg.norm(v, axis=1) for v in (np.cross(first, second), first, second))
    return areas > LEAST_SINE * first * second


def _warning(obj, what, is_bad):
    count = int(is_bad.sum())
    return f"object {obj.name}: {count} of {obj.count} triangles {what}: they are left out" if count else ""


def _only(scene, kept):
    first, objects = 0, []
    for obj in scene.objects:
        own = kept[obj.span]
        count = int(own.sum())
        arrays = {name: getattr(obj, name) for name in ("polygons", "corners", "lightmap_uvs", "sharp_edges")}
        arrays = {name: array if array is None else np.asarray(array)[own] for name, array in arrays.items()}
        objects.append(replace(obj, first=first, count=count, **arrays))
        first += count
    names = ("triangles", "corner_normals", "uvs", "triangle_materials")
    return replace(scene, objects=tuple(objects), **{name: getattr(scene, name)[kept] for name in names})


def _used_vertices(scene):
    """Without the vertices of no face: they would move the centre that geometry is rounded about."""
    is_used = np.zeros(len(scene.vertices), bool)
    is_used[scene.triangles] = True
    if is_used.all():
        return scene
    numbers = (np.cumsum(is_used) - 1).astype(np.int32)
    return replace(scene, vertices=scene.vertices[is_used], triangles=numbers[scene.triangles])


def _finite_attributes(scene):
    """Corner normals that are no directions become 0, which stands for the face's own; UVs that are not finite 0."""
    warnings = []
    normals, uvs = scene.corner_normals, scene.uvs
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(normals, axis=2)
    is_off = ~(lengths < 2.0)
    if is_off.any():
        normals = np.where(is_off[..., None], np.float32(0), normals)
        warnings += [_attribute_warning(obj, "shading normals", is_off[obj.span]) for obj in scene.objects]
    is_off = ~np.isfinite(uvs).all(axis=2)
    if is_off.any():
        uvs = np.where(is_off[..., None], np.float32(0), uvs)
        warnings += [_attribute_warning(obj, "texture coordinates", is_off[obj.span]) for obj in scene.objects]
    return replace(scene, corner_normals=normals, uvs=uvs), warnings


def _with_gentle_normals(scene):
    normals, is_changed = without_steep_normals(scene)
    names = [obj.name for obj in scene.objects if is_changed[obj.span].any()]
    return replace(scene, corner_normals=normals), _edge_warnings(names, int(is_changed.sum()))


def _edge_warnings(names, count):
    """One for all objects: they may be many, as whole scenes are shaded smooth by a click."""
    if not names:
        return []
    return [
        f"{named(names)}: {count} triangles have "
        f"shading normals more than {STEEPEST:g} degrees off a face, as over sharp edges: they are baked with those of "
        "the faces around them, without such edges"
    ]


def named(names) -> str:
    """Objects as the report calls them in one sentence."""
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return f"object{'s' if len(names) > 1 else ''} {', '.join(names[:MOST_NAMES])}{more}"


def _attribute_warning(obj, what, is_bad):
    count = int(is_bad.any(axis=1).sum())
    return f"object {obj.name}: {what} of {count} triangles are no numbers to use: they are ignored" if count else ""


def _filled(values, kept, loops, polygons):
    """Values (N, 3, C) of one object with those of triangles that were left out taken from their loops or polygons."""
    is_known = np.repeat(kept[:, None], 3, axis=1)
    by_loop = _table(loops[is_known], values[is_known], int(loops.max()) + 1)
    by_polygon = _table(np.repeat(polygons, 3)[is_known.ravel()], values[is_known], int(polygons.max()) + 1)
    found = by_loop[loops]
    found = np.where(np.isnan(found), by_polygon[polygons][:, None], found)
    return np.where(is_known[..., None], values, found)


def _table(keys, rows, count):
    table = np.full((count, rows.shape[1]), np.nan, rows.dtype)
    table[keys] = rows
    return table
