"""A picture of a baked scene, lit by nothing but the bake.

Everything happens in a scene of its own, made of copies: the scene that is shown, its materials, lights and world are
not touched, and the copies are gone afterwards. No light is copied; every surface only emits what the bake and its own
material say. So whatever is bright in the picture is bright in the bake, or a mirror of it: rays bounce from what is
smooth only, and only where that is asked for.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np

from ..core.luminance import LUMINANCE
from .as_rendered import as_rendered
from .image_pixels import read_pixels, write_pixels
from .picture_materials import Light, LitMaterials
from .read_mesh import BAKED_COLOURS, LIGHTMAP_LAYER
from .rects import in_lightmap, rect_of
from .visibility import Visibility
from .write_lightmap import IMAGE_PROPERTY, set_lightmap_uvs

COPIED = ("color", "pass_index", "visible_camera", "visible_glossy", "visible_transmission")  # that materials see
LONGER_SIDE = 960  # pixels
MOST_BOUNCES = 512
THROUGH = 16  # surfaces of glass, two of a pane
MIDDLE_GREY = 0.20  # radiance that the median of the picture is exposed to: dark corners open, sun patches keep shape


class PictureError(ValueError):
    """A scene that cannot be shown; the message says what is missing."""


def size_of(scene) -> tuple[int, int]:
    """Width and height of a picture that has the shape of the scene's renders."""
    sides = scene.render.resolution_x, scene.render.resolution_y
    width, height = (max(round(LONGER_SIDE * side / max(sides)), 1) for side in sides)
    return width, height


def render(path_png, width=960, height=540, samples=16, view_transform="AgX", exposure=None, bounces=0):
    """Render the current scene's bake through its camera into an 8-bit PNG.

    Parameters
    ----------
    samples : rays per pixel; they only smooth edges, as nothing here is random but the place within the pixel, and
        which way a ray goes on that has two
    view_transform : of Blender's colour management, e.g. "AgX", "Standard", "Raw"
    exposure : stops; None = chosen so that the median of the picture becomes a middle grey
    bounces : reflections by mirrors or within glass, of which the last shows glass black; rays pass through as many
        surfaces of glass and THROUGH more. 0 = all surfaces as the bake lights them, glass without refraction

    PictureError where the scene has no camera or nothing that is baked.
    """
    source = bpy.context.scene
    if not 0 <= bounces <= MOST_BOUNCES:
        raise PictureError(f"bounces is {bounces}: a picture has from 0 to {MOST_BOUNCES}")
    if source.camera is None:
        raise PictureError(f"scene {source.name} has no camera")
    copy = _SceneCopy(source, bounces > 0)
    try:
        copy.fill()
        scene = copy.scene
        if not copy.is_baked:
            raise PictureError(f"scene {source.name} has nothing to show: no object that is rendered has a bake")
        _set_up(scene, view_transform, bounces)
        if exposure is None:
            exposure = _automatic_exposure(scene, width, height)
        scene.view_settings.exposure = exposure
        _render(scene, path_png, width, height, samples, "PNG")
    finally:
        copy.remove()


class _SceneCopy:
    """A scene of its own that shows every renderable mesh of another one, wearing lit materials."""

    def __init__(self, source, is_traced):
        self._materials = LitMaterials(is_traced)
        self._meshes = []
        self._root = bpy.data.objects.new("picture", None)
        self._objects = [self._root]
        self.is_baked = False
        self.scene = bpy.data.scenes.new(f"{source.name} picture")
        self.scene.camera = source.camera
        self.scene.world = source.world
        self.scene.collection.objects.link(source.camera)
        self.scene.collection.objects.link(self._root)

    def fill(self):
        """Copy everything that a render shows."""
        with as_rendered(bpy.context.scene, bpy.context.view_layer):
            meshes = self._evaluated_meshes()
        for shown in meshes:
            self._add(*shown)

    def _evaluated_meshes(self):
        """(object, mesh copy, world matrix, materials) of all that a render shows; the iterator's entries die."""
        depsgraph = bpy.context.evaluated_depsgraph_get()
        visibility = Visibility(bpy.context.view_layer)
        shown = []
        for instance in depsgraph.object_instances:
            if instance.object.type != "MESH" or not visibility.shows(instance):
                continue
            evaluated = instance.object
            mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
            self._meshes.append(mesh)
            materials = [slot.material.original if slot.material else None for slot in evaluated.material_slots]
            shown.append((evaluated.original, mesh, instance.matrix_world.copy(), materials or [None]))
        return shown

    def _add(self, original, mesh, matrix, materials):
        light = _light_of(original, mesh)
        self.is_baked |= light != Light()
        for index, material in enumerate(materials):
            lit = self._materials.lit(material, light)
            if index < len(mesh.materials):
                mesh.materials[index] = lit
            else:
                mesh.materials.append(lit)
        obj = bpy.data.objects.new(original.name, mesh)
        # no object of its own can be sheared, a child's place can
        obj.parent, obj.matrix_parent_inverse = self._root, matrix
        for kind in COPIED:
            setattr(obj, kind, getattr(original, kind))
        for key in original.keys():
            if isinstance(original[key], float | int | str) or hasattr(original[key], "typecode"):
                obj[key] = original[key]
        self.scene.collection.objects.link(obj)
        self._objects.append(obj)

    def remove(self):
        """Take everything out of the file that was put in."""
        bpy.data.scenes.remove(self.scene)
        for obj in self._objects:
            bpy.data.objects.remove(obj)
        for mesh in self._meshes:
            bpy.data.meshes.remove(mesh)
        self._materials.remove()


def _light_of(obj, mesh):
    """Where the object's baked light is; its place in a shared atlas goes into the mesh copy's UVs."""
    image = obj.get(IMAGE_PROPERTY)
    layer = mesh.uv_layers.get(LIGHTMAP_LAYER)
    if image is not None and not isinstance(image, bpy.types.Image):
        raise PictureError(f"object {obj.name}: its property {IMAGE_PROPERTY} is no image")
    if image is not None and layer is not None:
        uvs = np.empty(len(mesh.loops) * 2, np.float32)
        layer.uv.foreach_get("vector", uvs)
        set_lightmap_uvs(mesh, in_lightmap(uvs.reshape(-1, 2), rect_of(obj)))
        return Light(image=image)
    if BAKED_COLOURS in mesh.color_attributes:
        return Light(attribute=BAKED_COLOURS)
    return Light()


def _set_up(scene, view_transform, bounces):
    try:
        scene.render.engine = "CYCLES"
    except TypeError as error:
        raise PictureError("pictures need Blender's add-on Cycles Render Engine, which is off") from error
    cycles = scene.cycles
    cycles.device = "CPU"
    # after its last bounce a ray still sees what shines, which is all that there is to see
    cycles.glossy_bounces = max(bounces - 1, 0)
    cycles.max_bounces = cycles.transmission_bounces = bounces - 1 + THROUGH if bounces else 0
    cycles.diffuse_bounces = cycles.volume_bounces = 0
    cycles.sample_clamp_indirect = 0.0
    cycles.transparent_max_bounces = 32
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    scene.view_settings.view_transform = view_transform
    scene.view_settings.look = "AgX - Medium High Contrast" if view_transform == "AgX" else "None"
    scene.view_settings.gamma = 1.0
    scene.render.use_compositing = False
    scene.render.use_sequencer = False


def _render(scene, path, width, height, samples, file_format):
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.cycles.samples = samples
    scene.render.image_settings.file_format = file_format
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.color_depth = "32" if file_format == "OPEN_EXR" else "8"
    scene.render.use_file_extension = False
    scene.render.filepath = str(Path(path).resolve())
    bpy.ops.render.render(write_still=True, scene=scene.name)


def _automatic_exposure(scene, width, height):
    """Stops that bring the median luminance of the picture to a middle grey."""
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "small.exr")
        _render(scene, path, max(width // 4, 1), max(height // 4, 1), 4, "OPEN_EXR")
        image = bpy.data.images.load(path)
        luminance = read_pixels(image)[..., :3] @ LUMINANCE
        bpy.data.images.remove(image)
    lit = luminance[luminance > 0]
    return float(np.log2(MIDDLE_GREY / np.median(lit))) if len(lit) else 0.0


def save_lightmap_png(image, path):
    """Write a lightmap as an 8-bit PNG to look at: light and dark compressed, hue kept.

    The brightness L / (1 + L), with L = 1 at the median of the lit texels, shows shadow and sun patch together.
    """
    light = np.nan_to_num(np.maximum(read_pixels(image)[..., :3], 0))
    luminance = light @ LUMINANCE
    lit = luminance[luminance > 0]
    scaled = light / (np.median(lit) if len(lit) else 1.0)
    shown = scaled / (1 + scaled @ LUMINANCE)[..., None]

    png = bpy.data.images.new("lightmap to look at", *image.size)
    try:
        write_pixels(png, _srgb(np.clip(shown, 0, 1)))
        png.file_format = "PNG"
        png.filepath_raw = str(Path(path).resolve())
        png.save()
    finally:
        bpy.data.images.remove(png)


def _srgb(linear):
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
