"""Nodes of a volume: what fills a thing, or the world, at a point inside. There is no surface: its
normal is the direction from which the point is seen, as in Cycles' worlds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ....engine.program.graph import Graph, Value
from ....engine.program.table import BY_NAME
from .bare import BareReader
from .objects import SPACE_SCALE, SPACE_START
from .reader import TreeReader


class VolumeReader(BareReader):
    """Reads the tree of a volume, which has its object's place and properties but not its mesh's
    attributes: they are 0 in Cycles too.
    """

    gives_light_alone = False

    def __init__(
        self,
        graph: Graph,
        images: Any,
        note: Callable[[str], None],
        is_world: bool = False,
        material_index: int = 0,
    ) -> None:
        super().__init__(graph, images, note, BY_NAME, material_index)
        self.is_world = is_world

    def apply(self, name: str, /, *arguments: Value, **settings: int) -> tuple[Value, ...]:
        if name == "instance_value" and not self.is_world:
            return TreeReader.apply(self, name, *arguments, **settings)
        return super().apply(name, *arguments, **settings)

    def generated(self) -> Value:
        """Coordinates from 0 to 1 in the texture space of the object's mesh; of a world the
        place.
        """
        place = self.apply("object_position", shift=0)[0]
        if self.is_world:
            return place
        scale, start = (
            self.apply("instance_value", attribute=name)[0] for name in (SPACE_SCALE, SPACE_START)
        )
        scaled = self.apply("product", place, scale)[0]
        return self.apply("scaled_sum", scaled, self.graph.constant(1.0), start)[0]

    def normal(self) -> Value:
        return self.apply("normal")[0]

    def ray_depth(self) -> None:
        """Points inside do not know how often a ray bounced."""
