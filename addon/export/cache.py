"""What an export has read, for the next: of what did not change since, nothing is read again."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

from .geometry.cache import ShapeCache
from .images.cache import ImageCache
from .materials.compiled import MaterialCache
from .report import Report
from .sync.changes import Changes
from .world import Sky


class WorldKey(NamedTuple):
    """uid: of the world, 0 for none. is_transparent: the film is."""

    uid: int
    is_transparent: bool


class ExportCache:
    """A new one knows nothing. work: how much was read since it was cleared: "meshes" and other
    shapes, "materials", "worlds".
    """

    def __init__(self) -> None:
        self.shapes, self.materials, self.images = ShapeCache(), MaterialCache(), ImageCache()
        self.worlds: dict[WorldKey, tuple[Sky, Report]] = {}
        self.work: Counter[str] = Counter()

    def forget(self, changes: Changes) -> None:
        """Drop what changed."""
        self.shapes.forget(changes.geometry)
        known = self.materials.compiled
        self.images.keep_textures(key for kept in known.values() for key, _ in kept.textures)
        gone = [
            key
            for key, kept in known.items()
            if changes.shading or key.uid in changes.materials or kept.tree in changes.trees
        ]
        # Images that only Blender has may have been painted or reloaded, which it tells as a change
        # of their materials.
        painted = any(known[key].reads_memory for key in gone)
        if changes.images or changes.shading or changes.world or painted:
            self.images.forget_memory()
            gone += [key for key, kept in known.items() if kept.reads_memory]
        self.materials.forget(gone)
        if changes.images:
            self.images.forget()
        if changes.shading or changes.world or changes.trees:
            self.worlds = {}

    def forget_moving_images(self) -> None:
        """The frame changed, and an image is a sequence: any may be it."""
        known = self.materials.compiled
        self.materials.forget([key for key, kept in known.items() if kept.textures])
        self.images.forget_moving()
        self.worlds = {}
