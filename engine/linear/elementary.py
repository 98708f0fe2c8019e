"""Elementary functions to the same bits on every processor, within 1 (exp), 2 (log) and 5 (arccos)
units in the last place.

NumPy's and the C library's differ in the last bit between instruction sets. What is computed here
are sums, products, quotients and roots alone, which IEEE 754 rounds in one way. Reductions are as
in Cody and Waite 1980 (Software Manual for the Elementary Functions).
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray

_LN2_HIGH, _LN2_LOW = float.fromhex("0x1.62e42feep-1"), float.fromhex("0x1.a39ef35793c76p-33")
"""Their sum is log 2; the first has zeros at its end, so that whole multiples are exact."""
_TERMS = [1 / n for n in range(13, 0, -1)]


def exp(x: Array) -> Array:
    """(...) float64: e to the powers x (...), which are finite."""
    x = np.clip(np.asarray(x, np.float64), -800.0, 800.0)  # 0 and infinity beyond
    whole = np.rint(x / (_LN2_HIGH + _LN2_LOW))
    rest = (x - whole * _LN2_HIGH) - whole * _LN2_LOW
    total = np.ones_like(rest)
    for over in _TERMS:
        total = 1 + rest * over * total
    return np.ldexp(total, whole.astype(np.intp))


def log(x: Array) -> Array:
    """(...) float64: the natural logarithms of x (...), finite numbers above 0."""
    part, whole = np.frexp(np.asarray(x, np.float64))
    low = part < 0.5**0.5
    part, whole = np.where(low, 2 * part, part), whole - low
    s = (part - 1) / (part + 1)
    square, series = s * s, np.zeros_like(s)
    for n in range(23, 1, -2):
        series = square * (1 / n + series)
    return whole * _LN2_HIGH + (2 * s + (2 * s * series + whole * _LN2_LOW))


def arccos(x: Array) -> Array:
    """(...) float64, radians from 0 to π: the angles whose cosines are x (...), -1 to 1."""
    x = np.asarray(x, np.float64)
    flipped = x < 0  # the tangent of half the angle is at most 1
    size = np.abs(x)
    t = np.sqrt((1 - size) / (1 + size))
    for _ in range(3):  # half of the angle, each time
        t = t / (1 + np.sqrt(1 + t * t))
    square, series = t * t, np.zeros_like(t)
    for n in range(21, 1, -2):
        series = square * (1 / n - series)
    angle = 16 * (t - t * series)
    return np.where(flipped, np.pi - angle, angle)
