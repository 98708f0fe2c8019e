"""Nodes of a world: what rays see that hit nothing. Such a ray has a direction and no surface."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ....engine.program.graph import Value
from .bare import ZERO, BareReader
from .inputs import NO_IMAGE
from .mapping import texture_mapped
from .reader import READERS, NodeInputs, Outputs

_ALONG = ("position", "object_position")
_AGAINST = ("normal", "face_normal", "object_normal", "reflection")


@dataclass(frozen=True)
class Sun:
    """A disc in the sky: the unit direction to its middle, and its angular diameter."""

    direction: tuple[float, float, float]
    size: float


class SkyReader(BareReader):
    """Reads a world's tree: a point is the direction that the ray goes, and its normals look back
    along it, as in Cycles.
    """

    def __init__(self, *given: Any, suns: list[Sun] | None = None) -> None:
        """suns: gets those that sky textures show where they are told to; None leaves these out."""
        super().__init__(*given)
        self.suns = suns

    def apply(self, name: str, /, *arguments: Value, **settings: int) -> tuple[Value, ...]:
        if name in _ALONG:
            return (self.along(),)
        if name == "normal_to_world":
            return arguments
        if name in _AGAINST:
            return super().apply("incoming")
        if name == "transform_vector":
            self.note(f"Node '{self.reading}' turns nothing in {{}}: vectors stay as they are")
            return arguments
        if name == "object_location":
            self.tell("instance_value")
            return (self.graph.constant(ZERO),)
        return super().apply(name, *arguments, **settings)

    def along(self) -> Value:
        """The unit direction of the ray."""
        minus = self.graph.constant((-1.0, -1.0, -1.0))
        return super().apply("product", super().apply("incoming")[0], minus)[0]

    def generated(self) -> Value:
        return self.along()

    def ray_length(self) -> None:
        """The sky is nowhere."""

    def ray_depth(self) -> None:
        """The sky does not know how it is seen."""


def environment_uv(view: NodeInputs, direction: Value) -> Value:
    """Where an environment image shows a direction, as (u, v, 0)."""
    do = view.math
    x, y, z = view.apply("separate_xyz", view.apply("vector_normalized", direction)[0])
    if view.node.projection == "MIRROR_BALL":
        # a ball that is seen along +y shows each direction where its normal halves the way
        size = do("MULTIPLY", 2.0, do("SQRT", do("MULTIPLY_ADD", y, -0.5, 0.5)))
        return do.plane(*(do("MULTIPLY_ADD", do("DIVIDE", k, size), 0.5, 0.5) for k in (x, z)))
    across = do("SQRT", do("MULTIPLY_ADD", x, x, do("MULTIPLY", y, y)))
    u = do("MULTIPLY_ADD", do("ARCTAN2", y, x), -0.5 / math.pi, 0.5)
    v = do("MULTIPLY_ADD", do("ARCTAN2", z, across), 1 / math.pi, 0.5)
    return do.plane(u, v)


def _environment(view: NodeInputs) -> Outputs:
    """Repeated at its borders, as Cycles does, also at the poles."""
    node = view.node
    if node.image is None:
        view.reader.note(NO_IMAGE)
    texture = view.reader.images.texture(
        node.image, node.image_user, "REPEAT", node.interpolation, True
    )
    given = view.value("Vector") if view.is_linked("Vector") else view.apply("position", shift=0)[0]
    where = environment_uv(view, texture_mapped(view, given))
    return {"Color": view.apply("image", where, texture=texture)[0]}


READERS["ShaderNodeTexEnvironment"] = _environment
