"""Eigenvalues, singular values and inverses by Jacobi rotations against LAPACK, mpmath and their
own definitions.
"""

import mpmath
import numpy as np
import pytest

from glint.engine import linear

EPS = np.finfo(np.float64).eps
RNG = np.random.default_rng(6)


def transposed(a):
    return np.swapaxes(a, -1, -2)


def size_of(a):
    return np.max(np.abs(a), (-2, -1), keepdims=True)


def assert_orthonormal_columns(q):
    eye = np.eye(q.shape[-1])
    np.testing.assert_allclose(
        transposed(q) @ q, np.broadcast_to(eye, (*q.shape[:-2], *eye.shape)), rtol=0, atol=32 * EPS
    )


SYMMETRIC = {
    "random 2": (lambda a: a + transposed(a))(RNG.normal(size=(500, 2, 2))),
    "random 3": (lambda a: a + transposed(a))(RNG.normal(size=(500, 3, 3))),
    "random 5": (lambda a: a + transposed(a))(RNG.normal(size=(20, 5, 5))),
    "diagonal": np.stack([np.diag(d) for d in RNG.normal(size=(20, 3))]),
    "equal": np.stack([np.eye(3), -2 * np.eye(3), np.zeros((3, 3)), np.ones((3, 3))]),
    "graded": np.array([[[1e-20, 1e-15, 1e-12], [1e-15, 1e-8, 1e-6], [1e-12, 1e-6, 1.0]]]),
    "huge": 1e300 * (lambda a: a + transposed(a))(RNG.normal(size=(20, 3, 3))),
    "tiny": 1e-300 * (lambda a: a + transposed(a))(RNG.normal(size=(20, 3, 3))),
}


@pytest.mark.parametrize("name", SYMMETRIC)
def test_symmetric_eigen_against_lapack(name):
    a = SYMMETRIC[name]
    values, q = linear.symmetric_eigen(a)
    assert_orthonormal_columns(q)
    size = np.where(size_of(a) == 0, 1.0, size_of(a))
    # Both methods are backward stable: eigenvalues to a few n ulp of the largest (Golub, Van Loan,
    # section 8.5).
    bound = 16 * a.shape[-1] * EPS
    np.testing.assert_allclose(
        values / size[..., 0], np.linalg.eigvalsh(a / size), rtol=0, atol=bound
    )
    np.testing.assert_allclose(
        q @ (values[..., None] / size * transposed(q)), a / size, rtol=0, atol=bound
    )


def test_eigen_reads_the_upper_triangle_only():
    a = np.array([[2.0, 1.0], [999.0, 3.0]])
    np.testing.assert_allclose(
        linear.symmetric_eigen(a)[0], np.linalg.eigvalsh([[2, 1], [1, 3]]), rtol=0, atol=16 * EPS
    )


RECTANGLES = {
    "random 3": RNG.normal(size=(500, 3, 3)),
    "random 2": RNG.normal(size=(500, 2, 2)),
    "tall": RNG.normal(size=(30, 5, 3)),
    "wide": RNG.normal(size=(30, 2, 4)),
    "rank 2": RNG.normal(size=(100, 3, 2)) @ RNG.normal(size=(100, 2, 3)),
    "rank 1": RNG.normal(size=(100, 3, 1)) @ RNG.normal(size=(100, 1, 3)),
    "zero": np.zeros((2, 3, 3)),
    "one column": np.array([[[1.0, 0, 0], [2, 0, 0], [3, 0, 0]]]),
    "graded": RNG.normal(size=(50, 3, 3)) * [1, 1e-9, 1e-18],
    "huge": 1e300 * RNG.normal(size=(50, 3, 3)),
    "tiny": 1e-300 * RNG.normal(size=(50, 3, 3)),
    "denormal": 1e-320 * RNG.normal(size=(5, 3, 3)),
}


@pytest.mark.parametrize("name", RECTANGLES)
def test_svd_against_lapack(name):
    a = RECTANGLES[name]
    u, values, v = linear.svd(a)
    assert_orthonormal_columns(u)
    assert_orthonormal_columns(v)
    assert np.all(np.diff(values) <= 0)
    assert np.all(values >= 0)
    size = np.where(size_of(a) == 0, 1.0, size_of(a))
    # Below the normal range singular values are rounded to multiples of 2^-1074.
    bound = 16 * max(a.shape[-2:]) * EPS + np.max(5e-324 / size)
    np.testing.assert_allclose(
        values / size[..., 0], np.linalg.svd(a / size, compute_uv=False), rtol=0, atol=bound
    )
    np.testing.assert_allclose(
        u @ (values[..., None] / size * transposed(v)), a / size, rtol=0, atol=bound
    )


def test_singular_values_are_relatively_accurate_for_scaled_columns():
    # Truth in 80 digits. LAPACK's bidiagonalisation gets the smallest of these wrong altogether.
    a = (
        linear.rotate([1.0, 2.0, 3.0], 0.8)
        @ np.array([[1, 0.5, 0.2], [0, 1, 0.4], [0, 0, 1]])
        * [1.0, 1e-12, 1e-24]
    )
    with mpmath.workdps(80):
        exact = sorted(
            (float(x) for x in mpmath.svd_r(mpmath.matrix(a.tolist()), compute_uv=False)),
            reverse=True,
        )
    np.testing.assert_allclose(linear.svd(a)[1], exact, rtol=64 * EPS)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_svd_of_non_finite_matrices_is_refused(bad):
    with pytest.raises(ValueError, match="not finite"):
        linear.svd([[1.0, bad], [0.0, 1.0]])


def test_inverse_of_stacks():
    a = RNG.normal(size=(300, 3, 3))
    condition = linear.pseudo_inverse(a).condition
    error = np.max(np.abs(linear.inverse(a) @ a - np.eye(3)), (-2, -1))
    assert np.all(error <= 64 * EPS * condition)
    np.testing.assert_allclose(condition, np.linalg.cond(a), rtol=1e-13 * condition.max())


@pytest.mark.parametrize(
    "scales", [(1, 1e-6, 1e6), (1e-30, 1, 1e30), (1e-150,) * 3, (1e150,) * 3, (1, 1, 1e-200)]
)
def test_inverse_of_rotation_times_any_scale_is_exact_to_rounding(scales):
    rotation = linear.rotate([3.0, -1.0, 2.0], 1.1)
    expected = rotation.T / np.array(scales, np.float64)[:, None]
    found = linear.inverse(rotation * np.array(scales, np.float64))
    np.testing.assert_allclose(
        found * np.array(scales)[:, None],
        expected * np.array(scales)[:, None],
        rtol=0,
        atol=32 * EPS,
    )


@pytest.mark.parametrize(
    "singular",
    [np.zeros((3, 3)), np.ones((3, 3)), np.arange(9.0).reshape(3, 3), np.diag([1.0, 0.0, 1.0])],
)
def test_inverse_refuses_singular_matrices_and_pseudo_inverse_reports_their_rank(singular):
    with pytest.raises(ValueError, match="singular"):
        linear.inverse(singular)
    result = linear.pseudo_inverse(singular)
    assert result.rank == np.linalg.matrix_rank(singular)
    assert result.condition > 1 / (8 * EPS)


@pytest.mark.parametrize("name", ["random 3", "tall", "wide", "rank 2", "rank 1", "zero"])
def test_pseudo_inverse_satisfies_the_penrose_conditions(name):
    a = RECTANGLES[name]
    plus, rank, _ = linear.pseudo_inverse(a)
    values = np.linalg.svd(a, compute_uv=False)
    k = max(int(np.max(rank)), 1)
    spread = np.max(values[..., 0] / np.maximum(values[..., k - 1], 1e-30)) if np.any(rank) else 1.0
    bound = 64 * EPS * spread**2 * max(1.0, np.max(np.abs(a)))
    np.testing.assert_allclose(a @ plus @ a, a, rtol=0, atol=bound)
    np.testing.assert_allclose(
        plus @ a @ plus, plus, rtol=0, atol=bound * max(1.0, np.max(np.abs(plus)) ** 2)
    )
    np.testing.assert_allclose(a @ plus, transposed(a @ plus), rtol=0, atol=bound)
    np.testing.assert_allclose(plus @ a, transposed(plus @ a), rtol=0, atol=bound)


def test_the_tolerance_decides_what_counts():
    a = np.diag([1.0, 1e-10])
    assert linear.pseudo_inverse(a).rank == 2
    assert linear.pseudo_inverse(a, tolerance=1e-8).rank == 1
    assert linear.pseudo_inverse(a).condition == pytest.approx(1e10, rel=4 * EPS)


def test_affine_inverse_of_a_flattened_placement_keeps_its_plane():
    flat = np.column_stack(
        [linear.rotate([1.0, 1.0, 0.0], 0.7) @ linear.scale(2, 3, 0), [10.0, -20.0, 30.0]]
    )
    back = linear.affine_inverse(flat)
    assert back.rank == 2
    points = np.array([[0.5, -1.5, 0.0], [4.0, 2.0, 0.0]])
    moved = linear.transform_points(flat, points)
    np.testing.assert_allclose(
        linear.transform_points(back.matrix, moved), points, rtol=0, atol=32 * EPS * 40
    )


def test_affine_inverse_of_stacks():
    placements = RNG.normal(size=(100, 3, 4))
    back = linear.affine_inverse(placements)
    assert back.matrix.shape == (100, 3, 4)
    points = RNG.normal(size=(100, 3))
    again = linear.transform_points(back.matrix, linear.transform_points(placements, points))
    assert np.all(np.abs(again - points) <= 256 * EPS * back.condition[:, None])
