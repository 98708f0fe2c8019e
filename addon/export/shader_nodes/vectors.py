"""Nodes that compute with vectors. Sines and cosines of angles are operations of their own, so that
those of constant angles are constants.
"""

from __future__ import annotations

from ....engine.program.graph import Value
from ....engine.program.operations_input import Space, VectorType
from ....engine.program.operations_math import MathOperation
from ....engine.program.operations_vector import MappingType, VectorMeasure, VectorOperation
from .mapping import sines_of
from .reader import READERS, NodeInputs, Outputs

_AXES = {"X_AXIS": (1.0, 0.0, 0.0), "Y_AXIS": (0.0, 1.0, 0.0), "Z_AXIS": (0.0, 0.0, 1.0)}


def _vector_math(view: NodeInputs) -> Outputs | None:
    operation = view.node.operation
    a, b, c = (view.value(name) for name in ("Vector", "Vector_001", "Vector_002"))
    if operation in VectorMeasure.__members__:
        return {"Value": view.apply("vector_measure", a, b, measure=VectorMeasure[operation])[0]}
    if operation not in VectorOperation.__members__:
        return None
    settings = {"operation": VectorOperation[operation]}
    return {"Vector": view.apply("vector_math", a, b, c, view.value("Scale"), **settings)[0]}


def _mapping(view: NodeInputs) -> Outputs | None:
    if view.node.vector_type not in MappingType.__members__:
        return None
    scale = view.value("Scale")
    if scale.constant is not None and not any(scale.constant):
        # Cycles' constant folding takes all of it for 0, the location included.
        return {"Vector": view.reader.graph.constant((0.0, 0.0, 0.0))}
    turned = view.apply(
        "mapping",
        view.value("Vector"),
        view.value("Location"),
        *sines_of(view, view.value("Rotation")),
        scale,
        mapping_type=MappingType[view.node.vector_type],
    )
    return {"Vector": turned[0]}


def _vector_rotate(view: NodeInputs) -> Outputs | None:
    kind, inverts = view.node.rotation_type, view.node.invert
    around = view.value("Vector"), view.value("Center")
    if kind == "EULER_XYZ":
        sines = sines_of(view, view.value("Rotation"))
        return {"Vector": view.apply("rotate_euler", *around, *sines, invert=int(inverts))[0]}
    if kind != "AXIS_ANGLE" and kind not in _AXES:
        return None
    constant = view.reader.graph.constant
    axis = constant(_AXES[kind]) if kind in _AXES else view.value("Axis")
    zero, angle = constant(0.0), view.value("Angle")
    sine = _math(view, MathOperation.SINE, angle, zero)
    cosine = _math(view, MathOperation.COSINE, angle, zero)
    if inverts:
        sine = _math(view, MathOperation.SUBTRACT, zero, sine)
    return {"Vector": view.apply("rotate_around_axis", *around, axis, sine, cosine)[0]}


def _vector_transform(view: NodeInputs) -> Outputs:
    node = view.node
    if node.convert_from == node.convert_to:  # Cycles leaves normals as long as they are, then
        return {"Vector": view.value("Vector")}
    spaces = {"convert_from": Space[node.convert_from], "convert_to": Space[node.convert_to]}
    kind = VectorType[node.vector_type]
    moved = view.apply("transform_vector", view.value("Vector"), vector_type=kind, **spaces)
    return {"Vector": moved[0]}


def _normal(view: NodeInputs) -> Outputs:
    """A fixed direction, and the cosine between it and the input."""
    direction = view.reader.graph.constant(list(view.node.outputs["Normal"].default_value))
    direction, normal = (
        view.apply("vector_normalized", vector)[0] for vector in (direction, view.value("Normal"))
    )
    cosine = view.apply("vector_measure", direction, normal, measure=VectorMeasure.DOT_PRODUCT)
    return {"Normal": direction, "Dot": cosine[0]}


def _math(view: NodeInputs, operation: MathOperation, a: Value, b: Value) -> Value:
    return view.apply("math", a, b, b, operation=operation, clamp=0)[0]


READERS.update(
    {
        "ShaderNodeVectorMath": _vector_math,
        "ShaderNodeMapping": _mapping,
        "ShaderNodeVectorRotate": _vector_rotate,
        "ShaderNodeNormal": _normal,
        "ShaderNodeVectorTransform": _vector_transform,
    }
)
