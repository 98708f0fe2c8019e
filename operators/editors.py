"""Editors of Blender's windows."""

from __future__ import annotations

from typing import Any

import bpy

_DRAWN = 0.2
"""Seconds after which Blender has drawn an editor for the first time."""


def editor_of(kind: str, context: bpy.types.Context) -> Any:
    """The area of an open editor of this kind ("TEXT_EDITOR", "IMAGE_EDITOR"), else of one in a
    window of its own, as large as the largest editor; None in a program without windows.
    """
    if bpy.app.background:
        return None
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == kind:
                return area
    if context.window is None:
        return None
    before = set(context.window_manager.windows)
    largest = max(context.window.screen.areas, key=lambda area: area.width * area.height)
    with context.temp_override(area=largest):
        bpy.ops.screen.area_dupli("INVOKE_DEFAULT")
    [window] = set(context.window_manager.windows) - before
    area = window.screen.areas[0]
    area.type = kind
    return area


def fit_picture(area: bpy.types.Area) -> None:
    """Shows all of an image editor's picture as soon as the editor has been drawn."""
    address = area.as_pointer()
    bpy.app.timers.register(lambda: _fit(address), first_interval=_DRAWN)


def _fit(address: int) -> None:
    """In the area at this address, if it is still there."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.as_pointer() == address and area.type == "IMAGE_EDITOR":
                region = next(region for region in area.regions if region.type == "WINDOW")
                with bpy.context.temp_override(window=window, area=area, region=region):
                    bpy.ops.image.view_all(fit_view=True)
