"""Nodes that bend the shading normal: normal maps, bumps, displacement."""

from __future__ import annotations

from typing import Any

import bpy

from ....engine.program.graph import Value
from ....engine.program.operations_input import WIDEST, NormalSpace, Space, VectorType
from .reader import (
    DISPLACED_WIDTH,
    READERS,
    TANGENT,
    UNDISPLACED_NORMAL,
    UNDISPLACED_TANGENT,
    NodeInputs,
    Outputs,
)
from .tangents import cross

WIDTH = (
    "The Filter Width of Bump nodes does not vary: {} compare heights a tenth of a pixel apart; "
    "unlink it"
)


def given_normal(view: NodeInputs) -> Value:
    """What comes in as Normal, else the shading normal."""
    return view.value("Normal") if view.is_linked("Normal") else view.reader.normal()


def _normal_map(view: NodeInputs) -> Outputs:
    """Blender 5.2 brings a convention, and a base, which counts with true displacement alone."""
    color = view.value("Color")
    if getattr(view.node, "convention", "OPENGL") == "DIRECTX":  # green is 1 - green
        constant = view.reader.graph.constant
        turned = view.apply("product", color, constant((1.0, -1.0, 1.0)))[0]
        color = view.apply("scaled_sum", turned, constant(1.0), constant((0.0, 1.0, 0.0)))[0]
    if view.node.space == "TANGENT" and view.reader.is_moved and _is_of_original(view.node):
        return {"Normal": _mapped_before(view, color)}
    name = TANGENT + view.node.uv_map
    bent = view.apply(
        "normal_map",
        color,
        view.value("Strength"),
        space=NormalSpace[view.node.space],
        attribute=name if view.node.space == "TANGENT" else "",
    )
    return {"Normal": bent[0]}


def _is_of_original(node: Any) -> bool:
    """Whether the tangents and normals of before the displacement count, as in Cycles from 5.0 on
    where the node has no choice.
    """
    usual = "ORIGINAL" if bpy.app.version >= (5, 0, 0) else "DISPLACED"
    return getattr(node, "base", usual) != "DISPLACED"


def _mapped_before(view: NodeInputs, color: Value) -> Value:
    """The normal that a colour means on the surface as it was before it was displaced, mixed with
    the shading normal; that alone where there is no tangent.
    """
    do, constant, zero = view.math, view.reader.graph.constant, (0.0, 0.0, 0.0)
    name = UNDISPLACED_TANGENT + view.node.uv_map
    tangent, sign = view.apply("attribute", attribute=name, shift=0)
    up = view.apply("attribute", attribute=UNDISPLACED_NORMAL, shift=0)[0]
    parts = view.apply(
        "separate_xyz", view.apply("scaled_sum", color, constant(2.0), constant((-1.0,) * 3))[0]
    )
    bent = view.apply("scaled_sum", tangent, parts[0], constant(zero))[0]
    across = do("MULTIPLY", parts[1], sign)
    bent = view.apply("scaled_sum", cross(view, up, tangent), across, bent)[0]
    bent = view.apply("scaled_sum", up, parts[2], bent)[0]
    bent = view.apply("normal_to_world", view.apply("vector_normalized", bent)[0])[0]
    side = do("MULTIPLY_ADD", view.apply("backfacing")[0], -2.0, 1.0)
    there = do("GREATER_THAN", view.apply("vector_length", tangent)[0], 0.0)
    share = do("MULTIPLY", do("MAXIMUM", view.value("Strength"), 0.0), there)
    own = view.reader.normal()
    rest = view.apply("scaled_sum", own, do("SUBTRACT", 1.0, share), constant(zero))[0]
    mixed = view.apply("scaled_sum", bent, do("MULTIPLY", share, side), rest)[0]
    return view.apply("vector_normalized", mixed)[0]


def _bump(view: NodeInputs) -> Outputs:
    normal, height = given_normal(view), view.value("Height")
    if height.constant is not None:
        return {"Normal": normal}
    width = _width(view)
    if width is None:  # heights at one place
        return {"Normal": normal}
    distance = view.value("Distance")
    if view.node.invert:
        distance = view.reader.negative(distance)
    bumped = view.reader.bumped(height, view.value("Strength"), distance, normal, width)
    return {"Normal": bumped}


def _width(view: NodeInputs) -> int | None:
    """How far apart heights are compared, as `Shift.by` takes it; None for not at all. A tenth of a
    pixel in Blender's own new Bump nodes; a whole one before 4.4, which brought the choice.
    """
    if "Filter Width" not in view.node.inputs:
        return DISPLACED_WIDTH
    given = view.value("Filter Width").constant
    if given is None:
        view.reader.note(WIDTH)
        return 0
    if not given[0] > 0:
        return None
    width = min(max(round(1000 * float(given[0])), 1), WIDEST)
    return 0 if width == 100 else width


def _displacement(view: NodeInputs) -> Outputs:
    """(height - midlevel) × scale along the normal; in object space as long as it is there."""
    graph = view.reader.graph
    one, minus = graph.constant((1.0, 1.0, 1.0)), graph.constant(-1.0)
    level = view.vector_of(view.value("Midlevel"))
    height = view.apply("scaled_sum", level, minus, view.vector_of(view.value("Height")))[0]
    size = view.apply("scaled_sum", one, view.value("Scale"), graph.constant((0.0, 0.0, 0.0)))[0]
    length = view.apply("product", height, size)[0]
    if view.node.space == "WORLD" or not view.reader.is_surface:
        return {"Displacement": view.apply("product", length, given_normal(view))[0]}
    return {"Displacement": _to_world(view, view.apply("product", length, _object_normal(view))[0])}


def _object_normal(view: NodeInputs) -> Value:
    """The same as `given_normal` in the object's space."""
    if not view.is_linked("Normal"):
        return view.apply("object_normal")[0]
    settings = {"convert_from": Space.WORLD, "convert_to": Space.OBJECT}
    turned = view.apply(
        "transform_vector", view.value("Normal"), vector_type=VectorType.NORMAL, **settings
    )
    return turned[0]


def _to_world(view: NodeInputs, vector: Value) -> Value:
    """Of a vector of the object's space."""
    settings = {"convert_from": Space.OBJECT, "convert_to": Space.WORLD}
    return view.apply("transform_vector", vector, vector_type=VectorType.VECTOR, **settings)[0]


def _vector_displacement(view: NodeInputs) -> Outputs:
    """(vector - midlevel) × scale along the axes of a space: of TANGENT x along the tangent, y
    along the normal, z across both.
    """
    level = view.vector_of(view.math("MULTIPLY", view.value("Midlevel"), -1.0))
    offset = _plus(view, view.value("Vector"), level)
    offset = view.apply("product", offset, view.vector_of(view.value("Scale")))[0]
    if view.node.space == "WORLD":
        return {"Displacement": offset}
    if view.node.space == "TANGENT":
        offset = _along_tangent(view, offset)
    return {"Displacement": _to_world(view, offset)}


def _along_tangent(view: NodeInputs, offset: Value) -> Value:
    """In the object's space."""
    x, y, z = view.apply("separate_xyz", offset)
    tangent, sign = view.apply("attribute", attribute=TANGENT, shift=0)
    normal = view.apply("object_normal")[0]
    across = view.apply("vector_normalized", cross(view, normal, tangent))[0]
    parts = ((tangent, x), (normal, y), (across, view.math("MULTIPLY", z, sign)))
    total = view.reader.graph.constant((0.0, 0.0, 0.0))
    for axis, length in parts:
        total = view.apply("scaled_sum", axis, length, total)[0]
    return total


def _plus(view: NodeInputs, a: Value, b: Value) -> Value:
    return view.apply("scaled_sum", a, view.reader.graph.constant(1.0), b)[0]


READERS.update(
    {
        "ShaderNodeNormalMap": _normal_map,
        "ShaderNodeBump": _bump,
        "ShaderNodeDisplacement": _displacement,
        "ShaderNodeVectorDisplacement": _vector_displacement,
    }
)
