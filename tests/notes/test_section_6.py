"""Section 6 of the lecture notes, Transformation Matrices."""

import numpy as np
import pytest

from glint.engine import linear

EPS = np.finfo(np.float64).eps


def close(found, expected, ulps=16.0):
    np.testing.assert_allclose(
        found, expected, rtol=0, atol=ulps * EPS * max(1.0, np.max(np.abs(expected)))
    )


def test_6_1_shear_and_reflection_in_the_plane():
    np.testing.assert_array_equal(linear.shear(0, 1, 0.5, n=2), [[1, 0.5], [0, 1]])
    np.testing.assert_array_equal(linear.shear(0, 1, 0.5, n=2) @ [2.0, 4.0], [4.0, 4.0])
    close(linear.reflect([0.0, 3.0]), [[1, 0], [0, -1]])
    mirror = linear.reflect([1.0, 2.0, -2.0])
    close(mirror @ mirror, np.eye(3))
    assert np.linalg.det(mirror) == pytest.approx(-1.0, abs=8 * EPS)


def test_6_1_a_symmetric_matrix_is_rotation_scale_and_rotation_back():
    a = np.array([[2.0, 1.0], [1.0, 1.0]])
    values, q = linear.symmetric_eigen(a)
    q = q * [1.0, np.sign(np.linalg.det(q))]
    back = linear.rotate_2d(-np.arctan2(q[1, 0], q[0, 0]))
    close(back @ q, np.eye(2))  # Q is a rotation, by that angle
    close(q @ linear.scale(*values) @ q.T, a)


def test_6_1_any_matrix_is_a_rotation_a_scale_and_another_rotation():
    a = linear.shear(0, 1, 1.0, n=2)
    u, values, v = linear.svd(a)
    close(u @ linear.scale(*values) @ v.T, a)
    # the golden ratio, FCG's own example
    close(values, [(1 + np.sqrt(5)) / 2, (np.sqrt(5) - 1) / 2])
    circle = np.stack([np.cos(np.linspace(0, 6, 50)), np.sin(np.linspace(0, 6, 50))])
    # the circle becomes an ellipse along the columns of U
    close(linear.length(((u.T @ a @ circle).T) / values), np.ones(50))


def test_6_2_scaling():
    np.testing.assert_array_equal(linear.scale(2, 3, 4), [[2, 0, 0], [0, 3, 0], [0, 0, 4]])


def test_6_2_rotations_about_the_axes():
    phi = 0.4
    c, s = np.cos(phi), np.sin(phi)
    np.testing.assert_array_equal(linear.rotate_z(phi), [[c, -s, 0], [s, c, 0], [0, 0, 1]])
    np.testing.assert_array_equal(linear.rotate_x(phi), [[1, 0, 0], [0, c, -s], [0, s, c]])
    np.testing.assert_array_equal(linear.rotate_y(phi), [[c, 0, s], [0, 1, 0], [-s, 0, c]])


def test_6_2_arbitrary_rotations():
    axis, phi = np.array([1.0, 2.0, -1.0]), 0.9
    matrix = linear.rotate(axis, phi)
    close(matrix, linear.rotate_by_frame(axis, phi))
    close(matrix @ axis, axis)
    close(matrix.T @ matrix, np.eye(3))
    assert np.trace(matrix) == pytest.approx(1 + 2 * np.cos(phi), abs=8 * EPS)
    for about, unit in zip(
        (linear.rotate_x, linear.rotate_y, linear.rotate_z), np.eye(3), strict=True
    ):
        close(linear.rotate(unit, phi), about(phi))


def test_6_2_normals_need_the_inverse_transpose():
    matrix = linear.shear(0, 1, 1.5) @ linear.scale(1, 0.25, 2)
    n, t = linear.unit([1.0, 1.0, 0.5]), np.array([1.0, -1.0, 0.0])
    assert linear.dot(n, t) == 0.0
    moved = linear.transform_normals(matrix, n)
    assert linear.dot(moved, matrix @ t) == pytest.approx(0.0, abs=8 * EPS)
    # transformed as a vector, it is no normal any more
    assert abs(linear.dot(matrix @ n, matrix @ t)) > 0.1
    close(moved, linear.unit(np.linalg.inv(matrix).T @ n))


def test_6_3_affine_transformations_compose_by_products():
    linear_part = np.array([[1.0, 2.0], [3.0, 4.0]])
    matrix = linear.affine(linear_part, [5.0, 6.0])
    np.testing.assert_array_equal(matrix, [[1, 2, 5], [3, 4, 6], [0, 0, 1]])
    np.testing.assert_array_equal(linear.transform_points(matrix, [1.0, 1.0]), [8.0, 13.0])
    both = linear.translate(1.0, -1.0) @ matrix
    np.testing.assert_array_equal(linear.transform_points(both, [1.0, 1.0]), [9.0, 12.0])


def test_6_3_directions_do_not_translate():
    np.testing.assert_array_equal(
        linear.transform_directions(linear.translate(5, 6, 7), [1.0, 2.0, 3.0]), [1.0, 2.0, 3.0]
    )
    np.testing.assert_array_equal(linear.translate(5, 6) @ [1.0, 2.0, 0.0], [1.0, 2.0, 0.0])


def test_6_3_translation_is_a_shear_one_dimension_up():
    sheared = linear.shear(0, 2, 5.0) @ linear.shear(1, 2, 6.0)
    np.testing.assert_array_equal(sheared, linear.translate(5, 6))


def test_6_4_windowing_in_the_plane_is_the_product_of_three():
    low, high, new_low, new_high = (1.0, 2.0), (3.0, 6.0), (-1.0, 0.0), (4.0, 1.0)
    product = (
        linear.translate(*new_low) @ linear.scale(5 / 2, 1 / 4, 1) @ linear.translate(-1.0, -2.0)
    )
    close(linear.window(low, high, new_low, new_high), product)


def test_6_4_windowing_in_space_has_z_in_its_third_row():
    low, high, new_low, new_high = np.array(
        [[0.0, 1, 2], [2.0, 5, 10], [-1.0, -1, -1], [1.0, 1, 1]]
    )
    matrix = linear.window(low, high, new_low, new_high)
    np.testing.assert_array_equal(
        matrix[2], [0, 0, (1 - -1) / (10 - 2), (-1 * 10 - 1 * 2) / (10 - 2)]
    )
    np.testing.assert_array_equal(linear.transform_points(matrix, low), new_low)
    np.testing.assert_array_equal(linear.transform_points(matrix, high), new_high)
    as_printed = matrix.copy()
    # the notes' row: the constant stands where the factor belongs
    as_printed[2] = [0, 0, matrix[2, 3], 0]
    assert linear.transform_points(as_printed, low)[2] != -1.0


def test_6_5_inverses_of_simple_transformations():
    close(linear.inverse(linear.scale(2, 4, 8)), linear.scale(0.5, 0.25, 0.125))
    rotation = linear.rotate([1.0, 1.0, 0.0], 0.3)
    close(linear.inverse(rotation), rotation.T)


def test_6_5_the_inverse_of_any_matrix_through_its_svd():
    a = np.array([[1.0, 2.0, 0.5], [-1.0, 3.0, 2.0], [0.0, 1.0, -4.0]])
    u, values, v = linear.svd(a)
    close(linear.inverse(a), v @ linear.scale(*(1 / values)) @ u.T)
    close(linear.inverse(a) @ a, np.eye(3))


def test_6_5_a_near_singular_placement_reports_how_far_to_trust_its_inverse():
    squashed = linear.rotate_x(0.3) @ linear.scale(1, 1, 1e-9)
    result = linear.pseudo_inverse(squashed)
    assert result.rank == 3
    assert result.condition == pytest.approx(1e9, rel=1e-6)
    close(result.matrix @ squashed, np.eye(3), 1e9)
    assert linear.pseudo_inverse(linear.rotate_x(0.3) @ linear.scale(1, 1, 0)).rank == 2


def test_6_6_frame_to_canonical_and_back():
    e, basis = np.array([4.0, -1.0]), linear.rotate_2d(0.5)
    matrix = linear.canonical_from_frame(e, basis)
    close(matrix, np.block([[basis, e[:, None]], [np.zeros((1, 2)), np.ones((1, 1))]]))
    close(linear.transform_points(matrix, [2.0, 3.0]), e + 2 * basis[:, 0] + 3 * basis[:, 1])
    close(linear.rigid_inverse(matrix), np.linalg.inv(matrix))
    close(linear.transform_points(linear.rigid_inverse(matrix), e), [0.0, 0.0])


def test_6_6_the_same_in_space():
    matrix = linear.canonical_from_frame(
        [1.0, 2.0, 3.0], linear.basis_from_vector([1.0, -1.0, 2.0])
    )
    close(linear.rigid_inverse(matrix) @ matrix, np.eye(4))
