"""A `trade.Trade` as a plot: time against error on logarithmic axes, the Pareto front and the
current settings marked.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..settings import DECLARED
from . import plot
from .trade_rows import Row, Trade
from .trade_tunables import TUNABLES

Array = np.ndarray

WIDTH, HEIGHT = 960, 640
_LEFT, _RIGHT, _TOP, _BOTTOM = 110, 30, 104, 64
_GRID, _TEXT, _POINT = (0.22, 0.22, 0.24), (0.85, 0.85, 0.85), (0.62, 0.64, 0.67)
_FRONT, _CURRENT = (0.35, 0.75, 1.0), (1.0, 0.62, 0.2)
_CURVES = (_FRONT, _CURRENT, (0.6, 0.9, 0.4), (0.95, 0.5, 0.75))
_DECADE_MARGIN = 0.08
_MEASURE = "of the picture's brightness"


def draw_trade(trade: Trade, title: str = "") -> Array:
    """(h, w, 3) float64 in 0 to 1, row 0 on top. An error of 0 stands on the lower edge, one that
    no square met at its bound.
    """
    image = plot.canvas(WIDTH, HEIGHT)
    plot.draw_text(
        image, f"{title}: time and error" if title else "Time and error", (_LEFT, 16), _TEXT, 2
    )
    plot.draw_text(image, f"Errors against {trade.reference}", (_LEFT, 40), _POINT)
    if not trade.rows:
        plot.draw_text(image, "Nothing was measured", (WIDTH // 2, HEIGHT // 2), _TEXT, 2, 0.5)
        return image
    x_range = _range([row.frame_seconds for row in trade.rows])
    y_range = _range([row.relative_rmse or row.bound for row in trade.rows])
    _draw_axes(image, x_range, y_range, "Seconds a frame")
    _draw_rows(
        image,
        trade,
        lambda row: _place(row.frame_seconds, row.relative_rmse or row.bound, x_range, y_range),
    )
    _draw_legend(image, _turned(trade))
    return image


def draw_curves(
    curves: Mapping[str, Sequence[tuple[float, float]]],
    title: str,
    note: str = "",
    measure: str = _MEASURE,
) -> Array:
    """(h, w, 3): several curves of (seconds of processor time, error) in one plot, each with its
    name on top; colours by order. measure: what the error is, in words.
    """
    image = plot.canvas(WIDTH, HEIGHT)
    plot.draw_text(image, title, (_LEFT, 16), _TEXT, 2)
    plot.draw_text(image, note, (_LEFT, 40), _POINT)
    everything = [point for points in curves.values() for point in points]
    x_range, y_range = (
        _range([seconds for seconds, _ in everything]),
        _range([error for _, error in everything]),
    )
    _draw_axes(image, x_range, y_range, "Seconds of processor time", measure)
    for number, (name, points) in enumerate(curves.items()):
        color = _CURVES[number % len(_CURVES)]
        places = [_place(seconds, error, x_range, y_range) for seconds, error in points]
        for first, second in itertools.pairwise(places):
            plot.draw_line(image, first, second, color, 2)
        for place in places:
            plot.draw_dot(image, place, 4, color)
        plot.draw_text(image, name, (_LEFT + 6 + 200 * number, 58), color, 2)
    return image


def _range(values: Sequence[float]) -> tuple[float, float]:
    """Decimal logarithms of the ends of an axis, a little beyond the values and at least a decade
    apart.
    """
    exponents = [math.log10(value) for value in values if 0 < value < math.inf] or [0.0]
    low, high = min(exponents) - _DECADE_MARGIN, max(exponents) + _DECADE_MARGIN
    missing = max(0.0, 1.0 - (high - low)) / 2
    return low - missing, high + missing


def _place(
    seconds: float, error: float, x_range: tuple[float, float], y_range: tuple[float, float]
) -> tuple[float, float]:
    return _along(seconds, x_range, _LEFT, WIDTH - _RIGHT), _along(
        error, y_range, HEIGHT - _BOTTOM, _TOP
    )


def _along(value: float, ends: tuple[float, float], start: float, end: float) -> float:
    share = (
        (math.log10(value) - ends[0]) / (ends[1] - ends[0])
        if 0 < value < math.inf
        else float(value > 0)
    )
    return start + min(max(share, 0.0), 1.0) * (end - start)


def _draw_axes(
    image: Array,
    x_range: tuple[float, float],
    y_range: tuple[float, float],
    x_title: str,
    measure: str = _MEASURE,
) -> None:
    bottom, right = HEIGHT - _BOTTOM, WIDTH - _RIGHT
    for value, label in _ticks(x_range):
        x = _along(value, x_range, _LEFT, right)
        plot.draw_line(image, (x, _TOP), (x, bottom), _GRID)
        plot.draw_text(image, label, (int(x), bottom + 8), _TEXT, 1, 0.5)
    for value, label in _ticks(y_range, in_percent=measure == _MEASURE):
        y = _along(value, y_range, bottom, _TOP)
        plot.draw_line(image, (_LEFT, y), (right, y), _GRID)
        plot.draw_text(image, label, (_LEFT - 8, int(y) - 4), _TEXT, 1, 1.0)
    plot.draw_text(image, x_title, ((_LEFT + right) // 2, HEIGHT - 30), _TEXT, 2, 0.5)
    plot.draw_text(image, "Error", (_LEFT - 8, _TOP - 18), _TEXT, 1, 1.0)
    plot.draw_text(image, f"({measure})", (_LEFT, _TOP - 18), _POINT)


def _ticks(ends: tuple[float, float], in_percent: bool = False) -> list[tuple[float, str]]:
    """1, 2 and 5 times the powers of ten within the ends; powers of ten alone over more than three
    decades. Values with their labels.
    """
    steps = (1, 2, 5) if ends[1] - ends[0] <= 3 else (1,)
    values = [
        (step, power)
        for power in range(math.floor(ends[0]), math.ceil(ends[1]) + 1)
        for step in steps
    ]
    return [
        (step * 10.0**power, _label(step, power + 2) + " %" if in_percent else _label(step, power))
        for step, power in values
        if ends[0] <= math.log10(step) + power <= ends[1]
    ]


def _label(step: int, power: int) -> str:
    return f"{step * 10.0**power:g}" if -3 <= power <= 4 else f"{step}e{power}"


def _draw_rows(image: Array, trade: Trade, place: Callable[[Row], tuple[float, float]]) -> None:
    for row in trade.rows:
        plot.draw_dot(image, place(row), 3, _POINT)
    front = trade.front
    for first, second in itertools.pairwise(front):
        plot.draw_line(image, place(first), place(second), _FRONT, 2)
    for row in front:
        plot.draw_dot(image, place(row), 5, _FRONT)
    turned = _turned(trade)
    _draw_names(image, [(_name(row, turned), place(row)) for row in front])
    if trade.current is not None:
        plot.draw_dot(image, place(trade.current), 9, _CURRENT, ring=2.5)


_Box = tuple[float, float, float, float]
"""Left, top, right, bottom; pixels."""


def _draw_names(image: Array, named: Sequence[tuple[str, tuple[float, float]]]) -> None:
    """Each name beside its dot where it lies over no other and no dot; names without such a place
    are left out.
    """
    taken = [(x - 5, y - 5, x + 5, y + 5) for _, (x, y) in named]
    for name, (x, y) in named:
        width = plot.text_width(name)
        for left, top in (
            (x + 9, y - 14),
            (x + 9, y + 6),
            (x - 9 - width, y + 8),
            (x - 9 - width, y - 16),
        ):
            box = (left - 3, top - 2, left + width + 3, top + 13)
            if (
                left >= _LEFT
                and box[2] <= WIDTH
                and not any(_overlap(box, other) for other in taken)
            ):
                plot.draw_text(image, name, (int(left), int(top)), _TEXT)
                taken.append(box)
                break


def _overlap(a: _Box, b: _Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _turned(trade: Trade) -> list[str]:
    """Names of the tunables that the front's rows differ in, and of the first, which is always
    told; in the order of `trade.TUNABLES`.
    """
    names = [tunable.name for tunable in TUNABLES]
    return names[:1] + [
        name for name in names[1:] if len({row.tunables.get(name) for row in trade.front}) > 1
    ]


def _name(row: Row, turned: Sequence[str]) -> str:
    """The tunables' values."""
    told = (DECLARED[name].shown(row.tunables[name]) for name in turned if name in row.tunables)
    return " / ".join(told)


def _in_words(name: str) -> str:
    """As Blender shows the setting."""
    return DECLARED[name].label or name.replace("_", " ")


def _draw_legend(image: Array, turned: Sequence[str]) -> None:
    x, y = _LEFT + 6, 60
    for color, text, ring in (
        (_FRONT, f"Best ({' / '.join(_in_words(name) for name in turned)})", 0.0),
        (_POINT, "Other settings", 0.0),
        (_CURRENT, "Settings of now", 2.0),
    ):
        plot.draw_dot(image, (x, y), 4, color, ring)
        plot.draw_text(image, text, (x + 12, y - 4), _TEXT)
        x += 12 + plot.text_width(text) + 24
