"""Pictures that Glint draws itself, as images of the .blend file."""

from __future__ import annotations

import bpy
import numpy as np


def show(name: str, picture: np.ndarray, context: bpy.types.Context) -> bpy.types.Image:
    """Put a canvas, (h, w, 3) of what a screen shows with row 0 on top, into the image `name`, and into an image editor if one is open."""
    height, width = picture.shape[:2]
    image = bpy.data.images.get(name)
    if image is None or tuple(image.size) != (width, height):
        if image is not None:
            bpy.data.images.remove(image)
        image = bpy.data.images.new(name, width, height)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = np.flipud(picture)
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    for area in context.screen.areas if context.screen else ():
        if area.type == "IMAGE_EDITOR":
            area.spaces.active.image = image
            break
    return image
