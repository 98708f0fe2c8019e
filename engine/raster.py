"""Raster images (notes, section 3): point samples, pixel values of few bits, coverage and
compositing, the sRGB curve.

Images are arrays with row 0 at the bottom, as `film.Film`; pixel (i, j) is image[j, i] and its
centre is the point (i, j).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Array = np.ndarray
Image = Callable[[Array, Array], Array]
"""I(x, y) of section 3.4: takes arrays of any one shape, gives values of that shape, or with
channels behind it.
"""

CENTER = np.zeros((1, 2))


def point_sample(image: Image, nx: int, ny: int, offsets: Array = CENTER) -> Array:
    """The raster image (ny, nx) or (ny, nx, c) float64 of I: each pixel is the mean of I over its
    samples (section 3.4).

    offsets: (k, 2) from the pixel's centre, in pixels; the default is one sample at the centre.
    `sampling.pixel_offsets` gives a filter.
    """
    x, y = np.meshgrid(np.arange(nx, dtype=np.float64), np.arange(ny, dtype=np.float64))
    total: Any = sum(np.asarray(image(x + dx, y + dy), np.float64) for dx, dy in offsets)
    return total / len(offsets)


def coverage(inside: Image, nx: int, ny: int, offsets: Array) -> Array:
    """(ny, nx) float64 α: the share of each pixel's samples for which inside(x, y) is true (section
    3.6a); the alpha mask of 3.6c.
    """
    return point_sample(lambda x, y: np.asarray(inside(x, y), bool), nx, ny, offsets)


def quantize(values: Array, bits: int) -> Array:
    """Values in [0, 1] to the nearest of the 2^bits levels 0 ... 2^bits - 1 (section 3.5); uint8 up
    to 8 bits, uint16 up to 16.

    Outside values are clipped and NaN becomes 0. Raises ValueError for other than 1 to 16 bits.
    """
    if not 1 <= bits <= 16:
        raise ValueError(f"bits is {bits}: use 1 to 16")
    top = 2**bits - 1
    clipped = np.clip(
        np.nan_to_num(np.asarray(values, np.float64), posinf=1.0, neginf=0.0), 0.0, 1.0
    )
    return np.floor(clipped * top + 0.5).astype(np.uint8 if bits <= 8 else np.uint16)


def dequantize(levels: Array, bits: int) -> Array:
    """Levels back to [0, 1] float64. A value in [0, 1] returns with an error of at most half a
    level, 0.5 / (2^bits - 1): banding.
    """
    return np.asarray(levels, np.float64) / (2**bits - 1)


def composite(foreground: Array, background: Array, alpha: Array) -> Array:
    """c = α c_f + (1 - α) c_b (section 3.6b, with its erratum). Colours (..., c), straight; alpha
    (...) or a number.
    """
    alpha = np.asarray(alpha, np.float64)[..., None]
    return alpha * np.asarray(foreground, np.float64) + (1 - alpha) * np.asarray(
        background, np.float64
    )


def over(foreground: Array, background: Array) -> Array:
    """(..., c + 1) over (..., c + 1), alpha last (section 3.6c), both premultiplied: associative
    (Porter, Duff 1984).
    """
    foreground, background = np.asarray(foreground, np.float64), np.asarray(background, np.float64)
    return foreground + (1 - foreground[..., -1:]) * background


def premultiply(straight: Array) -> Array:
    """(..., c + 1) -> the same, colours times alpha."""
    straight = np.array(straight, np.float64)
    straight[..., :-1] *= straight[..., -1:]
    return straight


def unpremultiply(premultiplied: Array) -> Array:
    """(..., c + 1) -> the same, colours over alpha; where alpha is 0 the colours stay, as light
    without cover has no straight form.
    """
    premultiplied = np.array(premultiplied, np.float64)
    alpha = premultiplied[..., -1:]
    premultiplied[..., :-1] /= np.where(alpha == 0, 1.0, alpha)
    return premultiplied


def srgb_from_linear(linear: Array) -> Array:
    """The sRGB curve (IEC 61966-2-1) by channel, float64; odd in its argument, so negative values
    keep their sign.
    """
    linear = np.asarray(linear, np.float64)
    size = np.abs(linear)
    return np.copysign(
        np.where(size <= 0.0031308, 12.92 * size, 1.055 * size ** (1 / 2.4) - 0.055), linear
    )


def linear_from_srgb(encoded: Array) -> Array:
    """The inverse curve, float64. The standard's own constants leave a step of 2e-8 between the two
    pieces.
    """
    encoded = np.asarray(encoded, np.float64)
    size = np.abs(encoded)
    return np.copysign(
        np.where(size <= 0.04045, size / 12.92, ((size + 0.055) / 1.055) ** 2.4), encoded
    )
