"""The scene as arrays: triangles, materials, lights, in world space and metres.

Built by ``addon.blender.read_scene`` from a .blend, or by hand in tests. After the constructor nobody re-checks.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from .environment import Environment
from .ranges import (
    BRIGHTEST,
    LARGEST_COORDINATE,
    SceneError,
    require_colour,
    require_direction,
    require_number,
    require_pixels,
    require_vector,
)

# Between radiances and exitances only these two go: a Lambertian surface of radiance L sends out M = pi L [W/m^2].


def exitance_from_radiance(radiance):
    """M = pi L [W/m^2] of a Lambertian surface of radiance L [W/(m^2 sr)]."""
    return np.pi * np.asarray(radiance)


def radiance_from_exitance(exitance):
    """L = M / pi [W/(m^2 sr)]; of an irradiance E, the E / pi that a bake stores."""
    return np.asarray(exitance) / np.pi


@dataclass(frozen=True, slots=True)
class Texture:
    """An image looked up bilinearly at UVs; row 0 is v = 0.

    Attributes
    ----------
    name : str
    pixels : float32 (height, width, 3), linear Rec.709
    """

    name: str
    pixels: np.ndarray

    def __post_init__(self):
        require_pixels(f"image {self.name}", self.pixels)


@dataclass(frozen=True, slots=True)
class Back:
    """Of a surface's back, what Material says of the front; both look up their textures at the same UVs."""

    reflectance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reflectance_texture: Texture | None = None
    radiance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radiance_texture: Texture | None = None

    def __post_init__(self):
        require_colour("a back", "reflectance", self.reflectance, 1.0)


@dataclass(frozen=True, slots=True)
class Material:
    """A Lambertian surface, or what of one an image leaves; both sides are the same unless ``back`` says otherwise.

    Rays meet it with a chance of 1 less the mean of its transmittance, and pass straight through else.

    Attributes
    ----------
    name : str
    reflectance : (3,) diffuse reflectance rho [0..1] for the light that meets it; multiplies the texture where there
        is one
    reflectance_texture : Texture or None
    radiance : (3,) self-emitted L_e [W/(m^2 sr)], both sides; multiplies the texture where there is one
    radiance_texture : Texture or None
    transmittance : (3,) share of the light that passes straight through [0..1]; (0, 0, 0) = opaque; multiplies the
        texture where there is one
    transmittance_texture : Texture or None
    translucence : (3,) diffuse transmittance [0..1] for the light that meets it, which leaves at the other side: no
        more than is not reflected; multiplies the texture where there is one
    translucence_texture : Texture or None
    back : Back or None, what the back is like where it is not like the front; nothing that is translucent has one
    open_side : "front" or "back": which side all rays pass, as if nothing were there; None = neither
    textures_extend : whether its textures go on beyond UVs of 0 to 1 as at their edges; False = they repeat
    meets_shadow_rays : whether it hides lights; False = they shine through it
    meets_light : whether light that bounces meets it; False = it passes, and nobody sees the surface, which must not
        emit nor scatter light
    """

    name: str
    reflectance: tuple[float, float, float] = (0.8, 0.8, 0.8)
    reflectance_texture: Texture | None = None
    radiance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radiance_texture: Texture | None = None
    transmittance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    transmittance_texture: Texture | None = None
    translucence: tuple[float, float, float] = (0.0, 0.0, 0.0)
    translucence_texture: Texture | None = None
    back: Back | None = None
    open_side: str | None = None
    textures_extend: bool = False
    meets_shadow_rays: bool = True
    meets_light: bool = True

    def __post_init__(self):
        owner = f"material {self.name}"
        require_colour(owner, "reflectance", self.reflectance, 1.0)
        require_colour(owner, "radiance", self.radiance, BRIGHTEST)
        for side in (self, self.of_back):
            brightest = np.array(side.radiance, np.float64)
            if side.radiance_texture is not None:
                brightest = brightest * side.radiance_texture.pixels.max(axis=(0, 1))
            require_colour(owner, "radiance times its texture", brightest, BRIGHTEST)
        if self.open_side not in (None, "front", "back"):
            raise SceneError(f"{owner}: open_side is {self.open_side!r}: allowed are 'front', 'back' and None")
        if self.is_translucent and not (self.open_side is None and self.back is None):
            raise SceneError(f"{owner} is translucent: both of its sides must be the same")
        require_colour(owner, "translucence", self.translucence, 1.0)
        require_colour(owner, "transmittance", self.transmittance, 1.0)
        if self.transmittance_texture is not None:
            most = np.array(self.transmittance, np.float64) * self.transmittance_texture.pixels.max(axis=(0, 1))
            require_colour(owner, "transmittance times its texture", most, 1.0)
        if not self.meets_light and (self.emits or max(*self.reflectance, *self.translucence) > 0):
            raise SceneError(f"{owner} sends on light, which nobody sees")
        if not any((self.reflectance_texture, self.transmittance_texture, self.translucence_texture)):
            self._require_no_gain()

    def _require_no_gain(self):
        passing, scattered = np.array(self.transmittance), np.add(self.reflectance, self.translucence)
        most = ((1 - passing.mean()) * scattered + passing).max()
        if most > 1 + 1e-6:
            raise SceneError(f"material {self.name} sends on {most:.4g} times the light that it gets in a channel")

    @property
    def is_nothing(self) -> bool:
        """Whether all light passes as if it were not there."""
        passes_all = self.transmittance_texture is None and min(self.transmittance) == 1
        scatters = max(*self.reflectance, *self.of_back.reflectance, *self.translucence) > 0
        return passes_all and not scatters and not self.emits

    @property
    def transmits(self) -> bool:
        return max(self.transmittance) > 0

    @property
    def of_back(self) -> Material | Back:
        """What has the back's reflectance and radiance."""
        return self.back or self

    def seen_by(self, shadow_rays: bool, light: bool) -> Material:
        """The material on a surface that hides lights or not, and that light that bounces meets or not."""
        made = replace(self, meets_shadow_rays=self.meets_shadow_rays and shadow_rays)
        if light:
            return made
        nothing = dict.fromkeys(("reflectance", "radiance", "translucence"), (0.0, 0.0, 0.0))
        return replace(made, meets_light=False, back=None, **nothing)

    @property
    def is_opaque(self) -> bool:
        """Whether all rays meet it, and none passes."""
        return not self.transmits and self.open_side is None and self.meets_shadow_rays and self.meets_light

    @property
    def stops_light(self) -> bool:
        """Whether light that bounces meets some of it; what glass does not pass is lost: all rays pass it, tinted."""
        reflects = max(*self.reflectance, *self.of_back.reflectance) > 0
        is_glass = self.transmits and not reflects and not self.is_translucent
        return self.meets_light and not is_glass

    @property
    def passes_colour(self) -> bool:
        """Whether what passes straight has another colour than before."""
        texture = self.transmittance_texture
        is_grey = texture is None or not np.ptp(texture.pixels, axis=2).any()
        return self.transmits and not (is_grey and np.ptp(self.transmittance) == 0)

    @property
    def is_translucent(self) -> bool:
        return max(self.translucence) > 0

    @property
    def emits(self) -> bool:
        return max(*self.radiance, *self.of_back.radiance) > 0


@dataclass(frozen=True, slots=True)
class PointLight:
    """A small sphere, or a point where the radius is 0. I = P / (4 pi).

    ``cone_cosines`` makes it a spot: full inside cos >= cone_cosines[1], none outside cos <= cone_cosines[0],
    smoothstep between; ``direction`` is where it looks. ``soft_falloff``: a disc that always faces the receiver, as
    Cycles does it. ``profile``: what the intensity is multiplied by in each direction, the first channel of what would
    be seen there from the light; None = 1. ``distance_power``: what it gives is multiplied by this power of the
    distance [m]; 0 = the square law. ``cone_metric``: of a cone that is a round one stretched, whose cosine of d is
    d . direction / sqrt(d . metric d); zeros = a round one.
    """

    name: str
    position: tuple[float, float, float]  # [m]
    intensity: tuple[float, float, float]  # I [W/sr]
    radius: float = 0.0  # [m]
    soft_falloff: bool = False
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    cone_cosines: tuple[float, float] = (-2.0, -2.0)
    casts_shadow: bool = True  # False = it shines through everything
    profile: Environment | None = None
    distance_power: float = 0.0
    cone_metric: tuple[float, ...] = (0.0,) * 6  # xx, yy, zz, xy, xz, yz

    def __post_init__(self):
        owner = f"light {self.name}"
        require_vector(owner, "cone_metric", self.cone_metric, LARGEST_COORDINATE, count=6)
        require_vector(owner, "position", self.position)
        require_colour(owner, "intensity", self.intensity, BRIGHTEST)
        require_number(owner, "radius", self.radius, 0.0, LARGEST_COORDINATE)
        require_direction(owner, "direction", self.direction)
        require_vector(owner, "cone_cosines", self.cone_cosines, 2.0, count=2)
        require_number(owner, "distance_power", self.distance_power, 0.0, 2.0)


@dataclass(frozen=True, slots=True)
class AreaLight:
    """A flat emitter that lights the side ``axis_u x axis_v`` looks to, and blocks no light.

    The rectangle centre +- axis_u +- axis_v, or the ellipse with these half axes. ``spread`` < pi narrows the beam:
    L max(0, tan(s/2) - tan(a)) / (tan(s/2) - s/2), a the angle from the normal (Cycles' area light).
    """

    name: str
    centre: tuple[float, float, float]  # [m]
    axis_u: tuple[float, float, float]  # half side [m]
    axis_v: tuple[float, float, float]  # half side [m]
    radiance: tuple[float, float, float]  # L [W/(m^2 sr)]
    is_ellipse: bool = False
    spread: float = 3.141592653589793  # full angle [rad]
    casts_shadow: bool = True

    def __post_init__(self):
        owner = f"light {self.name}"
        for name in ("centre", "axis_u", "axis_v"):
            require_vector(owner, name, getattr(self, name))
        require_colour(owner, "radiance", self.radiance, BRIGHTEST)
        require_number(owner, "spread", self.spread, 0.0, 3.2)


@dataclass(frozen=True, slots=True)
class SunLight:
    """Light from far away. ``irradiance`` at normal incidence; ``angle`` is the full angle of its disc."""

    name: str
    direction: tuple[float, float, float]  # where the light travels to, unit
    irradiance: tuple[float, float, float]  # [W/m^2]
    angle: float = 0.0  # [rad]
    casts_shadow: bool = True

    def __post_init__(self):
        owner = f"light {self.name}"
        require_direction(owner, "direction", self.direction)
        require_colour(owner, "irradiance", self.irradiance, BRIGHTEST)
        require_number(owner, "angle", self.angle, 0.0, 3.2)


@dataclass(frozen=True, slots=True)
class SceneObject:
    """One object (or instance) of the scene: a run of triangles.

    Attributes
    ----------
    name : str
    first, count : its triangles are ``triangles[first : first + count]``
    is_target : whether receivers are placed on it
    polygons : int32 (count,) which polygon of the object's mesh each triangle is part of: a polygon's triangles stay
        together in a chart
    corners : int32 (count, 3) which face corner (Blender: loop) of the object's mesh each triangle corner is
    mesh : name of the mesh, or None; objects of one name share its UVs, and need ``polygons`` and ``corners``
    lightmap_uvs : float32 (count, 3, 2) or None, the existing "Lightmap" UVs, for ``keep_uvs``
    sharp_edges : bool (count, 3) edge k runs from triangle corner k to corner (k + 1) % 3; True = vertex colours are
        not shared across it
    """

    name: str
    first: int
    count: int
    is_target: bool = True
    polygons: np.ndarray | None = None
    corners: np.ndarray | None = None
    mesh: str | None = None
    lightmap_uvs: np.ndarray | None = None
    sharp_edges: np.ndarray | None = None

    def __post_init__(self):
        if self.count < 0:
            raise SceneError(f"object {self.name} has {self.count} triangles")
        shapes = {"polygons": (), "corners": (3,), "lightmap_uvs": (3, 2), "sharp_edges": (3,)}
        for name, shape in shapes.items():
            array, expected = getattr(self, name), (self.count, *shape)
            if array is not None and np.shape(array) != expected:
                raise SceneError(f"object {self.name}: {name}: expected {expected}, got {np.shape(array)}")
        if self.mesh is not None and (self.polygons is None or self.corners is None):
            raise SceneError(f"object {self.name}: one that shares a mesh needs polygons and corners")

    @property
    def span(self) -> slice:
        return slice(self.first, self.first + self.count)


@dataclass(frozen=True, slots=True)
class Scene:
    """Triangles, materials and lights, in world space.

    Single numbers of ``vertices``, ``corner_normals`` and ``uvs`` may be anything, NaN included: what no ray can meet
    is left out of a bake with a warning (sound_faces.py).

    Attributes
    ----------
    vertices : float64 (V, 3) [m]
    triangles : int32 (T, 3) counter-clockwise seen from the front; an object of negative scale is already flipped back
    corner_normals : float32 (T, 3, 3) unit shading normals per corner; equal to the geometric normal where flat shaded
    uvs : float32 (T, 3, 2) texture coordinates; 0 where there are none
    triangle_materials : int32 (T,) index into ``materials``
    objects : runs of triangles, in order, without gaps
    materials : tuple of Material
    lights : tuple of PointLight, AreaLight, SunLight
    world_radiance : (3,) L of the world [W/(m^2 sr)], the same all round; multiplies the environment where there is one
    environment : Environment or None
    warnings : one sentence each, naming the object or material
    """

    vertices: np.ndarray
    triangles: np.ndarray
    corner_normals: np.ndarray
    uvs: np.ndarray
    triangle_materials: np.ndarray
    objects: tuple[SceneObject, ...]
    materials: tuple[Material, ...]
    lights: tuple = ()
    world_radiance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    environment: Environment | None = None
    warnings: tuple[str, ...] = field(default=())

    def __post_init__(self):
        triangle_count = len(self.triangles)
        for name in ("vertices", "triangles", "corner_normals", "uvs", "triangle_materials"):
            array = getattr(self, name)
            if isinstance(array, np.ndarray):  # a view in other strides, which the kernel does not take
                object.__setattr__(self, name, np.ascontiguousarray(array))
        _require_rows("vertices", self.vertices, np.float64, (len(self.vertices), 3))
        _require_rows("triangles", self.triangles, np.int32, (triangle_count, 3))
        _require_rows("corner_normals", self.corner_normals, np.float32, (triangle_count, 3, 3))
        _require_rows("uvs", self.uvs, np.float32, (triangle_count, 3, 2))
        _require_rows("triangle_materials", self.triangle_materials, np.int32, (triangle_count,))
        _require_index("triangles", self.triangles, "vertex", len(self.vertices))
        _require_index("triangle_materials", self.triangle_materials, "material", len(self.materials))
        require_colour("the world", "radiance", self.world_radiance, BRIGHTEST)
        if self.environment is not None:
            brightest = np.array(self.world_radiance, np.float64) * self.environment.pixels.max(axis=(0, 1))
            require_colour("the world", "radiance times its environment", brightest, BRIGHTEST)
        expected = 0
        for obj in self.objects:
            if obj.first != expected:
                raise SceneError(f"object {obj.name} starts at triangle {obj.first}: expected {expected}")
            expected += obj.count
        if expected != triangle_count:
            raise SceneError(f"objects cover {expected} of {triangle_count} triangles")

    @property
    def hides_as_it_shows(self) -> bool:
        """Whether shadow rays and light that bounces meet the same surfaces."""
        return all(material.meets_shadow_rays == material.meets_light for material in self.materials)

    @property
    def corners(self) -> np.ndarray:
        """World positions of the triangles' corners, float64 (T, 3, 3) [m]."""
        return self.vertices[self.triangles]


def _require_rows(name, array, dtype, shape):
    if not isinstance(array, np.ndarray) or array.dtype != dtype or array.shape != shape:
        found = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
        raise SceneError(f"{name}: expected {np.dtype(dtype)} {shape}, got {found}")


def _require_index(name, indices, noun, count):
    bad = (indices < 0) | (indices >= count)
    if bad.any():
        row = int(np.argwhere(bad)[0][0])
        raise SceneError(f"{name}[{row}] names a {noun} outside 0..{count - 1}")
