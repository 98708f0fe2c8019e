"""How large a picture can be traced in time while the view moves: from what pictures cost, as
measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

BUDGET = 1 / 60
"""Seconds for a picture while the view moves; drawing it takes as long again where there is no
graphics card.
"""
LONGEST_WAIT = 0.05
"""Seconds for which the interface may stand still."""
SETTLED = 0.15
"""Seconds within which a view that has stopped moving is to show all its pixels."""
_WEIGHT = 0.4
"""Of a new measurement in the running mean."""
_COARSEST = 16
_GROWTH = 0.7
"""The power of the pixels with which tracing grows: neighbouring rays of a fine picture have more
in common (0.7 to 0.8 was measured from 2000 to 500 000 pixels).
"""

_STOPPING = 0.75
"""Of the speed before, below which a view is about to stop: a hand brakes, and what it moved last
is but part of a redraw's time.
"""


class Motion:
    """How fast a view moves, from redraw to redraw."""

    def __init__(self) -> None:
        self._place, self._at, self._speed = np.empty(0), 0.0, 0.0

    def slows(self, place: np.ndarray, at: float) -> bool:
        """Whether a view that shows `place`, any numbers that change with it, at `at` seconds moves
        slower than the last time it moved.
        """
        moved = (
            float(np.linalg.norm(place - self._place))
            if place.shape == self._place.shape
            else math.inf
        )
        if moved == 0:
            return False
        before, self._speed = self._speed, moved / max(at - self._at, 1e-6)
        self._place, self._at = place, at
        return self._speed < _STOPPING * before < math.inf


@dataclass
class Pacer:
    """Running means. rate: seconds of tracing one sample of a picture, over its pixels to the power
    of `_GROWTH`. fixed: seconds of a picture that do not grow with it. build: seconds that trees
    took when they were made last.  per_shaded: seconds of a pixel whose rays are known, None before
    there was one.

    Before the first measurement the guess is coarse, so that the first picture comes at once.
    """

    rate: float = 3e-5
    fixed: float = 0.0
    build: float = 0.0
    per_shaded: float | None = None

    def note(
        self,
        pixels: int,
        samples: int,
        trace_seconds: float,
        build_seconds: float,
        other_seconds: float | None,
    ) -> None:
        """A picture was made: `samples` of each of its pixels took `trace_seconds`, trees and all
        else the other two (None: unknown).
        """
        if pixels * samples <= 0:
            return
        self.build = build_seconds or self.build
        self.rate += _WEIGHT * (trace_seconds / samples / pixels**_GROWTH - self.rate)
        if other_seconds is not None:
            self.fixed += _WEIGHT * (other_seconds - self.fixed)

    def note_shading(self, pixels: int, seconds: float) -> None:
        """One sample of so many pixels was shaded again."""
        before = seconds / pixels if self.per_shaded is None else self.per_shaded
        self.per_shaded = before + _WEIGHT * (seconds / pixels - before)

    def shades_in_time(self, pixels: int) -> bool:
        """Whether pixels whose rays are known may all be shaded before anything is shown."""
        return self.per_shaded is not None and pixels * self.per_shaded <= LONGEST_WAIT

    def seconds(self, pixels: float) -> float:
        """What one sample of so many pixels takes, trees not counted."""
        return self.fixed + self.rate * pixels**_GROWTH

    def divisor(self, pixels: int) -> int:
        """Screen pixels to a side of a traced one, so that a picture of one sample takes no longer
        than the budget.
        """
        room = max(BUDGET - self.fixed, BUDGET / 4)
        most = max((room / self.rate) ** (1 / _GROWTH), 1.0) if self.rate > 0 else math.inf
        return min(_COARSEST, max(1, math.ceil(math.sqrt(pixels / most))))

    def prefers_whole(self, pixels: int, redraw_seconds: float) -> bool:
        """Whether to trace all pixels of a view that is about to stop: where Blender takes so long
        to draw that after a coarse picture the whole one would come too late, and it comes in time
        by itself.
        """
        whole = self.seconds(pixels)
        return whole <= SETTLED < BUDGET + redraw_seconds + whole

    @property
    def is_slow_to_build(self) -> bool:
        """Whether a picture at full resolution should not wait for trees that stand where the
        camera does.
        """
        return self.build > BUDGET
