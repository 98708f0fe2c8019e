"""What Blender's header and progress bar say while a picture is being made."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from ... import engine
from ..viewport.status import PYTHON, error_of, error_text
from .remaining import Remaining

_PAUSE = 0.5
"""Seconds between two texts: Blender draws its window for each, which takes processors from the
render.
"""
_LEAD, _PACE = 0.05, 5.0
"""While nobody knows how much is left, the bar creeps towards this share, and has gone half of it
after so many seconds.
"""


class Progress:
    """Tells of one render. tells: also in words, which a program without windows would print line
    by line.
    """

    def __init__(
        self,
        render_engine: Any,
        about: str,
        tells: bool,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._engine, self._about, self._tells, self._clock = render_engine, about, tells, clock
        self._start = clock()
        self._told_at = -1e9
        self._shown = 0.0
        self._error: float | None = None
        self._remaining = Remaining(self._start)

    def watching(self, stage: str, should_stop: Callable[[], bool]) -> Callable[[], bool]:
        """`should_stop` for a stage of unknown length, which tells of it whenever it is asked."""

        def ask() -> bool:
            self.wait(stage)
            return should_stop()

        return ask

    def wait(self, stage: str) -> None:
        """A stage of unknown length goes on."""
        now = self._clock()
        self._remaining.restart(now)
        self._move(0.0, now)
        self._say(now, f"{stage} ({now - self._start:.0f} s)")

    def trace(self, fraction: float, settings: engine.Settings) -> None:
        """fraction: of all work on pixels: their samples, and rays that tell what covers them."""
        if fraction <= 0:
            self.wait("Sorting the scene")
            return
        now, samples = self._clock(), settings.samples
        self._remaining.move(now, fraction, samples)
        self._move(fraction, now)
        parts = [f"Sample {self._remaining.samples}/{samples}"]
        if settings.backend == "NUMPY":
            parts.append(PYTHON)
        if self._error is not None:
            parts.append(f"Error {error_text(self._error)}")
        # else nobody knows what the threshold will save
        if self._error is not None or settings.error_threshold == 0:
            parts.extend(_time(self._remaining.seconds(now, settings)))
        self._say(now, " | ".join(parts))

    def end_wave(self, film: engine.Film) -> None:
        """Every pixel has had the film's samples."""
        self._remaining.end_wave(self._clock(), film.samples)
        self._error = error_of(film)

    def _move(self, fraction: float, now: float) -> None:
        waited = now - self._start
        self._shown = max(self._shown, fraction, _LEAD * waited / (waited + _PACE))
        self._engine.update_progress(self._shown)

    def _say(self, now: float, text: str) -> None:
        if self._tells and now - self._told_at >= _PAUSE:
            self._told_at = now
            self._engine.update_stats(self._about, text)


def _time(seconds: float) -> list[str]:
    return (
        [f"Remaining {int(seconds) // 60:02d}:{int(seconds) % 60:02d}"]
        if seconds < math.inf
        else []
    )
