"""What a person can set: stored with the scene; and how the running bake stands: never stored."""

from math import degrees, radians

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from ..core.settings import BakeSettings

DEFAULTS = BakeSettings()


def _as_shown(number: float) -> float:
    """What a person has set: properties keep 32 bits, in which 180 degrees are more than 180."""
    return float(f"{number:.6g}")


class PATCHLIGHT_PG_settings(bpy.types.PropertyGroup):
    """Bake options of a scene; saved in the .blend."""

    target: EnumProperty(
        name="Target",
        description="Where the light is stored",
        items=(
            ("lightmap", "Lightmap", "An image that all baked objects share, placed by the UV layer 'Lightmap'"),
            (
                "vertex",
                "Vertex Colors",
                "The color attribute 'Patchlight'; needs meshes fine enough to hold the shadows",
            ),
        ),
        default=DEFAULTS.target,
    )
    method: EnumProperty(
        name="Method",
        description="How the light that surfaces exchange is estimated",
        items=(
            ("auto", "Automatic", "Monte Carlo"),
            ("hemicube", "Hemicube", "Classic: project the scene onto the pixels of half a cube above each patch"),
            ("monte-carlo", "Monte Carlo", "Random rays, spread evenly"),
        ),
        default=DEFAULTS.method,
    )
    solver: EnumProperty(
        name="Solver",
        description="How the radiosity of the patches is found",
        items=(
            ("auto", "Automatic", "Choose by the size of the scene and how much it reflects"),
            ("direct", "Direct", "Exact; for small scenes only"),
            ("conjugate-gradient", "Conjugate Gradient", "Exact; for medium scenes, and for very bright materials"),
            ("progressive", "Progressive", "Shoot from the brightest patch first"),
            ("stochastic", "Stochastic", "For large scenes; always uses Monte Carlo rays"),
        ),
        default=DEFAULTS.solver,
    )
    error: FloatProperty(
        name="Error",
        description="Stop when the estimated relative error of the light is below this; half the error takes about "
        "four times as long",
        default=DEFAULTS.error,
        min=0.0001,
        max=1.0,
        soft_min=0.005,
        soft_max=0.2,
        precision=3,
        step=1,
    )
    use_time_limit: BoolProperty(
        name="Time Limit", description="Stop sampling after this time even if the error is not reached yet"
    )
    time_limit: FloatProperty(
        name="Time Limit",
        description="Seconds of sampling",
        default=60.0,
        min=0.1,
        soft_max=3600.0,
        precision=1,
        step=100,
    )
    size_mode: EnumProperty(
        name="Size By",
        description="What decides the size of the lightmap",
        items=(
            ("SIZE", "Size", "A lightmap of about this many pixels on each side"),
            ("DENSITY", "Density", "As many pixels as the surfaces need at this density"),
        ),
        default="SIZE",
    )
    size: IntProperty(
        name="Size",
        description="Pixels on each side of the lightmap, about",
        default=round(DEFAULTS.texels**0.5),
        min=8,
        max=16384,
        subtype="PIXEL",
    )
    density: FloatProperty(
        name="Density",
        description="Lightmap pixels per metre of surface",
        default=64.0,
        min=0.01,
        soft_max=512.0,
        precision=1,
    )
    keep_uvs: BoolProperty(
        name="Keep UVs", description="Use the UV layers 'Lightmap' that the objects have, instead of unwrapping them"
    )
    denoise: BoolProperty(
        name="Denoise",
        description="Let Open Image Denoise, which Blender has, improve the result where measured points say it does",
        default=DEFAULTS.denoise,
    )
    only_selected: BoolProperty(
        name="Selected Only", description="Bake only selected objects; the others still block and reflect light"
    )
    apply_modifiers: BoolProperty(
        name="Apply Modifiers",
        description="Bake objects whose modifiers make new faces, too, and apply these modifiers",
    )
    use_subdivide: BoolProperty(
        name="Subdivide", description="Cut large faces before baking: a wall of one face cannot hold a shadow"
    )
    subdivide: FloatProperty(
        name="Edge Length", description="Faces are cut until no edge is longer", default=0.1, min=0.001, unit="LENGTH"
    )
    smooth_angle: FloatProperty(
        name="Smooth Angle",
        description=(
            "Smooth-shaded faces that meet at a smaller angle share their vertex colors, unless the edge is marked "
            "sharp; flat-shaded faces do where they lie in one plane"
        ),
        default=radians(DEFAULTS.smooth_angle_deg),
        min=0.0,
        max=radians(180.0),
        subtype="ANGLE",
    )
    use_patch_size: BoolProperty(
        name="Patch Size", description="Set the size of the patches by hand instead of by the size of the scene"
    )
    patch_size: FloatProperty(
        name="Patch Size",
        description="Longest edge of the patches that exchange light; smaller is finer and slower",
        default=0.25,
        min=0.001,
        unit="LENGTH",
    )
    seed: IntProperty(name="Seed", description="The same seed gives the same result", default=DEFAULTS.seed, min=0)
    threads: IntProperty(
        name="Threads", description="Processor threads to use; 0 uses all", default=DEFAULTS.threads, min=0, max=1024
    )

    def to_settings(self, metres_per_unit: float) -> BakeSettings:
        """The settings of a bake, whose metres are Blender's units, as in Cycles: those of light, whatever is shown.

        Properties of lengths are kept in these units; what is given per metre is per metre as shown.
        """
        by_density = self.target == "lightmap" and self.size_mode == "DENSITY"
        return BakeSettings(
            target=self.target,
            method=self.method,
            solver=self.solver,
            error=_as_shown(self.error),
            time_limit=_as_shown(self.time_limit) if self.use_time_limit else None,
            texels=self.size * self.size,
            density=_as_shown(self.density) * metres_per_unit if by_density else None,
            keep_uvs=self.target == "lightmap" and self.keep_uvs,
            patch_size=_as_shown(self.patch_size) if self.use_patch_size else None,
            smooth_angle_deg=_as_shown(degrees(self.smooth_angle)),
            denoise=self.denoise,
            seed=self.seed,
            threads=self.threads,
        )

    @property
    def edge_length(self) -> float | None:
        """What to cut faces to [m], None to leave them."""
        return _as_shown(self.subdivide) if self.target == "vertex" and self.use_subdivide else None


class PATCHLIGHT_PG_state(bpy.types.PropertyGroup):
    """How the running bake stands and how the last one ended; lives in the window manager, so no file holds it."""

    is_baking: BoolProperty(options={"SKIP_SAVE"})
    progress: FloatProperty(options={"SKIP_SAVE"})  # [0..1]
    stage: StringProperty(options={"SKIP_SAVE"})
    has_result: BoolProperty(options={"SKIP_SAVE"})
    result_seconds: FloatProperty(options={"SKIP_SAVE"})
    result_error: FloatProperty(options={"SKIP_SAVE"})
    warning_count: IntProperty(options={"SKIP_SAVE"})


def add_to_types():
    """Give every scene its options and the window manager the state."""
    bpy.types.Scene.patchlight = PointerProperty(type=PATCHLIGHT_PG_settings)
    bpy.types.WindowManager.patchlight = PointerProperty(type=PATCHLIGHT_PG_state)


def remove_from_types():
    """Take them away again."""
    del bpy.types.WindowManager.patchlight
    del bpy.types.Scene.patchlight


CLASSES = (PATCHLIGHT_PG_settings, PATCHLIGHT_PG_state)
