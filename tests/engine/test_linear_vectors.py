"""Vectors and interpolation beyond the notes' examples: scale, precision, broadcasting, bad
input.
"""

import mpmath
import numpy as np
import pytest

from glint.engine import linear
from glint.engine.linear.vectors import power_of_two

EPS = np.finfo(np.float64).eps


def test_power_of_two_is_the_largest_one_not_above():
    sizes = np.array([5e-324, 3e-310, 0.75, 1.0, 1.999, 2.0, 3e100, 1.7e308])
    powers = power_of_two(sizes)
    np.testing.assert_array_equal(np.frexp(powers)[0], 0.5)
    assert np.all((sizes / powers >= 1) & (sizes / powers < 2))
    np.testing.assert_array_equal(power_of_two([0.0, np.inf, np.nan]), 1.0)


@pytest.mark.parametrize("size", [5e-324, 1e-310, 1e-200, 1.0, 1e200, 1e307])
def test_length_and_unit_neither_overflow_nor_underflow(size):
    vector = np.array([3.0, 0.0, 4.0]) * size
    exact = mpmath.sqrt(sum(mpmath.mpf(float(x)) ** 2 for x in vector))
    # Below the normal range the result itself is rounded to a multiple of 2^-1074.
    assert abs(linear.length(vector) - float(exact)) <= 2 * EPS * float(exact) + 5e-324
    exact_unit = [float(mpmath.mpf(float(x)) / exact) for x in vector]
    np.testing.assert_allclose(linear.unit(vector), exact_unit, rtol=3 * EPS)


def test_unit_of_zero_is_zero_and_of_non_finite_is_nan():
    np.testing.assert_array_equal(linear.unit(np.zeros((2, 3))), np.zeros((2, 3)))
    assert np.isnan(linear.unit([np.inf, 0.0, 0.0])[0])
    assert np.isnan(linear.unit([np.nan, 1.0, 0.0])).all()


@pytest.mark.parametrize("angle", [1e-12, 1e-8, 1e-3, 1.0, 3.0, np.pi - 1e-8])
def test_angle_keeps_relative_precision_near_zero_and_pi(angle):
    a, b = np.array([1.0, 0.0, 0.0]), np.array([np.cos(angle), np.sin(angle), 0.0])
    exact = float(mpmath.atan2(mpmath.mpf(float(b[1])), mpmath.mpf(float(b[0]))))
    assert linear.angle_between(a, 7e30 * b) == pytest.approx(exact, rel=4 * EPS)


def test_products_broadcast_over_leading_axes():
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(4, 1, 3)), rng.normal(size=(5, 3))
    np.testing.assert_allclose(linear.dot(a, b), (a * b).sum(-1), rtol=0, atol=8 * EPS * 10)
    np.testing.assert_allclose(linear.cross(a, b), np.cross(a, b), rtol=0, atol=8 * EPS * 10)
    assert linear.project(a, b).shape == (4, 5, 3)


def test_projecting_onto_the_zero_vector_gives_zero():
    np.testing.assert_array_equal(linear.project([1.0, 2.0, 3.0], [0.0, 0.0, 0.0]), np.zeros(3))


def test_lerp_is_exact_at_both_ends():
    assert linear.lerp(0.1, 0.1, 0.7, 1e17, -3.0) == 1e17
    assert linear.lerp(0.7, 0.1, 0.7, 1e17, -3.0) == -3.0


def test_piecewise_linear_agrees_with_numpy_and_keeps_columns():
    rng = np.random.default_rng(2)
    knots, values = np.sort(rng.normal(size=9)), rng.normal(size=(9, 2))
    x = np.concatenate([rng.normal(size=50) * 2, knots])
    found = linear.piecewise_linear(x, knots, values)
    for column in range(2):
        np.testing.assert_allclose(
            found[:, column], np.interp(x, knots, values[:, column]), rtol=0, atol=16 * EPS
        )


def test_piecewise_linear_with_one_knot_is_constant():
    np.testing.assert_array_equal(linear.piecewise_linear([-1.0, 5.0], [2.0], [3.0]), [3.0, 3.0])


@pytest.mark.parametrize(
    ("knots", "values"),
    [([0.0, 0.0], [1.0, 2.0]), ([1.0, 0.0], [1.0, 2.0]), ([0.0, 1.0], [1.0]), ([], [])],
)
def test_piecewise_linear_rejects_knots_that_do_not_rise(knots, values):
    with pytest.raises(ValueError, match="strictly increasing"):
        linear.piecewise_linear(0.5, knots, values)
