"""Renders of a scene that leave it as it is: everything happens on a copy that shares the objects
and goes away at the end.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from ..addon.render import final, statistics
from .pictures import check_whole, read_picture, render_result


@contextmanager
def copied(
    scene: bpy.types.Scene, view_layer: str, *, in_focus: bool = False
) -> Iterator[bpy.types.Scene]:
    """A copy of the scene's settings, of which one view layer renders, without compositor,
    sequencer, border, motion blur and stereoscopy. The scene, its picture and the file's data are
    untouched, whatever happens within. in_focus: through a copy of the camera without depth of
    field.
    """
    copy = scene.copy()
    cameras: list[tuple] = []
    try:
        if in_focus and copy.camera is not None and copy.camera.type == "CAMERA":
            cameras.append(_focused_camera(copy))
        render = copy.render
        render.use_border = render.use_compositing = render.use_sequencer = (
            render.use_motion_blur
        ) = render.use_freestyle = render.use_multiview = False
        render.use_persistent_data = False  # nobody renders the copy again
        for layer in copy.view_layers:
            layer.use = layer.name == view_layer
        yield copy
    finally:
        statistics.forget(copy.name)
        bpy.data.scenes.remove(copy)
        for camera, data in cameras:
            bpy.data.objects.remove(camera)
            bpy.data.cameras.remove(data)


def _focused_camera(copy: bpy.types.Scene) -> tuple[bpy.types.Object, bpy.types.Camera]:
    camera = copy.camera.copy()
    camera.data = camera.data.copy()
    camera.data.dof.use_dof = False
    copy.collection.objects.link(camera)
    copy.timeline_markers.clear()  # they would bind the file's own cameras
    copy.camera = camera
    return camera, camera.data


def _choose_glint(copy: bpy.types.Scene) -> None:
    """Only where another engine is chosen: Blender waits for previews when one is written, even the
    same, and previews of Glint would wait for this (`AfterPreviews`).
    """
    if copy.render.engine != "GLINT":
        copy.render.engine = "GLINT"


def read_job(scene: bpy.types.Scene, view_layer: str) -> final.Job:
    """What a final render of this view layer would trace: modifiers, visibility and settings as for
    a render. Raises RuntimeError with the reason where it cannot be rendered.
    """
    with copied(scene, view_layer) as copy, final.reading_only() as jobs:
        _choose_glint(copy)
        bpy.ops.render.render(scene=copy.name)
    if not jobs:
        raise RuntimeError("Blender did not ask Glint to render this scene")
    return jobs[0]


def rendered(copy: bpy.types.Scene, path: Path) -> tuple[np.ndarray, float]:
    """Render a copy with its own engine into an EXR file; gives the picture, (h, w, 4) float32 with
    row 0 at the bottom, and the seconds, Blender's own work included. Raises RuntimeError with
    Blender's message when the render fails, OSError when the file is not whole.
    """
    image = copy.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    start = time.perf_counter()
    bpy.ops.render.render(scene=copy.name)
    seconds = time.perf_counter() - start
    render_result().save_render(str(path), scene=copy)
    check_whole(path)
    return read_picture(path), seconds


def rendered_for(
    scene: bpy.types.Scene, view_layer: str, path: Path, measure: str, value: float
) -> str:
    """Render a scene with Glint for a target error (`engine.analysis.target.Target`; RMSE in
    percent) into an EXR file; gives what was asked for, chosen, predicted and reached, in words.
    Raises RuntimeError with Blender's message when the render fails.
    """
    with copied(scene, view_layer) as copy:
        _choose_glint(copy)
        copy.glint.target = measure
        setattr(copy.glint, "target_levels" if measure == "LEVELS" else "target_rmse", value)
        rendered(copy, path)
        return statistics.by_layer(copy.name)[view_layer].target
