"""How wrong the bake in the open file is, as an artist sees it, at the points of a reference by another program.

A reference (.npz) has, of N points on the evaluated meshes' loop triangles: ``object`` (name, "name#k" for instance k),
``triangle``, ``bary`` (N, 3), ``position`` (N, 3) [m], ``irradiance`` and ``stderr`` (N, 3) [W/m^2], R and s below.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ..core.lightmap import bilinear
from ..core.relative import DARK
from ..core.scene import exitance_from_radiance
from .as_rendered import as_rendered
from .attribute_values import read_values
from .files import FileError
from .image_pixels import read_pixels
from .read_mesh import LIGHTMAP_LAYER
from .rects import in_lightmap, rect_of
from .write_lightmap import IMAGE_PROPERTY

KEYS = ("object", "triangle", "bary", "position", "irradiance", "stderr")
LIT = 1e-4  # of the mean: points below it do not count for the median
SURE = 0.05  # where the reference's own error is larger it judges nothing
MOVED = 1e-5  # of the scene's size: a triangle that is elsewhere is another one


@dataclass(frozen=True, slots=True)
class Score:
    """What a comparison gives.

    Attributes
    ----------
    error : sqrt(mean r^2 - noise^2) over points and channels, r = min(|E - R| / (R + 0.3 M), 1), M the median of the
        lit R: the reference's noise is taken out
    bias : mean of (E - R) / (R + 0.3 M), clipped to -1 ... 1
    missing : share of points without a baked value; each counts as r = 1
    p50, p95 : quantiles of r
    noise : the reference's own, RMS of s / (R + 0.3 M)
    points : scored
    """

    error: float
    bias: float
    missing: float
    p50: float
    p95: float
    noise: float
    points: int


def load_reference(path) -> dict[str, np.ndarray]:
    """The arrays of a reference; raises FileError."""
    try:
        with np.load(path) as file:
            arrays = {key: file[key] for key in KEYS}
    except (OSError, EOFError, ValueError, KeyError) as error:
        raise FileError(f"{path}: is no reference ({error})") from error
    if len({len(array) for array in arrays.values()}) != 1:
        raise FileError(f"{path}: is no reference (its arrays have different lengths)")
    return arrays


def score(reference: dict[str, np.ndarray]) -> Score:
    """Hold the lightmap in the open file against a reference."""
    true, deviation = (reference[key].astype(np.float64) for key in ("irradiance", "stderr"))
    scale = true + DARK * np.median(true[true > LIT * true.mean()])
    found = _baked_irradiance(reference)
    sure = (deviation / scale).max(axis=1) < SURE
    found, true, deviation, scale = (array[sure] for array in (found, true, deviation, scale))
    is_there = np.isfinite(found).all(axis=1)
    signed = np.where(is_there[:, None], np.clip((found - true) / scale, -1, 1), 1.0)
    noise = np.mean((deviation / scale) ** 2)
    return Score(
        error=float(np.sqrt(max(np.mean(signed**2) - noise, 0.0))),
        bias=float(signed.mean()),
        missing=float(1 - is_there.mean()),
        p50=float(np.quantile(np.abs(signed), 0.5)),
        p95=float(np.quantile(np.abs(signed), 0.95)),
        noise=float(np.sqrt(noise)),
        points=int(sure.sum()),
    )


def _baked_irradiance(reference):
    """Irradiance (N, 3) [W/m^2] that a viewer finds at the points, NaN where nothing is baked."""
    found = np.full((len(reference["object"]), 3), np.nan)
    size = np.linalg.norm(np.ptp(reference["position"], axis=0))
    with as_rendered(bpy.context.scene, bpy.context.view_layer):
        return exitance_from_radiance(_looked_up(bpy.context.evaluated_depsgraph_get(), reference, found, size))


def _looked_up(graph, reference, found, size):
    instances = _instances(graph)
    for name in np.unique(reference["object"]):
        if str(name) in instances:
            rows = np.flatnonzero(reference["object"] == name)
            part = {key: array[rows] for key, array in reference.items()}
            found[rows] = _on_object(graph, *instances[str(name)], part, MOVED * size)
    return found


def _instances(graph):
    """Name of the object and matrix (4, 4) by the name that a reference has for an instance."""
    named, counts = {}, {}
    for instance in graph.object_instances:
        evaluated = instance.object
        if evaluated.type != "MESH" or evaluated.original.hide_render:
            continue
        count = counts[evaluated.name] = counts.get(evaluated.name, -1) + 1
        name = f"{evaluated.name}#{count}" if instance.is_instance else evaluated.name
        named[name] = evaluated.name, np.array(instance.matrix_world)
    return named


def _on_object(graph, object_name, matrix, part, allowed):
    """E / pi (K, 3) at points of one object."""
    original = bpy.data.objects[(object_name, None)]
    mesh = original.evaluated_get(graph).data
    layer, image = mesh.uv_layers.get(LIGHTMAP_LAYER), original.get(IMAGE_PROPERTY)
    values = np.full((len(part["triangle"]), 3), np.nan)
    if layer is None or image is None or not len(mesh.loop_triangles):
        return values
    loops = read_values(mesh.loop_triangles, "loops", np.int32, 3)
    vertices = read_values(mesh.loop_triangles, "vertices", np.int32, 3)
    chosen = np.minimum(part["triangle"], len(loops) - 1)
    corners = read_values(mesh.vertices, "co", np.float32, 3)[vertices[chosen]] @ matrix[:3, :3].T + matrix[:3, 3]
    points = np.einsum("nk,nkc->nc", part["bary"], corners)
    uvs = np.einsum("nk,nkc->nc", part["bary"], read_values(layer.uv, "vector", np.float32, 2)[loops[chosen]])
    looked_up = bilinear(read_pixels(image)[..., :3], in_lightmap(uvs, rect_of(original)))
    is_same = np.linalg.norm(points - part["position"], axis=1) <= allowed
    values[is_same] = looked_up[is_same]
    return values
