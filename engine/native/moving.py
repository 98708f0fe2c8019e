"""Scenes in which things move: the core draws each sample of a scene of its own, which takes over
from the one before what stands still.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from ctypes import byref

from ..film import Film
from ..sampling.motion import Moments, moment, sample_times
from ..scene import Scene
from ..scene.view_axes import ViewAxes
from ..settings import Settings
from . import binding
from .binding import ERROR_BYTES
from .job import Job, created, refusal, started, with_notes
from .packer import Packed
from .packing import ScenePacker
from .packing_settings import pack_settings


class _Moments:
    """Scenes of the samples in the core, one at a time."""

    def __init__(
        self, core: ctypes.CDLL, scene: Scene, settings: Settings, axes: ViewAxes | None
    ) -> None:
        self._core, self._moments, self._axes = core, Moments(scene), axes
        self._times = sample_times(scene, settings.samples)[0]
        self._packer = ScenePacker()
        self._sample = 0
        self.first = self._times[0]
        self._packed = self._pack(0)
        self._next: Packed | None = None
        self.handle = created(core, self._packed.data)

    def _pack(self, sample: int) -> Packed:
        told = self._moments.at(self._times[sample])
        return self._packer.pack(self._axes.scene(told) if self._axes else told)

    def give(self, job: int, plan: Packed) -> None:
        """The render gets the scene of its next sample. The one after that is made ready while the
        core traces.
        """
        self._sample += 1
        packed = self._next or self._pack(self._sample)
        handle = created(self._core, packed.data, self.handle, exact=False)
        error = ctypes.create_string_buffer(ERROR_BYTES)
        taken = self._core.glint_render_move(job, handle, byref(plan.data), error, ERROR_BYTES)
        if taken != 0:
            self._core.glint_scene_destroy(handle)
            raise refusal(error.value.decode(errors="replace"), packed.data)
        self._core.glint_scene_destroy(self.handle)
        self.handle, self._packed = handle, packed
        more = self._sample + 1 < len(self._times)
        self._next = self._pack(self._sample + 1) if more else None

    def close(self) -> None:
        self._core.glint_scene_destroy(self.handle)


def render_moving(
    scene: Scene,
    settings: Settings,
    axes: ViewAxes | None,
    should_stop: Callable[[], bool],
    on_progress: Callable[[float], None],
    on_wave: Callable[[Film], None] | None,
) -> Film:
    """As `render.render_native`, of a scene in which more than the camera moves."""
    core = binding.library()
    moments = _Moments(core, scene, settings, axes)
    try:
        told = axes.scene(scene) if axes else scene
        plan = pack_settings(told, settings, "UNSEEN" if on_wave is None else "HELD")
        with started(core, moments.handle, plan.data) as job:
            render = Job(core, job, scene, settings, axes, lambda: moments.give(job, plan))
            film = render.run(should_stop, on_progress, on_wave)
    finally:
        moments.close()
    return with_notes(film, moment(scene, moments.first), core)
