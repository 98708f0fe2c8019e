"""What Blender tells of a change."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Changes:
    """What must be read again: session uids, addresses of the node trees that belong to one
    material, everything that shades.
    """

    geometry: set[int] = field(default_factory=set)
    materials: set[int] = field(default_factory=set)
    trees: set[int] = field(default_factory=set)
    world: bool = False
    shading: bool = False
    images: bool = False

    @classmethod
    def of(cls, updates: Iterable[Any]) -> Changes:
        """Of `depsgraph.updates`."""
        changes = cls()
        for update in updates:
            changes._add(update)
        return changes

    def _add(self, update: Any) -> None:
        block = update.id.original
        uid, kind = block.session_uid, block.id_type
        if update.is_updated_geometry:
            self.geometry.add(uid)
        if kind == "MATERIAL":
            self.materials.add(uid)
        elif kind == "WORLD":
            self.world = True
        elif kind in ("IMAGE", "TEXTURE", "MOVIECLIP"):
            self.images = self.shading = True
        elif kind == "NODETREE" and block.is_embedded_data:
            self.trees.add(block.as_pointer())
        elif kind == "NODETREE":
            self.shading = True  # a group: any material may use it
