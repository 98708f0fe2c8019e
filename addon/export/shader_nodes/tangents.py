"""Tangents that nodes give: round an axis of the object, or along a UV map."""

from __future__ import annotations

from ....engine.program.graph import Value
from ....engine.program.operations_vector import VectorOperation
from .reader import READERS, TANGENT, NodeInputs, Outputs


def radial_tangent(view: NodeInputs, axis: str) -> Value:
    """Round the middle of the generated coordinates; 0 where there is no surface."""
    if not view.reader.is_surface:
        return view.apply("tangent_of_surface")[0]
    do = view.math
    x, y, z = (
        do("SUBTRACT", part, 0.5) for part in view.apply("separate_xyz", view.reader.generated())
    )
    zero, minus = do.number(0.0), (lambda part: do("MULTIPLY", part, -1.0))
    around = {"X": (zero, minus(z), y), "Y": (minus(z), zero, x), "Z": (minus(y), x, zero)}[axis]
    return _in_surface(view, view.apply("combine_xyz", *around)[0])


def _in_surface(view: NodeInputs, direction: Value) -> Value:
    """A direction of the object's space, taken to the world as normals are, across the normal."""
    normal = view.reader.normal()
    found = cross(view, view.apply("normal_to_world", direction)[0], normal)
    return cross(view, normal, view.apply("vector_normalized", found)[0])


def cross(view: NodeInputs, a: Value, b: Value) -> Value:
    """a × b."""
    zero = view.reader.graph.constant(0.0)
    operation = VectorOperation.CROSS_PRODUCT
    return view.apply("vector_math", a, b, a, zero, operation=operation)[0]


def _tangent(view: NodeInputs) -> Outputs:
    if view.node.direction_type == "RADIAL":
        return {"Tangent": radial_tangent(view, view.node.axis)}
    along = view.apply("attribute", attribute=TANGENT + view.node.uv_map, shift=0)[0]
    return {"Tangent": _in_surface(view, along)}


READERS["ShaderNodeTangent"] = _tangent
