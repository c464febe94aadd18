"""A baked lightmap -> UV layers, one float image, and the pointers from objects to it."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.scene import SceneError
from .image_pixels import write_pixels
from .read_mesh import LIGHTMAP_LAYER
from .rects import WHOLE, in_mesh, set_rect

IMAGE_NAME = "Patchlight Lightmap"
IMAGE_PROPERTY = "patchlight_lightmap"
MOST_LAYERS = 8


def require_layer_room(name, mesh) -> None:
    """SceneError where the object's mesh cannot take one more UV layer of that name."""
    if LIGHTMAP_LAYER in mesh.uv_layers:
        return
    if LIGHTMAP_LAYER in mesh.attributes:
        raise SceneError(f"'{name}' has an attribute '{LIGHTMAP_LAYER}' that is no UV map: rename it to bake")
    if len(mesh.uv_layers) >= MOST_LAYERS:
        raise SceneError(f"'{name}' already has {MOST_LAYERS} UV maps: remove one to make room for '{LIGHTMAP_LAYER}'")


def lightmap_image(pixels) -> bpy.types.Image:
    """A new packed image of E / pi, float32 (H, W, 3), row 0 at v = 0; no object points to it yet."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(IMAGE_NAME, width, height, alpha=False, float_buffer=True, is_data=True)
    if hasattr(image, "use_half_precision"):
        image.use_half_precision = False
    write_pixels(image, pixels)
    image.update()
    image.pack()
    return image


def write_lightmap(targets, lightmap, image, keeps_uvs: bool) -> None:
    """Point the objects to the image, with all that shows an earlier one of theirs; store the UVs unless kept."""
    objects = [bpy.data.objects[(target.name, None)] for target in targets]
    if not keeps_uvs:
        _write_uvs(targets, objects, lightmap)
    before = _own_images(objects)
    for blender_object in objects:
        blender_object[IMAGE_PROPERTY] = image
        blender_object.update_tag()
    for old in reversed(before):
        _replace(old, image)


def lightmap_of(objects):
    """The image that these objects are baked into: all targets of a bake share one; None without a bake."""
    return next((ob[IMAGE_PROPERTY] for ob in objects if ob.get(IMAGE_PROPERTY) is not None), None)


def _write_uvs(targets, objects, lightmap):
    by_mesh = {}
    for target, blender_object in zip(targets, objects):
        mesh, uvs = blender_object.data, lightmap.uvs[target.span]
        rect = lightmap.rects.get(target.name, WHOLE)
        # where some have one all do: a material that several objects have reads 0 where there is none
        set_rect(blender_object, rect if lightmap.rects else None)
        has_place = np.isfinite(uvs).all(axis=(1, 2))  # a triangle without area may have none
        if mesh.name not in by_mesh:
            by_mesh[mesh.name] = np.zeros((len(mesh.loops), 2), np.float32)
        own = in_mesh(uvs[has_place], np.array(rect))
        by_mesh[mesh.name][target.corners[has_place]] = own
    for name, values in by_mesh.items():
        mesh = bpy.data.meshes[(name, None)]
        if LIGHTMAP_LAYER not in mesh.uv_layers:
            _add_layer(mesh)
        set_lightmap_uvs(mesh, values)


def set_lightmap_uvs(mesh, uvs) -> None:
    """Store UVs (loops, 2) in the layer "Lightmap" of this mesh alone.

    Not by ``uv_layers[...].uv``: a copy of a mesh shares its arrays until one of them is written, and that way in does
    not part them (Blender 4.5), so that the other mesh would get these UVs as well.
    """
    mesh.attributes[LIGHTMAP_LAYER].data.foreach_set("vector", np.ascontiguousarray(uvs, np.float32).ravel())
    mesh.update()


def _add_layer(mesh):
    """A UV layer; which one is edited and which one textures use stays as it was."""
    active = mesh.uv_layers.active_index
    render = next((layer.name for layer in mesh.uv_layers if layer.active_render), None)
    mesh.uv_layers.new(name=LIGHTMAP_LAYER, do_init=False)
    if render is not None:
        mesh.uv_layers.active_index = active
        mesh.uv_layers[render].active_render = True


def _own_images(objects):
    """Lightmaps of earlier bakes that only these objects point to."""
    images = {ob.get(IMAGE_PROPERTY): None for ob in objects}
    own = [each for each in images if isinstance(each, bpy.types.Image) and not each.library and each.is_float]
    targets = set(objects)
    others = {ob.get(IMAGE_PROPERTY) for ob in bpy.data.objects if ob not in targets}
    return [image for image in own if image not in others]


def _replace(old, image):
    """Give all that shows the ``old`` image the new one.

    Not by filling the old one anew: undo would give its file back, and leave the pixels that are shown.
    """
    name, is_kept = old.name, old.use_fake_user
    old.user_remap(image)
    bpy.data.images.remove(old)
    image.name, image.use_fake_user = name, is_kept
