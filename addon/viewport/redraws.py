"""How long Blender takes to draw its window, and how long it may be kept waiting for a picture.

An old picture that is drawn while the new one is being traced holds the new one up for a whole
redraw, and takes processors from it where there is no graphics card. So a view waits for what it
has just asked for, but no longer than a redraw: then it would gain nothing.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from .pacing import BUDGET, LONGEST_WAIT, SETTLED

LOOK = 0.004
"""Seconds between two looks at whether Blender has drawn. Between two of them it takes all events
that wait for it.
"""
_PAUSE = 0.1
"""Seconds between two redraws after which what moves has stopped in between."""
_LONGEST_REDRAW = 0.5
"""Seconds; more than that was something else that Blender did."""
_WEIGHT = 0.4
"""Of a new measurement in the running mean."""


class Redraws:
    """Of all views together: Blender draws them one after the other.

    seconds: running mean of a redraw, without what it was kept waiting.  number: counts them.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self.seconds = BUDGET
        self.number = 0
        self.clock = clock
        self._began: float | None = None
        self._ended = -math.inf
        self._waited = 0.0

    def begin(self) -> None:
        """A view is being drawn."""
        if self._began is None:
            self._began = self.clock()
            self.number += 1

    @property
    def next(self) -> int:
        """The number of the redraw that is going on, or else of the one to come."""
        return self.number + (self._began is None)

    @property
    def is_over(self) -> bool:
        """Whether Blender has drawn, and looked after what was done meanwhile without beginning
        anew.
        """
        return self._began is None and self.clock() - self._ended >= LOOK / 2

    def follows(self, number: int) -> bool:
        """Whether that redraw comes right after the one with this number."""
        began = self.clock() if self._began is None else self._began
        return self.next == number + 1 and began - self._ended < _PAUSE

    def end(self) -> None:
        """Blender is between two events: what was drawn is on the screen."""
        if self._began is not None:
            self._ended = self.clock()
            seconds = self._ended - self._began - self._waited
            self.seconds += _WEIGHT * (min(seconds, _LONGEST_REDRAW) - self.seconds)
        self._began, self._waited = None, 0.0

    def wait(self, wait: Callable[[float], object], is_patient: bool) -> None:
        """Let a view that is being drawn call `wait` with the seconds it may take. is_patient:
        nothing is worth drawing before.
        """
        start = self.clock()
        wait(max(0.0, (SETTLED if is_patient else min(self.seconds, LONGEST_WAIT)) - self._waited))
        self._waited += self.clock() - start
