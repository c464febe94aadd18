"""Cases whose quantity is the radiosity of rooms of polygons: form factors by the estimator, then the direct solver."""

from __future__ import annotations

import functools
import re

import numpy as np

from . import case_scene as scenes
from .analytic import Surface, cut_overlaps, exchanges, surface, without
from .cases import NUMBER, Case, CaseError
from .dense import solve_direct
from .polygon import clip, extent, fault_of, heights_above, unit_normal
from .transport import Estimate


def solve(form_factors, reflectance, emitted, areas):
    """Radiosity (N,) [W/m^2] by the direct solver, one channel."""
    reflectance, emitted = (np.broadcast_to(np.asarray(x, float), len(areas))[:, None] for x in (reflectance, emitted))
    return solve_direct(form_factors, reflectance, np.ascontiguousarray(emitted), np.asarray(areas)).radiosity[:, 0]


def solved(values, stated: float = 0.01) -> Estimate:
    """Results of a solve; how wrong they may be is not stated entry by entry but as a share."""
    values = np.asarray(values, np.float64)
    return Estimate(values, np.zeros_like(values), stated * np.abs(values))


def _areas(surfaces):
    return np.array([s.area for s in surfaces])


# ---- rooms of polygons ----


def furnace_case(case: Case, estimator) -> Estimate:
    """``B everywhere``, E and rho the same on all faces: in the case's own room, or cube, tetrahedron, L-room."""
    rho = case.number("rho")
    emitted = case.number("E", 1 - rho)
    scene = scenes.case_scene(case)
    if scene.surfaces:
        # what stands in a furnace glows like its walls, on both sides
        backs = [Surface(s.name, tuple(piece[::-1] for piece in s.pieces)) for s in scene.blockers]
        room = [*scene.surfaces.values(), *scene.blockers, *backs]
        rooms = [(estimator.matrix(room).value, _areas(room))]
    else:
        rooms = _closed_rooms(estimator)
    return solved(np.concatenate([solve(factors, rho, emitted, areas) for factors, areas in rooms]))


@functools.lru_cache(maxsize=1)
def _closed_rooms(estimator):
    """Form factors and areas of three closed rooms, the same for every reflectance."""
    rooms = (scenes.box((0, 0, 0), (1, 1, 1)), scenes.tetrahedron(), scenes.l_room())
    return [(estimator.matrix(room).value, _areas(room)) for room in rooms]


def faces_case(case: Case, estimator) -> Estimate:
    """``B per face``: a closed room, its own or a box that the quantity names, params rho and E per face."""
    surfaces, blockers = _room_of(case)
    rho, emitted = case.numbers("rho"), case.numbers("E")
    found = estimator.matrix(surfaces, blockers)
    return solved(solve(found.value, rho, emitted, _areas(surfaces)))


def zero_albedo_case(case: Case, estimator) -> Estimate:
    """``B-E`` where rho = 0."""
    surfaces, blockers = _room_of(case, default="cube")
    emitted = 1.0 + np.arange(len(surfaces))
    found = estimator.matrix(surfaces, blockers)
    return solved(np.abs(solve(found.value, 0.0, emitted, _areas(surfaces)) - emitted).max())


def _room_of(case, default=""):
    scene = scenes.case_scene(case)
    surfaces = list(scene.surfaces.values()) or scenes.room_named(f"{case.quantity} {case.id} {default}")
    if not surfaces:
        raise CaseError("no room is given")
    return surfaces, scene.blockers


def pinhole_case(case: Case, estimator) -> Estimate:
    """Furnace in a cube with a square hole in one face: B of the opposite face, of the rest of that face, of the walls,
    and the power that escapes."""
    rho = case.number("rho", 0.9)
    emitted = case.number("E", 1 - rho)
    scene = scenes.case_scene(case)
    cube = scenes.box((0, 0, 0), (1, 1, 1))
    hole = scene.surfaces.get("hole") or _square_hole(case.number("s"))
    frames = [without(face, hole) if _lies_in(hole, face) else face for face in cube]
    pierced = next(k for k, (a, b) in enumerate(zip(frames, cube)) if a is not b)
    surfaces = [*frames, hole]
    found = estimator.matrix(surfaces)
    reflectance, emission = np.full(7, rho), np.full(7, emitted)
    reflectance[6] = emission[6] = 0.0
    radiosity = solve(found.value, reflectance, emission, _areas(surfaces))
    walls = [k for k in range(6) if k // 2 != pierced // 2]
    escaped = hole.area * (found.value[6] @ radiosity)
    return solved([radiosity[pierced ^ 1], radiosity[pierced], radiosity[walls].mean(), escaped])


def _square_hole(size):
    a, b = 0.5 - size / 2, 0.5 + size / 2
    return surface("hole", [(a, a, 1), (a, b, 1), (b, b, 1), (b, a, 1)])


def _lies_in(hole, face):
    return len(cut_overlaps([hole, face])[1].pieces) > 1


def slit_case(case: Case, estimator) -> dict:
    """A room lit through a slit in its partition, behind which all is black with radiosity 1: mean irradiance and
    radiosity per face, irradiance at points."""
    scene = scenes.case_scene(case)
    names = list(scene.surfaces)
    slit = scene.named("slit")
    faces = [scene.surfaces[n] for n in names if n != "slit"]
    faces = [without(face, slit) if _lies_in(slit, face) else face for face in faces]
    surfaces = [*faces, slit]
    found = estimator.matrix(surfaces, scene.blockers)
    count, out = len(faces), {}
    for key, expected in case.exact.items():
        if key.startswith("H_direct"):
            out[key] = solved(found.value[:count, count])
        elif key.startswith("B_rho"):
            rho = np.full(count + 1, float(re.sub(r"^0", "0.", key[len("B_rho") :])))
            rho[count] = 0.0
            emitted = np.zeros(count + 1)
            emitted[count] = 1.0
            out[key] = solved(solve(found.value, rho, emitted, _areas(surfaces))[:count])
        elif key.startswith("H_points"):
            points = _points_of(case, len(expected))
            seen = [estimator.element(p, _normal_at(p, faces), slit, scene.blockers) for p in points]
            out[key] = Estimate(*(np.array([getattr(s, part) for s in seen]) for part in Estimate.__slots__))
        else:
            raise CaseError(f"result {key!r} is not understood")
    return out


def _points_of(case, count):
    words = " ".join(str(p) for p in case.params.get("points", ()))
    triple = rf"\(\s*({NUMBER})\s*,\s*({NUMBER})\s*,\s*({NUMBER})\s*\)"
    points = np.array(re.findall(triple, words.replace("[", "(").replace("]", ")")), float).reshape(-1, 3)
    if len(points) != count:
        raise CaseError(f"{count} points are wanted and {len(points)} are given")
    return points


def _normal_at(point, faces):
    for face in faces:
        for piece in face.pieces:
            inward = np.cross(unit_normal(piece), np.roll(piece, -1, axis=0) - piece)
            depth = ((point - piece) * inward).sum(axis=1)
            size = extent(piece)
            if abs((point - piece[0]) @ unit_normal(piece)) < 1e-9 * size and (depth >= -1e-9 * size**2).all():
                return unit_normal(piece)
    raise CaseError(f"the point {tuple(float(x) for x in point)} lies on no face")


def divided_rooms_case(case: Case, estimator) -> Estimate:
    """``max B in room 2``: two boxes on either side of a wall, a furnace in room 1, no emission in room 2.

    A floor that reaches through both is split at the wall, as a mesher must.
    """
    scene = scenes.case_scene(case)
    wall = next((s for name, s in scene.surfaces.items() if "wall" in name), None)
    if wall is None:
        raise CaseError("no wall is given")
    rho = case.number("rho", 0.5)
    thicknesses = case.numbers("thickness") if "thickness" in case.params else [0.0]
    floors = [s for s in scene.surfaces.values() if s is not wall]
    largest = [_light_behind(wall, floors, float(t), rho, estimator) for t in thicknesses]
    return solved(max(largest))


def _light_behind(wall, floors, thickness, rho, estimator):
    corners = np.concatenate([p for s in [wall, *floors] for p in s.pieces])
    normal = unit_normal(wall.pieces[0])
    axis = int(np.argmax(np.abs(normal)))
    low, high, place = corners.min(axis=0), corners.max(axis=0), wall.pieces[0][0, axis]
    reach = np.ptp(corners, axis=0).max()
    if high[axis] - low[axis] < 1e-9 * reach:
        low[axis], high[axis] = place - reach, place + reach
    top, bottom = high.copy(), low.copy()
    top[axis], bottom[axis] = place - thickness / 2, place + thickness / 2
    rooms = [_with_floors(scenes.box(*ends), floors) for ends in ((low, top), (bottom, high))]
    surfaces = rooms[0] + rooms[1]
    lit = np.arange(len(surfaces)) < len(rooms[0])
    found = estimator.matrix(surfaces, [wall])
    radiosity = solve(found.value, rho, np.where(lit, 1 - rho, 0.0), _areas(surfaces))
    return radiosity[~lit].max()


def _with_floors(faces, floors):
    """The faces of a box, those that coincide with a given floor replaced by the part of the floor over them."""
    out = []
    for face in faces:
        parts = [
            part for floor in floors for piece in floor.pieces for part in [_common(piece, face.pieces[0])] if len(part)
        ]
        out.append(Surface(face.name, tuple(parts)) if parts else face)
    return out


def _common(piece, face):
    if heights_above(piece, face[0], unit_normal(face)).any() or unit_normal(piece) @ unit_normal(face) < 0:
        return np.empty((0, 3))
    inward = np.cross(unit_normal(face), np.roll(face, -1, axis=0) - face)
    for origin, normal in zip(face, inward / np.linalg.norm(inward, axis=1, keepdims=True)):
        piece = clip(piece, heights_above(piece, origin, normal))
        if not len(piece) or fault_of(piece):
            return np.empty((0, 3))
    return piece


def plates_case(case: Case, estimator) -> Estimate:
    """``B1,B2`` of infinite parallel plates: square plates a million times as wide as their gap."""
    rho, emitted = pair(case, "rho"), pair(case, "E")
    plates = [
        surface("1", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]),
        surface("2", [(0, 0, 1e-6), (0, 1, 1e-6), (1, 1, 1e-6), (1, 0, 1e-6)]),
    ]
    return solved(solve(estimator.matrix(plates).value, rho, emitted, _areas(plates)))


def pair(case: Case, name: str):
    """A parameter of two surfaces, as one list or as name1, name2."""
    if name in case.params:
        return case.numbers(name)
    return np.array([case.number(f"{name}1"), case.number(f"{name}2")])


# ---- the limit of fine elements ----


def continuum_case(case: Case, estimator) -> Estimate:
    """Mean B of the faces of a cube, one of them lit, in the limit of small elements: of three sizes by Aitken's rule.

    In the order lit, opposite, around (once, or for each face).
    """
    rho, emitted = case.number("rho"), case.number("E", 1.0)
    coarse, middle, fine = (_cube_means(count, rho, emitted, estimator) for count in (2, 4, 8))
    step, next_step = middle - coarse, fine - middle
    limit = fine - next_step**2 / (next_step - step)
    return solved(limit[[0, 1, *[2] * (np.size(case.exact) - 2)]])


def _cube_means(count, rho, emitted, estimator):
    cells = [cell for face in scenes.box((0, 0, 0), (1, 1, 1)) for cell in _grid(face.pieces[0], count)]
    if estimator.name != "analytic":
        raise CaseError("the limit of small elements is left to the analytic method")
    panels, face = np.array(cells), np.repeat(np.arange(6), count * count)
    area = 1 / count**2
    factors = np.zeros((len(panels), len(panels)))
    for k, panel in enumerate(panels):
        others = np.flatnonzero(face != face[k])
        factors[k, others] = exchanges(panel, panels[others]) / area
    radiosity = solve(factors, rho, np.where(face == 0, emitted, 0.0), np.full(len(panels), area))
    means = radiosity.reshape(6, -1).mean(axis=1)
    return np.array([means[0], means[1], means[2:].mean()])


def _grid(corners, count):
    a, b, _, d = corners
    u, v = (b - a) / count, (d - a) / count
    return [a + i * u + j * v + np.array([0 * u, u, u + v, v]) for i in range(count) for j in range(count)]
