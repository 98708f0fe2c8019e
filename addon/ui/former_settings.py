"""Settings in files that an older version of Glint saved.

A file keeps what somebody chose, not what a setting has to begin with: where that changes from one
version to the next, a scene that was saved with the old one still gets it. So scenes are marked
with a number when they are saved, and what was offered at the number is written where nothing was
chosen. Names of settings and the numbers of choices never change (tests/blender/test_files_last.py
holds them), so nothing else has to be carried over.
"""

from __future__ import annotations

from typing import Any

import bpy

VERSION = 2
"""To be raised when the settings offered to a user change."""
_OFFERED_UNTIL: dict[int, dict[str, Any]] = {
    1: {
        "samples": 64,
        "error_threshold": 4.0,
        "visibility_samples": 1,
        "soft_light": "SHARED",
        "clamp_indirect": 0.0,
    }
}
"""Number -> settings that were offered otherwise up to it, and how."""


@bpy.app.handlers.persistent
def mark(*_: Any) -> None:
    """Scenes of Glint are of this version, before a file is saved."""
    for scene in bpy.data.scenes:
        if scene.library is None and scene.render.engine == "GLINT":
            scene.glint.version = VERSION


@bpy.app.handlers.persistent
def carry_over(*_: Any) -> None:
    """After loading: what older versions offered, in the scenes that they saved."""
    for scene in bpy.data.scenes:
        if scene.library is not None or not 0 < scene.glint.version < VERSION:
            continue
        for number, offered in sorted(_OFFERED_UNTIL.items()):
            if scene.glint.version <= number:
                _write(scene, offered)
        scene.glint.version = VERSION


def _write(scene: bpy.types.Scene, offered: dict[str, Any]) -> None:
    for group in (scene.glint.final, scene.glint.viewport):
        for name, value in offered.items():
            if not group.is_property_set(name):
                setattr(group, name, value)


def register() -> None:
    bpy.app.handlers.save_pre.append(mark)
    bpy.app.handlers.load_post.append(carry_over)


def unregister() -> None:
    bpy.app.handlers.save_pre.remove(mark)
    bpy.app.handlers.load_post.remove(carry_over)
