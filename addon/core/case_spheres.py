"""Cases whose quantity is the radiosity of spheres: zones, caps, openings, ports, one inside another."""

from __future__ import annotations

import numpy as np

from . import case_scene as scenes
from .bodies import disk, sphere
from .case_factors import concentric_matrix
from .case_solutions import pair, solve, solved
from .cases import Case, CaseError
from .transport import Estimate


def zones_case(case: Case, estimator) -> Estimate:
    """Irradiance in a sphere, the same everywhere, and B per zone: params rows of area fraction, rho, E."""
    key = next((k for k in case.params if k.startswith("zones")), None)
    if key is None:
        raise CaseError("no zones are given")
    shares, rho, emitted = case.numbers(key).T
    irradiance, radiosity = _zones(shares, rho, emitted, estimator)
    if case.quantity.startswith("irradiance"):
        return solved([irradiance, *radiosity])
    return solved(radiosity)


def _zones(shares, rho, emitted, estimator):
    zones = [
        sphere(f"zone{k}", 1.0, angles, scenes.SPHERE_SIDES, looks_in=True)
        for k, angles in enumerate(scenes.zone_angles(shares))
    ]
    areas = np.array([zone.area for zone in zones])
    found = estimator.body_matrix(zones)
    radiosity = solve(found.value, rho, emitted, areas)
    return areas @ (found.value @ radiosity) / areas.sum(), radiosity


def lit_cap_case(case: Case, estimator) -> Estimate:
    """``B wall, B cap``: a sphere of which a cap of area fraction f emits."""
    f, rho = case.number("f"), case.number("rho")
    _, radiosity = _zones([f, 1 - f], np.array([rho, rho]), np.array([case.number("E", 1.0), 0.0]), estimator)
    wall_first = case.quantity.lower().find("wall") < case.quantity.lower().find("cap")
    return solved(radiosity[::-1] if wall_first else radiosity)


def cavity_case(case: Case, estimator) -> Estimate:
    """Sphere without a cap of area fraction f, E = 1 - rho: B of the wall, escaped over emitted power, emissivity."""
    f, rho = case.number("f"), case.number("rho")
    emitted = case.number("E", 1 - rho)
    wall, opening = _sphere_with_port(1.0, f)
    found = estimator.body_matrix([wall, opening])
    areas = np.array([wall.area, opening.area])
    radiosity = solve(found.value, np.array([rho, 0.0]), np.array([emitted, 0.0]), areas)
    leaving = found.value[1, 0] * radiosity[0]
    return solved([radiosity[0], areas[1] * leaving / (areas[0] * emitted), leaving * (1 - rho) / emitted])


def _sphere_with_port(radius, fraction):
    """A sphere without its cap at the top, and the polygon that closes it, both seen from inside."""
    edge = np.arccos(1 - 2 * fraction)
    angles = np.linspace(edge, np.pi, scenes.SPHERE_RINGS + 1)
    wall = sphere("wall", radius, angles, scenes.SPHERE_SIDES, looks_in=True)
    return wall, disk("port", radius * np.sin(edge), radius * np.cos(edge), scenes.SPHERE_SIDES, looks_up=False)


def port_case(case: Case, estimator) -> Estimate:
    """Two spheres that share a circular port, B1, B2 and B2 / B1.

    What enters the port from one side leaves it on the other, diffuse, as the light of a sphere is the same everywhere:
    each side of the port radiates the irradiance of the other.
    """
    f = [case.number("f1"), case.number("f2")]
    radii = [case.number("R1", 1.0), case.number("R2", np.sqrt(f[0] * (1 - f[0]) / (f[1] * (1 - f[1]))))]
    rho, emitted = pair(case, "rho"), pair(case, "E")
    system, areas = np.zeros((4, 4)), np.zeros(4)
    reflectance, emission = np.ones(4), np.zeros(4)
    for k in range(2):
        bodies = _sphere_with_port(radii[k], f[k])
        found = estimator.body_matrix(list(bodies)).value
        wall, port, behind = 2 * k, 2 * k + 1, 2 * (1 - k) + 1
        areas[[wall, port]] = [body.area for body in bodies]
        system[wall, wall], system[wall, port] = found[0]
        # irradiance of this side of the port is what its other side radiates
        system[behind, wall] = found[1, 0]
        reflectance[wall], emission[wall] = rho[k], emitted[k]
    radiosity = solve(system, reflectance, emission, areas)
    return solved([radiosity[0], radiosity[2], radiosity[2] / radiosity[0]])


def concentric_case(case: Case, estimator) -> Estimate:
    """``B inner, B outer`` of concentric spheres r1, r2."""
    r1, r2 = case.number("r1", 1.0), case.number("r2", 2.0)
    found = concentric_matrix(r1, r2, estimator)
    return solved(solve(found.value, pair(case, "rho"), pair(case, "E"), np.array([r1**2, r2**2])))
