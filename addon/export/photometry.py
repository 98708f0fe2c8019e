"""Photometric webs of luminaires: files of the Illuminating Engineering Society (ANSI/IES LM-63),
as Cycles reads them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray

WATTS_PER_CANDELA = 0.0706650768394
"""4π sr over 177.83 lm/W, the luminous efficacy of daylight D65."""
UNREADABLE = 100.0
"""What Cycles takes in every direction where a file cannot be read."""
_TYPE_C = 1


class PhotometryError(ValueError):
    """A file that does not say how bright a luminaire is."""


@dataclass(frozen=True, eq=False)
class Web:
    """Intensity by direction. polar: (v,) angles from straight down, azimuth: (h,) round that,
    rising, degrees. power: (h, v) watts over 4π steradians.
    """

    polar: Array
    azimuth: Array
    power: Array

    def at(self, azimuth: Array, polar: Array) -> Array:
        """(n,) by Catmull-Rom splines between the angles, 0 beyond them. Degrees."""
        inside = (
            (polar >= self.polar[0])
            & (polar < self.polar[-1])
            & (azimuth >= self.azimuth[0])
            & (azimuth < self.azimuth[-1])
        )
        columns, across = _places(self.azimuth, azimuth)
        rows, along = _places(self.polar, polar)
        last = len(self.azimuth) - 1
        after = np.where(columns + 2 <= last, columns + 2, last - 1)  # as in Cycles
        around = (np.maximum(columns - 1, 0), columns, columns + 1, after)
        values = [self._down(column, rows, along) for column in around]
        return np.where(inside, np.maximum(_spline(values, across), 0.0), 0.0)

    def table(self) -> Array:
        """(r, c) of `at`: rows of the same polar angle from 0 to 180 degrees, both ends included,
        columns of azimuths from 0 on, a full turn without its end.
        """
        rows, columns = 1024, 1 if (self.power == self.power[0]).all() else 1024
        azimuth, polar = np.meshgrid(
            np.arange(columns) * (360 / columns), np.linspace(0, 180, rows)
        )
        # the range is open at its end, which belongs to it in a table
        polar = np.where(polar == self.polar[-1], np.nextafter(polar, 0), polar)
        return self.at(azimuth.ravel(), polar.ravel()).reshape(rows, columns)

    def _down(self, column: Array, rows: Array, along: Array) -> Array:
        """(n,) between the polar angles at azimuths of these numbers. Poles continue on the other
        side as if the luminaire were symmetric; other ends stay as they are.
        """
        last = len(self.polar) - 1
        above, below = (
            (1 if self.polar[0] == 0 else 0),
            (last - 1 if self.polar[-1] == 180 else last),
        )
        before, after = (
            np.where(rows > 0, rows - 1, above),
            np.where(rows + 2 <= last, rows + 2, below),
        )
        values = [self.power[column, row] for row in (before, rows, rows + 1, after)]
        return _spline(values, along)


def read_web(text: str) -> Web:
    """The web of a file's text. Raises PhotometryError."""
    numbers = _Numbers(text)
    numbers.skip(2)  # lamps, lumens of each
    factor = numbers.one()
    rows, columns, kind = (int(numbers.one()) for _ in range(3))
    numbers.skip(4)  # the unit, and the luminaire's sizes
    factor *= numbers.one() * numbers.one()
    numbers.skip(1)  # watts
    if kind != _TYPE_C:
        raise PhotometryError("its photometry is not of type C")
    if rows < 2 or columns < 1:
        raise PhotometryError("it has no angles")
    polar, azimuth = numbers.some(rows), numbers.some(columns)
    power = numbers.some(rows * columns).reshape(columns, rows)
    if not (np.diff(polar) > 0).all() or not (np.diff(azimuth) > 0).all():
        raise PhotometryError("its angles do not rise")
    if polar[0] < 0 or polar[-1] > 180:
        raise PhotometryError("its vertical angles are not from 0 to 180")
    azimuth, power = _all_round(azimuth, power)
    return Web(polar, azimuth, factor * WATTS_PER_CANDELA * power)


class _Numbers:
    """The numbers behind the line that begins with TILT, and behind the tilts that it announces."""

    def __init__(self, text: str) -> None:
        lines = text.replace(",", " ").splitlines()
        start = next((k for k, line in enumerate(lines) if line.startswith("TILT=")), None)
        if start is None:
            raise PhotometryError("it has no line TILT=")
        words = " ".join(lines[start + 1 :]).split()
        try:
            self._numbers = np.array(words, np.float64)
        except ValueError:
            self._numbers = np.array([_number(word) for word in words])
        self._at = 0
        if lines[start].startswith("TILT=INCLUDE"):
            self.skip(1)
            self.skip(2 * int(self.one()))

    def one(self) -> float:
        return float(self.some(1)[0])

    def some(self, count: int) -> Array:
        found = self._numbers[self._at : self._at + count]
        self.skip(count)
        if len(found) < count or not np.isfinite(found).all():
            raise PhotometryError("numbers are missing")
        return found

    def skip(self, count: int) -> None:
        self._at += max(count, 0)


def _number(word: str) -> float:
    """NaN for what is none: files end with remarks, seldom."""
    try:
        return float(word)
    except ValueError:
        return np.nan


def _all_round(azimuth: Array, power: Array) -> tuple[Array, Array]:
    """The full turn from one side, a quarter or a half that stands for its mirror images."""
    if azimuth[0] == 90:
        azimuth = azimuth - 90
    if azimuth[0] != 0:
        raise PhotometryError("its horizontal angles do not begin at 0")
    if len(azimuth) == 1:
        return np.array([0.0, 360.0]), power[[0, 0]]
    for whole in (180.0, 360.0):
        if azimuth[-1] == whole / 2:
            azimuth = np.concatenate([azimuth, whole - azimuth[-2::-1]])
            power = np.concatenate([power, power[-2::-1]])
    if azimuth[-1] != 360:
        gap = 360 - azimuth[-1]
        if gap not in (azimuth[1] - azimuth[0], azimuth[-1] - azimuth[-2]):
            raise PhotometryError("its horizontal angles end neither at 0, 90, 180 nor 360")
        azimuth, power = np.append(azimuth, 360.0), np.concatenate([power, power[:1]])
    return azimuth, power


def _places(angles: Array, wanted: Array) -> tuple[Array, Array]:
    """(n,) number of the last angle before each, and the share of the way to the next."""
    k = np.clip(np.searchsorted(angles, wanted, "left") - 1, 0, len(angles) - 2)
    return k, (wanted - angles[k]) / (angles[k + 1] - angles[k])


def _spline(values: list[Array], x: Array) -> Array:
    """Catmull-Rom between the second and the third of four values."""
    a, b, c, d = values
    return 0.5 * (((d + 3 * (b - c) - a) * x + (2 * a - 5 * b + 4 * c - d)) * x + (c - a)) * x + b
