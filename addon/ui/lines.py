"""Text in panels: Blender cuts labels that are too long, so longer lines are broken where the panel
ends.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

import bpy

_LETTER, _SPACE = 6.2, 3.0
"""Pixels of a letter and of a space of Blender's font on a screen of scale 1, rather too many than
too few.
"""
_MARGIN = 44
"""Pixels of a panel that hold no text."""
_ICON = 20
"""Pixels of an icon."""
_LABEL = 8
"""Pixels of a label that hold no text."""
_FEWEST = 16
"""Letters of a line, however narrow the panel and deep the text."""


def fits(text: str, pixels: float) -> bool:
    """Whether a label of so many pixels on a screen of scale 1 shows all of a text."""
    return _LETTER * len(text) + _LABEL <= pixels


def draw_text(
    column: bpy.types.UILayout,
    lines: Iterable[str],
    region: bpy.types.Region,
    bullet: str = "",
    beside: int = 0,
    icon: str = "NONE",
) -> None:
    """Draw lines, broken to the width of the region less the pixels that something takes `beside`
    them. They are set in by four spaces and their own, or by an icon before the first.
    """
    width = region.width / bpy.context.preferences.system.ui_scale - _MARGIN - beside
    below, hang = ("NONE", "   ") if icon == "NONE" else ("BLANK1", "")
    if icon != "NONE":
        width -= _ICON
    for line in lines:
        text = line.lstrip(" ")
        indent = " " * (4 + len(line) - len(text)) if icon == "NONE" else ""
        letters = max(_FEWEST, int((width - _SPACE * len(indent)) / _LETTER))
        first, *rest = textwrap.wrap(bullet + text, letters) or [""]
        column.label(text=indent + first, icon=icon)
        for piece in rest:
            column.label(text=indent + hang + piece, icon=below)
