"""Nodes of a world: what rays see that hit nothing. Such a ray has a direction and no surface."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ....engine.program.graph import Graph, Value
from ....engine.program.operations_math import MathOperation
from .inputs import noted_interpolation
from .mapping import texture_mapped
from .reader import READERS, NodeInputs, Outputs, TreeReader

_ALONG = ("position", "object_position")
_AGAINST = ("normal", "face_normal", "object_normal", "reflection")
_NOWHERE = {
    "backfacing": (0.0,),
    "uv": ((0.0, 0.0, 0.0),),
    "attribute": ((0.0, 0.0, 0.0), 1.0),
    "object_location": ((0.0, 0.0, 0.0),),
}
_VIEW = ("camera_position", "window")


class SkyReader(TreeReader):
    """Reads a world's tree: a point is the direction that the ray goes, and its normals look back
    along it, as in Cycles.
    """

    def __init__(self, graph: Graph, images: Any, note: Callable[[str], None]) -> None:
        super().__init__(graph, images, note)

    def apply(self, name: str, /, *arguments: Value, **settings: int) -> tuple[Value, ...]:
        if name in _ALONG:
            return (self.along(),)
        if name in _AGAINST:
            return super().apply("incoming")
        if name in _VIEW:
            self.note("Camera and window coordinates are not known in the world {}: 0 is used")
            return (self.graph.constant((0.0, 0.0, 0.0)),)
        if name in _NOWHERE:
            return tuple(map(self.graph.constant, _NOWHERE[name]))
        return super().apply(name, *arguments, **settings)

    def along(self) -> Value:
        """The unit direction of the ray."""
        minus = self.graph.constant((-1.0, -1.0, -1.0))
        return super().apply("product", super().apply("incoming")[0], minus)[0]

    def generated(self) -> Value:
        return self.along()


def environment_uv(view: NodeInputs, direction: Value) -> Value:
    """Where an environment image shows a direction, as (u, v, 0)."""
    graph = view.reader.graph
    unit = view.apply("vector_normalized", direction)[0]
    if view.node.projection == "MIRROR_BALL":
        return _mirror_ball(view, unit)
    x, y, z = view.apply("separate_xyz", unit)
    across = _math(view, "SQRT", _math(view, "MULTIPLY_ADD", x, x, _math(view, "MULTIPLY", y, y)))
    turn, half = graph.constant(-0.5 / math.pi), graph.constant(0.5)
    u = _math(view, "MULTIPLY_ADD", _math(view, "ARCTAN2", y, x), turn, half)
    v = _math(
        view,
        "MULTIPLY_ADD",
        _math(view, "ARCTAN2", z, across),
        graph.constant(1 / math.pi),
        half,
    )
    return view.apply("combine_xyz", u, v, graph.constant(0.0))[0]


def _mirror_ball(view: NodeInputs, unit: Value) -> Value:
    """A ball that is seen along +y shows each direction where its normal halves the way."""
    graph = view.reader.graph
    x, y, z = view.apply("separate_xyz", unit)
    half, zero = graph.constant(0.5), graph.constant(0.0)
    room = _math(view, "MULTIPLY_ADD", y, graph.constant(-0.5), half)
    size = _math(view, "MULTIPLY", graph.constant(2.0), _math(view, "SQRT", room))
    u, v = (
        _math(view, "MULTIPLY_ADD", _math(view, "DIVIDE", part, size), half, half)
        for part in (x, z)
    )
    return view.apply("combine_xyz", u, v, zero)[0]


def _math(view: NodeInputs, name: str, *numbers: Value) -> Value:
    zero = view.reader.graph.constant(0.0)
    given = (*numbers, zero, zero)[:3]
    return view.apply("math", *given, operation=MathOperation[name], clamp=0)[0]


def _environment(view: NodeInputs) -> Outputs:
    """Repeated at its borders, as Cycles does, also at the poles."""
    node = view.node
    interpolation = noted_interpolation(node, view.reader.note)
    texture = view.reader.images.texture(node.image, node.image_user, "REPEAT", interpolation, True)
    given = view.value("Vector") if view.is_linked("Vector") else view.apply("position", shift=0)[0]
    where = environment_uv(view, texture_mapped(view, given))
    return {"Color": view.apply("image", where, texture=texture)[0]}


READERS["ShaderNodeTexEnvironment"] = _environment
