"""Motion blur: where the camera stands while the shutter is open."""

from __future__ import annotations

import math
from dataclasses import replace

import bpy
import numpy as np

from ...engine.scene import Scene
from ..export.camera import camera_frame

_KEYS = 3
"""As Cycles has them unless a camera asks for more."""
_BEFORE = {"START": 0.0, "CENTER": 0.5, "END": 1.0}
"""How much of the shutter's time lies before the frame."""


def with_camera_motion(
    scene: Scene, render_engine: bpy.types.RenderEngine, depsgraph: bpy.types.Depsgraph
) -> Scene:
    """The scene with the movement of its camera, where Blender's scene has motion blur. The frame
    changes on the way, so that nothing evaluated may be kept over this call.
    """
    render, frame = depsgraph.scene.render, depsgraph.scene.frame_current_final
    if not render.use_motion_blur or render_engine.is_preview:
        return scene
    camera = depsgraph.scene.camera  # of the frame: markers may bind others before and after it
    times = shutter_times(frame, render.motion_blur_shutter, render.motion_blur_position)
    try:
        keys = np.stack([_camera_at(time, camera, render_engine, depsgraph) for time in times])
    finally:
        _go_to(frame, render_engine)
    if (keys == keys[0]).all():
        return scene
    return replace(scene, camera=replace(scene.camera, motion=keys))


def shutter_times(frame: float, shutter: float, position: str) -> list[float]:
    """The frames of the keys: the shutter is open for `shutter` frames."""
    return [frame + shutter * (k / (_KEYS - 1) - _BEFORE[position]) for k in range(_KEYS)]


def _camera_at(
    time: float,
    camera: bpy.types.Object,
    render_engine: bpy.types.RenderEngine,
    depsgraph: bpy.types.Depsgraph,
) -> np.ndarray:
    _go_to(time, render_engine)
    evaluated = camera.evaluated_get(depsgraph)
    return camera_frame(np.array(evaluated.matrix_world, np.float64), camera.name)


def _go_to(time: float, render_engine: bpy.types.RenderEngine) -> None:
    whole = math.floor(time)
    render_engine.frame_set(whole, subframe=time - whole)
