"""Which pixels are good enough after a wave, and how far each may be from its limit
(semantics/stopping.md).
"""

from __future__ import annotations

import numpy as np

from ..film import FIRST_ESTIMATE, UNKNOWN_ERROR
from ..settings import Settings

Array = np.ndarray

_LIGHT_POINTS = 16
"""Of each soft light, that a pixel has looked at before it may stop."""
_LENS_SAMPLES = 16
"""The same of a lens, or of a camera that moves."""
_DIM_POINTS = 32
"""The same where it is black so far, or its horizon cuts the light."""
_MOST = 1e30
"""Squared levels of what is not finite."""


def widened(
    region: tuple[int, int, int, int], by: int, resolution: tuple[int, int]
) -> tuple[int, int, int, int]:
    """The region with so many pixels of the frame round it, x0, y0, x1, y1."""
    (x0, y0, x1, y1), (width, height) = region, resolution
    return max(x0 - by, 0), max(y0 - by, 0), min(x1 + by, width), min(y1 + by, height)


def levels(x: Array) -> Array:
    """8-bit levels of the sRGB curve over linear values >= 0, which goes on above 1."""
    return 255 * np.where(
        x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055
    )


def visible_difference(mean: Array, difference: Array) -> Array:
    """How far two linear values seem apart on an sRGB screen, in 8-bit levels, given their mean and
    their difference >= 0.
    """
    high = np.maximum(np.abs(mean), difference)
    return levels(high) - levels(high - difference)


class Refinement:
    """What is known of the samples of each pixel of a region of height by width pixels.

    settings: their error_threshold is in levels, 0 stops no pixel.
    traced: (h, w) bool, pixels that take further samples; others are only looked at by their
    neighbours.
    spread: whether they are seen from several places.
    active: (pixels,) bool, those that take further samples.
    """

    def __init__(self, settings: Settings, traced: Array, spread: bool = False):
        self._threshold, self._light_samples, self._traced = (
            settings.error_threshold,
            settings.light_samples,
            traced,
        )
        self._soft_light, self._cut = np.zeros((2, traced.size), bool)
        self._samples = 0
        self._least = _LENS_SAMPLES if spread else 0
        self.active = np.ones(traced.size, bool)
        self._low, self._high = (
            np.full((4, traced.size), np.inf),
            np.full((4, traced.size), -np.inf),
        )
        self._ahead = np.full(traced.size, np.inf)
        self._range = np.zeros(traced.size)
        self._around = np.zeros(traced.size)

    def note(
        self,
        pixel: Array | slice,
        values: Array,
        soft_light: Array,
        cut: Array,
    ) -> None:
        """Another sample of these pixels: (4, m) colour and lost alpha, (m,) bool whether a soft
        light reached them, and whether their horizon cuts one.
        """
        if self._samples < FIRST_ESTIMATE:
            self._soft_light[pixel] |= soft_light
            self._cut[pixel] |= cut
        self._low[:, pixel] = np.minimum(self._low[:, pixel], values)
        self._high[:, pixel] = np.maximum(self._high[:, pixel], values)

    def end_wave(self, mean: Array, samples: int) -> None:
        """Stops the pixels that are good enough. mean: (3, pixels) colour so far."""
        self._samples = samples
        if samples < FIRST_ESTIMATE:
            return
        apart = self._high - self._low
        with np.errstate(invalid="ignore", over="ignore"):
            seen = np.concatenate([visible_difference(mean, apart[:3]), 255 * apart[3:]]).max(0)
        seen = np.where(np.isfinite(seen), seen, np.inf)
        self._range = np.where(self.active, seen, self._range)
        if samples == FIRST_ESTIMATE:
            self._around = _neighborhoods(self._range.reshape(self._traced.shape)).max(0).ravel()
            self.active &= self._traced.ravel()
        if self._threshold > 0 and samples >= self._least:
            black, points = (
                (self._low[:3] == 0).all(0) & (self._high[:3] == 0).all(0),
                samples * self._light_samples,
            )
            met = self._soft_light | self._cut
            dim = black | self._cut
            least = np.where(dim, _DIM_POINTS, _LIGHT_POINTS)
            waits = met & (points < least) | black & self._cut
            self.active &= waits | ~(
                np.maximum(self._range, self._around) / samples**0.75 <= self._threshold
            )

    def end_wave_ahead(self, samples: int, estimate: ErrorEstimate) -> None:
        """The same where light is resolved: what the first waves say of a pixel and those round it
        tells how many samples it takes, so that this depends on no more of the picture.
        """
        self._samples = samples
        if samples < FIRST_ESTIMATE:
            return
        if samples == FIRST_ESTIMATE:
            self._ahead = np.full(self.active.shape, np.inf)
            number = FIRST_ESTIMATE
            while self._threshold > 0 and number < 1 << 30:
                enough = estimate.levels(np.full(self.active.shape, number)) <= self._threshold
                fewer = enough & (number >= self._least)
                self._ahead = np.where(fewer, np.minimum(self._ahead, number), self._ahead)
                number *= 2
        self.active &= (samples < self._ahead) & self._traced.ravel()


class ErrorEstimate:
    """How far pixels may be from their limit, by how their means moved from wave to wave. shape:
    (h, w) of the region.
    """

    def __init__(self, shape: tuple[int, int]):
        self._shape, self._samples = shape, 0
        self._mean = np.zeros((4, shape[0] * shape[1]))
        self._spread, self._around = np.zeros((2, shape[0] * shape[1]))

    def end_wave(self, mean: Array, samples: int, active: Array) -> None:
        """mean: (4, pixels) colour and lost alpha so far.  active: (pixels,) bool, those that took
        part.
        """
        before, self._samples = self._samples, samples
        if before < samples and before > 0:
            with np.errstate(invalid="ignore", over="ignore"):
                apart = np.abs(mean - self._mean)
                moved = np.concatenate(
                    [visible_difference(mean[:3], apart[:3]), 255 * apart[3:]]
                ).max(0)
                spread = np.minimum(
                    np.where(np.isnan(moved), np.inf, moved) ** 2
                    * (before * samples / (samples - before)),
                    _MOST,
                )
            known = spread if before == 1 else (self._spread + spread) / 2
            self._spread = np.where(active, known, self._spread)
            if samples == FIRST_ESTIMATE:
                here = _neighborhoods(self._spread.reshape(self._shape)) / FIRST_ESTIMATE
                self._around = (here.sum(0) / _neighborhoods(np.ones(self._shape)).sum(0)).ravel()
        self._mean = mean

    def levels(self, samples: Array) -> Array:
        """(pixels,) two standard deviations, about, of pixels with so many samples."""
        n = np.maximum(samples, 1)
        error = np.sqrt(self._spread / n + self._around * (FIRST_ESTIMATE / n) ** 1.5)
        return np.where(samples < FIRST_ESTIMATE, UNKNOWN_ERROR, np.minimum(error, UNKNOWN_ERROR))


def _neighborhoods(image: Array) -> Array:
    """(9, h, w): each pixel and its eight neighbours, 0 beyond the image."""
    height, width = image.shape
    padded = np.pad(image, 1)
    return np.stack([padded[j : j + height, i : i + width] for j in range(3) for i in range(3)])
