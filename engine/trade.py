"""The trade of time for accuracy, measured on one scene: crops rendered over a grid of knobs, each compared with a reference.

What a setting costs and what it loses depends on the scene, so it is measured there: seconds are the least of several interleaved
renders, errors are against a picture of many more samples.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from . import metrics
from .errors import SceneError
from .film import Film
from .flip import displayed, flip
from .packing import is_soft
from .scene import Scene
from .settings import Settings

Array = np.ndarray
Crop = tuple[int, int, int, int]

REFERENCE_SAMPLES = 1024
_FIRST_STOP = 4
"""Samples that every pixel takes whatever the error threshold (SEMANTICS.md, Refinement)."""
_REFERENCE_LIGHT_SAMPLES = 4
_REFERENCE_MARGIN = 4
"""The reference takes at least so many times the light points of any point of the grid."""
_REFERENCE_BOUNCES = 16


@dataclass(frozen=True)
class Knob:
    """A setting that trades time for accuracy.

    name: a field of Settings.  values: from fast to accurate.  matters: whether it can change a picture of this scene.
    falling: smaller values are the more accurate ones.
    """

    name: str
    values: tuple[Any, ...]
    matters: Callable[[Scene], bool]
    falling: bool = False

    @property
    def kind(self) -> type:
        """int or float."""
        return type(self.values[0])

    def ladder(self, *values: Any) -> list[Any]:
        """Different values from fast to accurate."""
        return sorted(set(values), reverse=self.falling)


def has_soft_lights(scene: Scene) -> bool:
    """Whether a light has an extent."""
    return any(is_soft(light) for light in scene.lights)


def has_bounces(scene: Scene) -> bool:
    """Whether a material reflects or refracts rays."""
    return any(lobe.kind in ("MIRROR", "REFRACTION") for material in scene.materials for lobe in material.lobes)


KNOBS = (
    Knob("samples", (1, 2, 4, 8, 16, 32, 64), lambda scene: True),
    Knob("error_threshold", (8.0, 2.0, 0.0), lambda scene: True, falling=True),
    Knob("light_samples", (1, 2, 4, 8, 16), has_soft_lights),
    Knob("max_bounces", (0, 1, 2, 4, 8), has_bounces),
)
"""Every knob that is measured. A new one needs a row here and nothing else."""


@dataclass(frozen=True)
class Row:
    """One setting, measured.

    knobs: field of Settings → value.  seconds: of tracing the crops.  frame_seconds: expected of the whole frame, trees included.
    relative_rmse: of linear colour, over the reference's root mean square.  max_error: largest difference of linear colour.
    levels: largest difference on screen, in 8-bit levels.  psnr: decibels of the screen's colours.  flip_mean, flip_p99: LDR-FLIP.
    wrong: share of pixels that are off by more than 1 %.  on_front: no other row is both faster and better.  current: the base settings.
    """

    knobs: dict[str, Any]
    seconds: float
    frame_seconds: float
    relative_rmse: float
    max_error: float
    levels: float
    psnr: float
    flip_mean: float
    flip_p99: float
    wrong: float
    on_front: bool = False
    current: bool = False


@dataclass(frozen=True)
class Trade:
    """rows: by seconds.  reference: what the errors are against, in words.  crops: (x0, y0, x1, y1) of the full frame.
    repeats: renders per row, of which the fastest counts.  complete: False when it was stopped before every row had its renders."""

    rows: tuple[Row, ...]
    reference: str
    crops: tuple[Crop, ...]
    resolution: tuple[int, int]
    repeats: int
    complete: bool

    @property
    def front(self) -> tuple[Row, ...]:
        """The rows that nothing beats, fastest first."""
        return tuple(row for row in self.rows if row.on_front)

    @property
    def current(self) -> Row | None:
        """The row of the base settings."""
        return next((row for row in self.rows if row.current), None)

    def as_json(self) -> dict[str, Any]:
        """Plain values; what is not finite is None."""
        rows = [{name: _plain(value) for name, value in asdict(row).items()} for row in self.rows]
        return {**asdict(self), "rows": rows}


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


class _StoppedError(Exception):
    """The caller wants no more."""


def measure(
    scene: Scene,
    base: Settings | None = None,
    *,
    values: Mapping[str, Sequence[Any]] | None = None,
    crops: Sequence[Crop] | None = None,
    reference_samples: int = REFERENCE_SAMPLES,
    reference_seconds: float = 60.0,
    repeats: int = 5,
    should_stop: Callable[[], bool] = lambda: False,
    on_progress: Callable[[float], None] = lambda fraction: None,
) -> Trade:
    """Render crops of `scene` over the grid of knobs and compare each with a reference.

    base: the current settings; what is no knob stays as it is there.  values: knob → values to try instead of those of `KNOBS`.
    reference_samples: per pixel.  reference_seconds: the float64 tracer makes the reference if it should take no longer than this; else
    the core does, and `Trade.reference` says so.  should_stop: asked at least every 50 ms; the rows measured until then are returned.
    Raises SceneError for a scene or settings that are not sound, MemoryError.
    """
    base = replace(base or Settings(), passes=frozenset(), region=None)
    crops = tuple(crops or choose_crops(scene.camera.resolution))
    grid = settings_grid(scene, base, values or {})
    problems = scene.problems() + [problem for settings in grid for problem in settings.problems()]
    if problems:
        raise SceneError("\n".join(dict.fromkeys(problems)))
    work, found = _Work(scene, crops, should_stop, on_progress), _Found()
    try:
        _fill(found, work, grid, repeats, reference_samples, reference_seconds)
    except _StoppedError:
        found.complete = False
    finally:
        work.close()
    share = sum((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in crops) / math.prod(scene.camera.resolution)
    seconds = found.seconds
    rows = [_row(s, base, seconds[s], seconds[s] / share + work.build_seconds, errors) for s, errors in found.errors.items()]
    return Trade(with_front(rows), found.reference, crops, scene.camera.resolution, repeats, found.complete)


@dataclass
class _Found:
    """What is known so far, by settings."""

    reference: str = "none: stopped before it was complete"
    seconds: dict[Settings, float] = field(default_factory=dict)
    errors: dict[Settings, dict[str, float]] = field(default_factory=dict)
    complete: bool = True


def _fill(found: _Found, work: _Work, grid: list[Settings], repeats: int, samples: int, seconds: float) -> None:
    """Make the reference, then render the whole grid, `repeats` times over, so that a busy moment of the machine meets all settings."""
    truth, found.reference = _reference(work, grid, samples, seconds)
    work.expect(repeats * sum(_cost(settings) for settings in grid))
    for settings in grid * repeats:
        took, pictures = work.render(settings)
        found.seconds[settings] = min(found.seconds.get(settings, math.inf), took)
        if settings not in found.errors:
            found.errors[settings] = _errors(pictures, truth)


def choose_crops(resolution: tuple[int, int], count: int = 16, side: int = 20) -> tuple[Crop, ...]:
    """Up to `count` squares spread evenly over the frame, wherever the picture has something to show or not, so that their mean error
    is the frame's; the whole frame where it is hardly larger than they are."""
    width, height = resolution
    across = max(int(math.sqrt(count)), 1)
    if width <= across * side or height <= across * side:
        return ((0, 0, width, height),)
    lefts, bottoms = ([int((k + 0.5) * size / across - side / 2) for k in range(across)] for size in (width, height))
    return tuple((x, y, x + side, y + side) for y in bottoms for x in lefts)


def settings_grid(scene: Scene, base: Settings, values: Mapping[str, Sequence[Any]]) -> list[Settings]:
    """Every combination of the knobs that can change a picture of this scene, the base's own values always among them."""
    unknown = sorted(set(values) - {knob.name for knob in KNOBS})
    if unknown:
        raise SceneError(f"no such knob: {', '.join(unknown)}; there are {', '.join(knob.name for knob in KNOBS)}")
    names = [knob.name for knob in KNOBS if knob.matters(scene)]
    ladders = [_ladder(knob, base, values) for knob in KNOBS if knob.matters(scene)]
    grid = [replace(base, **dict(zip(names, steps, strict=True))) for steps in itertools.product(*ladders)]
    return [settings for settings in grid if settings == base or not _is_idle(settings)]


def _ladder(knob: Knob, base: Settings, values: Mapping[str, Sequence[Any]]) -> list[Any]:
    return knob.ladder(*values.get(knob.name, knob.values), getattr(base, knob.name))


def _is_idle(settings: Settings) -> bool:
    """Whether the error threshold cannot stop a pixel: none stops before the samples that the first estimate takes."""
    return settings.error_threshold > 0 and settings.samples <= _FIRST_STOP


def with_front(rows: Sequence[Row]) -> tuple[Row, ...]:
    """The rows by seconds, `on_front` set where no row is as fast and has a smaller relative RMSE, or is faster with an equal one."""
    ordered, least = [], math.inf
    for row in sorted(rows, key=lambda row: (row.seconds, row.relative_rmse)):
        ordered.append(replace(row, on_front=row.relative_rmse < least))
        least = min(least, row.relative_rmse)
    return tuple(ordered)


def advice(trade: Trade) -> str:
    """One sentence on the current settings: on the front, or what would be as good and faster."""
    current = trade.current
    if current is None:
        return "The current settings were not measured"
    if not any(row.relative_rmse for row in trade.rows):
        return "Every setting gives the same picture in these crops: if the frame has more to show, use more or larger crops"
    if current.on_front:
        return "The current settings lie on the front: nothing measured is both faster and better"
    better = next(row for row in trade.front if row.relative_rmse <= current.relative_rmse)
    change = ", ".join(f"{name} {value}" for name, value in better.knobs.items() if current.knobs[name] != value)
    return f"{change} would be as good in {better.seconds / current.seconds:.0%} of the time"


# --- rendering ----------------------------------------------------------------------------------------------------------------------


class _Work:
    """Renders crops, one settings after the other, on trees that are made once."""

    def __init__(self, scene: Scene, crops: tuple[Crop, ...], should_stop: Callable[[], bool], on_progress: Callable) -> None:
        self.scene, self.crops, self.should_stop, self._tell = scene, crops, should_stop, on_progress
        self.build_seconds = 0.0
        self._done, self._expected, self._range = 0.0, 1.0, (0.0, 0.5)
        self._held: Any = None

    def expect(self, cost: float) -> None:
        """The second half of the progress: the grid, of this cost in all."""
        self._done, self._expected, self._range = 0.0, cost, (0.5, 1.0)

    def render(self, settings: Settings, share_of: float | None = None) -> tuple[float, list[Array]]:
        """Seconds of tracing and the crops' linear colours, (h, w, 3) float32. share_of: this render is all of the progress's half."""
        seconds, pictures, cost = 0.0, [], 1.0 if share_of else _cost(settings)
        for crop in self.crops:
            film = self._film(replace(settings, region=crop))
            seconds += film.stats["trace"]
            self.build_seconds = max(self.build_seconds, film.stats["build"])
            pictures.append(film.combined[..., :3])
            self._done += cost / len(self.crops)
            low, high = self._range
            self._tell(low + (high - low) * min(self._done / self._expected, 1.0))
        return seconds, pictures

    def _film(self, settings: Settings) -> Film:
        film = self._traced(settings)
        if film is None or not film.complete or self.should_stop():
            raise _StoppedError
        return film

    def _traced(self, settings: Settings) -> Film | None:
        if settings.backend != "NATIVE":
            from .reference import render_reference

            return render_reference(self.scene, settings, self.should_stop, lambda fraction: None, None)
        if self._held is None:
            from .native_live import NativeLive

            self._held = NativeLive()
        films: list[Film] = []
        self._held.render(self.scene, settings, True, self.should_stop, lambda film, final: films.append(film) if final else None)
        return films[-1] if films else None

    def close(self) -> None:
        if self._held is not None:
            self._held.close()


def _cost(settings: Settings) -> float:
    """About proportional to the time of a render, for the progress."""
    return settings.samples * (1 + settings.light_samples)


def _reference(work: _Work, grid: Sequence[Settings], samples: int, seconds: float) -> tuple[list[Array], str]:
    """The crops of the reference, and what it is in words."""
    points = max(s.samples * s.light_samples for s in grid)
    light_samples = max(_REFERENCE_LIGHT_SAMPLES, -(-_REFERENCE_MARGIN * points // samples)) if has_soft_lights(work.scene) else 1
    bounces = max(_REFERENCE_BOUNCES, *(s.max_bounces for s in grid))
    settings = replace(grid[0], samples=samples, error_threshold=0.0, light_samples=light_samples, max_bounces=bounces)
    problems = settings.problems()
    if problems:
        raise SceneError("the reference cannot be made: " + "; ".join(problems))
    backend = grid[0].backend if _too_slow(work, settings, seconds) else "NUMPY"
    _, pictures = work.render(replace(settings, backend=backend), share_of=1.0)
    tracer = "the float64 tracer" if backend == "NUMPY" else "the core itself (the float64 tracer would have been too slow)"
    return pictures, f"{tracer}, {samples} samples × {light_samples} light samples, {bounces} bounces"


def _too_slow(work: _Work, settings: Settings, allowed: float) -> bool:
    """Whether the float64 tracer would take longer than `allowed` for these settings: one sample of one crop tells."""
    start = time.perf_counter()
    x0, y0, x1, y1 = work.crops[len(work.crops) // 2]
    pilot = replace(settings, backend="NUMPY", samples=1, light_samples=1, region=(x0, y0, x1, y1))
    work._film(pilot)
    pilot_seconds = time.perf_counter() - start
    pixels = sum((right - left) * (top - bottom) for left, bottom, right, top in work.crops)
    lights = (1 + settings.light_samples) / 2
    return pilot_seconds * settings.samples * lights * pixels / ((x1 - x0) * (y1 - y0)) > allowed


# --- errors -------------------------------------------------------------------------------------------------------------------------


def _errors(pictures: list[Array], truth: list[Array]) -> dict[str, float]:
    """The error columns of a row, over all crops together."""
    picture, reference = (np.concatenate([crop.reshape(-1, 1, 3) for crop in crops]) for crops in (pictures, truth))
    shown, shown_reference = displayed(picture), displayed(reference)
    flips = np.concatenate([flip(*pair).ravel() for pair in zip(pictures, truth, strict=True)])
    return {
        "relative_rmse": metrics.relative_rmse(picture, reference),
        "max_error": metrics.max_absolute_error(picture, reference),
        "levels": 255 * metrics.max_absolute_error(shown, shown_reference),
        "psnr": metrics.psnr(shown, shown_reference),
        "flip_mean": float(flips.mean()),
        "flip_p99": float(np.percentile(flips, 99)),
        "wrong": metrics.wrong_fraction(picture, reference),
    }


def _row(settings: Settings, base: Settings, seconds: float, frame_seconds: float, errors: dict[str, float]) -> Row:
    knobs = {knob.name: getattr(settings, knob.name) for knob in KNOBS}
    current = all(getattr(base, name) == value for name, value in knobs.items())
    return Row(knobs, seconds, frame_seconds, **errors, current=current)
