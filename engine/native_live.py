"""The core for `engine.live`: scenes that outlive a render, so that their trees need not be made anew."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from . import native
from .core_types import DONE, FAILED
from .film import Film
from .packing import pack_scene, pack_settings
from .scene import Scene
from .settings import Settings
from .view_axes import ViewAxes, narrow_view_axes

_POLL_MILLISECONDS = 4
"""How soon a task makes room for the next."""


class NativeLive:
    """One scene in the core, and renders of it. For one thread."""

    def __init__(self) -> None:
        self._core = native.library()
        self._held = ExitStack()
        self._scene: Scene | None = None
        self._axes: ViewAxes | None = None
        self._handle: int = 0

    def render(
        self, scene: Scene, settings: Settings, exact: bool, should_stop: Callable[[], bool], on_film: Callable[[Film, bool], None]
    ) -> None:
        """Draw `scene`; `on_film` gets every wave that there is time to read, and True with the last. Raises as `native.render_native`."""
        self._hold(scene)
        plan = pack_settings(scene, settings, hold_waves=False)
        with native._render(self._core, self._handle, plan.data) as job:
            self._run(job, native._Render(self._core, job, scene, settings, self._axes), should_stop, on_film)

    def close(self) -> None:
        """Give the scene back."""
        self._held.close()
        self._scene, self._handle = None, 0

    def _hold(self, scene: Scene) -> None:
        if self._scene is scene:
            return
        self.close()
        self._axes = narrow_view_axes(scene.camera)
        packed = pack_scene(self._axes.scene(scene) if self._axes else scene)
        self._held.callback(packed.lent.clear)
        self._handle = self._held.enter_context(native._scene(self._core, packed.data))
        self._scene = scene

    def _run(self, job: int, render: native._Render, should_stop: Callable[[], bool], on_film: Callable[[Film, bool], None]) -> None:
        film, cancelled = None, False
        while True:
            progress = self._core.glint_render_wait(job, _POLL_MILLISECONDS)
            if progress.samples > (film.samples if film else 0):
                film = render._film(progress.samples, complete=True)
                on_film(film, progress.state == DONE)
            elif progress.state == DONE:
                on_film(film, True)
            if progress.state == FAILED:
                render._result(progress)
            if progress.state >= DONE:
                return
            if not cancelled and should_stop():
                self._core.glint_render_cancel(job)
                cancelled = True
