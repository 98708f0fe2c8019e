"""The core's own exp, log, sine, cosine and highlight power against mpmath."""

import ctypes

import mpmath
import numpy as np
import pytest

from glint.engine.native import binding
from glint.engine.native.core_types import MathFunction
from native_tools import needs_core

pytestmark = needs_core

RANDOM = np.random.default_rng(11)


def evaluate(name: str, x: np.ndarray, y: np.ndarray | None = None) -> np.ndarray:
    x = np.ascontiguousarray(x, float)
    y, out = (x if y is None else np.ascontiguousarray(y, float)), np.empty_like(x)
    pointers = [a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in (x, y, out)]
    binding.library().glint_math(MathFunction[name.upper()], *pointers, len(x))
    return out


def ulps(measured: np.ndarray, x: np.ndarray, exact) -> float:
    """Largest distance from the exact value in units of the last place of a double."""
    with mpmath.workdps(60):
        pairs = zip(measured.tolist(), x.tolist(), strict=True)
        return max(float(abs(m - exact(mpmath.mpf(a)))) / np.spacing(abs(m)) for m, a in pairs)


@pytest.mark.parametrize(
    ("name", "x"),
    [
        ("exp", RANDOM.uniform(-700, 709, 3000)),
        ("exp", RANDOM.uniform(-1, 1, 3000)),
        ("log", np.exp(RANDOM.uniform(-740, 700, 3000))),
        ("log", 1 + RANDOM.uniform(-0.5, 1, 3000)),
    ],
)
def test_error_is_below_two_ulps(name: str, x: np.ndarray) -> None:
    assert ulps(evaluate(name, x), x, getattr(mpmath, name)) < 2


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sine_and_cosine_from_zero_to_pi(name: str) -> None:
    x = np.concatenate([RANDOM.uniform(0, np.pi, 2000), [0, np.pi / 2, np.pi]])
    with mpmath.workdps(40):
        exact = np.array([float(getattr(mpmath, name)(mpmath.mpf(float(a)))) for a in x])
    assert np.abs(evaluate(name, x) - exact).max() <= 2.3e-16


def test_limits() -> None:
    assert np.array_equal(
        evaluate("exp", np.array([-1000, 0, 800, -np.inf, np.inf])), [0, 1, np.inf, 0, np.inf]
    )
    assert np.array_equal(evaluate("log", np.array([0, 1, np.inf])), [-np.inf, 0, np.inf])
    assert np.isnan(evaluate("log", np.array([-1.0, np.nan]))).all()


@pytest.mark.parametrize(
    ("exponent", "allowed"),
    [(0, 0), (1, 1e-12), (1e2, 1e-12), (1e4, 1e-12), (1e6, 1e-9), (1e9, 1e-6)],
)
def test_highlight_power(exponent: float, allowed: float) -> None:
    """cos^p from the squared tangent; N14 asks for 1e-6, 1e-6, 1e-6, 1e-5, 1e-4 and 5e-3."""
    angle = np.concatenate([np.linspace(0, 1.57, 400), 10 ** np.linspace(-9, 0, 400)])
    power = evaluate("cosine_power", np.tan(angle) ** 2, np.full(len(angle), float(exponent)))
    with mpmath.workdps(40):
        exact = np.array([float(mpmath.cos(mpmath.mpf(float(a))) ** exponent) for a in angle])
    assert np.isfinite(power).all()
    assert np.abs(power - exact).max() <= allowed


def test_highlight_power_at_any_tangent() -> None:
    """To 1e-13 of itself, also where the sum of the squares is near a power of two or of its root,
    and where 1 + tan^2 is 1.
    """
    corners = np.array([np.sqrt(2), 2, np.sqrt(8), 4, 1e3]) - 1
    tangent2 = np.concatenate(
        [
            np.exp(RANDOM.uniform(-690, 690, 2000)),
            np.outer(corners, 1 + np.arange(-4, 5) * 2e-16).ravel(),
        ]
    )
    exponent = RANDOM.uniform(0.01, 2, len(tangent2))
    power = evaluate("cosine_power", tangent2, exponent)
    with mpmath.workdps(40):
        pairs = zip(tangent2.tolist(), exponent.tolist(), strict=True)
        exact = np.array([float((1 + mpmath.mpf(t)) ** (-mpmath.mpf(p) / 2)) for t, p in pairs])
    assert (np.abs(power - exact) <= 1e-13 * exact).all()
    # there 1 - cos^p is as small as tan^2, and as exactly known
    small = np.exp(RANDOM.uniform(-60, -5, 500))
    large = 1 / small
    exact = np.exp(-np.log1p(small) * large / 2)
    assert np.abs(evaluate("cosine_power", small, large) - exact).max() <= 1e-15


def test_highlight_power_of_what_is_no_angle_is_finite() -> None:
    power = evaluate(
        "cosine_power", np.array([1e308, np.inf, np.nan, 0.0, 5e-324]), np.full(5, 3.0)
    )
    assert np.array_equal(power, [power[0], power[0], power[0], 1, 1]) and 0 <= power[0] <= 1e-300
