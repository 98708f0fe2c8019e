"""How long a render still takes, from when its samples and the pictures of its waves came.

Of a wave's samples, and of the last picture with the camera rays beyond them, what is done tells
how long the whole takes, and what was known before only while that is young. Other pictures take as
long as the one before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ... import engine

_YOUNG = 0.2
"""Share of a wave's samples, and of the last picture, from which on its own speed alone tells what
the whole takes.
"""
_BEYOND = 1.5
"""Samples that take as long as the camera rays beyond them, before a wave told."""
_SAME = 1e-6
"""Samples apart that are rounding."""


@dataclass
class _Point:
    """When so many samples of all pixels were there."""

    seconds: float = 0.0
    samples: float = 0.0


class Remaining:
    """The waves of a render, each of samples and then a picture, as their progress comes in. The
    last picture may be made along with camera rays beyond the samples, of which the fractions of
    the work at the ends of waves tell how many samples they are worth.
    """

    def __init__(self, now: float) -> None:
        self.restart(now)

    def restart(self, now: float) -> None:
        """The first wave begins."""
        self._began, self._moved = _Point(now), _Point(now)
        self._cost = 0.0  # seconds of a sample, known at the wave's beginning; 0 in the first
        self._picture = 0.0  # seconds of the picture of the wave before
        self._share: float | None = None  # of the work, of a sample; unknown in the first wave
        self._fraction = self._finished = 0.0  # of all work; of the last picture

    def move(self, now: float, fraction: float, most: int) -> None:
        """So much of all work is done, of a render of `most` samples."""
        self._fraction, share = fraction, self._share_of(most)
        done = fraction / share
        if self._share is not None:
            done = min(done, float(self._goal(most)))
        whole = round(done)
        if abs(done - whole) <= _SAME * whole:
            done = float(whole)
        if done > self._moved.samples:
            self._moved = _Point(now, done)
        beyond = 1.0 - most * share
        if self._moved.samples == most and beyond > _SAME:
            self._finished = min(1.0, max(0.0, fraction - most * share) / beyond)

    def end_wave(self, now: float, samples: int) -> None:
        """The picture of so many samples is there."""
        if self._moved.samples > self._began.samples:
            self._cost = self._own_cost()
        self._picture = now - self._moved.seconds
        self._share = self._fraction / samples if self._fraction > 0 else None
        self._began = self._moved = _Point(now, float(samples))

    @property
    def samples(self) -> int:
        """Whole samples that all pixels have had."""
        return int(self._moved.samples + 1e-9)

    def seconds(self, now: float, settings: engine.Settings) -> float:
        """Until the last picture; infinite before anything is known."""
        most = settings.samples
        cost, goal = self._cost_now(most), self._goal(most)
        if not cost > 0:
            return math.inf
        waited = now - self._moved.seconds if self._moved.samples == goal else 0.0
        samples = (most - self._moved.samples) * cost
        beyond = self._beyond(settings) * cost
        if goal < most:
            later = math.ceil(math.log2(most / goal)) * max(self._picture, waited)
            return samples + max(0.0, self._picture - waited) + later + beyond
        picture = self._picture + beyond
        if self._finished > 0:
            return samples + (1.0 - self._finished) * _blend(picture, waited, self._finished)
        return samples + max(0.0, picture - waited)

    def _beyond(self, settings: engine.Settings) -> float:
        """Samples that take as long as the camera rays beyond them."""
        if self._share is None:
            return _BEYOND if settings.visibility_samples > 1 else 0.0
        return max(0.0, 1.0 / self._share - settings.samples)

    def _goal(self, most: int) -> int:
        """Samples at the end of this wave; of the first, those that have begun."""
        began = self._began.samples
        return min(most, max(1, math.ceil(2 * began if began else self._moved.samples)))

    def _share_of(self, most: int) -> float:
        return 1.0 / most if self._share is None else self._share

    def _own_cost(self) -> float:
        """Seconds of a sample in this wave."""
        began, moved = self._began, self._moved
        return (moved.seconds - began.seconds) / (moved.samples - began.samples)

    def _cost_now(self, most: int) -> float:
        done = self._moved.samples - self._began.samples
        if not done > 0:
            return self._cost
        own = self._own_cost()
        if not self._cost > 0:
            return own
        wave = self._goal(most) - self._began.samples
        return _blend(self._cost * wave, own * done, done / wave) / wave


def _blend(known: float, spent: float, share: float) -> float:
    """Seconds of a whole, of which so many were spent on a share of it."""
    young = max(0.0, 1.0 - share / _YOUNG)
    return young * known + (1.0 - young) * spent / share
