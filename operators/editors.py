"""Editors of Blender's windows."""

from __future__ import annotations

from typing import Any

import bpy


def editor_of(kind: str, context: bpy.types.Context) -> Any:
    """The space of an open editor of this kind ("TEXT_EDITOR", "IMAGE_EDITOR"), else of one in a
    window of its own; None in a program without windows.
    """
    if bpy.app.background:
        return None
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == kind:
                return area.spaces.active
    if context.area is None:
        return None
    before = set(context.window_manager.windows)
    bpy.ops.screen.area_dupli("INVOKE_DEFAULT")
    [window] = set(context.window_manager.windows) - before
    area = window.screen.areas[0]
    area.type = kind
    return area.spaces.active
