"""The elementary functions of programs over lanes (engine/core/src/program/functions.h) against
mpmath, and their limits against NumPy's.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import mpmath
import numpy as np
import pytest

from glint.engine.native import binding
from native_tools import needs_core

pytestmark = needs_core

RANDOM = np.random.default_rng(17)
COUNT = 1500
LARGEST = np.finfo(float).max
WORST_ANGLE = 6381956970095103 * 2.0**797  # of all doubles the nearest to a multiple of pi / 2
UNITS = {  # as each docstring states
    "exp": 1.1,
    "exp2": 1.1,
    "log": 1,
    "log2": 1,
    "log10": 1,
    "pow": 2,
    "sin": 1,
    "cos": 1,
    "tan": 1.1,
    "asin": 1,
    "acos": 1,
    "atan": 1,
    "atan2": 2,
    "sinh": 2,
    "cosh": 2,
    "tanh": 1.1,
}
LIMITS = np.array(
    [0, 0.1, 0.5, 1, 2, 3, 7, 1e30, 2.0**53, 2.0**53 + 2, 5e-324, 1e-310, LARGEST, np.inf, np.nan]
)
LIMITS = np.concatenate([LIMITS, -LIMITS])


def evaluate(name: str, x: np.ndarray, y: np.ndarray | None = None) -> np.ndarray:
    """(n,) of f(x) or f(x, y)."""
    x = np.ascontiguousarray(x, float)
    y, out = x if y is None else np.ascontiguousarray(y, float), np.empty_like(x)
    pointers = [a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in (x, y, out)]
    assert binding.library().glint_function(name.encode(), *pointers, len(x)) == 0
    return out


def units(measured: np.ndarray, exact: Callable[..., mpmath.mpf], *arguments: np.ndarray) -> float:
    """The largest distance from the exact value in units of its last place; infinities count as
    right where the exact value is beyond the range of double.
    """
    worst = 0.0
    with mpmath.workprec(160):
        for m, *a in zip(measured.tolist(), *(x.tolist() for x in arguments), strict=True):
            truth = exact(*map(mpmath.mpf, a))
            if abs(truth) > LARGEST:
                assert np.isinf(m) and (m > 0) == (truth > 0), a
                continue
            assert np.isfinite(m), a
            unit = mpmath.mpf(float(np.spacing(abs(float(truth)))))
            worst = max(worst, float(abs(m - truth) / unit))
    return worst


def uniform(limit: float, count: int = COUNT) -> np.ndarray:
    return RANDOM.uniform(-limit, limit, count)


def sizes(least: float, most: float, count: int = COUNT) -> np.ndarray:
    """Of random signs, their logarithms to base 2 uniform."""
    return RANDOM.choice([-1.0, 1.0], count) * np.exp2(RANDOM.uniform(least, most, count))


def around(*points: float) -> np.ndarray:
    """The 40 doubles next to each point."""
    steps = np.arange(-20, 21)
    return np.concatenate([p + steps * np.spacing(p) for p in points])


EVERY = sizes(-1074, 1023.9)
ANGLES = np.concatenate(
    [uniform(4), uniform(2e6), EVERY, np.arange(1, 500) * (np.pi / 4), [WORST_ANGLE], around(2**20)]
)
POSITIVE = np.concatenate(
    [abs(EVERY), RANDOM.uniform(0.5, 2, COUNT), around(1, 2**0.5, 0.5**0.5, 2.0**-1022)]
)
UNIT = np.concatenate([uniform(1), sizes(-1074, 0), 1 - abs(sizes(-53, 0)), around(0.5), [1, -1]])
ARGUMENTS = {
    "exp": np.concatenate([uniform(746), uniform(1), EVERY, around(709.782712893384)]),
    "exp2": np.concatenate([uniform(1076), uniform(1), np.arange(-1074.0, 1024, 7)]),
    "log": POSITIVE,
    "log2": np.concatenate([POSITIVE, np.exp2(np.arange(-1074.0, 1024, 9))]),
    "log10": np.concatenate([POSITIVE, 10 ** np.arange(-20.0, 23)]),
    "sin": ANGLES,
    "cos": ANGLES,
    "tan": ANGLES,
    "asin": np.concatenate([UNIT, -UNIT]),
    "acos": np.concatenate([UNIT, -UNIT]),
    "atan": np.concatenate([uniform(5, 3000), EVERY, around(0.4375, 0.6875, 1.1875, 2.4375)]),
    "sinh": np.concatenate([uniform(712), uniform(3, 3000), sizes(-1074, 0), around(1, 710.4758)]),
    "cosh": np.concatenate([uniform(712), uniform(3, 3000), sizes(-1074, 0), around(710.4758)]),
    "tanh": np.concatenate([uniform(40), uniform(2, 3000), sizes(-1074, 0), around(1, 22)]),
}
EXACT = {"exp2": lambda x: mpmath.power(2, x), "log2": lambda x: mpmath.log(x, 2)}


@pytest.mark.parametrize("name", ARGUMENTS)
def test_functions_of_one_number_are_as_exact_as_they_say(name: str) -> None:
    x = ARGUMENTS[name]
    if name in ("exp", "exp2"):
        x = np.clip(x, -1100, 1100)  # mpmath takes 2^(1e300) for a number
    exact = EXACT.get(name) or getattr(mpmath, name)
    assert units(evaluate(name, x), exact, x) <= UNITS[name]


def test_power_is_as_exact_as_it_says() -> None:
    """Results of all sizes from bases of all sizes, those next to 1 too, and roots."""
    base = np.concatenate([abs(sizes(-1, 1)), abs(EVERY), 1 + sizes(-52, -2), around(1.5)])
    log = np.log(base)
    exponent = RANDOM.uniform(-746, 710, len(base)) / np.where(log == 0, 1, log)
    x = np.concatenate([base, base, abs(sizes(-4, 4))])
    y = np.concatenate([exponent, uniform(1, len(base)), uniform(60)])
    assert units(evaluate("pow", x, y), mpmath.power, x, y) <= UNITS["pow"]
    whole = np.round(uniform(40))
    x = -abs(sizes(-3, 3))
    assert units(evaluate("pow", x, whole), mpmath.power, x, whole) <= UNITS["pow"]


def test_angle_of_a_vector_is_as_exact_as_it_says() -> None:
    y = np.concatenate([RANDOM.normal(size=6000), EVERY, sizes(-1074, -1000)])
    x = np.concatenate([RANDOM.normal(size=6000), sizes(-1074, 1023.9), sizes(-1074, -1000)])
    assert units(evaluate("atan2", y, x), mpmath.atan2, y, x) <= UNITS["atan2"]


def same(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Where bits are equal, any NaN for any other."""
    return (a.view(np.int64) == b.view(np.int64)) | (np.isnan(a) & np.isnan(b))


@pytest.mark.parametrize("name", [*UNITS, "fmod", "floor_mod"])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_limits(name: str) -> None:
    """Of zeros, infinities, NaN, denormals and the largest: signs of zeros count. What is neither
    0 nor infinite nor 1 may differ from NumPy's by what both lack.
    """
    names = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2"}
    numpys = {**names, "pow": "power", "floor_mod": "mod"}
    truth = getattr(np, numpys.get(name, name))
    binary = name in ("pow", "atan2", "fmod", "floor_mod")
    pairs = np.meshgrid(LIMITS, LIMITS) if binary else (LIMITS,)
    arguments = [np.ascontiguousarray(a.ravel()) for a in pairs]
    result, expected = evaluate(name, *arguments), truth(*arguments)
    near = np.isfinite(expected) & (abs(result - expected) <= 5e-16 * abs(expected))
    plain = (expected != 0) & (abs(expected) != 1)
    assert (same(result, expected) | (near & plain)).all()


@pytest.mark.parametrize("name", ["floor", "ceil", "trunc", "round"])
def test_rounding(name: str) -> None:
    x = np.concatenate([LIMITS, EVERY, uniform(10), np.arange(-9, 9) / 2, around(2.0**52, 0.5)])
    with np.errstate(invalid="ignore"):
        half_away = np.copysign(np.floor(abs(x)) + (abs(x) - np.floor(abs(x)) >= 0.5), x)
        expected = half_away if name == "round" else getattr(np, name)(x)
    assert same(evaluate(name, x), expected).all()


def test_remainders_are_exact() -> None:
    """Quotients of all sizes, next to integers and far beyond 2^53; no rounding is allowed."""
    tenths = np.arange(-300, 300) * 0.1
    x = np.concatenate([EVERY, sizes(0, 60), uniform(1e6), tenths, around(3e15)])
    y = np.concatenate([sizes(-1074, 1023), uniform(3), sizes(-20, 3), 0 * tenths + 0.1])
    y = np.concatenate([y, np.full(len(x) - len(y), 3.0)])
    with mpmath.workprec(2200):
        pairs = zip(x.tolist(), y.tolist(), strict=True)
        expected = [
            float(mpmath.sign(a) * mpmath.fmod(abs(mpmath.mpf(a)), abs(mpmath.mpf(b))))
            for a, b in pairs
        ]
    assert same(evaluate("fmod", x, y), np.copysign(expected, x)).all()
    assert np.array_equal(evaluate("floor_mod", x, y), np.mod(x, y))


def test_unknown_function() -> None:
    assert binding.library().glint_function(b"gamma", None, None, None, 0) == -1
