"""Which tracer draws a picture: the native core, or the float64 NumPy reference."""

from __future__ import annotations

from collections.abc import Callable

from .errors import SceneError
from .film import Film
from .lights.lit import lit_scene
from .native import binding
from .native.render import render_native
from .scene import Scene
from .scene.problems import scene_problems
from .settings import Settings


def available_backends() -> tuple[str, ...]:
    """The tracers that can run here, best first: NATIVE when the core's library loads, NUMPY
    always.
    """
    return ("NATIVE", "NUMPY") if native_error() is None else ("NUMPY",)


def native_error() -> str | None:
    """Why the native core cannot be used here; None when it can."""
    return binding.load_error()


def render(
    scene: Scene,
    settings: Settings | None = None,
    *,
    should_stop: Callable[[], bool] = lambda: False,
    on_progress: Callable[[float], None] = lambda fraction: None,
    on_wave: Callable[[Film], None] | None = None,
) -> Film:
    """Draw `scene`.

    should_stop: asked at least every 50 ms on the calling thread; True ends the render with
    `Film.complete` False. on_progress: told the finished fraction of the work, 0 to 1, as far as it
    is known: it may go back after a wave.  on_wave: given a complete picture after 1, 2, 4, 8 …
    samples. Raises SceneError for a scene or settings that are not sound, MemoryError when memory
    cannot be had.
    """
    settings = settings or Settings()
    check(scene, settings)
    draw = tracer(settings.backend)
    scene = lit_scene(scene, **settings.lighting)
    return draw(scene, settings, should_stop, on_progress, on_wave)


def tracer(backend: str) -> Callable[..., Film]:
    """The one that draws, as `native.render.render_native`."""
    if backend == "NATIVE":
        return render_native
    # two fifths of the lines of the engine: Blender starts, and the core draws, without them
    from .reference.trace import render_reference

    return render_reference


def check(scene: Scene, settings: Settings) -> None:
    """Raises SceneError for a scene or settings that are not sound."""
    problems = settings.problems() + scene_problems(scene) or _beyond_the_frame(
        settings.region, scene.camera.resolution
    )
    if problems:
        raise SceneError("\n".join(problems))


def _beyond_the_frame(
    region: tuple[int, int, int, int] | None, resolution: tuple[int, int]
) -> list[str]:
    beyond = region is not None and (region[2] > resolution[0] or region[3] > resolution[1])
    return (
        [f"region {region} reaches beyond the frame of {resolution[0]} by {resolution[1]} pixels"]
        if beyond
        else []
    )
