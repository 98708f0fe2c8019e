"""How long a render still takes, from when its samples and the pictures of its waves came."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ... import engine

_PICTURE = 0.25
"""Samples of all pixels that take as long as the picture of a wave, rather few: before one was
made.
"""
_BEYOND = 1.5
"""Samples that take as long as the camera rays beyond them, before a wave told."""
_GROWTH = 1.1
"""How much longer the picture of a wave takes than that of the wave before."""
_YOUNG = 0.2
"""Share of a wave from which on its own speed alone tells what samples take."""
_FORECAST = 0.1
"""Share of the last picture that what was known before counts for in its speed, when it begins."""
_SAME = 1e-6


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
        self._cost = 0.0  # seconds of a sample in the wave before
        self._picture: float | None = None  # seconds of the picture of the wave before
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
        cost = self._cost_now(most)
        if not cost > 0:
            return math.inf
        goal = self._goal(most)
        picture = self._picture_of(cost)
        waited = now - self._moved.seconds if self._moved.samples == goal else 0.0
        samples = (most - self._moved.samples) * cost
        beyond = self._beyond(settings) * cost
        if goal < most:
            later = _pictures(max(picture, waited) * _GROWTH, math.log2(most / goal))
            return samples + max(0.0, picture - waited) + later + beyond
        picture += beyond
        if self._finished > 0:
            # its own speed tells more and more
            forecast = _FORECAST * (1.0 - self._finished)
            picture = (forecast * picture + waited) / (forecast + self._finished)
        return samples + max(0.0, picture - waited)

    def _picture_of(self, cost: float) -> float:
        """Seconds of the picture of this wave, but for what is made along with the last."""
        return _PICTURE * cost if self._picture is None else _GROWTH * self._picture

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
        if not self._cost > 0:
            return self._own_cost()
        young = max(0.0, 1.0 - done / (_YOUNG * (self._goal(most) - self._began.samples)))
        return young * self._cost + (1.0 - young) * self._own_cost()


def _pictures(seconds: float, waves: float) -> float:
    """What those of so many waves take, the first of which takes `seconds`."""
    return sum(seconds * _GROWTH**k for k in range(math.ceil(waves)))
