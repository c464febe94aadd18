"""Scenes with exact light, for benches: what is asked of a solver, or of a bake, and the truth to hold it against.

Truth comes from closed forms and analytic form factors, never from rays. Two kinds, as two things are asked:

- the *system* of a scene's patches, one radiosity each, from their analytic form factors: what a solver may reach;
- the *irradiance at points*, of the continuum: what a bake may reach.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .analytic import exchange_among, exchanges
from .bench_cube import cube_irradiance
from .bodies import sphere
from .case_scene import box, l_room
from .closed_forms import two_surfaces
from .dense import solve_direct
from .patches import Patches, patch_triangles
from .polygon import are_coplanar, distinct_corners, unit_normal
from .quadrature import fan
from .scene import Material, Scene, SceneObject, radiance_from_exitance
from .triangles import triangle_areas, unit_normals

WHOLE = 1e30  # a patch size at which every triangle is one patch [m]
PORTS = (0.1, 0.2)  # area fractions that the two spheres' common port takes of each
SPHERE_RHO = (0.7, 0.5)
ROOM_RHO = 0.5


@dataclass(frozen=True, slots=True)
class ExactScene:
    """A scene and its truth.

    Attributes
    ----------
    name : str
    scene : one material per reflectance; what is lit emits M = 1 W/m^2
    patch_size : of the system that solvers are given [m]
    emitted : float64 (T,) M of each triangle's front [W/m^2]
    system : Patches -> exact radiosity of the fronts, float64 (P,) [W/m^2]
    irradiance : points (N, 3), triangles (N,) -> exact irradiance, float64 (N,) [W/m^2]; None where none is known
    parts : int64 (T,), surfaces of which only the mean irradiance is exact; None where it is at every point
    """

    name: str
    scene: Scene
    patch_size: float
    emitted: np.ndarray
    system: Callable[[Patches], np.ndarray]
    irradiance: Callable[[np.ndarray, np.ndarray], np.ndarray] | None
    parts: np.ndarray | None = None


def exact_scene(name: str) -> ExactScene:
    """The scene of this name, one of SCENES."""
    return SCENES[name]()


def _cube() -> ExactScene:
    """A closed cube with one glowing face, in patches of 0.5 m; convex, so that nothing hides anything."""
    polygons = [face.pieces[0] for face in box((0, 0, 0), (1, 1, 1))]
    scene, emitted = _scene(polygons, np.full(6, ROOM_RHO), np.arange(6) == 0)

    def factors(corners, k):
        others = np.array([j for j in range(len(corners)) if not are_coplanar(corners[j], corners[k])])
        row = np.zeros(len(corners))
        row[others] = exchanges(distinct_corners(corners[k]), corners[others])
        return row

    return ExactScene(
        "cube", scene, 0.5, emitted,
        lambda patches: _solved(scene, patches, emitted, factors),
        lambda points, triangles: cube_irradiance(points, triangles // 2, ROOM_RHO),
    )  # fmt: skip


def _l_room() -> ExactScene:
    """A room with an L for a floor, one end wall glowing, each triangle one patch: an arm of it is partly hidden."""
    polygons = [surface.pieces for surface in l_room()]
    pieces = [piece for part in polygons for piece in part]
    is_lit = np.array([k == 3 for k, part in enumerate(polygons) for _ in part])
    scene, emitted = _scene(pieces, np.full(len(pieces), ROOM_RHO), is_lit)
    # only what has some of the room behind it can hide anything: the two walls of the inner corner
    hiding = [p for p in pieces if ((scene.vertices - p[0]) @ unit_normal(p)).min() < -1e-9]

    def factors(corners, k):
        row = np.zeros(len(corners))
        for j in range(k):
            first, second = (distinct_corners(corners[i]) for i in (k, j))
            others = [p for p in hiding if not are_coplanar(p, first) and not are_coplanar(p, second)]
            row[j] = 0.0 if are_coplanar(first, second) else exchange_among(first, second, others)
        return row

    return ExactScene(
        "l-room", scene, WHOLE, emitted, lambda patches: _solved(scene, patches, emitted, factors, True), None
    )


def _spheres(rings: int = 12, sides: int = 24) -> ExactScene:
    """Two spheres that share a circular port, the first one glowing.

    The port and the cap that it replaces are seen under the same form factor from all of a sphere's wall, so its light
    is the same everywhere. The panels are flat: the mean of their light differs from it by the square of their size,
    that of panels at the port more.
    """
    first = 1.0
    second = first * np.sqrt(PORTS[0] * (1 - PORTS[0]) / (PORTS[1] * (1 - PORTS[1])))
    panels = [_open_sphere(r, f, rings, sides, up) for r, f, up in zip((first, second), PORTS, (True, False))]
    owners = np.repeat([0, 1], [len(part) for part in panels])
    rho = np.array(SPHERE_RHO)
    scene, emitted = _scene([*panels[0], *panels[1]], rho[owners], owners == 0)
    form_factors = ((1 - PORTS[0], PORTS[0]), (PORTS[1], 1 - PORTS[1]))
    radiosity = np.array(two_surfaces(form_factors, SPHERE_RHO, (1.0, 0.0)))
    triangle_owners = scene.triangle_materials.astype(np.int64)
    irradiance = (radiosity - (1.0, 0.0)) / rho
    return ExactScene(
        "spheres", scene, WHOLE, emitted,
        lambda patches: radiosity[triangle_owners[patches.triangles]],
        lambda points, triangles: irradiance[triangle_owners[triangles]],
        triangle_owners,
    )  # fmt: skip


SCENES = {"cube": _cube, "l-room": _l_room, "spheres": _spheres}


def _open_sphere(radius, fraction, rings, sides, is_below):
    """Panels of a sphere seen from inside, its port in z = 0 and the rest below or above."""
    edge = np.arccos(1 - 2 * fraction)
    wall = sphere("wall", radius, np.linspace(edge, np.pi, rings + 1), sides, True, -radius * np.cos(edge))
    panels = [distinct_corners(panel) for ring in wall.rings for panel in ring.panels]
    return panels if is_below else [(panel * (1, 1, -1))[::-1] for panel in panels]


def _scene(polygons, rho, is_lit):
    """The core scene of convex polygons, seen from their fronts, and M of its triangles (T,)."""
    kinds = sorted(set(zip(rho, is_lit)), key=lambda kind: (not kind[1], -kind[0]))
    materials = tuple(
        Material(f"rho {r:g}", (r,) * 3, radiance=(float(radiance_from_exitance(float(lit))),) * 3) for r, lit in kinds
    )
    material = [kinds.index(kind) for kind in zip(rho, is_lit)]
    fans = [fan(polygon) for polygon in polygons]
    corners = np.concatenate(fans)
    owners = np.repeat(np.arange(len(fans)), [len(part) for part in fans])
    normals = unit_normals(corners)
    vertices, triangles = np.unique(corners.reshape(-1, 3).round(12), axis=0, return_inverse=True)
    scene = Scene(
        vertices=vertices,
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        corner_normals=np.repeat(normals[:, None], 3, axis=1).astype(np.float32),
        uvs=np.zeros((len(corners), 3, 2), np.float32),
        triangle_materials=np.array(material, np.int32)[owners],
        objects=(SceneObject("room", 0, len(corners), polygons=owners.astype(np.int32)),),
        materials=materials,
    )
    return scene, np.asarray(is_lit, np.float64)[owners]


# ---- the systems' truth ----


def _solved(scene, patches, emitted, exchange_row, is_lower=False):
    """Exact radiosity (P,) of the patches' fronts; ``exchange_row(corners, k)`` is A_k F_kj, of all j or of j < k."""
    corners = _polygons(scene, patches)
    found = np.stack([exchange_row(corners, k) for k in range(len(corners))])
    found = found + found.T if is_lower else found
    factors = found / patches.areas[:, None]
    columns = (patches.reflectance[:, :1], emitted[patches.triangles][:, None])
    return solve_direct(factors, *columns, patches.areas).radiosity[:, 0]


def _polygons(scene, patches):
    """Corners of all patches, float64 (P, 4, 3) [m]; those at an apex repeat one."""
    halves, _ = patch_triangles(scene, patches, np.arange(len(patches)))
    first, second = halves.reshape(2, len(patches), 3, 3)
    return np.concatenate([first, second[:, 2:]], axis=1)


def even_points(scene: Scene, count: int, seed: int):
    """Some ``count`` random points by area: triangles int32 (N,), barycentrics float64 (N, 3)."""
    rng = np.random.default_rng(seed)
    areas = triangle_areas(scene.corners)
    triangles = np.sort(rng.choice(len(areas), count, p=areas / areas.sum())).astype(np.int32)
    return triangles, rng.dirichlet((1, 1, 1), count)
