"""Pictures one after the other, as of an animation: what two scenes have in common is not made
ready twice.
"""

from __future__ import annotations

from collections.abc import Callable

from .backends import check, render
from .film import Film
from .native.live import NativeLive
from .scene import Scene, SceneDelta
from .settings import Settings


class KeptRender:
    """Draws scenes as `engine.render` does, to the bit, and holds the last one in the core: the
    next takes over its tables and trees, of the values that are the very same. The float64 tracer
    keeps nothing. For one thread at a time.
    """

    def __init__(self) -> None:
        self._native: NativeLive | None = None

    def render(
        self,
        scene: Scene,
        settings: Settings,
        *,
        should_stop: Callable[[], bool] = lambda: False,
        on_progress: Callable[[float], None] = lambda fraction: None,
        on_wave: Callable[[Film], None] | None = None,
        delta: SceneDelta | None = None,
    ) -> Film:
        """The arguments, and what is raised, are those of `engine.render`. delta: from the scene
        before to this one, where there is one; else they are compared.
        """
        if settings.backend != "NATIVE":
            return render(
                scene,
                settings,
                should_stop=should_stop,
                on_progress=on_progress,
                on_wave=on_wave,
            )
        check(scene, settings)
        if self._native is None:
            self._native = NativeLive()
        try:
            return self._native.draw(scene, settings, should_stop, on_progress, on_wave, delta)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Give back what is held."""
        native, self._native = self._native, None
        if native is not None:
            native.close()
