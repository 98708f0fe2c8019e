"""Parts of a frame, rendered on their own: what they cost, how many rays they take, and their pictures."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .film import Film
from .scene import Scene
from .settings import Settings

Array = np.ndarray
Crop = tuple[int, int, int, int]
"""x0, y0, x1, y1 of the full frame, half open."""

_TILE = 32
"""Pixels across the squares that the core gives to its threads."""


class StoppedError(Exception):
    """The caller wants no more."""


@dataclass(frozen=True, eq=False)
class Rendered:
    """The crops of one setting. seconds: of tracing, as if the whole frame's threads had worked on them.  rays: of all kinds; those of
    neighbours that refinement looks at count in both.  pictures: (h, w, 3) float32 each, linear."""

    seconds: float
    rays: float
    pictures: list[Array]


def choose_crops(resolution: tuple[int, int], count: int = 16, side: int = 20) -> tuple[Crop, ...]:
    """Up to `count` squares spread evenly over the frame, wherever the picture has something to show or not, so that their mean error
    is the frame's; the whole frame where it is hardly larger than they are."""
    width, height = resolution
    across = max(int(math.sqrt(count)), 1)
    if width <= across * side or height <= across * side:
        return ((0, 0, width, height),)
    lefts, bottoms = ([int((k + 0.5) * size / across - side / 2) for k in range(across)] for size in (width, height))
    return tuple((x, y, x + side, y + side) for y in bottoms for x in lefts)


def area(crops: Sequence[Crop]) -> int:
    """Pixels."""
    return sum((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in crops)


def threads_at_work(settings: Settings, size: tuple[int, int]) -> int:
    """How many threads a picture of that size keeps busy."""
    if settings.backend != "NATIVE":
        return 1
    tiles = math.prod(-(-side // _TILE) for side in size)
    return min(settings.threads or os.cpu_count() or 1, tiles)


class CropRenderer:
    """Renders crops, one settings after the other, on trees that are made once. build_seconds: what these took."""

    def __init__(self, scene: Scene, crops: tuple[Crop, ...], should_stop: Callable[[], bool]) -> None:
        self.scene, self.crops, self.should_stop = scene, crops, should_stop
        self.build_seconds = 0.0
        self._held: Any = None

    def __enter__(self) -> CropRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        if self._held is not None:
            self._held.close()

    def render(self, settings: Settings, on_crop: Callable[[], None] = lambda: None, crops: Sequence[Crop] = ()) -> Rendered:
        """All crops, or those given. Raises StoppedError when should_stop says so."""
        seconds, rays, pictures = 0.0, 0.0, []
        for crop in crops or self.crops:
            film = self.film(replace(settings, region=crop))
            size = (crop[2] - crop[0], crop[3] - crop[1])
            frame = threads_at_work(settings, self.scene.camera.resolution)
            seconds += film.stats["trace"] * threads_at_work(settings, size) / frame
            rays += film.stats["rays"]
            self.build_seconds = max(self.build_seconds, film.stats["build"])
            pictures.append(film.combined[..., :3])
            on_crop()
        return Rendered(seconds, rays, pictures)

    def film(self, settings: Settings) -> Film:
        """One picture, of the settings' region."""
        film = self._traced(settings)
        if not film.complete or self.should_stop():
            raise StoppedError
        return film

    def _traced(self, settings: Settings) -> Film:
        if settings.backend != "NATIVE":
            from .reference import render_reference

            return render_reference(self.scene, settings, self.should_stop, lambda fraction: None, None)
        if self._held is None:
            from .native_live import NativeLive

            self._held = NativeLive()
        return self._held.draw(self.scene, settings, self.should_stop)
