"""Pictures that Glint draws itself, as images of the .blend file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from .editors import fit_picture, in_editor


def show(
    name: str,
    picture: np.ndarray,
    context: bpy.types.Context,
    opens: bool = True,
    on_open: Callable[[Any], None] = lambda area: None,
) -> bpy.types.Image:
    """Put a canvas, (h, w, 3) of what a screen shows with row 0 on top, into the image `name`, and
    if it `opens` that into an image editor (`editors.in_editor`), whose area `on_open` gets.
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

    def put(area: Any) -> None:
        area.spaces.active.image = bpy.data.images.get(name)
        fit_picture(area)
        on_open(area)

    if opens:
        in_editor("IMAGE_EDITOR", context, put)
    return image
