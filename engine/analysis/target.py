"""Settings from a target error: squares of the frame tell what each number of samples loses in this
scene, and what it costs.

The error of n well-placed samples falls about as a power of n, so a few numbers of samples,
compared with many more, tell the error of any. What is chosen depends on pictures and counts of
rays alone, so the same scene and target give the same settings on every machine.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import SceneError
from ..film import FIRST_ESTIMATE, Film
from ..scene import Scene
from ..scene.problems import scene_problems
from ..settings import Settings
from .flip import displayed
from .metrics import relative_rmse, weighted_quantile
from .trade_crops import Crop, CropRenderer, Rendered, StoppedError, area
from .trade_tunables import has_soft_lights

Array = np.ndarray
Display = Callable[[Array], Array]
"""Linear colours (..., 3) to those of the display, 0 to 1."""

MEASURES = ("LEVELS", "RMSE")
_POWERS = tuple(1 << k for k in range(13))
MOST_SAMPLES = _POWERS[-1]
_FIRST_TRUTH, _MOST_TRUTH = 64, 1024
_MARGIN = 4
"""The truth of a pilot has at least so many times the samples of what is compared with it."""
_THRESHOLDS = (16.0, 8.0, 4.0, 2.0, 1.0, 0.5)
_SLOPES = (0.5, 1.0)
"""Errors of n samples fall at least as n^-0.5 and at most as n^-1."""
_LIGHT_SAMPLES = 2
"""Points on a soft light for each pixel sample: pixel samples bring new ones, and smooth edges as
well.
"""
VISIBLE = 0.999
"""The largest visible error is the one that so many of the pixels stay within: the very largest
hangs on single pixels, of which squares of the frame tell nothing.
"""
_CLASSES = 16
"""Pixels are told apart by how much a first look finds to do round them, in so many classes."""
_SQUARES, _SMALLEST, _LARGEST, _SHARE = 32, 8, 16, 1 / 16
"""Half of the squares lie where a first look finds most to do, half evenly over the rest."""


@dataclass(frozen=True)
class Target:
    """How wrong a picture may be.

    measure: LEVELS, the difference of red, green or blue on the display, in 8-bit levels, that 999
    of 1000 pixels stay within; or RMSE, of linear colour, over the picture's root mean square.
    value: the largest error that is good enough.
    """

    measure: str
    value: float

    def problems(self) -> list[str]:
        """What is wrong with it, one sentence each."""
        rules = (
            (
                self.measure in MEASURES,
                f"the target's measure {self.measure!r} is not one of {', '.join(MEASURES)}",
            ),
            (0 < self.value < math.inf, f"the target error is {self.value}: use a number above 0"),
        )
        return [text for good, text in rules if not good]

    def text(self, error: float) -> str:
        """An error in the target's unit."""
        return f"{error:.2g} levels" if self.measure == "LEVELS" else f"{100 * error:.2g} % RMSE"


@dataclass(frozen=True)
class Forecast:
    """What was chosen for a target. error: predicted, in the target's measure.  seconds: predicted
    of tracing the frame. pilot_seconds: what finding out took.  met: whether the prediction is
    within the target.  look: what the prediction rests on.
    """

    target: Target
    settings: Settings
    error: float
    seconds: float
    pilot_seconds: float
    look: Look = field(repr=False, compare=False)

    @property
    def met(self) -> bool:
        return self.error <= self.target.value

    @property
    def line(self) -> str:
        """In words."""
        s, asked = self.settings, self.target.text(self.target.value)
        chosen = (
            f"{s.samples} samples, threshold {s.error_threshold:g}, {s.light_samples} light samples"
        )
        best = "" if self.met else " (the best that is offered)"
        return (
            f"asked for {asked}: {chosen}{best}, predicted {self.target.text(self.error)} in "
            f"{self.seconds:.2f} s"
        )


def choose_settings(
    scene: Scene,
    base: Settings,
    target: Target,
    display: Display = displayed,
    *,
    should_stop: Callable[[], bool] = lambda: False,
) -> Forecast | None:
    """The settings with the fewest rays whose predicted error is within the target; None when
    stopped.

    base: what is no matter of accuracy, and light_samples = 1 where soft lights are to throw hard
    shadows; its region is the picture. Raises SceneError for a scene, settings or target that are
    not sound, MemoryError.
    """
    problems = scene_problems(scene) + base.problems() + target.problems()
    if problems:
        raise SceneError("\n".join(problems))
    lights = (
        min(base.light_samples, _LIGHT_SAMPLES)
        if has_soft_lights(scene, base)
        else base.light_samples
    )
    settings = replace(base, error_threshold=0.0, light_samples=lights)
    frame = base.region or (0, 0, *scene.camera.resolution)
    with CropRenderer(scene, (frame,), should_stop) as renderer:
        try:
            began = time.perf_counter()
            look = Look.at(renderer, frame, settings, target.measure, display)
            return _Pilot(renderer, look, settings, target).forecast(began)
        except StoppedError:
            return None


def reached_error(
    scene: Scene, forecast: Forecast, film: Film, should_stop: Callable[[], bool] = lambda: False
) -> float | None:
    """The error of a picture made with the forecast's settings, in the pilot's squares and as many
    others, against four times as many samples; None when stopped.
    """
    settings, look = forecast.settings, forecast.look
    truth = replace(
        settings, samples=_MARGIN * settings.samples, error_threshold=0.0, passes=frozenset()
    )
    crops = look.squares(is_check=True)
    with CropRenderer(scene, crops, should_stop) as renderer:
        try:
            true = renderer.render(truth).pictures
        except StoppedError:
            return None
    return look.error(look.weights(crops), look.cut(film.combined[..., :3], crops), true)


def error_between(
    measure: str, picture: Array, truth: Array, display: Display = displayed
) -> float:
    """Of linear pictures (..., 3), as Target says."""
    if measure == "RMSE":
        return relative_rmse(picture, truth)
    apart = _apart_on(display, picture, truth).ravel()
    return weighted_quantile(apart, np.ones(apart.size), VISIBLE)


def _apart_on(display: Display, picture: Array, truth: Array) -> Array:
    """(..., 3) linear colours → (...) largest difference of a channel, in 8-bit levels."""
    shown, true = _shown(display, picture, truth)
    return 255 * np.abs(shown - true).max(-1)


def _shown(display: Display, *pictures: Array) -> Array:
    """Pictures of one shape as the display shows them, at once: a view transform takes long to
    begin with.
    """
    return display(np.stack(pictures))


def _sum_around(image: Array) -> Array:
    """(h, w): of each pixel and its eight neighbours."""
    height, width = image.shape
    padded = np.pad(image, 1)
    around: Any = sum(padded[j : j + height, i : i + width] for j in range(3) for i in range(3))
    return around


@dataclass(frozen=True, eq=False)
class Look:
    """A first look at the whole frame: few samples tell where the errors will be, so that small
    things are not missed.

    frame: its rectangle.  side: of the squares.  apart: (h, w) squared difference between four
    samples and one, of linear colour or of what the display shows, summed over each pixel and its
    neighbours.  brightness: root mean square of linear colour.
    """

    frame: Crop
    side: int
    apart: Array
    brightness: float
    measure: str
    display: Display

    @classmethod
    def at(
        cls, renderer: CropRenderer, frame: Crop, settings: Settings, measure: str, display: Display
    ) -> Look:
        plain = replace(settings, passes=frozenset())
        few, one = (
            renderer.render(replace(plain, samples=n)).pictures[0].astype(float)
            for n in (FIRST_ESTIMATE, 1)
        )
        shown = (few, one) if measure == "RMSE" else _shown(display, few, one)
        side = min(max(int(math.sqrt(_SHARE * area([frame]) / _SQUARES)), _SMALLEST), _LARGEST)
        apart = _sum_around(((shown[0] - shown[1]) ** 2).sum(-1))
        return cls(frame, side, apart, float(np.sqrt((few**2).mean())), measure, display)

    def squares(self, is_check: bool) -> tuple[Crop, ...]:
        """Those of the pilot; for the check, as many others as well; the whole frame where it has
        hardly more.
        """
        rows, columns = (size // self.side for size in self.apart.shape)
        if rows * columns <= 2 * _SQUARES:
            return (self.frame,)
        cells = (
            self.apart[: rows * self.side, : columns * self.side]
            .reshape(rows, self.side, columns, self.side)
            .sum((1, 3))
            .ravel()
        )
        order = np.argsort(-cells, kind="stable")
        half = _SQUARES // 2
        most, rest = order[: half * (1 + is_check)], np.sort(order[2 * half :])
        shifts = (0.25, 0.75) if is_check else (0.25,)
        evenly = [
            rest[((np.arange(half) + shift) * len(rest) / half).astype(int)] for shift in shifts
        ]
        return tuple(self._square(int(cell), columns) for cell in np.concatenate([most, *evenly]))

    def _square(self, cell: int, columns: int) -> Crop:
        x, y = (
            self.frame[0] + cell % columns * self.side,
            self.frame[1] + cell // columns * self.side,
        )
        return x, y, x + self.side, y + self.side

    def cut(self, image: Array, crops: Sequence[Crop]) -> list[Array]:
        """Those crops of an image of the frame."""
        x, y = self.frame[:2]
        return [image[y0 - y : y1 - y, x0 - x : x1 - x] for x0, y0, x1, y1 in crops]

    def weights(self, crops: Sequence[Crop]) -> Array:
        """(pixels of the crops,) how many pixels of the frame each stands for: those where the
        first look found as much to do.
        """
        here = np.concatenate([crop.ravel() for crop in self.cut(self.apart, crops)])
        borders = np.unique(np.sort(here)[np.arange(1, _CLASSES) * here.size // _CLASSES])
        own, all_of_them = (
            np.searchsorted(borders, apart, side="right") for apart in (here, self.apart.ravel())
        )
        counts, everywhere = (
            np.bincount(classes, minlength=borders.size + 1) for classes in (own, all_of_them)
        )
        return everywhere[own] / counts[own]

    def error(self, weights: Array, pictures: Sequence[Array], truth: Sequence[Array]) -> float:
        """Of the frame, from some crops and their weights."""
        picture, reference = (
            np.concatenate([crop.reshape(-1, 3) for crop in crops]).astype(float)
            for crops in (pictures, truth)
        )
        if self.measure == "LEVELS":
            return weighted_quantile(_apart_on(self.display, picture, reference), weights, VISIBLE)
        squares = float((weights * ((picture - reference) ** 2).sum(-1)).sum())
        return (
            math.sqrt(squares / (3 * self.apart.size)) / self.brightness
            if self.brightness > 0
            else 0.0
        )


class _Pilot:
    """Finds the settings."""

    def __init__(
        self, renderer: CropRenderer, look: Look, settings: Settings, target: Target
    ) -> None:
        self._renderer, self._look, self._wanted, self._target = renderer, look, settings, target
        self._crops = look.squares(is_check=False)
        self._weights = look.weights(self._crops)
        self._scale = area([look.frame]) / area(self._crops)
        self._known: dict[tuple[int, float], Rendered] = {}
        self._errors: dict[tuple[int, float], float] = {}
        self._truth_samples = 0
        self._truth: Sequence[Array] = ()

    def forecast(self, began: float) -> Forecast:
        """began: when finding out began, by time.perf_counter."""
        samples = self._enough_samples()
        samples, threshold = min(self._options(samples), key=lambda option: self._rays(*option))
        wanted = replace(self._wanted, samples=samples, error_threshold=threshold)
        seconds = self._seconds(samples, threshold) + self._renderer.build_seconds
        return Forecast(
            self._target,
            wanted,
            self._error(samples, threshold),
            seconds,
            time.perf_counter() - began,
            self._look,
        )

    def _enough_samples(self) -> int:
        """The least power of two that meets the target, by a truth of four times as many where that
        can be had.
        """
        self._make_truth(_FIRST_TRUTH)
        while True:
            samples = next(
                (n for n in _POWERS if self._error(n) <= self._target.value), MOST_SAMPLES
            )
            if _MARGIN * samples <= self._truth_samples or self._truth_samples == _MOST_TRUTH:
                return samples
            self._make_truth(min(_MARGIN * samples, _MOST_TRUTH))

    def _options(self, samples: int) -> list[tuple[int, float]]:
        """(samples, threshold): these samples; and these or twice as many with the largest
        threshold that meets the target.
        """
        measured = [
            n for n in (samples, 2 * samples) if n > FIRST_ESTIMATE and self._is_measured(n)
        ]
        stopped = [
            next(((n, t) for t in _THRESHOLDS if self._error(n, t) <= self._target.value), None)
            for n in measured
        ]
        return [(samples, 0.0), *filter(None, stopped)]

    def _make_truth(self, samples: int) -> None:
        self._truth_samples, self._truth = samples, self._rendered(samples, 0.0).pictures
        self._errors = {}

    def _rendered(self, samples: int, threshold: float) -> Rendered:
        if (samples, threshold) not in self._known:
            plan = replace(
                self._wanted, samples=samples, error_threshold=threshold, passes=frozenset()
            )
            self._known[samples, threshold] = self._renderer.render(plan, crops=self._crops)
        return self._known[samples, threshold]

    def _is_measured(self, samples: int) -> bool:
        return _MARGIN * samples <= self._truth_samples

    def _nearest(self, samples: int) -> int:
        """The most samples up to these that are measured."""
        return min(samples, self._truth_samples // _MARGIN)

    def _error(self, samples: int, threshold: float = 0.0) -> float:
        """Measured, or along the slope of what is."""
        measured = self._nearest(samples)
        error = self._measured_error(measured, threshold)
        return error if measured == samples else error * (samples / measured) ** -self._slope()

    def _measured_error(self, samples: int, threshold: float) -> float:
        """Against the truth at hand; kept, as a display's own transform takes longer than many
        samples.
        """
        if (samples, threshold) not in self._errors:
            pictures = self._rendered(samples, threshold).pictures
            self._errors[samples, threshold] = self._look.error(
                self._weights, pictures, self._truth
            )
        return self._errors[samples, threshold]

    def _slope(self) -> float:
        """How the errors of measured numbers of samples fall: s in n^-s, by least squares."""
        numbers = [n for n in _POWERS if n >= FIRST_ESTIMATE and self._is_measured(n)]
        errors = [self._error(n) for n in numbers]
        if min(errors) == 0:
            return _SLOPES[1]
        slope = -float(np.polyfit(np.log(numbers), np.log(errors), 1)[0])
        return min(max(slope, _SLOPES[0]), _SLOPES[1])

    def _rays(self, samples: int, threshold: float) -> float:
        """Of the crops."""
        measured = self._nearest(samples)
        return self._rendered(measured, threshold).rays * samples / measured

    def _seconds(self, samples: int, threshold: float) -> float:
        """Of the frame."""
        measured = self._nearest(samples)
        return self._scale * self._rendered(measured, threshold).seconds * samples / measured
