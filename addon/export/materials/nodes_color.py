"""Nodes that the algebra of sums is closed under; what else they can do is a program's."""

from __future__ import annotations

from typing import Any

from .evaluator import COLOR_NODES, NodeView
from .terms import (
    ONE,
    ZERO,
    Sum,
    add,
    complement,
    constant,
    constant_value,
    grey,
    is_constant,
    mix,
    multiply,
    scale,
)


def _math(view: NodeView, output: Any) -> Sum | None:
    node = view.node
    a, b, c = (view.number(name) for name in ("Value", "Value_001", "Value_002"))
    result = _arithmetic(node.operation, a, b, c)
    return _clamped(view, result) if node.use_clamp else result


def _arithmetic(operation: str, a: Sum, b: Sum, c: Sum) -> Sum | None:
    """The operations that sums and products are closed under."""
    if operation == "ADD":
        return add(a, b)
    if operation == "SUBTRACT":
        return complement(b) if a == ONE else add(a, scale(b, -1.0))
    if operation == "MULTIPLY":
        return multiply(a, b)
    if operation == "MULTIPLY_ADD":
        return add(multiply(a, b), c)
    if operation == "DIVIDE" and is_constant(b) and b:
        return scale(a, 1 / constant_value(b)[0])
    return None


def _clamped(view: NodeView, terms: Sum | None, low: float = 0.0, high: float = 1.0) -> Sum | None:
    return view.evaluator.clamped(terms, low, high) if terms is not None else None


def _clamp(view: NodeView, output: Any) -> Sum | None:
    """min(max(value, low), high), so high where the two are the wrong way round; RANGE puts them
    right.
    """
    bounds = view.fixed("Min", "Max")
    if bounds is None:
        return None
    low, high = bounds
    if low > high:
        low, high = (high, low) if view.node.clamp_type == "RANGE" else (high, high)
    return _clamped(view, view.number("Value"), low, high)


def _mix(view: NodeView, output: Any) -> Sum | None:
    """The Mix node of Blender 3.4 and later, of numbers and colours."""
    kind = {"FLOAT": "Float", "VECTOR": "Vector", "RGBA": "Color"}.get(view.node.data_type)
    if kind is None or (kind == "Vector" and view.node.factor_mode != "UNIFORM"):
        return None
    read = view.number if kind == "Float" else view.color
    a, b = read(f"A_{kind}"), read(f"B_{kind}")
    factor = view.factor("Factor_Float") if view.node.clamp_factor else view.number("Factor_Float")
    result = _blended(view, view.node.blend_type if kind == "Color" else "MIX", factor, a, b)
    return _clamped(view, result) if kind == "Color" and view.node.clamp_result else result


def _mix_rgb(view: NodeView, output: Any) -> Sum | None:
    result = _blended(
        view, view.node.blend_type, view.factor("Fac"), view.color("Color1"), view.color("Color2")
    )
    return _clamped(view, result) if view.node.use_clamp else result


def _blended(view: NodeView, kind: str, factor: Sum, a: Sum, b: Sum) -> Sum | None:
    if not factor:
        return a
    blend = _blend(view, kind, a, b)
    return mix(factor, a, blend) if blend is not None else None


def _blend(view: NodeView, kind: str, a: Sum, b: Sum) -> Sum | None:
    if kind == "MIX":
        return b
    if kind == "MULTIPLY":
        return multiply(a, b)
    if kind == "ADD":
        return add(a, b)
    if kind == "SUBTRACT":
        return add(a, scale(b, -1.0))
    if kind == "SCREEN":
        return add(a, b, scale(multiply(a, b), -1.0))
    return None


def _invert(view: NodeView, output: Any) -> Sum:
    color = view.color("Color")
    return mix(view.number("Fac", 1.0), color, complement(color))


def _map_range(view: NodeView, output: Any) -> Sum | None:
    node = view.node
    if node.data_type != "FLOAT" or node.interpolation_type != "LINEAR":
        return None
    bounds = view.fixed("From Min", "From Max", "To Min", "To Max")
    if bounds is None:
        return None
    low, high, to_low, to_high = bounds
    if high == low:
        return ZERO
    slope = (to_high - to_low) / (high - low)
    result = add(scale(view.number("Value"), slope), constant(to_low - low * slope))
    return (
        _clamped(view, result, min(to_low, to_high), max(to_low, to_high)) if node.clamp else result
    )


def _combine(view: NodeView, output: Any) -> Sum | None:
    """Three numbers as one colour: red times the first plus green times the second …"""
    if getattr(view.node, "mode", "RGB") != "RGB":
        return None
    names = [socket.identifier for socket in view.node.inputs][:3]
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return add(
        *(
            multiply(view.number(name), constant(axis))
            for name, axis in zip(names, axes, strict=True)
        )
    )


def _hue_saturation(view: NodeView, output: Any) -> Sum | None:
    """Value alone is a scale."""
    hue, saturation, value = (view.number(name) for name in ("Hue", "Saturation", "Value"))
    if not is_constant(hue) or constant_value(hue)[0] != 0.5 or saturation != ONE:
        return None
    color = view.color("Color")
    return mix(view.factor("Fac", 1.0), color, multiply(color, value))


def _rgb_to_bw(view: NodeView, output: Any) -> Sum:
    return grey(view.color("Color"))


COLOR_NODES.update(
    {
        "ShaderNodeMath": _math,
        "ShaderNodeClamp": _clamp,
        "ShaderNodeMix": _mix,
        "ShaderNodeMixRGB": _mix_rgb,
        "ShaderNodeInvert": _invert,
        "ShaderNodeMapRange": _map_range,
        "ShaderNodeCombineColor": _combine,
        "ShaderNodeCombineRGB": _combine,
        "ShaderNodeCombineXYZ": _combine,
        "ShaderNodeHueSaturation": _hue_saturation,
        "ShaderNodeRGBToBW": _rgb_to_bw,
    }
)
