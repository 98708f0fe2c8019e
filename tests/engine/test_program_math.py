"""Operations of programs, run by the NumPy executor, against closed forms and special values."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from glint.engine.program.execute.operations import apply
from glint.engine.program.operations_math import ClampType, MathOperation
from glint.engine.program.table import BY_NAME
from native_tools import needs_core
from program_tools import by_core, by_reference

M = MathOperation
SPECIAL = (0.0, -0.0, 1.0, -2.5, 1e300, -1e300, math.inf, -math.inf, math.nan)

# Value of operation(a, b, c), worked out by hand from the node's definition.
CASES = [
    (M.ADD, (1.5, 2, 9), 3.5),
    (M.SUBTRACT, (1.5, 2, 9), -0.5),
    (M.MULTIPLY, (1.5, 2, 9), 3),
    (M.DIVIDE, (3, 4, 9), 0.75),
    (M.DIVIDE, (3, 0, 9), 0),
    (M.SINE, (math.pi / 6, 7, 9), 0.5),
    (M.COSINE, (math.pi / 3, 7, 9), 0.5),
    (M.TANGENT, (math.pi / 4, 7, 9), 1),
    (M.ARCSINE, (0.5, 7, 9), math.pi / 6),
    (M.ARCSINE, (2, 7, 9), math.pi / 2),
    (M.ARCCOSINE, (0.5, 7, 9), math.pi / 3),
    (M.ARCCOSINE, (-2, 7, 9), math.pi),
    (M.ARCTANGENT, (1, 7, 9), math.pi / 4),
    (M.POWER, (2, 10, 9), 1024),
    (M.POWER, (-2, 3, 9), -8),
    (M.POWER, (-2, 0.5, 9), 0),
    (M.POWER, (0, 0, 9), 1),
    (M.LOGARITHM, (8, 2, 9), 3),
    (M.LOGARITHM, (8, 1, 9), 0),
    (M.LOGARITHM, (-8, 2, 9), 0),
    (M.MINIMUM, (1.5, 2, 9), 1.5),
    (M.MAXIMUM, (1.5, 2, 9), 2),
    (M.ROUND, (-2.5, 7, 9), -2),
    (M.LESS_THAN, (1.5, 2, 9), 1),
    (M.LESS_THAN, (2, 2, 9), 0),
    (M.GREATER_THAN, (2, 1.5, 9), 1),
    (M.GREATER_THAN, (2, 2, 9), 0),
    (M.MODULO, (-5.5, 2, 9), -1.5),
    (M.MODULO, (5, 0, 9), 0),
    (M.FLOORED_MODULO, (-5.5, 2, 9), 0.5),
    (M.FLOORED_MODULO, (5, 0, 9), 0),
    (M.ABSOLUTE, (-1.5, 7, 9), 1.5),
    (M.ARCTAN2, (-1, -1, 9), -0.75 * math.pi),
    (M.ARCTAN2, (0.0, -0.0, 9), 0),
    (M.FLOOR, (-1.5, 7, 9), -2),
    (M.CEIL, (-1.5, 7, 9), -1),
    (M.FRACT, (-1.25, 7, 9), 0.75),
    (M.SQRT, (2.25, 7, 9), 1.5),
    (M.SQRT, (-1, 7, 9), 0),
    (M.INVERSE_SQRT, (4, 7, 9), 0.5),
    (M.INVERSE_SQRT, (0, 7, 9), 0),
    (M.SIGN, (-3, 7, 9), -1),
    (M.SIGN, (0, 7, 9), 0),
    (M.EXPONENT, (1, 7, 9), math.e),
    (M.RADIANS, (180, 7, 9), math.pi),
    (M.DEGREES, (math.pi, 7, 9), 180),
    (M.SINH, (math.log(2), 7, 9), 0.75),
    (M.COSH, (math.log(2), 7, 9), 1.25),
    (M.TANH, (math.log(2), 7, 9), 0.6),
    (M.TRUNC, (-1.5, 7, 9), -1),
    (M.SNAP, (-1.5, 0.4, 9), -1.6),
    (M.SNAP, (1.5, 0, 9), 0),
    (M.WRAP, (5.5, 3, 1), 1.5),
    (M.WRAP, (0.5, 3, 1), 2.5),
    (M.WRAP, (0.5, 3, 3), 3),
    (M.COMPARE, (1, 1.25, 0.25), 1),
    (M.COMPARE, (1, 1.25, 0.2), 0),
    (M.COMPARE, (1, 1 + 2.0**-24, 0), 1),
    (M.MULTIPLY_ADD, (1.5, 2, 9), 12),
    (M.PINGPONG, (2.5, 2, 9), 1.5),
    (M.PINGPONG, (-0.5, 2, 9), 0.5),
    (M.PINGPONG, (2.5, 0, 9), 0),
    (M.SMOOTH_MIN, (1, 1, 0.6), 0.9),
    (M.SMOOTH_MIN, (1, 2, 0.6), 1),
    (M.SMOOTH_MIN, (1, 2, 0), 1),
    (M.SMOOTH_MAX, (1, 1, 0.6), 1.1),
    (M.SMOOTH_MAX, (1, 2, 0.6), 2),
]


def evaluated(name: str, arguments: np.ndarray, *settings: int) -> np.ndarray:
    """Outputs (outputs, n) of one operation; arguments (arguments, n)."""
    operation = BY_NAME[name]
    named = dict(zip((name for name, _ in operation.settings), settings, strict=True))
    return np.stack(apply(operation, list(arguments), named))


@pytest.mark.parametrize(("operation", "arguments", "expected"), CASES)
def test_math_equals_the_closed_form(operation, arguments, expected):
    columns = np.array(arguments, float)[:, None]
    value = evaluated("math", columns, operation, 0)
    np.testing.assert_allclose(value, [[expected]], rtol=1e-15, atol=1e-15)
    held = evaluated("math", columns, operation, 1)
    np.testing.assert_allclose(held, [[min(max(expected, 0), 1)]], rtol=1e-15, atol=1e-15)


def test_every_math_operation_has_a_closed_form_here():
    assert {case[0] for case in CASES} == set(MathOperation)


@pytest.mark.parametrize("operation", MathOperation)
def test_special_values_give_what_single_hits_give(operation):
    """A hit's value never depends on the hits beside it, and clamped it is never outside [0, 1]."""
    columns = np.array(list(itertools.product(SPECIAL, repeat=3))).T
    together = evaluated("math", columns, operation, 0)
    alone = [evaluated("math", columns[:, i : i + 1], operation, 0)[0, 0] for i in range(0, 729, 7)]
    np.testing.assert_array_equal(together[0, ::7], alone)
    held = evaluated("math", columns, operation, 1)
    assert ((held >= 0) & (held <= 1)).all()


def test_divisors_of_zero_are_never_infinite_or_nan():
    a = np.array([0.0, -0.0, 5.0, -5.0])
    for operation in (M.DIVIDE, M.MODULO, M.FLOORED_MODULO, M.SNAP, M.PINGPONG):
        for zero in (0.0, -0.0):
            value = evaluated("math", np.array([a, np.full(4, zero), a]), operation, 0)
            np.testing.assert_array_equal(value, np.zeros((1, 4)))


def test_clamp_of_both_types():
    columns = np.array([[-1.0, 0.5, 3.0], [2.0, 2.0, 2.0], [0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(evaluated("clamp", columns, ClampType.MINMAX), [[0, 0, 0]])
    np.testing.assert_array_equal(evaluated("clamp", columns, ClampType.RANGE), [[0, 0.5, 2]])


@needs_core
@pytest.mark.parametrize("operation", MathOperation)
def test_core_is_reference_at_special_values(operation):
    """NaN and infinities, too. Sines of 1e300 agree only if angles are reduced exactly."""
    columns = list(np.array(list(itertools.product(SPECIAL, repeat=3))).T)
    for clamp in (0, 1):
        settings = {"operation": operation, "clamp": clamp}
        (wanted,) = by_reference(BY_NAME["math"], columns, settings)
        (found,) = by_core(BY_NAME["math"], columns, settings)
        np.testing.assert_allclose(found, wanted, rtol=1e-12, equal_nan=True)


@needs_core
@pytest.mark.parametrize("clamp_type", ClampType)
def test_core_clamps_special_values_as_the_reference(clamp_type):
    columns = list(np.array(list(itertools.product(SPECIAL, repeat=3))).T)
    (wanted,) = by_reference(BY_NAME["clamp"], columns, {"clamp_type": clamp_type})
    (found,) = by_core(BY_NAME["clamp"], columns, {"clamp_type": clamp_type})
    np.testing.assert_array_equal(found, wanted)
