"""Nodes where there is no surface: of worlds, of lights and inside of volumes. What only meshes
have is 0 there, in Cycles too, which is told with the node's name where something reads it.
"""

from __future__ import annotations

from typing import Any

from ....engine.program.graph import Value
from ....engine.program.operations_input import NormalSpace
from ....engine.program.operations_rays import ASKING
from .objects import VIEW_LAYER
from .rays import without_rays
from .reader import FARTHEST, TreeReader

ZERO = (0.0, 0.0, 0.0)
MESH_ONLY: dict[str, tuple[tuple | float, ...]] = {
    "attribute": (ZERO, 1.0),
    "uv": (ZERO,),
    "barycentric": (ZERO,),
    "edge_distance": (FARTHEST,),
    "pixel_step": (ZERO,),
    "instance_value": (ZERO, 0.0),
    "tangent_of_surface": (ZERO,),
}
"""Operations that read what a mesh or its object has, and what they give instead."""
_TOLD = {
    **dict.fromkeys(
        ASKING, "finds nothing near in {}, where there is no surface, as in Cycles; set a constant"
    ),
    "attribute": "reads what only meshes have: it gives 0 in {}; set a constant",
    "uv": "reads a UV map, of which {} has none: it is 0; use Generated or Normal of Texture "
    "Coordinate",
    "barycentric": "reads a place on a triangle, of which {} has none: it is 0; use Generated of "
    "Texture Coordinate",
    "tangent_of_surface": "reads a tangent, of which {} has none: it is 0; set a constant",
    **dict.fromkeys(
        ("edge_distance", "pixel_step"), "draws edges, of which {} has none: use Brick Texture"
    ),
    "instance_value": "reads what is an object's or an instancer's own, which {} has not: it gives "
    "0; set a constant",
    "bump": "bends nothing in {}, where there is no surface: use Vector Math or Mapping",
    "normal_map": "bends nothing in {}, where there are no tangents: set its space to Object or "
    "World",
    "view_layer": "reads the view layer, which is not known in {}: it gives 0; set a constant",
}


class BareReader(TreeReader):
    """Reads a tree that dresses no mesh."""

    is_surface = False
    gives_light_alone = True

    def apply(self, name: str, /, *arguments: Value, **settings: int) -> tuple[Value, ...]:
        if name in MESH_ONLY:
            self.tell(name, **settings)
            return tuple(map(self.graph.constant, MESH_ONLY[name]))
        if name in ASKING:
            self.tell(name)
            return without_rays(self, name, arguments)
        if name == "bump":
            self.tell(name)
            return (self.graph.constant(ZERO),)
        if name == "normal_map":
            return (self._mapped_normal(*arguments, **settings),)
        return super().apply(name, *arguments, **settings)

    def tell(self, name: str, **settings: Any) -> None:
        is_of_layer = str(settings.get("attribute", "")).startswith(VIEW_LAYER)
        told = _TOLD["view_layer" if is_of_layer else name]
        self.note(f"Node '{self.reading}' {told}")

    def object_incoming(self) -> Value:
        return self.apply("object_normal")[0]

    def object_to_world(self, vector: Value) -> Value:
        """A normal of the object's space in the world; of any length where no object turns it, as
        in Cycles.
        """
        return vector

    def _mapped_normal(self, color: Value, strength: Value, space: int, **_: Any) -> Value:
        """As on surfaces (the operation `normal_map`), which only face the ray."""
        own = self.apply("normal")[0]
        if space == NormalSpace.TANGENT:
            self.tell("normal_map")
            return own
        turns = space in (NormalSpace.BLENDER_OBJECT, NormalSpace.BLENDER_WORLD)
        constant, side = self.graph.constant, -1.0 if turns else 1.0
        stretched = self.apply("product", color, constant((2.0, 2.0 * side, 2.0 * side)))[0]
        one, shift = constant(1.0), constant((-1.0, -side, -side))
        mapped = self.apply("scaled_sum", stretched, one, shift)[0]
        if space in (NormalSpace.OBJECT, NormalSpace.BLENDER_OBJECT):
            return self._between(own, self.object_to_world(mapped), strength)
        return self._between(own, self.apply("vector_normalized", mapped)[0], strength)

    def _between(self, own: Value, bent: Value, strength: Value) -> Value:
        """The unit vector from own towards bent by a share that is at least 0."""
        do, constant = self.arithmetic(), self.graph.constant
        held = do("MAXIMUM", strength, 0.0)
        rest = self.apply("scaled_sum", own, do("SUBTRACT", 1.0, held), constant(ZERO))[0]
        mixed = self.apply("scaled_sum", bent, held, rest)[0]
        return self.apply("vector_normalized", mixed)[0]
