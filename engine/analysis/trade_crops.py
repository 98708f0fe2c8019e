"""Parts of a frame, rendered on their own: what they cost, how many rays they take, and their
pictures.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..backends import tracer
from ..film import Film
from ..native.live import NativeLive
from ..sampling import TILE_SIDE
from ..scene import Scene
from ..settings import Settings

Array = np.ndarray
Crop = tuple[int, int, int, int]
"""x0, y0, x1, y1 of the full frame, half open."""


class StoppedError(Exception):
    """The caller wants no more."""


@dataclass(frozen=True, eq=False)
class Rendered:
    """The crops of one setting. seconds: of tracing, as if the whole frame's threads had worked on
    them.  rays: of all kinds; those of neighbours that refinement looks at count in both.
    pictures: (h, w, 3) float32 each, linear.  each: seconds of each crop.
    """

    seconds: float
    rays: float
    pictures: list[Array]
    each: list[float]


@dataclass(frozen=True, eq=False)
class Squares:
    """Crops that stand for a frame. weights: (n,) how many like it the frame has of each; all 1
    where the crops are the whole frame.
    """

    crops: tuple[Crop, ...]
    weights: Array

    @property
    def pixel_weights(self) -> Array:
        """(pixels of the crops,) in their order."""
        return np.repeat(self.weights, [area([crop]) for crop in self.crops])

    def halves(self) -> tuple[Squares, Squares]:
        """Two that have no square in common, each for the whole frame; twice the same one where a
        single crop is all there is.
        """
        if len(self.crops) == 1:
            return self, self
        even, odd = (Squares(self.crops[k::2], 2 * self.weights[k::2]) for k in range(2))
        return even, odd


def pick_squares(apart: Array, count: int, side: int) -> Squares:
    """Up to `count` squares, the whole frame as one crop where it has hardly more.

    apart: (h, w), 0 or more, what a first look finds to do in each pixel.  side: of a square in
    pixels; those at the right and upper border may be smaller.  A square is picked with a
    probability that grows with what there is to do in it, so that its weight, the inverse, makes
    sums over the squares' pixels estimates of sums over the frame (Horvitz and Thompson 1952). The
    picks are evenly spaced along the squares in the order of their probabilities: no chance is
    involved, and neighbours in that order are alike.
    """
    height, width = apart.shape
    bottoms, lefts = np.arange(0, height, side), np.arange(0, width, side)
    if len(bottoms) * len(lefts) <= count:
        return Squares(((0, 0, width, height),), np.ones(1))
    work = np.add.reduceat(np.add.reduceat(apart, bottoms, 0), lefts, 1).ravel()
    pixels = np.outer(np.diff([*bottoms, height]), np.diff([*lefts, width])).ravel()
    chances = _chances(
        sum(size / max(size.sum(), 1e-300) for size in (work, np.sqrt(work * pixels), pixels)),
        count,
    )
    order = np.argsort(-chances, kind="stable")
    ends = np.cumsum(chances[order])
    picked = order[np.minimum(np.searchsorted(ends, np.arange(count) + 0.5), len(order) - 1)]
    boxes = [(lefts[k % len(lefts)], bottoms[k // len(lefts)]) for k in picked]
    crops = tuple(
        (int(x), int(y), int(min(x + side, width)), int(min(y + side, height))) for x, y in boxes
    )
    return Squares(crops, 1 / chances[picked])


def _chances(sizes: Array, count: int) -> Array:
    """(n,) probabilities in proportion to sizes, none above 1, that sum up to `count`."""
    certain = np.zeros(len(sizes), bool)
    while True:
        rest = count - certain.sum()
        chances = np.where(certain, 1.0, rest * sizes / sizes[~certain].sum())
        above = (chances >= 1) & ~certain
        if not above.any():
            return chances
        certain |= above


def area(crops: Sequence[Crop]) -> int:
    """Pixels."""
    return sum((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in crops)


def threads_at_work(settings: Settings, size: tuple[int, int]) -> int:
    """How many threads a picture of that size keeps busy."""
    if settings.backend != "NATIVE":
        return 1
    tiles = math.prod(-(-side // TILE_SIDE) for side in size)
    return min(settings.threads or os.cpu_count() or 1, tiles)


class CropRenderer:
    """Renders crops, one settings after the other, on trees that are made once. build_seconds: what
    these took.
    """

    def __init__(
        self, scene: Scene, crops: tuple[Crop, ...], should_stop: Callable[[], bool]
    ) -> None:
        self.scene, self.crops, self.should_stop = scene, crops, should_stop
        self.build_seconds = 0.0
        self._held: Any = None

    def __enter__(self) -> CropRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        if self._held is not None:
            self._held.close()

    @contextmanager
    def smaller(self, stride: int) -> Iterator[None]:
        """The frame has so many times fewer pixels each way meanwhile, and is one crop."""
        whole = self.scene, self.crops
        camera = self.scene.camera
        width, height = (-(-side // stride) for side in camera.resolution)
        self.scene = replace(self.scene, camera=replace(camera, resolution=(width, height)))
        self.crops = ((0, 0, width, height),)
        try:
            yield
        finally:
            self.scene, self.crops = whole

    def render(
        self,
        settings: Settings,
        on_crop: Callable[[], None] = lambda: None,
        crops: Sequence[Crop] = (),
    ) -> Rendered:
        """All crops, or those given. Raises StoppedError when should_stop says so."""
        each, rays, pictures = [], 0.0, []
        for crop in crops or self.crops:
            film = self.film(replace(settings, region=crop))
            size = (crop[2] - crop[0], crop[3] - crop[1])
            frame = threads_at_work(settings, self.scene.camera.resolution)
            each.append(film.stats["trace"] * threads_at_work(settings, size) / frame)
            rays += film.stats["rays"]
            self.build_seconds = max(self.build_seconds, film.stats["build"])
            pictures.append(film.combined[..., :3])
            on_crop()
        return Rendered(sum(each), rays, pictures, each)

    def film(self, settings: Settings) -> Film:
        """One picture, of the settings' region."""
        film = self._traced(settings)
        if not film.complete or self.should_stop():
            raise StoppedError
        return film

    def _traced(self, settings: Settings) -> Film:
        if settings.backend != "NATIVE":
            draw = tracer(settings.backend)
            return draw(self.scene, settings, self.should_stop, lambda fraction: None, None)
        if self._held is None:
            self._held = NativeLive()
        return self._held.draw(self.scene, settings, self.should_stop)
