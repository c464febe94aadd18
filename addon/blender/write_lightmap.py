"""A baked lightmap -> UV layers, one float image, and the pointers from objects to it."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.scene import SceneError
from .read_mesh import LIGHTMAP_LAYER

IMAGE_NAME = "Patchlight Lightmap"
IMAGE_PROPERTY = "patchlight_lightmap"
RECT_PROPERTY = "patchlight_rect"
MOST_LAYERS = 8


def require_layer_room(name, mesh) -> None:
    """SceneError where the object's mesh cannot take one more UV layer."""
    if LIGHTMAP_LAYER not in mesh.uv_layers and len(mesh.uv_layers) >= MOST_LAYERS:
        raise SceneError(f"'{name}' already has {MOST_LAYERS} UV maps: remove one to make room for '{LIGHTMAP_LAYER}'")


def write_lightmap(targets, lightmap) -> None:
    """Store the UVs and the image. ``lightmap.pixels`` hold E / pi, float32 (H, W, 3), row 0 at v = 0."""
    objects = [bpy.data.objects[(target.name, None)] for target in targets]
    image = _image_for(objects, lightmap.pixels)
    for target, blender_object in zip(targets, objects):
        _write_uvs(blender_object.data, target.corners, lightmap.uvs[target.span])
        blender_object[IMAGE_PROPERTY] = image
        if RECT_PROPERTY in blender_object:  # of an earlier bake; these UVs are in the whole image
            del blender_object[RECT_PROPERTY]
        blender_object.update_tag()


def _write_uvs(mesh, corners, uvs):
    layer = mesh.uv_layers.get(LIGHTMAP_LAYER) or _new_layer(mesh)
    values = np.zeros((len(mesh.loops), 2), np.float32)
    has_place = np.isfinite(uvs).all(axis=(1, 2))  # a triangle without area may have none
    values[corners[has_place]] = uvs[has_place]
    layer.uv.foreach_set("vector", values.ravel())
    mesh.update()


def _new_layer(mesh):
    """A UV layer; which one is edited and which one textures use stays as it was."""
    active = mesh.uv_layers.active_index
    render = next((layer.name for layer in mesh.uv_layers if layer.active_render), None)
    mesh.uv_layers.new(name=LIGHTMAP_LAYER, do_init=False)
    if render is not None:
        mesh.uv_layers.active_index = active
        mesh.uv_layers[render].active_render = True
    return mesh.uv_layers[LIGHTMAP_LAYER]


def _image_for(objects, pixels):
    """The packed image; one that only these objects use is filled anew, so that materials which show it stay right."""
    height, width = pixels.shape[:2]
    image = _own_image(objects)
    if image is None:
        image = bpy.data.images.new(IMAGE_NAME, width, height, alpha=False, float_buffer=True, is_data=True)
    elif tuple(image.size) != (width, height):
        image.scale(width, height)
    if hasattr(image, "use_half_precision"):
        image.use_half_precision = False
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()
    return image


def _own_image(objects):
    images = {blender_object.get(IMAGE_PROPERTY) for blender_object in objects}
    images.discard(None)
    image = images.pop() if len(images) == 1 else None
    if not isinstance(image, bpy.types.Image) or image.library or not image.is_float or image.channels != 4:
        return None
    others = (o for o in bpy.data.objects if o.get(IMAGE_PROPERTY) == image and o not in objects)
    return image if next(others, None) is None else None
