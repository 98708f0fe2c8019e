"""Motion blur: where the camera and everything else stands while the shutter is open."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import bpy
import numpy as np

from ...engine.scene import Scene
from ..export.camera import camera_frame
from ..export.culling import Culling
from ..export.geometry.displacing import Displaced
from ..export.keys import Pose, frame_of, moved, read_pose
from ..export.placing import without_collapsed
from ..export.report import Report
from ..export.unsupported import note_blur
from .views import looker_of

_KEYS = 3
"""As Cycles has them unless an object asks for more."""
_CURVE = 257
"""Points of the shutter's curve, as Cycles has about as many."""
_BEFORE = {"START": 0.0, "CENTER": 0.5, "END": 1.0}
"""How much of the shutter's time lies before the frame."""
_LONGEST = 1e6
"""Frames that a shutter may be open: Blender has none beyond 1048574."""
_NO_SHUTTER = (
    "Motion Blur's shutter is longer than a million frames, or no number: nothing is blurred; set "
    "it anew"
)


def with_motion(
    scenes: Sequence[Scene],
    render_engine: bpy.types.RenderEngine,
    depsgraph: bpy.types.Depsgraph,
    views: Sequence[str] = ("",),
    displaced: Mapping[int, Displaced] = MappingProxyType({}),
) -> tuple[tuple[Scene, ...], tuple[str, ...]]:
    """Scenes that are the same but for their cameras, those of `views`, with the movement of the
    camera and of what is in it, where Blender's scene has motion blur, and notes. The frame changes
    on the way, so that nothing evaluated may be kept over this call. displaced: as `Export` has it.
    Where the shutter `opens`, scenes may have placements that leave no surface: those stay that do
    at some key.
    """
    render, frame = depsgraph.scene.render, frame_of(depsgraph.scene)
    if not opens(render_engine, depsgraph):
        asks = blurs(depsgraph) and not render_engine.is_preview
        lasts = asks and not render.motion_blur_shutter <= _LONGEST
        return tuple(scenes), (_NO_SHUTTER,) if lasts else ()
    camera = depsgraph.scene.camera  # of the frame: markers may bind others before and after it
    culling = Culling.of(depsgraph.scene_eval, scenes[0].camera)
    still = read_pose(depsgraph, culling=culling)
    count = max(_KEYS, still.most_keys)
    times = shutter_times(frame, render.motion_blur_shutter, render.motion_blur_position, count)
    frames: list[list[np.ndarray]] = []
    poses: list[Pose] = []
    zooms: set[float] = set()
    try:
        for time in times:
            go_to(time, render_engine)
            frames.append([_frame(render_engine, view, depsgraph, camera) for view in views])
            poses.append(read_pose(depsgraph))
            zooms.add(_zoom(camera.evaluated_get(depsgraph)))
    finally:
        go_to(frame, render_engine)
    report = Report()
    note_blur(depsgraph, report)
    if len(zooms) > 1:
        report.note(
            "Cameras that zoom while the shutter is open blur by what moves alone ({}): move the "
            "camera instead",
            camera.name,
        )
    scene = moved(scenes[0], still, poses, report, displaced=displaced)
    scene = replace(scene, instances=without_collapsed(scene.instances, report))
    opening = _shutter(render.motion_blur_shutter_curve, report)
    seen = (replace(scene, camera=some.camera) for some in scenes)
    moving = zip(seen, zip(*frames, strict=True), strict=True)
    return tuple(_with_camera(some, own, opening) for some, own in moving), report.notes()


def _frame(
    render_engine: bpy.types.RenderEngine,
    view: str,
    depsgraph: bpy.types.Depsgraph,
    camera: bpy.types.Object,
) -> np.ndarray:
    """Where a view looks from now; "" looks through the camera."""
    looker = looker_of(render_engine, view, depsgraph)
    if looker is not None:
        return camera_frame(looker.matrix, looker.camera.name)
    matrix = camera.evaluated_get(depsgraph).matrix_world
    return camera_frame(np.array(matrix, np.float64), camera.name)


def _zoom(camera: bpy.types.Object) -> float:
    """What a perspective camera's picture widens with, which blurs in Cycles: neither orthographic
    scales nor shifts do.
    """
    data = camera.data
    return data.angle if camera.type == "CAMERA" and data.type == "PERSP" else 0.0


def _with_camera(scene: Scene, frames: Sequence[np.ndarray], opening: np.ndarray | None) -> Scene:
    keys = np.stack(frames)
    motion = None if (keys == keys[0]).all() else keys
    return replace(scene, camera=replace(scene.camera, motion=motion, shutter=opening))


def _shutter(curve: bpy.types.CurveMapping, report: Report) -> np.ndarray | None:
    """How far the shutter is open; None where it is all the time."""
    curve.initialize()
    times = np.linspace(0.0, 1.0, _CURVE)
    opening = np.array([curve.evaluate(curve.curves[0], time) for time in times], np.float64)
    opening = np.maximum(opening, 0.0)
    if not np.isfinite(opening).all() or not opening.any():
        report.note("The shutter curve never opens the shutter: it is open for all its time")
        return None
    return None if np.ptp(opening) == 0 else opening


def shutter_times(frame: float, shutter: float, position: str, count: int = _KEYS) -> list[float]:
    """The frames of the keys: the shutter is open for `shutter` frames."""
    return [frame + shutter * (k / (count - 1) - _BEFORE[position]) for k in range(count)]


def opens(render_engine: bpy.types.RenderEngine, depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether `with_motion` looks at other times."""
    shutter = depsgraph.scene.render.motion_blur_shutter
    return not render_engine.is_preview and blurs(depsgraph) and 0 < shutter <= _LONGEST


def blurs(depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether the scene and its view layer have motion blur."""
    return depsgraph.scene.render.use_motion_blur and depsgraph.view_layer.use_motion_blur


def go_to(time: float, render_engine: bpy.types.RenderEngine) -> None:
    """Evaluates another frame."""
    whole = math.floor(time)
    render_engine.frame_set(whole, subframe=time - whole)
