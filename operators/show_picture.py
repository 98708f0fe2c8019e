"""Pictures that Glint draws itself, as images of the .blend file."""

from __future__ import annotations

import bpy
import numpy as np

from .editors import editor_of, fit_picture


def show(
    name: str, picture: np.ndarray, context: bpy.types.Context, opens: bool = True
) -> bpy.types.Image:
    """Put a canvas, (h, w, 3) of what a screen shows with row 0 on top, into the image `name`, and
    if it `opens` that into an image editor: an open one, else one in a new window where there are
    windows.
    """
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
    area = editor_of("IMAGE_EDITOR", context) if opens else None
    if area is not None:
        area.spaces.active.image = image
        fit_picture(area)
    return image
