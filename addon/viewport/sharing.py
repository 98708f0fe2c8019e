"""One export for all views of one scene: quad views, and any number of windows, read Blender's data
once.
"""

from __future__ import annotations

import weakref
from typing import Any

from ...engine.scene import Camera, Scene, SceneDelta
from ..export.sync.incremental import LiveExport
from . import timer


class SharedExport:
    """The export of one depsgraph, and who has heard of its latest evaluation."""

    def __init__(self) -> None:
        self._export = LiveExport()
        self._told: weakref.WeakSet[Any] = weakref.WeakSet()
        self._evaluation = -1

    def update(self, viewer: Any, depsgraph: Any, camera: Camera, **options: Any) -> Scene:
        """The scene for a viewer whom Blender told of an evaluation. The first to come takes its
        updates in; who comes again was told of another one.
        """
        if viewer in self._told or self._evaluation != timer.evaluation():
            self._told.clear()
            self._evaluation = timer.evaluation()
            self._export.apply_updates(depsgraph)
        self._told.add(viewer)
        return self._export.scene(depsgraph, camera, **options)

    def delta(self, **options: Any) -> SceneDelta | None:
        """As of `LiveExport`."""
        return self._export.delta(**options)

    def notes(self, **options: Any) -> tuple[str, ...]:
        """What could not be exported as it is, of the scene that a viewer with these options was
        given.
        """
        return self._export.notes(**options)


_exports: weakref.WeakValueDictionary[tuple, SharedExport] = weakref.WeakValueDictionary()


def export_of(depsgraph: Any) -> SharedExport:
    """The export of this scene and view layer. It lives as long as a viewer holds it; after an undo
    step or another file it is a new one: what was kept may not hold any more.
    """
    source = (
        depsgraph.scene.session_uid,
        depsgraph.view_layer.name,
        depsgraph.as_pointer(),
        timer.epoch(),
    )
    found = _exports.get(source)
    if found is None:
        found = _exports[source] = SharedExport()
    return found
