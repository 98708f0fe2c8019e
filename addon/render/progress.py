"""What Blender's header and progress bar say while a picture is being made."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from ... import engine
from ..viewport.status import PYTHON, error_of, error_text

_PAUSE = 0.5
"""Seconds between two texts: Blender draws its window for each, which takes processors from the
render.
"""
_LEAD, _PACE = 0.05, 5.0
"""While nobody knows how much is left, the bar creeps towards this share, and has gone half of it
after so many seconds.
"""
_TRUSTED = 0.5
"""Seconds of a wave after which its own speed tells what remains: later waves skip what has
converged.
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
        self._wave = (self._start, 0.0)  # when, and at which fraction it began
        self._moved = self._wave  # when it came to the fraction that it has
        self._speed = 0.0  # fractions a second in the wave before
        self._pause = 0.0  # seconds between its last sample and its picture
        self._samples = 0  # of the pixels, in all waves so far

    def watching(self, stage: str, should_stop: Callable[[], bool]) -> Callable[[], bool]:
        """`should_stop` for a stage of unknown length, which tells of it whenever it is asked."""

        def ask() -> bool:
            self.wait(stage)
            return should_stop()

        return ask

    def wait(self, stage: str) -> None:
        """A stage of unknown length goes on."""
        now = self._clock()
        self._wave = self._moved = (now, 0.0)
        self._move(0.0, now)
        self._say(now, f"{stage} ({now - self._start:.0f} s)")

    def trace(self, fraction: float, settings: engine.Settings) -> None:
        """fraction: of all work on pixels: their samples, and rays that tell what covers them."""
        if fraction <= 0:
            self.wait("Sorting the scene")
            return
        now, samples = self._clock(), settings.samples
        if fraction > self._moved[1]:
            self._moved = (now, fraction)
        self._move(fraction, now)
        taken = min(samples, int(fraction / self._share_of_sample(samples) + 1e-9))
        parts = [f"Sample {taken}/{samples}"]
        if settings.backend == "NUMPY":
            parts.append(PYTHON)
        if self._error is not None:
            parts.append(f"Error {error_text(self._error)}")
        # else nobody knows what the threshold will save
        if self._error is not None or settings.error_threshold == 0:
            parts.extend(_time(self._remaining(samples, now)))
        self._say(now, " | ".join(parts))

    def end_wave(self, film: engine.Film) -> None:
        """Every pixel has had the film's samples."""
        now = self._clock()
        self._speed = self._speed_of_wave() or self._speed
        self._pause = now - self._moved[0]
        self._samples, self._error = film.samples, error_of(film)
        self._wave = self._moved = (now, self._moved[1])

    def _remaining(self, samples: int, now: float) -> float:
        """Seconds at the speed of this wave, or of the one before while this is young, and with the
        pauses of all that come; infinite without any.
        """
        moved, fraction = self._moved
        is_young = moved - self._wave[0] <= _TRUSTED
        speed = self._speed if is_young and self._speed else self._speed_of_wave()
        if not speed > 0:
            return math.inf
        waves = math.ceil(math.log2(samples / max(1, self._samples))) + (self._samples == 0)
        waited, beyond = now - moved, 1.0 - samples * self._share_of_sample(samples)
        if beyond > 1e-3:  # the last picture is made along with that work
            waves += min(1.0, (1.0 - fraction) / beyond) - 1.0
        pauses = waves * max(self._pause, waited)
        return max(0.0, (1.0 - fraction) / speed + pauses - waited)

    def _share_of_sample(self, samples: int) -> float:
        """Of the work, of each sample of all pixels; as if there were nothing else where nobody
        knows yet.
        """
        return self._wave[1] / self._samples if self._samples else 1.0 / samples

    def _speed_of_wave(self) -> float:
        (began, before), (moved, fraction) = self._wave, self._moved
        return (fraction - before) / (moved - began) if moved > began else 0.0

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
