"""Images read at points of the surface: (u, v) in [0, 1]² spans the image, v = 0 is its bottom
row.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..scene import Texture

Array = np.ndarray
Place = tuple[Array, Array]
"""Rows or columns of an image, and which are outside of one that is cut off."""


class Image:
    """A texture read as linear values, float64. Bytes with the sRGB curve are filtered as they are,
    and the curve is undone afterwards, as in Cycles.
    """

    def __init__(self, texture: Texture, power: Callable[[Array, float], Array] = np.power):
        """power: by which the curve is undone."""
        self._texture, self._power = texture, power
        self._pixels = texture.pixels.reshape(-1, 4)
        self._scale = 255.0 if texture.pixels.dtype == np.uint8 else 1.0
        self._curved = texture.encoding == "SRGB" and texture.pixels.dtype == np.uint8

    def read(self, u: Array, v: Array) -> Array:
        """(4, n) RGBA at (n,) coordinates; those that are not finite read as 0."""
        height, width = self._texture.pixels.shape[:2]
        x, y = _finite(u) * width, _finite(v) * height
        if self._texture.interpolation == "CLOSEST":
            return self._decoded(self._texels(self._column(np.floor(x)), self._row(np.floor(y))))
        x0, y0 = np.floor(x - 0.5), np.floor(y - 0.5)
        fx, fy = x - 0.5 - x0, y - 0.5 - y0
        if self._texture.interpolation == "CUBIC":
            return self._decoded(self._cubic(x0, y0, fx, fy))
        columns = self._column(x0), self._column(x0 + 1)
        below, above = (
            (1 - fx) * self._texels(columns[0], row) + fx * self._texels(columns[1], row)
            for row in (self._row(y0), self._row(y0 + 1))
        )
        return self._decoded((1 - fy) * below + fy * above)

    def _cubic(self, x0: Array, y0: Array, fx: Array, fy: Array) -> Array:
        """(4, n) by the uniform cubic B-spline, over the sixteen texels round the points."""
        columns, rows = [self._column(x0 + i) for i in range(-1, 3)], []
        for row in (self._row(y0 + j) for j in range(-1, 3)):
            texels = (self._texels(column, row) for column in columns)
            rows.append(sum(w * t for w, t in zip(_spline(fx), texels, strict=True)))
        return sum(w * row for w, row in zip(_spline(fy), rows, strict=True))

    def _decoded(self, rgba: Array) -> Array:
        if not self._curved:
            return rgba
        code = rgba[:3]
        # the sRGB curve (IEC 61966-2-1); alpha has none
        steep = self._power((code + 0.055) / 1.055, 2.4)
        color = np.where(code <= 0.04045, code / 12.92, steep)
        return np.concatenate([color, rgba[3:]])

    def texels(self) -> Array:
        """(h, w, 4) RGBA of the whole image."""
        stored = self._decoded((self._pixels / self._scale).T)
        return stored.T.reshape(self._texture.pixels.shape)

    def _column(self, x: Array) -> Place:
        return _extended(x, self._texture.pixels.shape[1], self._texture.extension)

    def _row(self, y: Array) -> Place:
        return _extended(y, self._texture.pixels.shape[0], self._texture.extension)

    def _texels(self, column: Place, row: Place) -> Array:
        """(4, n), extended past the borders."""
        index = row[0] * self._texture.pixels.shape[1] + column[0]
        values = self._pixels.take(index, 0).T / self._scale
        if self._texture.extension == "CLIP":
            values[:, column[1] | row[1]] = 0.0
        return values


def _spline(t: Array) -> tuple[Array, Array, Array, Array]:
    """Weights of the four texels round a place that is t of the way between the middle two."""
    return (
        (1 - t) ** 3 / 6,
        (3 * t**3 - 6 * t**2 + 4) / 6,
        (3 * (t**2 - t**3) + 3 * t + 1) / 6,
        t**3 / 6,
    )


def _finite(a: Array) -> Array:
    return np.where(np.abs(a) < 2.0**31, a, 0.0)


def _extended(k: Array, size: int, extension: str) -> Place:
    """Texel numbers within the image for any whole number."""
    k = k.astype(np.int64)
    outside = np.zeros(len(k), bool)
    if extension == "REPEAT":
        k = k % size
    elif extension == "MIRROR":
        k = k % (2 * size)
        k = np.minimum(k, 2 * size - 1 - k)
    else:
        outside = ((k < 0) | (k >= size)) & (extension == "CLIP")
        k = np.clip(k, 0, size - 1)
    return k, outside
