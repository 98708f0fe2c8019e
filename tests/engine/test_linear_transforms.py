"""Transformations beyond the notes' examples: normals at every scale, exact windows, homogeneous
stacks.
"""

import mpmath
import numpy as np
import pytest

from glint.engine import linear

EPS = np.finfo(np.float64).eps
RNG = np.random.default_rng(5)


def exact_cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def exact_normal(matrix, normal):
    """The unit normal of the transformed surface, by cofactors in 700 digits: the truth for
    singular matrices, too.
    """
    with mpmath.workdps(700):  # squares of 1e-300 beside 1 need the digits
        rows = [[mpmath.mpf(float(x)) for x in row] for row in matrix]
        cofactors = [
            exact_cross(rows[1], rows[2]),
            exact_cross(rows[2], rows[0]),
            exact_cross(rows[0], rows[1]),
        ]
        determinant = sum(x * y for x, y in zip(rows[0], cofactors[0], strict=True))
        sign = -1 if determinant < 0 else 1
        out = [
            sign * sum(x * mpmath.mpf(float(y)) for x, y in zip(row, normal, strict=True))
            for row in cofactors
        ]
        size = mpmath.sqrt(sum(x * x for x in out))
        return np.array([float(x / size) for x in out])


def angle_to(exact, found):
    return linear.angle_between(exact, found)


UNIFORM = [(size,) * 3 for size in (1e-300, 1e-30, 1.0, 1e30, 1e300)]
SCALES = [*UNIFORM, (1, 1, 1e6), (1, 2, 0), (1, 3, 1e-30), (1, 1, 1e30), (-2, 1, 1)]


@pytest.mark.parametrize("scales", SCALES)
def test_normals_to_4e_16_rad_at_any_scale(scales):
    for _ in range(20):
        rotation = linear.rotate(RNG.normal(size=3), RNG.uniform(0, np.pi))
        matrix = rotation * np.array(scales, np.float64)
        normal = linear.unit(RNG.normal(size=3))
        assert (
            angle_to(exact_normal(matrix, normal), linear.transform_normals(matrix, normal))
            <= 4e-16
        )


def test_normals_of_general_matrices_to_the_rounding_of_their_cofactors():
    for matrix in RNG.normal(size=(50, 3, 3)):
        normal = linear.unit(RNG.normal(size=3))
        out = linear.normal_matrix(matrix) @ normal
        condition = np.sum(np.abs(linear.normal_matrix(np.abs(matrix)))) / linear.length(out)
        assert (
            angle_to(exact_normal(matrix, normal), linear.transform_normals(matrix, normal))
            <= 4 * EPS * (1 + condition) * 3
        )


def test_a_flattened_matrix_gives_the_normal_of_the_plane_that_is_left():
    flat = linear.rotate_x(0.3) @ linear.scale(2, 3, 0)
    found = linear.transform_normals(flat, [[0.1, 0.2, 0.9], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(found, [linear.rotate_x(0.3)[:, 2]] * 2, rtol=0, atol=4 * EPS)


@pytest.mark.parametrize("matrix", [np.zeros((3, 3)), np.outer([1, 2, 3], [1, 1, 1])])
def test_a_collapsed_surface_has_the_zero_normal(matrix):
    np.testing.assert_array_equal(linear.transform_normals(matrix, [0.0, 0.0, 1.0]), np.zeros(3))


def test_mirrored_matrices_keep_normals_outside():
    np.testing.assert_allclose(
        linear.transform_normals(linear.scale(-1, 1, 1), [1.0, 0.0, 0.0]),
        [-1.0, 0.0, 0.0],
        rtol=EPS,
    )
    np.testing.assert_allclose(
        linear.transform_normals(linear.scale(-1, 1, 1), [0.0, 1.0, 0.0]), [0.0, 1.0, 0.0], rtol=EPS
    )


@pytest.mark.parametrize("phi", [0.0, 1e-9, 0.7, np.pi / 2, np.pi, -2.5, 7.0])
def test_rodrigues_equals_the_change_of_frame(phi):
    for axis in [*RNG.normal(size=(20, 3)), *np.eye(3), *-np.eye(3)]:
        np.testing.assert_allclose(
            linear.rotate(axis, phi), linear.rotate_by_frame(axis, phi), rtol=0, atol=8 * EPS
        )


def test_small_rotations_keep_their_second_order():
    # 1 - cos φ from the rounded cosine would be 0 here.
    matrix = linear.rotate([1.0, 1.0, 0.0], 1e-9)
    assert matrix[0, 1] == pytest.approx(2 * np.sin(5e-10) ** 2 / 2, rel=4 * EPS)


@pytest.mark.parametrize("axis", [[0, 0, 0], [np.nan, 0, 1]])
def test_no_rotation_about_nothing(axis):
    with pytest.raises(ValueError, match="non-zero, finite"):
        linear.rotate(axis, 1.0)


def test_no_shear_of_an_axis_along_itself():
    with pytest.raises(ValueError, match="two different"):
        linear.shear(1, 1, 0.5)


def test_placements_and_homogeneous_matrices_move_points_alike():
    placements = RNG.normal(size=(7, 3, 4))
    points = RNG.normal(size=(7, 3))
    by_hand = np.einsum("kij,kj->ki", placements[:, :, :3], points) + placements[:, :, 3]
    for matrices in (placements, linear.homogeneous(placements)):
        np.testing.assert_allclose(
            linear.transform_points(matrices, points), by_hand, rtol=0, atol=16 * EPS * 5
        )
        np.testing.assert_allclose(
            linear.transform_directions(matrices, points),
            by_hand - placements[:, :, 3],
            rtol=0,
            atol=16 * EPS * 5,
        )


def test_one_matrix_moves_many_points():
    matrix, points = linear.translate(1, 2, 3), RNG.normal(size=(4, 5, 3))
    np.testing.assert_array_equal(
        linear.transform_points(matrix, points), points + np.array([1, 2, 3])
    )


def test_windows_hit_their_corners_in_any_dimension():
    low, high, new_low, new_high = RNG.normal(size=(4, 5))
    matrix = linear.window(low, high, new_low, new_high)
    bound = 16 * EPS * (1 + np.max(np.abs(matrix)) * 4)
    np.testing.assert_allclose(linear.transform_points(matrix, low), new_low, rtol=0, atol=bound)
    np.testing.assert_allclose(linear.transform_points(matrix, high), new_high, rtol=0, atol=bound)
