"""The world's light: what rays see that leave the scene, and suns for what of it is too small for them to find.

A sun is a hundred-thousandth of the sphere and may give more light than all the rest: gather rays would make fireflies
of it, shadow rays know where to look.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .environment import Environment, from_octahedron
from .luminance import LUMINANCE
from .scene import Scene, SunLight, exitance_from_radiance

SIDE = 128  # of the map that rays look up, about a degree a texel: what is finer no diffuse surface shows
TAPS = 8  # along a side of each texel
BRIGHT = 30.0  # times the mean luminance is what a pixel must have to be part of a spot
WIDEST = 0.05  # radians, about three degrees: so far around its brightest pixel a spot reaches
MOST_SPOTS = 256  # that are looked for
MOST_SUNS = 16  # that are taken out of the image, of the spots those of most light
LEAST_SUN = 1e-3  # of all light is what a sun must have; the rest stays in the image


def with_suns(scene: Scene) -> Scene:
    """The same light, with the brightest spots of the scene's environment as suns among its lights."""
    if scene.environment is None or not max(scene.world_radiance) > 0:
        return scene
    environment, suns = _parted(scene.environment, np.array(scene.world_radiance))
    return replace(scene, environment=environment, lights=(*scene.lights, *suns)) if suns else scene


def sky_map(scene: Scene):
    """Pi times the radiance of the world, over an octahedron laid out flat (pl_solution.sky): float32 (n^2, 3)."""
    exitance = np.asarray(exitance_from_radiance(scene.world_radiance), np.float32).reshape(1, 3)
    if scene.environment is None or not exitance.max() > 0:
        return exitance
    rows = [
        scene.environment.seen(_directions(row)).reshape(TAPS, SIDE, TAPS, 3).mean(axis=(0, 2)) for row in range(SIDE)
    ]
    return (exitance * np.concatenate(rows)).astype(np.float32)


def _directions(row):
    """Unit vectors through TAPS^2 places of every texel in a row of the map, (TAPS * SIDE * TAPS, 3)."""
    places = (np.arange(SIDE * TAPS) + 0.5) / (SIDE * TAPS) * 2 - 1
    y, x = (part.ravel() for part in np.meshgrid(places[row * TAPS : (row + 1) * TAPS], places, indexing="ij"))
    return from_octahedron(x, y)


def _parted(environment: Environment, radiance):
    """The environment without its brightest spots, and these as suns."""
    luminance = environment.pixels @ (LUMINANCE * radiance)
    solid_angles = environment.solid_angles
    light = float(luminance.sum(axis=1) @ solid_angles)
    most = BRIGHT * light / (4 * np.pi)
    rows, columns = np.nonzero(luminance > most)
    above = 1 - most / luminance[rows, columns]
    excess = above[:, None] * environment.pixels[rows, columns]
    towards, sizes = environment.directions(rows, columns), solid_angles[rows]
    power = above * luminance[rows, columns] * sizes
    spots = [spot for spot in _spots(towards, power) if power[spot].sum() >= LEAST_SUN * light]
    spots = sorted(spots, key=lambda spot: -power[spot].sum())[:MOST_SUNS]
    suns, pixels = [], environment.pixels.copy()
    for spot in spots:
        irradiance = sizes[spot] @ excess[spot] * radiance
        suns.append(_sun(environment, towards[spot], power[spot], irradiance, sizes[spot].min()))
        pixels[rows[spot], columns[spot]] -= excess[spot].astype(np.float32)
    return replace(environment, pixels=np.maximum(pixels, 0)), tuple(suns)


def _spots(towards, power):
    """Pixels of directions (N, 3) in heaps around those of most power (N,): up to MOST_SPOTS arrays of indices."""
    spots, left = [], np.arange(len(power))
    while len(left) and len(spots) < MOST_SPOTS:
        near = towards[left] @ towards[left[np.argmax(power[left])]] >= np.cos(WIDEST)
        spots.append(left[near])
        left = left[~near]
    return spots


def _sun(environment: Environment, towards, power, irradiance, pixel):
    """One sun for directions (N, 3) of a power (N,): a disc that spreads it as far, and by a ``pixel`` [sr]."""
    centre = power @ towards
    centre /= np.linalg.norm(centre)
    # of a disc's points the mean square distance from its middle is half of its radius squared
    spread = power @ ((towards - centre) ** 2).sum(axis=1) / power.sum()
    radius = np.sqrt(2 * spread + pixel / np.pi)
    return SunLight(
        f"of environment {environment.name}",
        tuple(float(x) for x in -centre),
        tuple(float(x) for x in irradiance),
        float(2 * radius),
    )
