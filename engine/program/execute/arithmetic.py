"""Operations on numbers, as Cycles defines them (svm/math_util.h, util/math.h), in float64.

Arguments and results are float64 (n,). NaN and infinity follow from IEEE arithmetic, except where
Cycles defines a value: a division by zero is 0, as are a root and a logarithm without a real value.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..operations_math import ClampType, MathOperation

Numbers = NDArray[np.float64]

_FLOAT32_EPSILON = 2.0**-23
_NUMBERS_OF_C = 2.0**31


def math(a: Numbers, b: Numbers, c: Numbers, *, operation: int, clamp: int) -> Numbers:
    """The Math node: MathOperation `operation` of a, b and c, held in [0, 1] if `clamp`."""
    with np.errstate(all="ignore"):
        value = np.asarray(_MATH[MathOperation(operation)](a, b, c), np.float64)
    return np.fmin(np.fmax(value, 0.0), 1.0) if clamp else value


def clamp(value: Numbers, low: Numbers, high: Numbers, *, clamp_type: int) -> Numbers:
    """The Clamp node. MINMAX with low > high gives high."""
    if clamp_type == ClampType.RANGE:
        low, high = np.fmin(low, high), np.fmax(low, high)
    return np.fmin(np.fmax(value, low), high)


def safe_divide(a: Numbers, b: Numbers) -> Numbers:
    """a / b, 0 where b is 0."""
    return np.where(b != 0, a / np.where(b != 0, b, 1.0), 0.0)


def safe_power(a: Numbers, b: Numbers) -> Numbers:
    """a to the power b, 0 where a < 0 and b is no whole number that an int of C holds."""
    whole = (np.trunc(b) == b) & (b >= -_NUMBERS_OF_C) & (b < _NUMBERS_OF_C)
    return np.where((a < 0) & ~whole, 0.0, np.power(a, b))


def safe_logarithm(a: Numbers, b: Numbers) -> Numbers:
    """The logarithm of a to the base b, 0 where either is not positive or b is 1."""
    return np.where((a <= 0) | (b <= 0), 0.0, safe_divide(np.log(a), np.log(b)))


def wrap(value: Numbers, high: Numbers, low: Numbers) -> Numbers:
    """value moved by whole multiples of high - low into [low, high); low where they are equal."""
    size = high - low
    return np.where(size != 0, value - size * np.floor(safe_divide(value - low, size)), low)


def ping_pong(a: Numbers, b: Numbers) -> Numbers:
    """A triangle wave from 0 at a = 0 to b at a = b; 0 where b is 0."""
    phase = safe_divide(a - b, b * 2)
    return np.where(b != 0, np.abs((phase - np.floor(phase)) * b * 2 - b), 0.0)


def smooth_minimum(a: Numbers, b: Numbers, c: Numbers) -> Numbers:
    """min(a, b), rounded off by a cubic where |a - b| < c."""
    h = safe_divide(np.fmax(c - np.abs(a - b), 0.0), c)
    return np.where(c != 0, np.fmin(a, b) - h * h * h * c / 6, np.fmin(a, b))


def compare(a: Numbers, b: Numbers, c: Numbers) -> Numbers:
    """1 where a and b differ by no more than c, or than float32's epsilon; otherwise 0."""
    return (a == b) | (np.abs(a - b) <= np.fmax(c, _FLOAT32_EPSILON))


def safe_modulo(a: Numbers, b: Numbers) -> Numbers:
    """C's fmod, 0 where b is 0."""
    return np.where(b != 0, np.fmod(a, b), 0.0)


def snapped(a: Numbers, b: Numbers) -> Numbers:
    """The multiple of b at or below a (in units of b); 0 where b is 0."""
    return np.floor(safe_divide(a, b)) * b


def sign(a: Numbers) -> Numbers:
    """-1, 0 or 1; 1 for NaN."""
    return np.where(a == 0, 0.0, np.where(a < 0, -1.0, 1.0))


def _inside(a: Numbers) -> Numbers:
    return np.fmin(np.fmax(a, -1.0), 1.0)


_M = MathOperation
_MATH = {
    _M.ADD: lambda a, b, c: a + b,
    _M.SUBTRACT: lambda a, b, c: a - b,
    _M.MULTIPLY: lambda a, b, c: a * b,
    _M.DIVIDE: lambda a, b, c: safe_divide(a, b),
    _M.SINE: lambda a, b, c: np.sin(a),
    _M.COSINE: lambda a, b, c: np.cos(a),
    _M.TANGENT: lambda a, b, c: np.tan(a),
    _M.ARCSINE: lambda a, b, c: np.arcsin(_inside(a)),
    _M.ARCCOSINE: lambda a, b, c: np.arccos(_inside(a)),
    _M.ARCTANGENT: lambda a, b, c: np.arctan(a),
    _M.POWER: lambda a, b, c: safe_power(a, b),
    _M.LOGARITHM: lambda a, b, c: safe_logarithm(a, b),
    _M.MINIMUM: lambda a, b, c: np.fmin(a, b),
    _M.MAXIMUM: lambda a, b, c: np.fmax(a, b),
    _M.ROUND: lambda a, b, c: np.floor(a + 0.5),
    _M.LESS_THAN: lambda a, b, c: a < b,
    _M.GREATER_THAN: lambda a, b, c: a > b,
    _M.MODULO: lambda a, b, c: safe_modulo(a, b),
    _M.ABSOLUTE: lambda a, b, c: np.abs(a),
    _M.ARCTAN2: lambda a, b, c: np.where((a == 0) & (b == 0), 0.0, np.arctan2(a, b)),
    _M.FLOOR: lambda a, b, c: np.floor(a),
    _M.CEIL: lambda a, b, c: np.ceil(a),
    _M.FRACT: lambda a, b, c: a - np.floor(a),
    _M.SQRT: lambda a, b, c: np.sqrt(np.fmax(a, 0.0)),
    _M.INVERSE_SQRT: lambda a, b, c: np.where(a > 0, 1 / np.sqrt(a), 0.0),
    _M.SIGN: lambda a, b, c: sign(a),
    _M.EXPONENT: lambda a, b, c: np.exp(a),
    _M.RADIANS: lambda a, b, c: a * (np.pi / 180),
    _M.DEGREES: lambda a, b, c: a * (180 / np.pi),
    _M.SINH: lambda a, b, c: np.sinh(a),
    _M.COSH: lambda a, b, c: np.cosh(a),
    _M.TANH: lambda a, b, c: np.tanh(a),
    _M.TRUNC: lambda a, b, c: np.trunc(a),
    _M.SNAP: lambda a, b, c: snapped(a, b),
    _M.WRAP: wrap,
    _M.COMPARE: compare,
    _M.MULTIPLY_ADD: lambda a, b, c: a * b + c,
    _M.PINGPONG: lambda a, b, c: ping_pong(a, b),
    _M.SMOOTH_MIN: smooth_minimum,
    _M.SMOOTH_MAX: lambda a, b, c: -smooth_minimum(-a, -b, c),
    _M.FLOORED_MODULO: lambda a, b, c: np.where(b != 0, a - np.floor(safe_divide(a, b)) * b, 0.0),
}
