"""The stamp: what a picture was made of, in the file's metadata, so that anyone can make it again and compare the bits.

Fields stand in the file as `glint.<view layer>.<field>`.
"""

from __future__ import annotations

import functools
import tomllib
from pathlib import Path
from typing import Any

from .. import engine
from ..engine.fingerprint import picture_fingerprint, settings_text, tracer_text, value_fingerprint

FIELDS = ("pixels", "settings", "geometry", "tracer", "frame")
"""pixels: hash of all passes as float32.  settings: JSON.  geometry: hash of the exported scene.  tracer: which one, and its version."""


@functools.cache
def manifest() -> dict[str, Any]:
    """The extension's manifest."""
    path = Path(__file__).parent.parent / "blender_manifest.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


def make_stamp(scene: engine.Scene, settings: engine.Settings, film: engine.Film, frame: int) -> dict[str, str]:
    """Field → text."""
    return {
        "pixels": picture_fingerprint(film.passes),
        "settings": settings_text(settings),
        "geometry": value_fingerprint(scene),
        "tracer": f"Glint {manifest()['version']}, {tracer_text(settings.backend)}",
        "frame": str(frame),
    }
