"""What a file links from libraries and Blender could not find."""

from __future__ import annotations

from typing import Any

import bpy

from .report import Report


def note_missing(depsgraph: Any, report: Report) -> None:
    """Tell of the empty place-holders that Blender puts in the place of missing linked data."""
    if not bpy.data.libraries:
        return
    for block in depsgraph.ids:
        if getattr(block.original, "is_missing", False):
            report.note(
                "Linked data that Blender could not find are empty: {}; relocate their library in "
                "the Outliner (Blender File)",
                block.name,
            )
