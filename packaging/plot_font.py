"""Draws engine/analysis/plot_font.py anew: `python packaging/plot_font.py DejaVuSans.ttf`, in a
Python with Pillow.
"""

from __future__ import annotations

import base64
import importlib
import sys
import textwrap
import zlib

import tree

PAGE = tree.ROOT / "engine" / "analysis" / "plot_font.py"
SIZES = (12, 19)
"""Pixels of an em."""
LETTERS = "".join(map(chr, (*range(33, 127), *range(0xA1, 0xAD), *range(0xAE, 0x100)))) + "≤≥–…→"
_HEAD = '''\
"""Letters of plots: DejaVu Sans 2.37 in two sizes, whose licence lets anybody copy, embed
and change it (dejavu-fonts.github.io/License.html). Made by packaging/plot_font.py.
"""

LETTERS = (
    {letters}
)
FORM = "BbbBB"
"""Of each letter: pixels to the next one, from there to its picture, from the top of capitals down
to it, its width and height; then its coverage row by row, four bits a pixel, an even number.
"""
FONTS = (
'''


def packed(path: str, size: int) -> bytes:
    """Of each letter what `FORM` says, one after the other."""
    font = importlib.import_module("PIL.ImageFont").truetype(path, size)
    top = font.getbbox("H")[1]
    data = bytearray()
    for letter in LETTERS:
        mask, (left, down) = font.getmask2(letter, mode="L")
        width, height = mask.size
        levels = [
            min(15, (mask.getpixel((x, y)) + 8) // 17) for y in range(height) for x in range(width)
        ]
        levels += [0] * (len(levels) % 2)
        data += bytes(
            (round(font.getlength(letter)), left % 256, (down - top) % 256, width, height)
        )
        data += bytes(16 * a + b for a, b in zip(levels[::2], levels[1::2], strict=True))
    return bytes(data)


def main() -> int:
    lines = textwrap.wrap(LETTERS, 80, break_on_hyphens=False)
    text = _HEAD.replace("{letters}", "\n    ".join(map(repr, lines)))
    for size in SIZES:
        code = base64.b85encode(zlib.compress(packed(sys.argv[1], size), 9)).decode()
        text += "    (\n"
        text += "".join(
            f'        "{line}"\n' for line in textwrap.wrap(code, 80, break_on_hyphens=False)
        )
        text += "    ),\n"
    PAGE.write_text(text + ")\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    tree.main(main)
