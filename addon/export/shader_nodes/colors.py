"""Nodes that compute with colours: mixing, ramps and curves, colour models."""

from __future__ import annotations

from typing import Any

from ....engine.program.graph import Value
from ....engine.program.operations_color import BlendType, ColorMode, RangeType
from ....engine.program.operations_math import ClampType
from .reader import READERS, NodeInputs, Outputs

ROWS = 257
"""Of tables that stand for ramps and curves: at whole 256ths, as in Cycles."""


def _held(view: NodeInputs, number: Value) -> Value:
    """A number from 0 to 1."""
    ends = (view.reader.graph.constant(0.0), view.reader.graph.constant(1.0))
    return view.apply("clamp", number, *ends, clamp_type=ClampType.MINMAX)[0]


def _held_color(view: NodeInputs, color: Value) -> Value:
    graph = view.reader.graph
    ends = (graph.constant((0.0,) * 3), graph.constant((1.0,) * 3))
    return view.apply("bounded", color, *ends)[0]


def _mix(view: NodeInputs) -> Outputs | None:
    node = view.node
    kind = {"FLOAT": "Float", "VECTOR": "Vector", "RGBA": "Color"}.get(node.data_type)
    if kind is None:
        return None
    a, b = view.value(f"A_{kind}"), view.value(f"B_{kind}")
    if kind == "Vector" and node.factor_mode == "NON_UNIFORM":
        factor = view.value("Factor_Vector")
        factor = _held_color(view, factor) if node.clamp_factor else factor
        return {"Result_Vector": view.apply("mix_vector", factor, a, b)[0]}
    factor = view.value("Factor_Float")
    factor = _held(view, factor) if node.clamp_factor else factor
    if kind == "Float":
        return {"Result_Float": view.apply("mix_number", factor, a, b)[0]}
    if kind == "Vector":
        return {"Result_Vector": view.apply("mix_vector", view.vector_of(factor), a, b)[0]}
    return {"Result_Color": _blended(view, factor, a, b, node.clamp_result)}


def _mix_rgb(view: NodeInputs) -> Outputs:
    colors = (view.value("Color1"), view.value("Color2"))
    return {"Color": _blended(view, _held(view, view.value("Fac")), *colors, view.node.use_clamp)}


def _blended(view: NodeInputs, factor: Value, a: Value, b: Value, clamps: bool) -> Value:
    found = view.apply("mix_color", factor, a, b, blend_type=BlendType[view.node.blend_type])[0]
    return _held_color(view, found) if clamps else found


def _factor(view: NodeInputs) -> Value:
    """The input called Fac or, in later Blenders, Factor."""
    return view.value("Fac" if "Fac" in view.node.inputs else "Factor")


def _invert(view: NodeInputs) -> Outputs:
    return {"Color": view.apply("invert", _factor(view), view.value("Color"))[0]}


def _gamma(view: NodeInputs) -> Outputs:
    return {"Color": view.apply("gamma", view.value("Color"), view.value("Gamma"))[0]}


def _bright_contrast(view: NodeInputs) -> Outputs:
    bright = view.value("Bright" if "Bright" in view.node.inputs else "Brightness")
    arguments = (view.value("Color"), bright, view.value("Contrast"))
    return {"Color": view.apply("bright_contrast", *arguments)[0]}


def _hue_saturation(view: NodeInputs) -> Outputs:
    numbers = (view.value(name) for name in ("Hue", "Saturation", "Value"))
    arguments = (*numbers, _factor(view), view.value("Color"))
    return {"Color": view.apply("hue_saturation", *arguments)[0]}


def _color_ramp(view: NodeInputs) -> Outputs:
    ramp = view.node.color_ramp
    color, alpha = view.apply(
        "ramp",
        _factor(view),
        interpolates=int(ramp.interpolation != "CONSTANT"),
        table=view.table(lambda: _ramp_table(ramp)),
    )
    return {"Color": color, "Alpha": alpha}


def _ramp_table(ramp: Any) -> tuple[float, ...]:
    numbers: list[float] = []
    for k in range(ROWS):
        numbers += ramp.evaluate(k / (ROWS - 1))
    return tuple(numbers)


_STEP = 1e-4
"""Half the width of a jump, which tables cannot hold as such."""


def _curve_table(mapping: Any, curves: list[Any], combined: Any = None) -> tuple[float, ...]:
    """What `curves` reads: where the curves begin and end, and rows of three of them.

    combined: a curve that all go through first.
    """
    mapping.initialize()
    ends = [(c.points[0].location[0], c.points[-1].location[0]) for c in mapping.curves]
    low, high = min(a for a, _ in ends), max(b for _, b in ends)
    if low == high:  # all points stand above each other
        return _step_table(low, curves)
    places = [low + k / (ROWS - 1) * (high - low) for k in range(ROWS)]
    if combined is not None:
        places = [mapping.evaluate(combined, x) for x in places]
    rows = [mapping.evaluate(curve, x) for x in places for curve in curves]
    return (float(low), float(high), *(float(x) for x in rows))


def _step_table(place: float, curves: list[Any]) -> tuple[float, ...]:
    """As `_curve_table`, of curves that jump at a place from their first point to their last."""
    ends = [[curve.points[end].location[1] for curve in curves] for end in (0, -1)]
    rows = [y for k in range(ROWS) for y in ends[k >= ROWS // 2]]
    return (place - _STEP, place + _STEP, *map(float, rows))


def _extends(mapping: Any) -> int:
    return int(mapping.extend == "EXTRAPOLATED")


def _rgb_curves(view: NodeInputs) -> Outputs:
    mapping = view.node.mapping
    table = view.table(lambda: _curve_table(mapping, [*mapping.curves[:3]], mapping.curves[3]))
    arguments = (_factor(view), view.value("Color"))
    return {"Color": view.apply("curves", *arguments, extends=_extends(mapping), table=table)[0]}


def _vector_curves(view: NodeInputs) -> Outputs:
    mapping = view.node.mapping
    table = view.table(lambda: _curve_table(mapping, [*mapping.curves[:3]]))
    arguments = (_factor(view), view.value("Vector"))
    return {"Vector": view.apply("curves", *arguments, extends=_extends(mapping), table=table)[0]}


def _float_curve(view: NodeInputs) -> Outputs:
    mapping = view.node.mapping
    table = view.table(lambda: _curve_table(mapping, [mapping.curves[0]] * 3))
    names = ("Factor" if "Factor" in view.node.inputs else "Fac", "Value")
    factor, value = (view.value(name) for name in names)
    # Cycles goes beyond the ends at each point only, not where it folds constants
    is_constant = factor.constant is not None and value.constant is not None
    folded = is_constant and all(map(view.is_folded, names))
    extends = 0 if folded else _extends(mapping)
    arguments = (factor, view.vector_of(value))
    found = view.apply("curves", *arguments, extends=extends, table=table)[0]
    return {"Value": view.apply("separate_xyz", found)[0]}


_HSV = ("ShaderNodeSeparateHSV", "ShaderNodeCombineHSV")


def _mode(view: NodeInputs) -> ColorMode:
    if view.node.bl_idname in _HSV:
        return ColorMode.HSV
    return ColorMode[getattr(view.node, "mode", "RGB")]


def _separate(view: NodeInputs) -> Outputs:
    color = view.value(view.node.inputs[0].identifier)
    parts = view.apply("separate_color", color, mode=_mode(view))
    names = (socket.identifier for socket in view.node.outputs)
    return dict(zip(names, parts, strict=True))


def _combine(view: NodeInputs) -> Outputs:
    parts = [view.value(socket.identifier) for socket in list(view.node.inputs)[:3]]
    name = view.node.outputs[0].identifier
    return {name: view.apply("combine_color", *parts, mode=_mode(view))[0]}


def _map_range(view: NodeInputs) -> Outputs | None:
    if view.node.data_type == "FLOAT_VECTOR":
        return _map_vectors(view)
    if view.node.data_type != "FLOAT":
        return None
    names = ("Value", "From Min", "From Max", "To Min", "To Max", "Steps")
    arguments = [view.value(name) for name in names]
    found = view.apply("map_range", *arguments, interpolation=_range_type(view))[0]
    return {"Result": _range_held(view, found, *arguments[3:5])}


def _map_vectors(view: NodeInputs) -> Outputs:
    names = ("Vector", "From_Min_FLOAT3", "From_Max_FLOAT3", "To_Min_FLOAT3", "To_Max_FLOAT3")
    parts = [view.apply("separate_xyz", view.value(name)) for name in (*names, "Steps_FLOAT3")]
    found = [_mapped_part(view, *(part[axis] for part in parts)) for axis in range(3)]
    return {"Vector": view.apply("combine_xyz", *found)[0]}


def _mapped_part(
    view: NodeInputs, value: Value, start: Value, end: Value, low: Value, high: Value, steps: Value
) -> Value:
    """One of a vector's parts; unlike a number it becomes `low` where its first range is empty."""
    ends = (view.reader.graph.constant(0.0), view.reader.graph.constant(1.0))
    arguments = (value, start, end, *ends, steps)
    factor = view.apply("map_range", *arguments, interpolation=_range_type(view))[0]
    return _range_held(view, view.apply("mix_number", factor, low, high)[0], low, high)


def _range_type(view: NodeInputs) -> RangeType:
    return RangeType[view.node.interpolation_type]


def _range_held(view: NodeInputs, found: Value, low: Value, high: Value) -> Value:
    """The result between low and high, where the node has that setting and it is on."""
    if not view.node.clamp or _range_type(view) not in (RangeType.LINEAR, RangeType.STEPPED):
        return found
    return view.apply("clamp", found, low, high, clamp_type=ClampType.RANGE)[0]


READERS.update(
    {
        "ShaderNodeMix": _mix,
        "ShaderNodeMixRGB": _mix_rgb,
        "ShaderNodeInvert": _invert,
        "ShaderNodeGamma": _gamma,
        "ShaderNodeBrightContrast": _bright_contrast,
        "ShaderNodeHueSaturation": _hue_saturation,
        "ShaderNodeValToRGB": _color_ramp,
        "ShaderNodeRGBCurve": _rgb_curves,
        "ShaderNodeVectorCurve": _vector_curves,
        "ShaderNodeFloatCurve": _float_curve,
        "ShaderNodeSeparateColor": _separate,
        "ShaderNodeSeparateRGB": _separate,
        "ShaderNodeSeparateHSV": _separate,
        "ShaderNodeCombineColor": _combine,
        "ShaderNodeCombineRGB": _combine,
        "ShaderNodeCombineHSV": _combine,
        "ShaderNodeMapRange": _map_range,
    }
)
