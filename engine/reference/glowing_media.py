"""Media that glow as a light: points in them stand for balls that shine alike to all sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..linear.columns import dot, unit
from .lights import HUGE, LightSample
from .tabled_lights import MeshPoint, MeshSource

Array = np.ndarray

WIDER = 2.0
"""Balls of an eighth of the points (`settings.MEDIUM_SHARE`, `MEDIUM_SHADOWS`)."""


class MediumSource(MeshSource):
    """Media that glow: their light is spread out too far to be seen in highlights."""

    has_highlights = False

    def drawn_at(self, number: int, point: MeshPoint) -> None:
        return None

    def fewer(self, count: int) -> MediumSource:
        """The first so many of the points of each sample, in place of them all, for wider balls."""
        table = self._table.first(count)
        return MediumSource(self.light, self._eye, replace(table, reach=WIDER * table.reach))

    def least_distance(self, point: MeshPoint) -> float:
        """The radius of the ball that a point stands for."""
        return float(self._table.reach[point.number])

    def sample(self, x: Array, point: MeshPoint, n: int) -> LightSample:
        table, number = self._table, point.number
        q = self.place(point)
        d2, r2 = dot(q - x, q - x), table.reach[number] ** 2
        with np.errstate(divide="ignore"):
            share = np.where(d2 < r2, (6 - 5 * (d2 / r2)) / r2, 1 / d2)
        spread = np.where(d2 > 0, table.spread[number] * share, 0.0)
        return LightSample(
            unit(q - x),
            self.parts * spread / (np.pi * table.each),
            q,
            spread,
            np.clip(table.front[number], -HUGE, HUGE)[:, None],
            group=self._group(number),
        )
