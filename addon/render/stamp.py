"""The stamp: what a picture was made of, in the file's metadata, so that anyone can make it again
and compare the bits.

Fields stand in the file as `glint.<view layer>.<field>`.
"""

from __future__ import annotations

import functools
import tomllib
from functools import partial
from pathlib import Path
from typing import Any

from ... import engine
from ...engine.analysis.fingerprint import (
    picture_fingerprint,
    settings_text,
    tracer_text,
    value_fingerprint,
)
from ...engine.futures import Future, started

FIELDS = ("pixels", "settings", "geometry", "tracer", "frame")
"""pixels: `picture_fingerprint`.  settings: JSON.  geometry: hash of the exported scene.  tracer:
which one, and its version.
"""


@functools.cache
def manifest() -> dict[str, Any]:
    """The extension's manifest."""
    path = Path(__file__).parents[2] / "blender_manifest.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


class Stamping:
    """A stamp in the making. Its hashes are worked out on threads of their own: that of the scene
    while it is traced, that of the picture while Blender takes it over.
    """

    def __init__(self, scene: engine.Scene) -> None:
        self._geometry = started(partial(value_fingerprint, scene))
        self._pixels: Future[str] | None = None

    def __enter__(self) -> Stamping:
        return self

    def __exit__(self, *_: object) -> None:
        for future in (self._geometry, self._pixels):
            if future is not None:
                future.close()

    def begin_pixels(self, film: engine.Film) -> None:
        """The picture is there; nobody may change its arrays before `fields` is called."""
        self._pixels = started(partial(picture_fingerprint, film.passes))

    def fields(self, settings: engine.Settings, frame: float) -> dict[str, str]:
        """Field → text, after `begin_pixels`."""
        return {
            "pixels": self._pixels.result(),
            **_made_of(self._geometry.result(), settings, frame),
        }


def expected(scene: engine.Scene, settings: engine.Settings, frame: float) -> dict[str, str]:
    """The fields of a picture that was not drawn yet, but for "pixels"."""
    return _made_of(value_fingerprint(scene), settings, frame)


def _made_of(geometry: str, settings: engine.Settings, frame: float) -> dict[str, str]:
    return {
        "settings": settings_text(settings),
        "geometry": geometry,
        "tracer": f"Glint {manifest()['version']}, {tracer_text(settings.backend)}",
        "frame": f"{frame:.10g}",
    }
