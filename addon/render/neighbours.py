"""The frames before and after, for the pass Vector."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import bpy

from ...engine.scene import Camera, Scene
from ..export.camera import export_camera
from ..export.culling import Culling
from ..export.geometry.displacing import Displaced
from ..export.keys import FROM_FRAME_TO_FRAME, at_key, frame_of, moved, read_pose
from ..export.report import Report
from .motion import blurs, go_to
from .views import looker_of


def with_neighbours(
    scenes: Sequence[Scene],
    render_engine: bpy.types.RenderEngine,
    depsgraph: bpy.types.Depsgraph,
    views: Sequence[str] = ("",),
    displaced: Mapping[int, Displaced] = MappingProxyType({}),
) -> tuple[tuple[Scene, ...], tuple[str, ...]]:
    """Scenes that are the same but for their cameras, those of `views`, with the frames before and
    after, and notes. With motion blur they stay as they are, as in Cycles. The frame changes on the
    way, so that nothing evaluated may be kept over this call. displaced: as `Export` has it.
    """
    if blurs(depsgraph):
        note = "The pass Vector is empty with Motion Blur in {}: turn it off, or the pass"
        return tuple(scenes), (note.format(depsgraph.view_layer.name),)
    if render_engine.is_preview:
        return tuple(scenes), ()
    camera, frame = depsgraph.scene.camera, frame_of(depsgraph.scene)
    culling = Culling.of(depsgraph.scene_eval, scenes[0].camera)
    report, here = Report(), read_pose(depsgraph, True, culling)
    poses, cameras = [], []
    try:
        for time in (frame - 1, frame + 1):
            go_to(time, render_engine)
            poses.append(read_pose(depsgraph, for_vectors=True))
            seen = zip(scenes, views, strict=True)
            cameras.append(
                [_camera(s.camera, camera, view, render_engine, depsgraph) for s, view in seen]
            )
    finally:
        go_to(frame, render_engine)
    times = [poses[0], here, poses[1]]
    moving = moved(scenes[0], here, times, report, FROM_FRAME_TO_FRAME, displaced)
    both = [at_key(moving, scenes[0], k) for k in (0, 2)]
    return tuple(
        replace(
            scene,
            neighbours=tuple(
                replace(other, camera=seen[k]) for other, seen in zip(both, cameras, strict=True)
            ),
        )
        for k, scene in enumerate(scenes)
    ), report.notes()


def _camera(
    here: Camera,
    camera: bpy.types.Object,
    view: str,
    render_engine: bpy.types.RenderEngine,
    depsgraph: bpy.types.Depsgraph,
) -> Camera:
    """The camera of a view at the frame that is evaluated; one that became another kind stays as it
    was.
    """
    looker = looker_of(render_engine, view, depsgraph)
    through = looker.camera if looker is not None else camera.evaluated_get(depsgraph)
    render = depsgraph.scene_eval.render
    found = export_camera(through, render, here.resolution, Report(), looker)
    return found if found.kind == here.kind else here
