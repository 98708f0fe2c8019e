"""Nodes that compute colours and numbers: exact on constants, by the algebra of sums where it
holds, texel by texel on one texture.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .evaluator import COLOR_NODES, NodeView
from .terms import (
    ONE,
    ZERO,
    Sum,
    add,
    complement,
    constant,
    constant_value,
    from_input,
    grey,
    is_constant,
    mix,
    multiply,
    scale,
)

Pointwise = Callable[..., np.ndarray]
"""Of (n, 3) arrays, one per operand, to (n, 3)."""

# letters as in Blender's Math node: a, b, c the operands
_MATH: dict[str, Pointwise] = {
    "DIVIDE": lambda a, b, c: np.divide(a, b, out=np.zeros_like(a), where=b != 0),
    "POWER": lambda a, b, c: np.where(
        (a >= 0) | (b == np.rint(b)),
        np.power(np.abs(a), b) * np.where((a < 0) & (b % 2 == 1), -1, 1),
        0,
    ),
    "SQRT": lambda a, b, c: np.sqrt(np.maximum(a, 0)),
    "INVERSE_SQRT": lambda a, b, c: np.where(a > 0, 1 / np.sqrt(np.where(a > 0, a, 1)), 0),
    "ABSOLUTE": lambda a, b, c: np.abs(a),
    "EXPONENT": lambda a, b, c: np.exp(a),
    "LOGARITHM": lambda a, b, c: np.where(
        (a > 0) & (b > 0) & (b != 1),
        np.log(np.maximum(a, 1e-30)) / np.log(np.where(b == 1, 2, b)),
        0,
    ),
    "MINIMUM": lambda a, b, c: np.minimum(a, b),
    "MAXIMUM": lambda a, b, c: np.maximum(a, b),
    "LESS_THAN": lambda a, b, c: (a < b) * 1.0,
    "GREATER_THAN": lambda a, b, c: (a > b) * 1.0,
    "COMPARE": lambda a, b, c: (np.abs(a - b) <= np.maximum(c, 1e-5)) * 1.0,
    "SIGN": lambda a, b, c: np.sign(a),
    "ROUND": lambda a, b, c: np.floor(a + 0.5),
    "FLOOR": lambda a, b, c: np.floor(a),
    "CEIL": lambda a, b, c: np.ceil(a),
    "TRUNC": lambda a, b, c: np.trunc(a),
    "FRACT": lambda a, b, c: a - np.floor(a),
    "MODULO": lambda a, b, c: np.fmod(a, np.where(b == 0, 1, b)) * (b != 0),
    "SINE": lambda a, b, c: np.sin(a),
    "COSINE": lambda a, b, c: np.cos(a),
    "TANGENT": lambda a, b, c: np.tan(a),
    "RADIANS": lambda a, b, c: np.radians(a),
    "DEGREES": lambda a, b, c: np.degrees(a),
}

_BLEND: dict[str, Pointwise] = {
    "DARKEN": lambda a, b: np.minimum(a, b),
    "LIGHTEN": lambda a, b: np.maximum(a, b),
    "DIFFERENCE": lambda a, b: np.abs(a - b),
    "OVERLAY": lambda a, b: np.where(a < 0.5, 2 * a * b, 1 - 2 * (1 - a) * (1 - b)),
    "DIVIDE": lambda a, b: np.divide(a, b, out=np.zeros_like(a), where=b != 0),
}


def pointwise(view: NodeView, key: tuple, function: Pointwise, *operands: Sum) -> Sum | None:
    """function of the operands where at most one varies, and that one with a single texture; None
    otherwise.
    """
    varying = [k for k, terms in enumerate(operands) if not is_constant(terms)]
    fixed = [
        np.array([constant_value(terms)], np.float32) if is_constant(terms) else None
        for terms in operands
    ]
    if not varying:
        with np.errstate(all="ignore"):
            return constant(tuple(float(x) for x in np.broadcast_to(function(*fixed), (1, 3))[0]))
    terms = operands[varying[0]]
    if (
        len(varying) > 1
        or len(terms) > 1
        or len(terms[0].factors) > 1
        or terms[0].factors[0].texture < 0
    ):
        return None
    return _texelwise(
        view,
        (*key, *(v.tobytes() if v is not None else b"" for v in fixed), terms[0].value),
        function,
        fixed,
        terms,
    )


def _texelwise(
    view: NodeView, key: tuple, function: Pointwise, fixed: list, terms: Sum
) -> Sum | None:
    (term,) = terms
    source = term.factors[0]
    if source.attribute:
        return None
    value = np.array(term.value, np.float32)

    def apply(colors: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            return function(*(v if v is not None else colors * value for v in fixed))

    return from_input(view.evaluator.images.derived(source, key, apply))


def _math(view: NodeView, output: Any) -> Sum | None:
    node = view.node
    a, b, c = (view.number(name) for name in ("Value", "Value_001", "Value_002"))
    result = _arithmetic(node.operation, a, b, c)
    if result is None and node.operation in _MATH:
        result = pointwise(view, ("math", node.operation), _MATH[node.operation], a, b, c)
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
    low, high = view.constant("Min", 0.0), view.constant("Max", 1.0)
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
    return pointwise(view, ("blend", kind), _BLEND[kind], a, b) if kind in _BLEND else None


def _invert(view: NodeView, output: Any) -> Sum:
    color = view.color("Color")
    return mix(view.factor("Fac", 1.0), color, complement(color))


def _gamma(view: NodeView, output: Any) -> Sum | None:
    def apply(color: np.ndarray, gamma: np.ndarray) -> np.ndarray:
        return np.where(color > 0, np.power(np.maximum(color, 0), gamma), color)

    return pointwise(view, ("gamma",), apply, view.color("Color"), view.number("Gamma"))


def _bright_contrast(view: NodeView, output: Any) -> Sum | None:
    def apply(color: np.ndarray, bright: np.ndarray, contrast: np.ndarray) -> np.ndarray:
        return np.maximum((1 + contrast) * color + bright - contrast * 0.5, 0)

    return pointwise(
        view,
        ("bright",),
        apply,
        view.color("Color"),
        view.number("Bright"),
        view.number("Contrast"),
    )


def _color_ramp(view: NodeView, output: Any) -> Sum | None:
    """The ramp sampled at 256 places, linear between; exact where both stops and inputs are
    8-bit.
    """
    factor = view.number("Fac")
    ramp = view.node.color_ramp
    channels = slice(3, 4) if output.name == "Alpha" else slice(0, 3)
    if is_constant(factor):
        values = np.array(ramp.evaluate(constant_value(factor)[0]))[channels]
        return constant(tuple(float(x) for x in np.broadcast_to(values, 3)))
    table = np.array([ramp.evaluate(k / 255) for k in range(256)], np.float32)[:, channels]
    table = np.broadcast_to(table, (256, 3))

    def apply(numbers: np.ndarray) -> np.ndarray:
        return np.stack(
            [np.interp(numbers[:, 0] * 255, np.arange(256), table[:, k]) for k in range(3)], -1
        )

    return pointwise(view, ("ramp", table.tobytes()), apply, factor)


def _map_range(view: NodeView, output: Any) -> Sum | None:
    node = view.node
    if node.data_type != "FLOAT" or node.interpolation_type != "LINEAR":
        return None
    low, high, to_low, to_high = (
        view.constant(name) for name in ("From Min", "From Max", "To Min", "To Max")
    )
    if high == low:
        return ZERO
    slope = (to_high - to_low) / (high - low)
    result = add(scale(view.number("Value"), slope), constant(to_low - low * slope))
    return (
        _clamped(view, result, min(to_low, to_high), max(to_low, to_high)) if node.clamp else result
    )


def _separate(view: NodeView, output: Any) -> Sum | None:
    """One channel as a number, of constants and textures, in RGB."""
    if getattr(view.node, "mode", "RGB") != "RGB":
        return None
    channel = next(
        k for k, socket in enumerate(view.node.outputs) if socket.identifier == output.identifier
    )
    color = next(view.color(name) for name in ("Color", "Image", "Vector") if view.input(name))
    return pointwise(
        view, ("channel", channel), lambda a: np.repeat(a[:, channel : channel + 1], 3, 1), color
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
    """Value alone is a scale; hue and saturation are worked out by Blender's HSV, texel by
    texel.
    """
    hue, saturation, value = (view.number(name) for name in ("Hue", "Saturation", "Value"))
    color, factor = view.color("Color"), view.factor("Fac", 1.0)
    if constant_value(hue)[0] == 0.5 and saturation == ONE and is_constant(hue):
        return mix(factor, color, multiply(color, value))
    result = pointwise(view, ("hsv",), _shift_hsv, color, hue, saturation, value)
    return mix(factor, color, result) if result is not None else None


def _shift_hsv(
    color: np.ndarray, hue: np.ndarray, saturation: np.ndarray, value: np.ndarray
) -> np.ndarray:
    """The hexcone model (Smith 1978): hue turned by hue - 0.5, saturation and value scaled."""
    high, low = color.max(1), color.min(1)
    span = high - low
    safe = np.where(span == 0, 1, span)
    red, green, blue = color.T
    sector = np.where(
        high == red,
        (green - blue) / safe,
        np.where(high == green, 2 + (blue - red) / safe, 4 + (red - green) / safe),
    )
    turned = np.mod(sector / 6 + hue[:, 0] + 0.5, 1.0) * 6
    share = np.clip(
        np.where(high == 0, 0, span / np.where(high == 0, 1, high)) * saturation[:, 0], 0, 1
    )
    offsets = np.mod(turned[:, None] + np.array([5.0, 3.0, 1.0]), 6)
    wave = np.clip(np.minimum(offsets, 4 - offsets), 0, 1)
    return (high * value[:, 0])[:, None] * (1 - share[:, None] * wave)


def _rgb_to_bw(view: NodeView, output: Any) -> Sum:
    return grey(view.color("Color"))


def _own_default(view: NodeView, output: Any) -> Sum:
    value = output.default_value
    return constant(float(value)) if isinstance(value, (int, float)) else constant(tuple(value)[:3])


COLOR_NODES.update(
    {
        "ShaderNodeRGB": _own_default,
        "ShaderNodeValue": _own_default,
        "ShaderNodeMath": _math,
        "ShaderNodeClamp": _clamp,
        "ShaderNodeMix": _mix,
        "ShaderNodeMixRGB": _mix_rgb,
        "ShaderNodeInvert": _invert,
        "ShaderNodeGamma": _gamma,
        "ShaderNodeBrightContrast": _bright_contrast,
        "ShaderNodeValToRGB": _color_ramp,
        "ShaderNodeMapRange": _map_range,
        "ShaderNodeSeparateColor": _separate,
        "ShaderNodeSeparateRGB": _separate,
        "ShaderNodeSeparateXYZ": _separate,
        "ShaderNodeCombineColor": _combine,
        "ShaderNodeCombineRGB": _combine,
        "ShaderNodeCombineXYZ": _combine,
        "ShaderNodeHueSaturation": _hue_saturation,
        "ShaderNodeRGBToBW": _rgb_to_bw,
    }
)
