"""The trade of time for accuracy, measured on one scene: crops rendered over a grid of knobs, each compared with a reference.

What a setting costs and what it loses depends on the scene, so it is measured there: seconds are the least of several interleaved
renders, errors are against a picture of many more samples.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from . import metrics
from .errors import SceneError
from .film import FIRST_ESTIMATE
from .flip import displayed, flip
from .packing import is_soft
from .scene import Scene
from .settings import Settings
from .trade_crops import Crop, CropRenderer, Rendered, StoppedError, area, choose_crops

Array = np.ndarray

REFERENCE_SAMPLES = 1024
_REFERENCE_LIGHT_SAMPLES = 4
_REFERENCE_MARGIN = 4
"""The reference takes at least so many times the light points of any point of the grid."""
_REFERENCE_BOUNCES = 16


@dataclass(frozen=True)
class Knob:
    """A setting that trades time for accuracy.

    name: a field of Settings.  values: from fast to accurate.  matters: whether it can change a picture of this scene.
    falling: smaller values are the more accurate ones.  group: knobs of one group are combined with each other.
    """

    name: str
    values: tuple[Any, ...]
    matters: Callable[[Scene], bool]
    falling: bool = False
    group: str = "sampling"

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
    Knob("max_bounces", (0, 1, 2, 4, 8), has_bounces, group="bounces"),
    Knob("cutoff", (0.01, 0.0), has_bounces, falling=True, group="bounces"),
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
    found = _Found()
    with CropRenderer(scene, crops, should_stop) as renderer:
        try:
            _fill(found, _Work(renderer, on_progress), grid, repeats, reference_samples, reference_seconds)
        except StoppedError:
            found.complete = False
    share = area(crops) / math.prod(scene.camera.resolution)
    seconds = found.seconds
    rows = [_row(s, base, seconds[s], seconds[s] / share + renderer.build_seconds, errors) for s, errors in found.errors.items()]
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
        crops = work.render(settings)
        found.seconds[settings] = min(found.seconds.get(settings, math.inf), crops.seconds)
        if settings not in found.errors:
            found.errors[settings] = _errors(crops.pictures, truth)


def settings_grid(scene: Scene, base: Settings, values: Mapping[str, Sequence[Any]]) -> list[Settings]:
    """Every combination of each group's knobs that can change a picture of this scene, the base's own values always among them; the other
    groups' knobs are as the base has them: what rays leave out and how many there are hardly depend on each other, and a grid over all
    knobs takes seven times as long."""
    unknown = sorted(set(values) - {knob.name for knob in KNOBS})
    if unknown:
        raise SceneError(f"no such knob: {', '.join(unknown)}; there are {', '.join(knob.name for knob in KNOBS)}")
    knobs = [knob for knob in KNOBS if knob.matters(scene)]
    groups = [[knob for knob in knobs if knob.group == group] for group in dict.fromkeys(knob.group for knob in knobs)]
    grid = dict.fromkeys(settings for group in groups for settings in _combinations(group, base, values))
    return [settings for settings in grid if settings == base or not _is_idle(settings)]


def _combinations(knobs: Sequence[Knob], base: Settings, values: Mapping[str, Sequence[Any]]) -> Iterator[Settings]:
    """All of some knobs."""
    for steps in itertools.product(*(_ladder(knob, base, values) for knob in knobs)):
        yield replace(base, **{knob.name: step for knob, step in zip(knobs, steps, strict=True)})


def _ladder(knob: Knob, base: Settings, values: Mapping[str, Sequence[Any]]) -> list[Any]:
    return knob.ladder(*values.get(knob.name, knob.values), getattr(base, knob.name))


def _is_idle(settings: Settings) -> bool:
    """Whether a knob is turned that can do nothing: no pixel stops before the samples that the first estimate takes, and at most one
    bounce is hardly worth cutting off."""
    stops_none = settings.error_threshold > 0 and settings.samples <= FIRST_ESTIMATE
    return stops_none or (settings.cutoff > 0 and settings.max_bounces <= 1)


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
    """Crops of one scene, and how far the measurement is."""

    def __init__(self, crops: CropRenderer, on_progress: Callable[[float], None]) -> None:
        self.crops, self._tell = crops, on_progress
        self._done, self._expected, self._range = 0.0, 1.0, (0.0, 0.5)

    def expect(self, cost: float) -> None:
        """The second half of the progress: the grid, of this cost in all."""
        self._done, self._expected, self._range = 0.0, cost, (0.5, 1.0)

    def render(self, settings: Settings, is_reference: bool = False) -> Rendered:
        """The crops; those of the reference are all of the progress's first half."""
        cost = 1.0 if is_reference else _cost(settings)
        return self.crops.render(settings, lambda: self._advance(cost / len(self.crops.crops)))

    def _advance(self, cost: float) -> None:
        self._done += cost
        low, high = self._range
        self._tell(low + (high - low) * min(self._done / self._expected, 1.0))


def _cost(settings: Settings) -> float:
    """About proportional to the time of a render, for the progress."""
    return settings.samples * (1 + settings.light_samples)


def _reference(work: _Work, grid: Sequence[Settings], samples: int, seconds: float) -> tuple[list[Array], str]:
    """The crops of the reference, and what it is in words."""
    points = max(s.samples * s.light_samples for s in grid)
    light_samples = max(_REFERENCE_LIGHT_SAMPLES, -(-_REFERENCE_MARGIN * points // samples)) if has_soft_lights(work.crops.scene) else 1
    bounces = max(_REFERENCE_BOUNCES, *(s.max_bounces for s in grid))
    settings = replace(grid[0], samples=samples, error_threshold=0.0, light_samples=light_samples, max_bounces=bounces, cutoff=0.0)
    problems = settings.problems()
    if problems:
        raise SceneError("the reference cannot be made: " + "; ".join(problems))
    backend = grid[0].backend if _too_slow(work, settings, seconds) else "NUMPY"
    pictures = work.render(replace(settings, backend=backend), is_reference=True).pictures
    tracer = "the float64 tracer" if backend == "NUMPY" else "the core itself (the float64 tracer would have been too slow)"
    return pictures, f"{tracer}, {samples} samples × {light_samples} light samples, {bounces} bounces"


def _too_slow(work: _Work, settings: Settings, allowed: float) -> bool:
    """Whether the float64 tracer would take longer than `allowed` for these settings: one sample of one crop tells."""
    start = time.perf_counter()
    crops = work.crops.crops
    middle = crops[len(crops) // 2]
    work.crops.film(replace(settings, backend="NUMPY", samples=1, light_samples=1, region=middle))
    pilot_seconds = time.perf_counter() - start
    lights = (1 + settings.light_samples) / 2
    return pilot_seconds * settings.samples * lights * area(crops) / area([middle]) > allowed


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
