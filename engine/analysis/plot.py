"""Pictures of numbers without a plotting library: lines, dots and text drawn into an array, and PNG
files of them.

Canvases are (h, w, 3) float64 in 0 to 1 of what a screen shows, row 0 on top; points are (x, y) in
pixels from the top left corner.
"""

from __future__ import annotations

import base64
import functools
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .plot_font import FONTS, FORM, LETTERS

Array = np.ndarray
Color = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class _Letter:
    """advance: pixels to the next one. left, top: of its picture, from there and from the top of
    capitals. cover: (h, w) from 0 to 1.
    """

    advance: int
    left: int
    top: int
    cover: Array


def canvas(width: int, height: int, color: Color = (0.09, 0.09, 0.1)) -> Array:
    """A new canvas of one colour."""
    return np.full((height, width, 3), color, np.float64)


def draw_line(
    image: Array,
    start: tuple[float, float],
    end: tuple[float, float],
    color: Color,
    width: float = 1.0,
) -> None:
    """A straight line with round ends and smooth edges."""
    (x0, y0), (x1, y1) = start, end
    window = _window(image, min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1), width / 2 + 1)
    if window is None:
        return
    rows, columns, x, y = window
    squared = (x1 - x0) ** 2 + (y1 - y0) ** 2
    along = (
        np.clip(((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / squared, 0.0, 1.0)
        if squared > 0
        else 0.0
    )
    distance = np.hypot(x - x0 - along * (x1 - x0), y - y0 - along * (y1 - y0))
    _blend(image, rows, columns, np.clip(width / 2 + 0.5 - distance, 0.0, 1.0), color)


def draw_dot(
    image: Array, center: tuple[float, float], radius: float, color: Color, ring: float = 0.0
) -> None:
    """A disc, or a circle of line width `ring`."""
    window = _window(image, *center, *center, radius + ring + 1)
    if window is None:
        return
    rows, columns, x, y = window
    distance = np.hypot(x - center[0], y - center[1])
    edge = np.abs(distance - radius) - ring / 2 if ring else distance - radius
    _blend(image, rows, columns, np.clip(0.5 - edge, 0.0, 1.0), color)


def draw_text(
    image: Array,
    text: str,
    corner: tuple[int, int],
    color: Color = (0.9, 0.9, 0.9),
    scale: int = 1,
    align: float = 0.0,
) -> None:
    """One line of text; `corner` is where its capitals have their top left, or their middle (align
    0.5) or top right (align 1). Letters that are not known are question marks; what leaves the
    canvas is cut off. scale: 1 for small letters, 2 for large ones.
    """
    left, top = round(corner[0] - align * text_width(text, scale)), int(corner[1])
    for letter in text:
        drawn = _letter(letter, scale)
        _stamp(image, drawn.cover, left + drawn.left, top + drawn.top, color)
        left += drawn.advance


def text_width(text: str, scale: int = 1) -> int:
    """Pixels that `draw_text` takes."""
    return sum(_letter(letter, scale).advance for letter in text)


def png_bytes(image: Array) -> bytes:
    """A canvas as an 8-bit PNG file (PNG specification, second edition: filter 0, one IDAT)."""
    levels = np.rint(np.clip(np.nan_to_num(image), 0.0, 1.0) * 255).astype(np.uint8)
    height, width = levels.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), levels.reshape(height, width * 3)], 1)
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows.tobytes())),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _window(
    image: Array, x0: float, y0: float, x1: float, y1: float, margin: float
) -> tuple | None:
    """(rows, columns, x, y) of the pixels around a box, None where it is outside the canvas or not
    finite.
    """
    if not np.isfinite([x0, y0, x1, y1]).all():
        return None
    height, width = image.shape[:2]
    left, right = max(int(x0 - margin), 0), min(int(x1 + margin) + 1, width)
    top, bottom = max(int(y0 - margin), 0), min(int(y1 + margin) + 1, height)
    if left >= right or top >= bottom:
        return None
    y, x = np.mgrid[top:bottom, left:right]
    return slice(top, bottom), slice(left, right), x, y


def _blend(image: Array, rows: slice, columns: slice, cover: Array, color: Sequence[float]) -> None:
    image[rows, columns] += cover[..., None] * (np.asarray(color) - image[rows, columns])


def _letter(letter: str, scale: int) -> _Letter:
    font = _font(scale)
    return font.get(letter) or font["?"]


@functools.cache
def _font(scale: int) -> dict[str, _Letter]:
    data = zlib.decompress(base64.b85decode(FONTS[scale - 1]))
    found, at = {}, 0
    for letter in LETTERS:
        advance, left, top, width, height = struct.unpack_from(FORM, data, at)
        at, pixels = at + struct.calcsize(FORM), width * height
        packed = np.frombuffer(data, np.uint8, (pixels + 1) // 2, at)
        levels = np.column_stack([packed >> 4, packed & 15]).ravel()[:pixels]
        found[letter] = _Letter(advance, left, top, levels.reshape(height, width) / 15)
        at += len(packed)
    return found | {" ": _Letter(found["n"].advance // 2, 0, 0, np.zeros((0, 0)))}


def _stamp(image: Array, glyph: Array, left: int, top: int, color: Color) -> None:
    x0, y0 = max(left, 0), max(top, 0)
    x1, y1 = min(left + glyph.shape[1], image.shape[1]), min(top + glyph.shape[0], image.shape[0])
    if x0 < x1 and y0 < y1:
        _blend(
            image,
            slice(y0, y1),
            slice(x0, x1),
            glyph[y0 - top : y1 - top, x0 - left : x1 - left],
            color,
        )
