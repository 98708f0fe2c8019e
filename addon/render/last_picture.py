"""The last picture of a render slot, for a render that is stopped before it shows anything: Blender
empties the slot before it asks an engine, so that else nothing would be there.
"""

from __future__ import annotations

from collections.abc import Hashable

import bpy
import numpy as np

from .compositor import runs_afterwards

_last: tuple[Hashable, np.ndarray] | None = None


def slot_of(
    depsgraph: bpy.types.Depsgraph, views: tuple[str, ...], size: tuple[int, int]
) -> Hashable | None:
    """What tells the picture's place from others; None where Combined alone is not what people see,
    or nobody looks.
    """
    scene = depsgraph.scene
    layers = [layer for layer in scene.view_layers if layer.use]
    if bpy.app.background or len(views) > 1 or len(layers) > 1 or runs_afterwards(scene):
        return None
    shown = next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)
    slot = shown.render_slots.active_index if shown is not None else 0
    return scene.session_uid, depsgraph.view_layer.name, size, slot


def keep(slot: Hashable | None, combined: np.ndarray) -> None:
    """In place of the one before, which is not what is seen any more: there is one at most."""
    global _last
    _last = None if slot is None else (slot, combined)


def kept(slot: Hashable | None) -> np.ndarray | None:
    return _last[1] if _last is not None and slot is not None and _last[0] == slot else None


@bpy.app.handlers.persistent
def forget(*_: object) -> None:
    global _last
    _last = None


@bpy.app.handlers.persistent
def _forget_for_others(scene: bpy.types.Scene, *_: object) -> None:
    """Another engine's picture takes its place."""
    if scene.render.engine != "GLINT":
        forget()


def register() -> None:
    bpy.app.handlers.load_post.append(forget)
    bpy.app.handlers.render_init.append(_forget_for_others)


def unregister() -> None:
    bpy.app.handlers.load_post.remove(forget)
    bpy.app.handlers.render_init.remove(_forget_for_others)
    forget()
