"""Adaptive refinement: which pixels are good enough after a wave, by how far their samples lie apart (SEMANTICS.md, "Refinement")."""

from __future__ import annotations

import numpy as np

from ..film import FIRST_ESTIMATE, UNKNOWN_ERROR

Array = np.ndarray


def widened(region: tuple[int, int, int, int], resolution: tuple[int, int]) -> tuple[int, int, int, int]:
    """The region with the pixels of the frame next to it, x0, y0, x1, y1."""
    x0, y0, x1, y1 = region
    return max(x0 - 1, 0), max(y0 - 1, 0), min(x1 + 1, resolution[0]), min(y1 + 1, resolution[1])


def levels(x: Array) -> Array:
    """8-bit levels of the sRGB curve over linear values >= 0, which goes on above 1."""
    return 255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055)


def visible_difference(mean: Array, difference: Array) -> Array:
    """How far two linear values seem apart on an sRGB screen, in 8-bit levels, given their mean and their difference >= 0."""
    high = np.maximum(np.abs(mean), difference)
    return levels(high) - levels(high - difference)


class Refinement:
    """What is known of the samples of each pixel of a region of height by width pixels.

    threshold: in levels, 0 stops no pixel.  shown: (h, w) bool, pixels that are drawn; others are only looked at by their neighbours.
    active: (pixels,) bool, those that take further samples.
    """

    def __init__(self, threshold: float, shown: Array):
        self._threshold, self._shown = threshold, shown
        self.active = np.ones(shown.size, bool)
        self._low, self._high = np.full((4, shown.size), np.inf), np.full((4, shown.size), -np.inf)
        self._range = np.zeros(shown.size)
        self._around = np.zeros(shown.size)

    def note(self, pixel: Array | slice, values: Array) -> None:
        """Another sample of these pixels: (4, m) colour and lost alpha."""
        self._low[:, pixel] = np.minimum(self._low[:, pixel], values)
        self._high[:, pixel] = np.maximum(self._high[:, pixel], values)

    def end_wave(self, mean: Array, samples: int) -> None:
        """Stops the pixels that are good enough. mean: (3, pixels) colour so far."""
        if samples < FIRST_ESTIMATE:
            return
        apart = self._high - self._low
        with np.errstate(invalid="ignore", over="ignore"):
            seen = np.concatenate([visible_difference(mean, apart[:3]), 255 * apart[3:]]).max(0)
        seen = np.where(np.isfinite(seen), seen, np.inf)
        self._range = np.where(self.active, seen, self._range)
        if samples == FIRST_ESTIMATE:
            self._around = _largest_of_neighbors(self._range.reshape(self._shown.shape)).ravel()
            self.active &= self._shown.ravel()
        if self._threshold > 0:
            self.active &= ~(self.error(np.float64(samples)) <= self._threshold)

    def error(self, samples: Array) -> Array:
        """(pixels,) estimated error in levels of pixels with so many samples."""
        error = np.maximum(self._range, self._around) / np.maximum(samples, 1) ** 0.75
        return np.where(samples < FIRST_ESTIMATE, UNKNOWN_ERROR, np.minimum(error, UNKNOWN_ERROR))


def _largest_of_neighbors(image: Array) -> Array:
    height, width = image.shape
    padded = np.pad(image, 1)
    return np.max([padded[j : j + height, i : i + width] for j in range(3) for i in range(3)], 0)
