"""Pictures of numbers without a plotting library: lines, dots and capital letters drawn into an
array, and PNG files of them.

Canvases are (h, w, 3) float64 in 0 to 1 of what a screen shows, row 0 on top; points are (x, y) in
pixels from the top left corner.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

import numpy as np

Array = np.ndarray
Color = tuple[float, float, float]

GLYPH_WIDTH, GLYPH_HEIGHT = 5, 7

_GLYPHS = {
    "0": "0E11131519110E",
    "1": "040C040404040E",
    "2": "0E11010204081F",
    "3": "1F02040201110E",
    "4": "02060A121F0202",
    "5": "1F101E0101110E",
    "6": "0608101E11110E",
    "7": "1F010204080808",
    "8": "0E11110E11110E",
    "9": "0E11110F01020C",
    "A": "0E11111F111111",
    "B": "1E11111E11111E",
    "C": "0E11101010110E",
    "D": "1C12111111121C",
    "E": "1F10101E10101F",
    "F": "1F10101E101010",
    "G": "0E11101711110F",
    "H": "1111111F111111",
    "I": "0E04040404040E",
    "J": "0702020202120C",
    "K": "11121418141211",
    "L": "1010101010101F",
    "M": "111B1515111111",
    "N": "11191513111111",
    "O": "0E11111111110E",
    "P": "1E11111E101010",
    "Q": "0E11111115120D",
    "R": "1E11111E141211",
    "S": "0F10100E01011E",
    "T": "1F040404040404",
    "U": "1111111111110E",
    "V": "11111111110A04",
    "W": "11111115151B11",
    "X": "11110A040A1111",
    "Y": "11110A04040404",
    "Z": "1F01020408101F",
    ".": "00000000000C0C",
    ",": "000000000C0408",
    ":": "000C0C000C0C00",
    "-": "0000001F000000",
    "+": "0004041F040400",
    "=": "00001F001F0000",
    "/": "00010204081000",
    "(": "02040808080402",
    ")": "08040202020408",
    "%": "18190204081303",
    "×": "00110A040A1100",
    "|": "04040404040404",
    "<": "02040810080402",
    ">": "08040201020408",
    "'": "04040800000000",
    "_": "0000000000001F",
    "#": "0A0A1F0A1F0A0A",
    ";": "000C0C000C0408",
    "?": "0E110102040004",
}
"""Seven rows of five dots, two hexadecimal digits a row."""


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
    """One line of text in capitals; `corner` is its top left, or its middle (align 0.5) or top
    right (align 1). Letters that are not known are question marks; what leaves the canvas is cut
    off.
    """
    left, top = round(corner[0] - align * text_width(text, scale)), int(corner[1])
    for number, letter in enumerate(text.upper()):
        if letter != " ":
            _stamp(
                image, _glyph(letter, scale), left + number * (GLYPH_WIDTH + 1) * scale, top, color
            )


def text_width(text: str, scale: int = 1) -> int:
    """Pixels that `draw_text` takes."""
    return max(len(text) * (GLYPH_WIDTH + 1) - 1, 0) * scale


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


def _glyph(letter: str, scale: int) -> Array:
    """(7 scale, 5 scale) of 0 and 1."""
    code = _GLYPHS.get(letter, _GLYPHS["?"])
    rows = [
        [
            int(code[2 * row : 2 * row + 2], 16) >> (GLYPH_WIDTH - 1 - column) & 1
            for column in range(GLYPH_WIDTH)
        ]
        for row in range(GLYPH_HEIGHT)
    ]
    return np.kron(np.array(rows, np.float64), np.ones((scale, scale)))


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
