"""Editors of Blender's windows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

_DRAWN = 0.2
"""Seconds after which Blender has drawn an editor for the first time."""


def in_editor(kind: str, context: bpy.types.Context, use: Callable[[Any], None]) -> None:
    """Call `use` with the area of an open editor of this kind ("TEXT_EDITOR", "IMAGE_EDITOR"), else
    with one in a window of its own, as large as the largest editor, once the operator that runs
    now has returned: a window that a modal operator opens becomes its context, and Blender then
    never ends it. Does nothing in a program without windows.
    """
    if bpy.app.background:
        return
    open_now = _areas(kind, context.window_manager)
    if open_now:
        use(open_now[0])
    elif context.window is not None:
        address = context.window.as_pointer()
        bpy.app.timers.register(lambda: _in_new_window(address, kind, use), first_interval=0.0)


def window_of(area: bpy.types.Area) -> bpy.types.Window:
    """The window that an open area stands in."""
    windows = bpy.context.window_manager.windows
    return next(window for window in windows if area in window.screen.areas[:])


def _areas(kind: str, manager: bpy.types.WindowManager) -> list[Any]:
    areas = (area for window in manager.windows for area in window.screen.areas)
    return [area for area in areas if area.type == kind]


def _in_new_window(address: int, kind: str, use: Callable[[Any], None]) -> None:
    """Beside the window at this address, if it is still there."""
    manager = bpy.context.window_manager
    before = set(manager.windows)
    parent = next((window for window in before if window.as_pointer() == address), None)
    if parent is None:
        return
    largest = max(parent.screen.areas, key=lambda area: area.width * area.height)
    with bpy.context.temp_override(window=parent, area=largest):
        bpy.ops.screen.area_dupli("INVOKE_DEFAULT")
    [window] = set(manager.windows) - before
    area = window.screen.areas[0]
    area.type = kind
    use(area)


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
