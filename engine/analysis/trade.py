"""The trade of time for accuracy, measured on one scene: crops rendered over a grid of knobs, each
compared with a reference.

What a setting costs and what it loses depends on the scene, so it is measured there: seconds are
the least of several interleaved renders, errors are against a picture of many more samples.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..errors import SceneError
from ..film import FIRST_ESTIMATE
from ..lights.lamps import is_soft, shared_samples
from ..scene import Scene
from ..settings import DECLARED, Settings
from . import metrics
from .flip import displayed, flip
from .trade_crops import Crop, CropRenderer, Rendered, Squares, StoppedError, area, pick_squares

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
VISIBLE = 0.999
"""The largest difference on screen that counts is the one that so many of the pixels stay within:
the very largest hangs on single pixels, of which squares of the frame tell nothing.
"""
_MISSED = 3.0
"""How many of the squares picked would be met on average by what all of them miss once in 20."""
_SHOWN = 6
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


@dataclass(frozen=True)
class Knob:
    """A setting that trades time for accuracy.

    name: a field of Settings.  values: from fast to accurate.  matters: whether it can change a
    picture of this scene with the base's settings. falling: smaller values are the more accurate
    ones.  group: knobs of one group are combined with each other.
    """

    name: str
    values: tuple[Any, ...]
    matters: Callable[[Scene, Settings], bool]
    falling: bool = False
    group: str = "sampling"

    @property
    def kind(self) -> type:
        """int or float."""
        return type(self.values[0])

    def ladder(self, *values: Any) -> list[Any]:
        """Different values from fast to accurate."""
        return sorted(set(values), reverse=self.falling)


def has_soft_lights(scene: Scene, settings: Settings) -> bool:
    """Whether something lights from more than a point, as the settings want the scene lit: a lamp
    of an extent, the sky, what glows, what is lit.
    """
    lit = settings.lighting
    glows = any(lobe.kind == "EMISSION" for m in scene.materials for lobe in m.lobes)
    sky = any(light.kind == "DOME" for light in scene.lights)
    return (
        bool(glows and lit["by_meshes"])
        or (sky and lit["by_world"])
        or scatters(scene, settings)
        or any(is_soft(light) for light in scene.lights)
    )


def has_bounces(scene: Scene, settings: Settings) -> bool:
    """Whether a material reflects or refracts rays, as metals do where they may."""
    return any(
        lobe.kind in ("MIRROR", "REFRACTION")
        or (lobe.is_metallic and settings.reflections != "OFF")
        for material in scene.materials
        for lobe in material.lobes
    )


def scatters(scene: Scene, settings: Settings) -> bool:
    """Whether surfaces throw light onto others: it is measured where it is wanted at all."""
    return settings.lighting["bounces"] > 0 and bool(scene.instances)


def has_many_lamps(scene: Scene, settings: Settings) -> bool:
    """Whether lamps share shadow rays at some of the numbers that are measured."""
    return shared_samples(scene.lights, replace(settings, lamp_shadows=8)) > 0


def has_fog(scene: Scene, settings: Settings) -> bool:
    """Whether media scatter light."""
    return scene.scatters and bool(scene.lights)


KNOBS = (
    Knob("samples", (1, 2, 4, 8, 16, 32, 64), lambda scene, settings: True),
    Knob("error_threshold", (8.0, 2.0, 0.0), lambda scene, settings: True, falling=True),
    Knob("light_samples", (1, 2, 4, 8, 16), has_soft_lights),
    Knob("lamp_shadows", (8, 16, 32, 64), has_many_lamps, group="lamps"),
    Knob("max_bounces", (0, 1, 4, 12), has_bounces, group="bounces"),
    Knob("cutoff", (0.01, 0.001, 0.0), has_bounces, falling=True, group="bounces"),
    Knob("diffuse_bounces", (0, 1, 2, 4), scatters, group="diffuse"),
    Knob("volume_samples", (1, 2, 4, 8, 16), has_fog, group="volumes"),
)
"""Every knob that is measured. A new one needs a row here and nothing else."""


@dataclass(frozen=True)
class Row:
    """One setting, measured.

    knobs: field of Settings → value.  seconds: of tracing the squares.  Of the whole frame, as the
    squares tell: frame_seconds, trees included;  relative_rmse: of linear colour, over the
    picture's root mean square;  levels: difference on screen, in 8-bit levels, that `VISIBLE` of
    the pixels stay within;  psnr: decibels of the screen's colours;  flip_mean, flip_p99: LDR-FLIP;
    wrong: share of pixels that are off by more than 1 %.  max_error: largest difference of linear
    colour in the squares.  spread: two standard deviations of relative_rmse, as a share of it; 0
    where the squares are the whole frame.  unseen: the relative_rmse of a frame of whose squares
    as many are as wrong as the worst one measured as would be missed by all picks once in 20.
    bound: where no square met an error, what relative_rmse is below, as `with_bounds` has it; else
    0.  on_front: no other row is both faster and better.
    current: the base settings.  checked: also on squares that had no part in choosing.
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
    spread: float = 0.0
    unseen: float = 0.0
    bound: float = 0.0
    on_front: bool = False
    current: bool = False
    checked: bool = False


@dataclass(frozen=True)
class Trade:
    """rows: by frame_seconds.  reference: what the errors are against, in words.  crops: (x0, y0,
    x1, y1) of the full frame. repeats: renders per row, of which the fastest counts.  complete:
    False when it was stopped before every row had its renders.
    """

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
    def shown(self) -> tuple[Row, ...]:
        """At most six of the front, as different as can be, with or beside the current settings;
        fastest first.
        """
        front, current = self.front, self.current
        chosen = [*front[:1], *front[1:][-1:]]
        if current is not None and current.on_front:
            chosen += [current] if not any(current is other for other in chosen) else []
        while len(chosen) < min(_SHOWN, len(front)):
            rest = [row for row in front if not any(row is other for other in chosen)]
            chosen.append(max(rest, key=lambda row: min(_step(row, other) for other in chosen)))
        if current is not None and not current.on_front:
            chosen.append(current)
        return tuple(sorted(chosen, key=_speed))

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


def _step(a: Row, b: Row) -> float:
    """How far apart two rows of a front are, in factors of time and of error."""
    return math.dist(
        *(
            [math.log(max(r.frame_seconds, 1e-9)), math.log(max(r.relative_rmse, 1e-6))]
            for r in (a, b)
        )
    )


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
    """Render squares of `scene` over the grid of knobs and compare each with a reference.

    base: the current settings; what is no knob stays as it is there.  values: knob → values to try
    instead of those of `KNOBS`. squares, side: how many of how many pixels across; where the frame
    has no more, it is measured as a whole.  reference_samples: per pixel.  reference_seconds: the
    float64 tracer makes the reference if it should take no longer than this; else the core does,
    and `Trade.reference` says so.  should_stop: asked at least every 50 ms; the rows measured until
    then are returned.  on_trade: told what is known, early and every now and then.  Raises
    SceneError for a scene or settings that are not sound, MemoryError.
    """
    base = replace(base or Settings(), passes=frozenset(), region=None)
    grid = sorted(
        settings_grid(scene, base, values or {}),
        key=lambda settings: (settings != base, _cost(settings)),
    )
    problems = scene.problems() + [problem for settings in grid for problem in settings.problems()]
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


def settings_grid(
    scene: Scene, base: Settings, values: Mapping[str, Sequence[Any]]
) -> list[Settings]:
    """Every combination of each group's knobs that can change a picture of this scene, the base's
    own values always among them; the other groups' knobs are as the base has them: what rays leave
    out and how many there are hardly depend on each other, and a grid over all knobs takes seven
    times as long.
    """
    unknown = sorted(set(values) - {knob.name for knob in KNOBS})
    if unknown:
        raise SceneError(
            f"no such knob: {', '.join(unknown)}; there are "
            f"{', '.join(knob.name for knob in KNOBS)}"
        )
    knobs = [knob for knob in KNOBS if knob.matters(scene, base)]
    groups = [
        [knob for knob in knobs if knob.group == group]
        for group in dict.fromkeys(knob.group for knob in knobs)
    ]
    grid = dict.fromkeys(
        settings for group in groups for settings in _combinations(group, base, values)
    )
    return [settings for settings in grid if settings == base or not _is_idle(settings)]


def _combinations(
    knobs: Sequence[Knob], base: Settings, values: Mapping[str, Sequence[Any]]
) -> Iterator[Settings]:
    """All of some knobs."""
    for steps in itertools.product(*(_ladder(knob, base, values) for knob in knobs)):
        yield replace(base, **{knob.name: step for knob, step in zip(knobs, steps, strict=True)})


def _ladder(knob: Knob, base: Settings, values: Mapping[str, Sequence[Any]]) -> list[Any]:
    return knob.ladder(*values.get(knob.name, knob.values), getattr(base, knob.name))


def _is_idle(settings: Settings) -> bool:
    """Whether a knob is turned that can do nothing: no pixel stops before the samples that the
    first estimate takes, and at most one bounce is hardly worth cutting off.
    """
    stops_none = settings.error_threshold > 0 and settings.samples <= FIRST_ESTIMATE
    return stops_none or (settings.cutoff > 0 and settings.max_bounces <= 1)


def with_front(rows: Sequence[Row]) -> tuple[Row, ...]:
    """The rows by frame_seconds, `on_front` set where no row is as fast and has a smaller relative
    RMSE, or is faster with an equal one.
    """
    ordered, least = [], math.inf
    for row in sorted(rows, key=_speed):
        ordered.append(replace(row, on_front=row.relative_rmse < least))
        least = min(least, row.relative_rmse)
    return tuple(ordered)


def with_bounds(rows: Sequence[Row]) -> list[Row]:
    """The rows; those whose squares met no error with a bound of it: what is rarer than the squares
    tell is as unlikely to be missed as `Row.unseen` says of the least error that was met.
    """
    least = min((row for row in rows if row.relative_rmse), key=_error, default=None)
    unseen = least.unseen if least else 0.0
    return [row if row.relative_rmse else replace(row, bound=unseen) for row in rows]


def _error(row: Row) -> float:
    return row.relative_rmse


def advice(trade: Trade) -> str:
    """One sentence on the current settings: on the front, or what would be as good and faster."""
    current = trade.current
    if current is None:
        return "The current settings were not measured"
    if not any(row.relative_rmse for row in trade.rows):
        return (
            "Every setting gives the same picture in these squares: if the frame has more to "
            "show, use more of them"
        )
    if current.on_front:
        return "The current settings lie on the front: nothing measured is both faster and better"
    better = next(row for row in trade.front if row.relative_rmse <= current.relative_rmse)
    change = ", ".join(
        f"{DECLARED[name].label} {value:g}"
        for name, value in better.knobs.items()
        if current.knobs[name] != value
    )
    share = better.frame_seconds / current.frame_seconds
    return f"{change} would be as good in {share:.0%} of the time"


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
            self._base,
            samples=FIRST_ESTIMATE,
            error_threshold=0.0,
            cutoff=0.0,
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
                self._errors[settings] = _errors(
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
            self._errors[settings] = _errors(pictures, truth, fewer, self._size)
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
                self._errors[settings] = _errors(pictures, truth + other_truth, both, self._size)
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
        ordered = sorted(rows.values(), key=_speed)
        marked = with_front(with_bounds(ordered))
        return {by_row[id(row)]: new for row, new in zip(ordered, marked, strict=True)}

    def _row(self, settings: Settings, errors: Mapping[str, Any]) -> Row:
        rendered = self._rendered[settings]
        each = np.maximum(np.array(rendered.each) - self._overhead, 0.02 * np.array(rendered.each))
        frame_seconds = float(np.dot(each, self._squares.weights)) + self._renderer.build_seconds
        knobs = {knob.name: getattr(settings, knob.name) for knob in KNOBS}
        current = all(getattr(self._base, name) == value for name, value in knobs.items())
        return Row(
            knobs,
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
                settings, backend="NUMPY", samples=1, light_samples=1, region=crops[len(crops) // 2]
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
        base,
        samples=samples,
        error_threshold=0.0,
        light_samples=light_samples,
        max_bounces=bounces,
        cutoff=0.0,
        lamp_shadows=0,
        diffuse_bounces=max(diffuse, _REFERENCE_DIFFUSE) if scatters(scene, base) else diffuse,
        volume_samples=max(_REFERENCE_VOLUME, *(s.volume_samples for s in grid))
        if has_fog(scene, base)
        else base.volume_samples,
    )
    problems = settings.problems()
    if problems:
        raise SceneError("the reference cannot be made: " + "; ".join(problems))
    return settings


def _speed(row: Row) -> tuple[float, float]:
    """What rows are ordered by: the time that is told."""
    return row.frame_seconds, row.relative_rmse


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


# --- errors
# --------------------------------------------------------------------------------------------------


def _errors(
    pictures: list[Array], truth: list[Array], squares: Squares, size: float
) -> dict[str, float]:
    """The error columns of a row, of the frame that the squares stand for. size: root mean square
    of its colours.
    """
    picture, reference = (
        np.concatenate([crop.reshape(-1, 3) for crop in crops]) for crops in (pictures, truth)
    )
    weights = squares.pixel_weights
    apart, apart_on_screen = (
        metrics.absolute_error(picture, reference),
        np.abs(displayed(picture) - displayed(reference)),
    )
    flips = np.concatenate([flip(*pair).ravel() for pair in zip(pictures, truth, strict=True)])
    error, shown = (
        metrics.root_mean_square(values, weights) for values in (apart, apart_on_screen)
    )
    return {
        "relative_rmse": 0.0 if error == 0 else error / size if size > 0 else math.inf,
        "max_error": float(apart.max()),
        "levels": 255 * metrics.weighted_quantile(apart_on_screen.max(-1), weights, VISIBLE),
        "psnr": -20 * math.log10(shown) if shown > 0 else math.inf,
        "flip_mean": float(np.average(flips, weights=weights)),
        "flip_p99": metrics.weighted_quantile(flips, weights, 0.99),
        "wrong": float(np.average(metrics.wrong_pixels(picture, reference), weights=weights)),
        **_uncertainty(apart, squares, error / size if 0 < size < math.inf else 0.0),
    }


def _uncertainty(apart: Array, squares: Squares, relative: float) -> dict[str, float]:
    """`Row.spread` and `Row.unseen`, 0 where the squares are the whole frame. apart: (n, 3) errors.
    relative: their root mean square, over the frame's own.

    Squares of which the picks meet three on average are missed by all of them with a chance of
    e⁻³, once in 20 (the rule of three: Hanley and Lippman-Hand 1983).
    """
    ends = np.cumsum([area([crop]) for crop in squares.crops])[:-1]
    sums = np.array([(part**2).sum() for part in np.split(apart, ends)]) * squares.weights
    total = sums.sum()
    if len(sums) == 1 or not 0 < total < math.inf:
        return {"spread": 0.0, "unseen": 0.0}
    unseen = relative * math.sqrt(_MISSED * sums.max() / total)
    return {"spread": _spread(sums, squares), "unseen": unseen}


def _spread(sums: Array, squares: Squares) -> float:
    """Two standard deviations of the root of the sums' mean, as a share of it, from how unlike the
    squares' (n,) are.
    """
    total, count = sums.sum(), len(sums)
    missing = np.maximum(1 - 1 / squares.weights, 0.0)
    variance = count / (count - 1) * (missing * (sums - total / count) ** 2).sum()
    return math.sqrt(variance) / total
