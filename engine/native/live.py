"""The core for `engine.live`: scenes that outlive a render, so that their trees need not be made
anew.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from ..film import Film
from ..lights.lit import lit_scene
from ..sampling.motion import is_moving
from ..scene import Openings, Scene, left_out
from ..scene.delta import SceneDelta
from ..scene.view_axes import ViewAxes, narrow_view_axes
from ..settings import Lighting, Settings
from . import binding
from .core_types import State
from .job import Job, created, started, with_notes
from .packer import Packed
from .packing import ScenePacker
from .packing_settings import pack_settings
from .render import render_native

_POLL_MILLISECONDS = 2
"""How soon a task makes room for the next."""


@dataclass(eq=False)
class _Held:
    """A scene in the core.

    told: the scene in its axes.  packed: the arrays that it borrows.  exact: it draws what a scene
    of its own would draw, to the bit.
    """

    scene: Scene
    axes: ViewAxes | None
    told: Scene
    packed: Packed
    handle: int
    exact: bool


class NativeLive:
    """One scene in the core, and renders of it. For one thread."""

    def __init__(self) -> None:
        self._core = binding.library()
        self._packer = ScenePacker()
        self._held: _Held | None = None
        self._asked: tuple[Scene, Lighting, bool, Scene] | None = None
        self._openings: Openings | None = None

    def render(
        self,
        scene: Scene,
        settings: Settings,
        exact: bool,
        should_stop: Callable[[], bool],
        on_film: Callable[[Film, bool], None],
        delta: SceneDelta | None = None,
    ) -> None:
        """Draw `scene`; `on_film` gets every wave that there is time to read, and True with the
        last. Raises as `render.render_native`.

        exact: the bits of `render.render_native`. Else trees may be those of another place of the
        camera, and what moved has its own.  delta: from a scene before to this one, where there is
        one.
        """

        def give(film: Film, final: bool) -> None:
            on_film(
                replace(film, notes=tuple(left_out.sentences(scene, film.stats)))
                if final
                else film,
                final,
            )

        scene = self._lit(scene, settings, exact, delta)
        if is_moving(scene):  # every sample is of a scene of its own: there is nothing to keep
            film = render_native(
                scene, settings, should_stop, on_wave=lambda film: on_film(film, False)
            )
            if film.complete:
                give(film, True)
            return
        held = self._hold(scene, exact, delta)
        plan = pack_settings(held.told, settings, waves="SEEN", remember=exact)
        with started(self._core, held.handle, plan.data) as job:
            self._run(
                job,
                Job(self._core, job, scene, settings, held.axes),
                settings.samples,
                should_stop,
                give,
            )

    def draw(
        self,
        scene: Scene,
        settings: Settings,
        should_stop: Callable[[], bool],
        on_progress: Callable[[float], None] = lambda fraction: None,
        on_wave: Callable[[Film], None] | None = None,
        delta: SceneDelta | None = None,
    ) -> Film:
        """`render.render_native` on the scene that is held: the same bits and the same work, so
        that its time and rays can be told. delta: as of `render`.
        """
        scene = self._lit(scene, settings, True, delta)
        if is_moving(scene):
            return render_native(scene, settings, should_stop, on_progress, on_wave)
        held = self._hold(scene, True, delta)
        plan = pack_settings(held.told, settings, "UNSEEN" if on_wave is None else "HELD")
        with started(self._core, held.handle, plan.data) as job:
            render = Job(self._core, job, scene, settings, held.axes)
            film = render.run(should_stop, on_progress, on_wave)
        return with_notes(film, scene, self._core)

    def close(self) -> None:
        """Give the scene back."""
        held, self._held = self._held, None
        if held is not None:
            self._core.glint_scene_destroy(held.handle)

    # --- scenes
    # ----------------------------------------------------------------------------------------------

    def _lit(
        self, scene: Scene, settings: Settings, exact: bool, delta: SceneDelta | None
    ) -> Scene:
        """The scene as the settings want it lit, the same value for the same. exact: else light
        comes through openings as in the last picture that was: to find out anew takes longer than a
        redraw.
        """
        lighting, asked = settings.lighting, self._asked
        if asked is not None and asked[1] == lighting and asked[2] >= exact:
            if asked[0] is scene:
                return asked[3]
            if SceneDelta.between(asked[0], scene, delta).keeps_content:  # no light is the camera's
                lit = replace(asked[3], camera=scene.camera)
                self._asked = (scene, *asked[1:3], lit)
                return lit
        if exact:
            lit = lit_scene(scene, **lighting)
            self._openings = next((x.openings for x in lit.lights if x.kind == "DOME"), None)
        else:
            lights = tuple(
                replace(x, openings=x.openings or self._openings) if x.kind == "DOME" else x
                for x in scene.lights
            )
            known = replace(scene, lights=lights)
            lit = lit_scene(known, **lighting, finding=False)
        self._asked = (scene, lighting, exact, lit)
        return lit

    def _hold(self, scene: Scene, exact: bool, delta: SceneDelta | None) -> _Held:
        """The scene in the core: the one that is there, or one that takes over from it what has not
        changed.
        """
        before = self._held
        if before is not None and before.scene is scene and (before.exact or not exact):
            return before
        axes = narrow_view_axes(scene.camera)
        told = axes.scene(scene) if axes else scene
        packed = self._packer.pack(told, delta)
        base = before.handle if before is not None else None
        handle = created(self._core, packed.data, base, exact)
        self.close()
        self._held = _Held(scene, axes, told, packed, handle, exact or before is None)
        return self._held

    # --- renders
    # ----------------------------------------------------------------------------------------------

    def _run(
        self,
        job: int,
        render: Job,
        most: int,
        should_stop: Callable[[], bool],
        on_film: Callable[[Film, bool], None],
    ) -> None:
        shown, cancelled = 0, False
        while True:
            progress = self._core.glint_render_wait(job, _POLL_MILLISECONDS)
            ended = progress.state >= State.DONE
            if progress.samples > shown and (ended or progress.samples < most):
                shown = progress.samples
                on_film(render.film(shown, complete=True, ended=ended), shown == most)
            if progress.state == State.FAILED:
                render.result(progress)
            if ended:
                return
            if not cancelled and should_stop():
                self._core.glint_render_cancel(job)
                cancelled = True
