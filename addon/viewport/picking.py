"""Which pixel of which scene lies under a point of a 3D view."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ... import engine
from ...engine.scene import Scene
from . import timer


@dataclass(frozen=True, eq=False)
class Picked:
    """A scene with the camera of the view, its settings, and a pixel of the full frame from the
    bottom left.
    """

    scene: Scene
    settings: engine.Settings
    pixel: tuple[int, int]


def pixel_at(region: Any, x: int, y: int) -> Picked | None:
    """What Glint shows at a point of a region, in screen pixels from its bottom left; None where it
    shows nothing.
    """
    session = timer.session_of(region.as_pointer())
    if session is None or session.shown_scene is None:
        return None
    scene, settings, view = session.shown_scene
    inside = _in_frame(view, x, y)
    if inside is not None:
        return Picked(replace(scene, camera=view.frame.camera), settings, inside)
    pixel = x // view.pixel_size, y // view.pixel_size
    x0, y0, x1, y1 = view.shown
    return Picked(scene, settings, pixel) if x0 <= pixel[0] < x1 and y0 <= pixel[1] < y1 else None


def _in_frame(view: Any, x: int, y: int) -> tuple[int, int] | None:
    """The render's own pixel there, where its pixels lie on those of the screen."""
    if view.frame is None:
        return None
    pixel, (width, height) = (x - view.frame.x, y - view.frame.y), view.frame.camera.resolution
    return pixel if 0 <= pixel[0] < width and 0 <= pixel[1] < height else None
