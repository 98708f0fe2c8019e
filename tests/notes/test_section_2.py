"""Section 2 of the lecture notes, Misc Math: products, frames, bases, interpolation, triangles."""

import numpy as np
import pytest

from glint.engine import linear

EPS = np.finfo(np.float64).eps


def close(found, expected, ulps=8.0):
    """Equal to a few roundings of numbers of size about 1."""
    np.testing.assert_allclose(
        found, expected, rtol=0, atol=ulps * EPS * max(1.0, np.max(np.abs(expected)))
    )


def test_2_1_trigonometric_identities_are_products_of_rotations():
    a, b = 0.7, 1.9
    close(linear.rotate_2d(a) @ linear.rotate_2d(b), linear.rotate_2d(a + b))
    close(linear.rotate_2d(a)[:, 0], [np.cos(a), np.sin(a)])
    assert np.cos(a) ** 2 + np.sin(a) ** 2 == pytest.approx(1.0, abs=2 * EPS)


def test_2_2_dot_product_is_lengths_times_cosine():
    a, b = np.array([1.0, 2.0, 2.0]), np.array([4.0, 0.0, 3.0])
    assert linear.dot(a, b) == 10.0
    assert (linear.length(a), linear.length(b)) == (3.0, 5.0)
    assert linear.angle_between(a, b) == pytest.approx(np.arccos(10 / 15), abs=8 * EPS)


def test_2_2_projection_divides_by_the_length_of_what_is_projected_onto():
    a, b = np.array([1.0, 2.0, 2.0]), np.array([4.0, 0.0, 3.0])
    assert linear.projected_length(a, b) == pytest.approx(10 / 5, abs=4 * EPS)
    assert linear.projected_length(b, a) == pytest.approx(10 / 3, abs=4 * EPS)
    close(linear.project(a, b), 2 * b / 5)
    assert linear.dot(a - linear.project(a, b), b) == pytest.approx(0.0, abs=16 * EPS)


def test_2_3_cross_product_is_the_determinant_and_the_right_hand_rule():
    a, b = np.array([1.0, 2.0, 3.0]), np.array([-2.0, 0.5, 4.0])
    by_determinant = [np.linalg.det(np.stack([unit, a, b])) for unit in np.eye(3)]
    close(linear.cross(a, b), by_determinant, 32)
    assert linear.length(linear.cross(a, b)) == pytest.approx(
        linear.length(a) * linear.length(b) * np.sin(linear.angle_between(a, b)), rel=16 * EPS
    )
    np.testing.assert_array_equal(linear.cross([1.0, 0, 0], [0, 1.0, 0]), [0, 0, 1])
    np.testing.assert_array_equal(linear.cross(b, a), -linear.cross(a, b))


def test_2_4_coordinates_in_a_frame_give_the_vector_back():
    basis = linear.basis_from_vector([1.0, -2.0, 0.5])
    b = np.array([3.0, 1.0, -2.0])
    coordinates = linear.coordinates_in(basis, b)
    close(coordinates, [q @ b for q in basis.T])
    close(sum(c * q for c, q in zip(coordinates, basis.T, strict=True)), b)
    assert linear.length(coordinates) == pytest.approx(linear.length(b), rel=8 * EPS)


def test_2_5_gram_schmidt_makes_an_orthonormal_basis_of_the_same_spans():
    columns = np.array([[3.0, 1.0, 2.0], [0.0, 2.0, 1.0], [4.0, 0.0, 5.0]])
    basis = linear.gram_schmidt(columns)
    close(basis.T @ basis, np.eye(3))
    close(basis[:, 0], [0.6, 0.0, 0.8])
    # column k needs only the first k basis vectors
    close(np.tril(basis.T @ columns, -1), np.zeros((3, 3)), 16)
    assert np.all(np.diag(basis.T @ columns) > 0)


def test_2_5_a_basis_from_one_vector_or_two():
    w, t = np.array([0.0, 3.0, 4.0]), np.array([0.0, 0.0, 1.0])
    for basis in (linear.basis_from_vector(w), linear.basis_from_vectors(w, t)):
        close(basis.T @ basis, np.eye(3))
        close(basis[:, 2], [0.0, 0.6, 0.8])
        close(linear.cross(basis[:, 0], basis[:, 1]), basis[:, 2])
    close(linear.basis_from_vectors(w, t)[:, :2], np.array([[-1.0, 0.0, 0.0], [0.0, -0.8, 0.6]]).T)


def test_2_6_linear_interpolation_over_two_points():
    assert linear.lerp(2.5, 2.0, 4.0, 10.0, 30.0) == 15.0
    np.testing.assert_array_equal(
        linear.lerp(0.5, 0.0, 1.0, np.array([0.0, 1.0]), np.array([1.0, 3.0])), [0.5, 2.0]
    )


def test_2_6_piecewise_linear_interpolation():
    knots, values = [0.0, 1.0, 3.0], [0.0, 2.0, -2.0]
    found = linear.piecewise_linear([-1.0, 0.0, 0.5, 1.0, 2.0, 3.0, 9.0], knots, values)
    np.testing.assert_array_equal(found, [0.0, 0.0, 1.0, 2.0, 0.0, -2.0, -2.0])


A, B, C = np.array([[1.0, 1.0], [4.0, 2.0], [2.0, 5.0]])


def test_2_7_barycentric_coordinates_by_solving():
    p = 0.2 * A + 0.3 * B + 0.5 * C
    found = linear.barycentric_by_solve(p, A, B, C)
    close(found, [0.2, 0.3, 0.5])
    close(np.column_stack([B - A, C - A]) @ found[1:], p - A)


def test_2_7_barycentric_coordinates_by_areas():
    p = 0.2 * A + 0.3 * B + 0.5 * C
    whole = linear.triangle_area(A, B, C)
    by_hand = (
        np.array(
            [
                linear.triangle_area(p, B, C),
                linear.triangle_area(p, C, A),
                linear.triangle_area(p, A, B),
            ]
        )
        / whole
    )
    close(by_hand, [0.2, 0.3, 0.5])
    close(linear.barycentric_by_areas(p, A, B, C), by_hand)


def test_2_7_both_ways_agree_in_space():
    a, b, c = (np.append(v, v @ [2.0, -1.0]) for v in (A, B, C))
    for weights in ([0.2, 0.3, 0.5], [1.5, -0.25, -0.25]):
        p = weights[0] * a + weights[1] * b + weights[2] * c
        close(linear.barycentric_by_solve(p, a, b, c), weights, 32)
        close(linear.barycentric_by_areas(p, a, b, c), weights, 32)


def test_2_7_edges_vertices_and_insides_are_told_apart():
    for weights, inside, strictly in (
        ([1, 0, 0], True, False),
        ([0, 0.5, 0.5], True, False),
        ([0.25, 0.25, 0.5], True, True),
        ([-0.25, 0.75, 0.5], False, False),
    ):
        found = linear.barycentric_by_areas(np.array(weights) @ np.stack([A, B, C]), A, B, C)
        np.testing.assert_array_equal(found == 0, np.array(weights) == 0)
        assert linear.is_inside(found) == inside
        assert linear.is_inside(found, closed=False) == strictly


def test_2_7_values_mix_smoothly():
    values = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    for vertex, expected in enumerate(values):
        np.testing.assert_array_equal(linear.interpolate(np.eye(3)[vertex], values), expected)
    close(linear.interpolate([0.25, 0.25, 0.5], values), [0.25, 0.25, 0.5])
