"""Glint's engine: `render(scene, settings) -> Film`, and rays without a picture: `Accelerator`.
Knows nothing of Blender.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .accelerator import Accelerator, Hits
from .analysis.explain import PixelExplainer, explanation_lines
from .cryptomatte import crypto_metadata, manifests
from .errors import NO_THREAD, SceneError
from .explained import Ray
from .film import (
    AOV,
    BY_SURFACE,
    CATCHER,
    CRYPTOMATTES,
    DENOISING,
    LIGHT_GROUP,
    OCCLUSION,
    PARTS,
    PASSES,
    Film,
)
from .kept import KeptRender
from .linear import affine_inverse, determinant
from .live import LiveRender, Task, Wave
from .sampling import TILE_SIDE
from .scene import Scene
from .scene.viewing import pixel_bounds_of_box
from .settings import Settings

__all__ = [
    "AOV",
    "BY_SURFACE",
    "CATCHER",
    "CRYPTOMATTES",
    "DENOISING",
    "LIGHT_GROUP",
    "NO_THREAD",
    "OCCLUSION",
    "PARTS",
    "PASSES",
    "TILE_SIDE",
    "Accelerator",
    "Film",
    "Hits",
    "KeptRender",
    "LiveRender",
    "PixelExplainer",
    "Ray",
    "Scene",
    "SceneError",
    "Settings",
    "Task",
    "Wave",
    "affine_inverse",
    "available_backends",
    "check",
    "crypto_metadata",
    "determinant",
    "explanation_lines",
    "manifests",
    "native_error",
    "pixel_bounds_of_box",
    "render",
]

np.ones((256, 256)) @ np.ones((256, 256))
"""OpenBLAS, which multiplies NumPy's matrices, takes 32 MB at its first product and keeps them; on
some processors products of small matrices do without. Asked when memory is short it spins for ever
instead of failing, so it is asked here.
"""


def available_backends() -> tuple[str, ...]:
    """The tracers that can run here, best first: NATIVE when the core's library loads, NUMPY
    always.
    """
    return ("NATIVE", "NUMPY") if native_error() is None else ("NUMPY",)


def native_error() -> str | None:
    """Why the native core cannot be used here; None when it can."""
    from . import native

    return native.load_error()


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
    `Film.complete` False. on_progress: told the finished fraction, 0 to 1.  on_wave: given a
    complete picture after 1, 2, 4, 8 … samples. Raises SceneError for a scene or settings that are
    not sound, MemoryError when memory cannot be had.
    """
    settings = settings or Settings()
    check(scene, settings)
    tracer = _tracer(settings.backend)
    scene = scene.as_lit(**settings.lighting)
    return tracer(scene, settings, should_stop, on_progress, on_wave)


def _tracer(backend: str) -> Callable[..., Film]:
    """The one that draws, loaded when it is first asked for."""
    if backend == "NATIVE":
        from .native import render_native

        return render_native
    from .reference import render_reference

    return render_reference


def check(scene: Scene, settings: Settings) -> None:
    """Raises SceneError for a scene or settings that are not sound."""
    problems = settings.problems() + scene.problems() or _beyond_the_frame(
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
