"""What was measured of a trade, and what follows from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from ..settings import DECLARED
from .trade_crops import Crop

_SHOWN = 6
"""Rows, at most, of a summary."""


@dataclass(frozen=True)
class Row:
    """One setting, measured.

    tunables: field of Settings → value. seconds: of tracing the squares. Of the whole frame, as the
    squares tell: frame_seconds, trees included; relative_rmse: of linear colour, over the picture's
    root mean square; levels: difference on screen, in 8-bit levels, that the share
    `trade_errors.VISIBLE` of the pixels stays within; psnr: decibels of the screen's colours;
    flip_mean, flip_p99: LDR-FLIP; wrong: share of pixels that are off by more than 1 %. max_error:
    largest difference of linear colour in the squares. spread: two standard deviations of
    relative_rmse, as a share of it; 0 where the squares are the whole frame. unseen: the
    relative_rmse of a frame of whose squares as many are as wrong as the worst one measured as
    would be missed by all picks once in 20. bound: where no square met an error, what relative_rmse
    is below, as `with_bounds` has it; else 0. on_front: no other row is both faster and better.
    current: the base settings. checked: also on squares that had no part in choosing.
    """

    tunables: dict[str, Any]
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
        return tuple(sorted(chosen, key=speed))

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


def with_front(rows: Sequence[Row]) -> tuple[Row, ...]:
    """The rows by frame_seconds, `on_front` set where no row is as fast and has a smaller relative
    RMSE, or is faster with an equal one.
    """
    ordered, least = [], math.inf
    for row in sorted(rows, key=speed):
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
        f"{DECLARED[name].label} {DECLARED[name].shown(value)}"
        for name, value in better.tunables.items()
        if current.tunables[name] != value
    )
    share = better.frame_seconds / current.frame_seconds
    return f"{change} would be as good in {share:.0%} of the time"


def speed(row: Row) -> tuple[float, float]:
    """What rows are ordered by: the time that is told."""
    return row.frame_seconds, row.relative_rmse
