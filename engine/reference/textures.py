"""Images read at points of the surface: (u, v) in [0, 1]² spans the image, v = 0 is its bottom
row.
"""

from __future__ import annotations

import numpy as np

from ..scene import Texture

Array = np.ndarray


class Image:
    """A texture decoded to linear values, float64 where it is read."""

    def __init__(self, texture: Texture):
        self._texture = texture
        self._pixels = texture.pixels.reshape(-1, 4)
        self._table = _decode_table(texture) if texture.pixels.dtype == np.uint8 else None

    def read(self, u: Array, v: Array) -> Array:
        """(4, n) RGBA at (n,) coordinates; those that are not finite read as 0."""
        height, width = self._texture.pixels.shape[:2]
        x, y = _finite(u) * width, _finite(v) * height
        if self._texture.interpolation == "CLOSEST":
            return self._texels(np.floor(x), np.floor(y))
        x, y = x - 0.5, y - 0.5
        x0, y0 = np.floor(x), np.floor(y)
        fx, fy = x - x0, y - y0
        below = (1 - fx) * self._texels(x0, y0) + fx * self._texels(x0 + 1, y0)
        above = (1 - fx) * self._texels(x0, y0 + 1) + fx * self._texels(x0 + 1, y0 + 1)
        return (1 - fy) * below + fy * above

    def texels(self) -> Array:
        """(h, w, 4) RGBA of the whole image."""
        height, width = self._texture.pixels.shape[:2]
        x, y = np.meshgrid(np.arange(width), np.arange(height))
        return self._texels(x.ravel(), y.ravel()).T.reshape(height, width, 4)

    def _texels(self, x: Array, y: Array) -> Array:
        """(4, n) of whole texel coordinates, extended past the borders."""
        height, width = self._texture.pixels.shape[:2]
        (column, left), (row, up) = (
            _extended(k, size, self._texture.extension) for k, size in ((x, width), (y, height))
        )
        raw = self._pixels[row * width + column]
        values = (
            raw.T.astype(np.float64)
            if self._table is None
            else np.stack([self._table[c][raw[:, c]] for c in range(4)])
        )
        return np.where(left | up, 0.0, values)


def _decode_table(texture: Texture) -> Array:
    """(4, 256): the value of each byte; the sRGB curve (IEC 61966-2-1) on colours when the texture
    says so.
    """
    linear = np.arange(256) / 255.0
    curve = np.where(linear <= 0.04045, linear / 12.92, ((linear + 0.055) / 1.055) ** 2.4)
    color = curve if texture.encoding == "SRGB" else linear
    return np.stack([color, color, color, linear])


def _finite(a: Array) -> Array:
    return np.where(np.abs(a) < 2.0**31, a, 0.0)


def _extended(k: Array, size: int, extension: str) -> tuple[Array, Array]:
    """Texel numbers within the image for any whole number, and which lie outside of a CLIP
    image.
    """
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
