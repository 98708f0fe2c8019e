"""The trade of time for accuracy, measured on one scene: crops rendered over a grid of tunables,
each compared with a reference.

What a setting costs and what it loses depends on the scene, so it is measured there: seconds are
the least of several interleaved renders, errors are against a picture of many more samples.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import SceneError
from ..film import FIRST_ESTIMATE
from ..scene import Scene
from ..scene.problems import scene_problems
from ..settings import Settings
from . import metrics
from .trade_crops import CropRenderer, Rendered, Squares, StoppedError, pick_squares
from .trade_errors import frame_errors
from .trade_rows import Row, Trade, advice, speed, with_bounds, with_front
from .trade_tunables import (
    TUNABLES,
    has_fog,
    has_soft_lights,
    reflects_roughly,
    scatters,
    settings_grid,
)

__all__ = ["TUNABLES", "Row", "Trade", "advice", "measure", "settings_grid"]

Array = np.ndarray

REFERENCE_SAMPLES = 1024
_REFERENCE_LIGHT_SAMPLES = 4
_REFERENCE_MARGIN = 4
"""The reference takes at least so many times the light points of any point of the grid."""
_REFERENCE_BOUNCES = 16
_REFERENCE_DIFFUSE = 8
_REFERENCE_VOLUME = 32
SQUARES, SIDE = 96, 12
"""Squares and their pixels across: every other one is for choosing settings, the rest for checking
what was chosen.
"""
_GLANCE = 64
"""Samples of the picture that the first points are compared with."""
_GLANCE_MARGIN = 4
"""The first points take at most so many times fewer samples than that, and the full reference at
least so many times more: else it is quick enough by itself.
"""
_LOOK, _LONGEST_STRIDE = 2**17, 4
"""Pixels of a first look, and how many of the frame stand across one of them at most."""
_PAUSE = 2.0
"""Seconds between two tellings of what is known so far."""


def measure(
    scene: Scene,
    base: Settings | None = None,
    *,
    values: Mapping[str, Sequence[Any]] | None = None,
    squares: int = SQUARES,
    side: int = SIDE,
    reference_samples: int = REFERENCE_SAMPLES,
    reference_seconds: float = 60.0,
    repeats: int = 5,
    should_stop: Callable[[], bool] = lambda: False,
    on_progress: Callable[[float], None] = lambda fraction: None,
    on_trade: Callable[[Trade], None] = lambda trade: None,
) -> Trade:
    """Render squares of `scene` over the grid of tunables and compare each with a reference.

    base: the current settings; what is no tunable stays as it is there.  values: tunable → values
    to try instead of those of `TUNABLES`. squares, side: how many of how many pixels across; where
    the frame has no more, it is measured as a whole.  reference_samples: per pixel.
    reference_seconds: the float64 tracer makes the reference if it should take no longer than
    this; else the core does, and `Trade.reference` says so.  should_stop: asked at least every 50
    ms; the rows measured until then are returned.  on_trade: told what is known, early and every
    now and then.  Raises SceneError for a scene or settings that are not sound, MemoryError.
    """
    base = replace(base or Settings(), passes=frozenset(), region=None)
    grid = sorted(
        settings_grid(scene, base, values or {}),
        key=lambda settings: (settings != base, _cost(settings)),
    )
    problems = scene_problems(scene) + [
        problem for settings in grid for problem in settings.problems()
    ]
    if problems:
        raise SceneError("\n".join(dict.fromkeys(problems)))
    with CropRenderer(scene, ((0, 0, *scene.camera.resolution),), should_stop) as renderer:
        work = _Work(renderer, base, grid, on_progress, on_trade)
        try:
            work.look(squares, side)
            work.fill(repeats, reference_samples, reference_seconds)
        except StoppedError:
            work.complete = False
        return work.trade()


# --- rendering
# --------------------------------------------------------------------------------------------------


class _Work:
    """A measurement on its way."""

    def __init__(
        self,
        renderer: CropRenderer,
        base: Settings,
        grid: list[Settings],
        on_progress: Callable[[float], None],
        on_trade: Callable[[Trade], None],
    ) -> None:
        self.complete, self.repeats = True, 0
        self._renderer, self._base, self._grid = renderer, base, grid
        self._tell, self._tell_trade, self._told_at = on_progress, on_trade, time.monotonic()
        self._reference = "none: stopped before it was complete"
        self._size, self._overhead = 0.0, 0.0
        self._squares = self._others = Squares((), np.zeros(0))
        self._rendered: dict[Settings, Rendered] = {}
        self._errors: dict[Settings, dict[str, float]] = {}
        self._checked: set[Settings] = set()
        self._first: Trade | None = None
        self._done, self._expected, self._fraction = 0.0, 1.0, 0.0

    def look(self, count: int, side: int) -> None:
        """Pick the squares by where few samples, and settings that leave out much, differ from a
        little more, in a smaller picture of a large frame. What a render of a square takes beyond
        its pixels is told from the first of these pictures, once whole and once in squares.
        """
        few = replace(
            _to_the_end(self._base),
            samples=FIRST_ESTIMATE,
            light_samples=min(self._base.light_samples, 2),
        )
        least = replace(few, samples=1, light_samples=1, max_bounces=0)
        width, height = self._renderer.scene.camera.resolution
        stride = _stride(width * height, count * side**2)
        with self._renderer.smaller(stride):
            whole, *coarser = (
                self._renderer.render(settings)
                for settings in (few, replace(few, samples=1), least)
            )
            picture = whole.pictures[0].astype(float)
            apart = [
                np.nan_to_num(((picture - other.pictures[0]) ** 2).sum(-1), posinf=0.0)
                for other in coarser
            ]
            work = sum(image / max(image.sum(), 1e-300) for image in apart)
            timed, others = pick_squares(work, count, side).halves()
            if others is not timed:
                seconds = np.dot(self._renderer.render(few, crops=timed.crops).each, timed.weights)
                self._overhead = max(0.0, seconds - whole.seconds) / timed.weights.sum()
        self._size = metrics.root_mean_square(np.nan_to_num(picture, posinf=0.0, neginf=0.0))
        work = np.repeat(np.repeat(work, stride, 0), stride, 1)[:height, :width]
        self._squares, self._others = pick_squares(work, count, side).halves()

    def fill(self, repeats: int, samples: int, seconds: float) -> None:
        """The grid against a reference of the core's, and against the float64 tracer's where that
        is not too slow; the front on the other squares; and the grid again and again, so that a
        busy moment of the machine meets all settings.
        """
        quick = reference_settings(self._renderer.scene, self._base, self._grid, samples)
        grid = sum(map(_cost, self._grid)) * (repeats + 0.2)
        if samples >= _GLANCE_MARGIN * _GLANCE:
            self._expected = grid + 2 * _cost(quick)
            self._glance()
        exact = quick if self._is_too_slow(quick, seconds) else replace(quick, backend="NUMPY")
        self._expected = self._done + grid + sum(map(_cost, {quick, exact})) + _cost(exact)
        for reference in dict.fromkeys((quick, exact)):
            truth = self._render(reference, self._squares).pictures
            self._reference = _in_words(reference)
            for settings in self._grid:
                if settings not in self._rendered:
                    self._rendered[settings] = self._render(settings, self._squares)
                self._errors[settings] = frame_errors(
                    self._rendered[settings].pictures, truth, self._squares, self._size
                )
                self._publish()
        self.repeats = 1
        if self._others is not self._squares:
            self._check(exact, truth)
        for _ in range(repeats - 1):
            for settings in self._grid:
                known, again = self._rendered[settings], self._render(settings, self._squares)
                self._rendered[settings] = replace(
                    known, each=list(map(min, known.each, again.each))
                )
                self._publish()
            self.repeats += 1
        self._tell(1.0)

    def _glance(self) -> None:
        """A first answer within seconds, which the measurement takes the place of: the present
        settings with fewer samples, on every other square, against few samples.
        """
        whole, fewer = self._squares, self._squares.halves()[0]
        most = _GLANCE // _GLANCE_MARGIN
        ladder = [
            settings
            for settings in self._grid
            if settings.samples <= most
            and replace(settings, samples=self._base.samples) == self._base
        ]
        if not ladder:
            return
        reference = reference_settings(self._renderer.scene, self._base, ladder, _GLANCE)
        self._squares = fewer
        truth = self._render(reference, fewer).pictures
        for settings in ladder:
            self._rendered[settings] = self._render(settings, fewer)
            pictures = self._rendered[settings].pictures
            self._errors[settings] = frame_errors(pictures, truth, fewer, self._size)
        self._reference = f"a first look by {_in_words(reference)}"
        self._first = self.trade()
        self._tell_trade(self._first)
        self._squares = whole
        self._rendered, self._errors = {}, {}

    def _check(self, reference: Settings, truth: list[Array]) -> None:
        """What is on the front, and the current settings, on the other squares too, which had no
        part in choosing them.
        """
        other_truth = self._render(reference, self._others).pictures
        both = Squares(
            self._squares.crops + self._others.crops,
            np.concatenate([self._squares.weights, self._others.weights]) / 2,
        )
        while True:
            rows = {
                settings: row
                for settings, row in self._rows().items()
                if settings not in self._checked
            }
            best = [settings for settings, row in rows.items() if row.on_front or row.current]
            if not best:
                return
            for settings in best:
                others = self._render(settings, self._others).pictures
                pictures = self._rendered[settings].pictures + others
                self._errors[settings] = frame_errors(
                    pictures, truth + other_truth, both, self._size
                )
                self._checked.add(settings)
                self._publish()

    def trade(self) -> Trade:
        """What is known: the first look until as much is measured."""
        if self._first is not None and len(self._errors) < len(self._first.rows):
            return replace(self._first, complete=self.complete)
        crops = (
            self._squares.crops
            if self._others is self._squares
            else self._squares.crops + self._others.crops
        )
        resolution = self._renderer.scene.camera.resolution
        return Trade(
            tuple(self._rows().values()),
            self._reference,
            crops,
            resolution,
            self.repeats,
            self.complete,
        )

    def _rows(self) -> dict[Settings, Row]:
        """By frame_seconds."""
        rows = {settings: self._row(settings, errors) for settings, errors in self._errors.items()}
        by_row = {id(row): settings for settings, row in rows.items()}
        ordered = sorted(rows.values(), key=speed)
        marked = with_front(with_bounds(ordered))
        return {by_row[id(row)]: new for row, new in zip(ordered, marked, strict=True)}

    def _row(self, settings: Settings, errors: Mapping[str, Any]) -> Row:
        rendered = self._rendered[settings]
        each = np.maximum(np.array(rendered.each) - self._overhead, 0.02 * np.array(rendered.each))
        frame_seconds = float(np.dot(each, self._squares.weights)) + self._renderer.build_seconds
        tunables = {tunable.name: getattr(settings, tunable.name) for tunable in TUNABLES}
        current = all(getattr(self._base, name) == value for name, value in tunables.items())
        return Row(
            tunables,
            sum(rendered.each),
            frame_seconds,
            **errors,
            current=current,
            checked=settings in self._checked,
        )

    def _render(self, settings: Settings, squares: Squares) -> Rendered:
        rendered = self._renderer.render(settings, crops=squares.crops)
        self._done += _cost(settings)
        self._fraction = max(self._fraction, min(self._done / self._expected, 1.0))
        self._tell(self._fraction)
        return rendered

    def _publish(self) -> None:
        now = time.monotonic()
        if now - self._told_at > _PAUSE:
            self._tell_trade(self.trade())
            self._told_at = time.monotonic()

    def _is_too_slow(self, settings: Settings, allowed: float) -> bool:
        """Whether the float64 tracer would take longer than `allowed` for these settings: one
        sample of one square tells.
        """
        if settings.backend == "NUMPY":
            return True  # it is the one at work
        crops = self._squares.crops
        start = time.perf_counter()
        self._renderer.film(
            replace(
                settings,
                backend="NUMPY",
                samples=1,
                light_samples=1,
                region=crops[len(crops) // 2],
            )
        )
        pilot_seconds = time.perf_counter() - start
        lights = (1 + settings.light_samples) / 2
        return pilot_seconds * settings.samples * lights * len(crops) > allowed


def _stride(pixels: int, picked: int) -> int:
    """How many pixels of a frame stand across one of a first look: that has some four times the
    pixels that are picked of it, so that the picks' time can be told from it.
    """
    looked = max(_LOOK, 4 * picked)
    return min(math.ceil(math.sqrt(max(pixels / looked, 1.0))), _LONGEST_STRIDE)


def _to_the_end(settings: Settings) -> Settings:
    """The same where no pixel stops early and no ray is cut off."""
    return replace(settings, error_threshold=0.0, cutoff=0.0)


def reference_settings(
    scene: Scene, base: Settings, grid: Sequence[Settings], samples: int
) -> Settings:
    """What the errors of a grid are measured against, drawn by the base's tracer. Raises SceneError
    where it asks for too much.
    """
    points = max(s.samples * s.light_samples for s in grid)
    light_samples = (
        max(_REFERENCE_LIGHT_SAMPLES, -(-_REFERENCE_MARGIN * points // samples))
        if has_soft_lights(scene, base)
        else 1
    )
    bounces = max(_REFERENCE_BOUNCES, *(s.max_bounces for s in grid))
    diffuse = max(s.diffuse_bounces for s in grid)
    settings = replace(
        _to_the_end(base),
        samples=samples,
        light_samples=light_samples,
        max_bounces=bounces,
        lamp_shadows=0,
        diffuse_bounces=max(diffuse, _REFERENCE_DIFFUSE) if scatters(scene, base) else diffuse,
        volume_samples=max(_REFERENCE_VOLUME, *(s.volume_samples for s in grid))
        if has_fog(scene, base)
        else base.volume_samples,
        reflections="ALL" if reflects_roughly(scene, base) else base.reflections,
    )
    problems = settings.problems()
    if problems:
        raise SceneError("the reference cannot be made: " + "; ".join(problems))
    return settings


def _cost(settings: Settings) -> float:
    """About proportional to the time of a render, for the progress."""
    return (
        settings.samples
        * (1 + settings.light_samples)
        * (1 if settings.backend == "NATIVE" else 30)
    )


def _in_words(reference: Settings) -> str:
    tracer = (
        "the float64 tracer"
        if reference.backend == "NUMPY"
        else "the core itself (the float64 tracer would have been too slow)"
    )
    return (
        f"{tracer}, {reference.samples} samples × {reference.light_samples} light samples, "
        f"{reference.max_bounces} bounces"
    )
