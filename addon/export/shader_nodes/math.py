"""Nodes that compute with numbers."""

from __future__ import annotations

from ....engine.program.operations_math import ClampType, MathOperation
from .reader import READERS, NodeInputs, Outputs


def _math(view: NodeInputs) -> Outputs | None:
    if view.node.operation not in MathOperation.__members__:
        return None
    operation = MathOperation[view.node.operation]
    arguments = (view.value(name) for name in ("Value", "Value_001", "Value_002"))
    value = view.apply("math", *arguments, operation=operation, clamp=int(view.node.use_clamp))
    return {"Value": value[0]}


def _clamp(view: NodeInputs) -> Outputs | None:
    if view.node.clamp_type not in ClampType.__members__:
        return None
    arguments = (view.value(name) for name in ("Value", "Min", "Max"))
    value = view.apply("clamp", *arguments, clamp_type=ClampType[view.node.clamp_type])
    return {"Result": value[0]}


READERS.update({"ShaderNodeMath": _math, "ShaderNodeClamp": _clamp})
