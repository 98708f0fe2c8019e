"""Barycentric coordinates by both ways, in the plane and in space, against exact rationals and each
other.
"""

from fractions import Fraction

import numpy as np
import pytest

from glint.engine import linear

EPS = np.finfo(np.float64).eps
RNG = np.random.default_rng(4)
WAYS = pytest.mark.parametrize("way", [linear.barycentric_by_solve, linear.barycentric_by_areas])


def exact_in_the_plane(p, a, b, c):
    (px, py), (ax, ay), (bx, by), (cx, cy) = ([Fraction(float(x)) for x in v] for v in (p, a, b, c))

    def doubled(x0, y0, x1, y1, x2, y2):
        return (x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0)

    whole = doubled(ax, ay, bx, by, cx, cy)
    parts = (
        doubled(px, py, bx, by, cx, cy),
        doubled(px, py, cx, cy, ax, ay),
        doubled(px, py, ax, ay, bx, by),
    )
    return [float(part / whole) for part in parts]


@WAYS
def test_the_plane_against_rational_arithmetic(way):
    for p, a, b, c in RNG.normal(size=(200, 4, 2)):
        exact = exact_in_the_plane(p, a, b, c)
        # Each product of differences carries 4 roundings; dividing by the area stretches them.
        sides = max(np.linalg.norm(x - y) for x in (p, a, b, c) for y in (p, a, b, c))
        bound = (
            16
            * EPS
            * (sides**2 / abs(2 * linear.triangle_area(a, b, c)))
            * (1 + max(map(abs, exact)))
        )
        np.testing.assert_allclose(way(p, a, b, c), exact, rtol=0, atol=bound)


@WAYS
def test_space_gives_back_the_coordinates_of_points_in_the_plane(way):
    a, b, c = RNG.normal(size=(3, 500, 3))
    weights = RNG.dirichlet([1, 1, 1], 500)
    p = linear.interpolate(weights, np.stack([a, b, c], 1))
    longest = np.max([linear.length(b - a), linear.length(c - a), linear.length(c - b)], 0)
    bound = 32 * EPS * (longest**2 / linear.triangle_area(a, b, c)) * 4
    assert np.all(np.abs(way(p, a, b, c) - weights) <= bound[:, None])


@WAYS
@pytest.mark.parametrize("axis", range(3))
def test_triangles_at_right_angles_to_an_axis(way, axis):
    a, b, c = np.insert([[0.0, 0.0], [2.0, 0.0], [0.0, 4.0]], axis, 7.0, axis=1)
    np.testing.assert_array_equal(way(0.25 * a + 0.25 * b + 0.5 * c, a, b, c), [0.25, 0.25, 0.5])


def test_off_the_plane_areas_project_at_right_angles():
    a, b, c = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 1.0]])
    normal = np.cross(b - a, c - a)
    p = 0.2 * a + 0.3 * b + 0.5 * c
    np.testing.assert_allclose(
        linear.barycentric_by_areas(p + 7 * normal, a, b, c), [0.2, 0.3, 0.5], rtol=0, atol=64 * EPS
    )


@WAYS
def test_a_triangle_without_area_has_no_coordinates(way):
    a, b = np.array([0.0, 0.0, 0.0]), np.array([1.0, 2.0, 3.0])
    assert not np.isfinite(way([0.5, 1.0, 1.5], a, b, 2 * b)).any()
    assert not linear.is_inside(way([0.5, 1.0, 1.5], a, b, 2 * b))


@WAYS
def test_huge_and_tiny_triangles(way):
    a, b, c = RNG.normal(size=(3, 2))
    p = (a + b + 2 * c) / 4
    for size in (1e-60, 1e60):
        np.testing.assert_allclose(
            way(size * p, size * a, size * b, size * c), way(p, a, b, c), rtol=1e-12
        )


def test_areas_are_signed_in_the_plane_only():
    a, b, c = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 3.0]])
    assert linear.triangle_area(a, b, c) == 3.0
    assert linear.triangle_area(a, c, b) == -3.0
    in_space = [np.append(v, 5.0) for v in (a, c, b)]
    assert linear.triangle_area(*in_space) == 3.0


def test_nan_is_outside():
    assert not linear.is_inside([np.nan, 0.5, 0.5])
    assert not linear.is_inside([np.nan, 0.5, 0.5], closed=False)
