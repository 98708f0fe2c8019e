"""Pictures by the core."""

from __future__ import annotations

from collections.abc import Callable

from ..film import Film
from ..sampling.motion import is_moving
from ..scene import Scene
from ..scene.view_axes import narrow_view_axes
from ..settings import Settings
from . import binding
from .job import Job, created, started, with_notes
from .moving import render_moving
from .packing import pack_scene
from .packing_settings import pack_settings


def render_native(
    scene: Scene,
    settings: Settings,
    should_stop: Callable[[], bool] = lambda: False,
    on_progress: Callable[[float], None] = lambda fraction: None,
    on_wave: Callable[[Film], None] | None = None,
) -> Film:
    """Draw `scene` with the core; the arguments are those of `engine.render`.

    Raises SceneError for what the core refuses, MemoryError, ImportError and OSError (see
    `binding.library`), RuntimeError for a fault of the core.
    """
    core, axes = binding.library(), narrow_view_axes(scene.camera)
    if is_moving(scene):
        return render_moving(scene, settings, axes, should_stop, on_progress, on_wave)
    told = axes.scene(scene) if axes else scene
    packed, plan = (
        pack_scene(told),
        pack_settings(told, settings, "UNSEEN" if on_wave is None else "HELD"),
    )
    handle = created(core, packed.data)
    try:
        with started(core, handle, plan.data) as job:
            film = Job(core, job, scene, settings, axes).run(should_stop, on_progress, on_wave)
    finally:
        core.glint_scene_destroy(handle)
    return with_notes(film, scene, core)
