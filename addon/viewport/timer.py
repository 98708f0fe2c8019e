"""Wakes Blender while pictures are being made, and only then; knows when all that was kept has
become stale.

`bpy.app.timers` run on Blender's thread between its events. Regions are found by address among
those that are on the screen now.
"""

from __future__ import annotations

import weakref
from typing import Any

import bpy

from .redraws import LOOK, Redraws

_PATIENCE = 0.25
"""Seconds between looks when a picture lies undrawn, as in a window that is hidden."""

redraws = Redraws()
_sessions: weakref.WeakSet[Any] = weakref.WeakSet()
_epoch = 0
_evaluation = 0


def watch(session: Any) -> None:
    """Redraw this session's region whenever it `wants_redraw`, while it is `busy`."""
    _sessions.add(session)


def forget(session: Any) -> None:
    _sessions.discard(session)


def session_of(region: int) -> Any | None:
    """The session that draws the region at this address."""
    return next((session for session in _sessions if session.region == region), None)


def drawing() -> None:
    """A view is being drawn."""
    redraws.begin()
    wake()


def wake() -> None:
    """Work has begun."""
    if not bpy.app.timers.is_registered(look):
        bpy.app.timers.register(look, first_interval=LOOK, persistent=True)


def epoch() -> int:
    """Changes when data-blocks may have been exchanged behind the depsgraph's back: undo, redo,
    another file.
    """
    return _epoch


def evaluation() -> int:
    """Changes before every evaluation of a depsgraph that Blender tells of."""
    return _evaluation


def look() -> float | None:
    """Lets tasks go on, and redraws where there is news. Returns the seconds until Blender's timer
    is to call it again, None for never.
    """
    redraws.end()
    if redraws.is_over:
        for session in _sessions:
            session.go_on()
    # before looking for news: a last picture that comes in between is looked for once more
    is_busy = any(session.busy for session in _sessions)
    news = {session.region for session in _sessions if session.wants_redraw}
    if news:
        _redraw(news)
    if is_busy:
        return LOOK
    return _PATIENCE if news else None


def _redraw(addresses: set[int]) -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.as_pointer() in addresses:
                        region.tag_redraw()


@bpy.app.handlers.persistent
def _advance(*_: Any) -> None:
    global _epoch
    _epoch += 1


@bpy.app.handlers.persistent
def _count(*_: Any) -> None:
    global _evaluation
    _evaluation += 1


_HANDLERS = {
    "undo_post": _advance,
    "redo_post": _advance,
    "load_post": _advance,
    "depsgraph_update_pre": _count,
    "frame_change_pre": _count,
}


def register() -> None:
    for name, handler in _HANDLERS.items():
        getattr(bpy.app.handlers, name).append(handler)


def unregister() -> None:
    for session in list(_sessions):
        session.close()
    for name, handler in _HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(handler)
    if bpy.app.timers.is_registered(look):
        bpy.app.timers.unregister(look)
