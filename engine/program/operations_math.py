"""Operations on numbers."""

from __future__ import annotations

from enum import IntEnum

from .operations import Operation, sockets

MathOperation = IntEnum(
    "MathOperation",
    "ADD SUBTRACT MULTIPLY DIVIDE SINE COSINE TANGENT ARCSINE ARCCOSINE ARCTANGENT POWER "
    "LOGARITHM MINIMUM MAXIMUM ROUND LESS_THAN GREATER_THAN MODULO ABSOLUTE ARCTAN2 FLOOR CEIL "
    "FRACT SQRT INVERSE_SQRT SIGN EXPONENT RADIANS DEGREES SINH COSH TANH TRUNC SNAP WRAP COMPARE "
    "MULTIPLY_ADD PINGPONG SMOOTH_MIN SMOOTH_MAX FLOORED_MODULO",
    start=0,
)
"""Blender's identifiers of the Math node's operations."""


class ClampType(IntEnum):
    """Blender's identifiers of the Clamp node's types."""

    MINMAX = 0
    RANGE = 1


MATH = (
    Operation(
        "math",
        sockets(value="number"),
        sockets(a="number", b="number", c="number"),
        (("operation", MathOperation), ("clamp", range(2))),
        "operation(a, b, c), held in [0, 1] if clamp",
    ),
    Operation(
        "clamp",
        sockets(value="number"),
        sockets(value="number", low="number", high="number"),
        (("clamp_type", ClampType),),
        "min(max(value, low), high); RANGE swaps low and high where low > high",
    ),
)
