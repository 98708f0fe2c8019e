"""Whether the picture that Blender has just written is there whole: Blender itself does not look,
and calls a render finished on a full disk, too.
"""

from __future__ import annotations

import logging
from pathlib import Path

import bpy

from ..addon.render import statistics
from .pictures import check_whole

log = logging.getLogger(__name__)

_FORMATS = ("PNG", "OPEN_EXR", "OPEN_EXR_MULTILAYER")


@bpy.app.handlers.persistent
def look(scene: bpy.types.Scene, *_: object) -> None:
    """Log an error, and show it in Statistics, where the file is cut off or missing."""
    render, image = scene.render, scene.render.image_settings
    has_views = render.use_multiview and image.views_format == "INDIVIDUAL"
    if render.engine != "GLINT" or image.file_format not in _FORMATS or has_views:
        return
    try:
        check_whole(_path(scene))
    except OSError as error:
        log.error("%s", error)
        statistics.add_note(scene.name, str(error))


def _path(scene: bpy.types.Scene) -> Path:
    """Of the file that was written last: a still one's name has no number."""
    render = scene.render
    extension = render.file_extension if render.use_file_extension else ""
    plain = bpy.path.abspath(render.filepath)
    still = Path(plain if plain.endswith(extension) else plain + extension)
    numbered = Path(bpy.path.abspath(render.frame_path(frame=scene.frame_current)))
    there = [path for path in (still, numbered) if path.is_file()]
    return max(there, key=lambda path: path.stat().st_mtime_ns, default=numbered)


def register() -> None:
    bpy.app.handlers.render_write.append(look)


def unregister() -> None:
    bpy.app.handlers.render_write.remove(look)
