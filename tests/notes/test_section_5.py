"""Section 5 of the lecture notes, Linear Algebra: eigenvalues and singular values."""

import numpy as np

from glint.engine import linear

EPS = np.finfo(np.float64).eps
SYMMETRIC = np.array([[4.0, 1.0, -2.0], [1.0, 2.0, 0.5], [-2.0, 0.5, 3.0]])
GENERAL = np.array([[1.0, 2.0, 0.5], [-1.0, 3.0, 2.0], [0.0, 1.0, -4.0]])


def close(found, expected, ulps=32.0):
    np.testing.assert_allclose(
        found, expected, rtol=0, atol=ulps * EPS * max(1.0, np.max(np.abs(expected)))
    )


def test_5_1_eigenvalues_of_a_2x2_solve_the_quadratic():
    a, b, c = 3.0, -1.0, 0.5
    values, vectors = linear.symmetric_eigen([[a, b], [b, c]])
    close(values, np.sort(np.roots([1.0, -(a + c), a * c - b * b])))
    for value, vector in zip(values, vectors.T, strict=True):
        close((np.array([[a, b], [b, c]]) - value * np.eye(2)) @ vector, np.zeros(2))


def test_5_2_symmetric_eigendecomposition():
    values, q = linear.symmetric_eigen(SYMMETRIC)
    close(q.T @ q, np.eye(3))
    close(q @ np.diag(values) @ q.T, SYMMETRIC)
    close(values, np.linalg.eigvalsh(SYMMETRIC))


def test_5_3_singular_value_decomposition():
    u, values, v = linear.svd(GENERAL)
    close(u.T @ u, np.eye(3))
    close(v.T @ v, np.eye(3))
    close(u @ np.diag(values) @ v.T, GENERAL)


def test_5_3_singular_vectors_are_eigenvectors_of_both_products():
    u, values, v = linear.svd(GENERAL)
    close(GENERAL @ GENERAL.T @ u, u * values**2, 128)
    close(GENERAL.T @ GENERAL @ v, v * values**2, 128)


def test_5_3_the_way_through_the_product_loses_half_the_digits():
    # A has singular values 1, 1 and 1e-10 up to its own rounding; through A Aᵀ the last one drowns
    # below sqrt(eps) = 1.5e-8.
    a = (
        linear.rotate([1.0, 2.0, 3.0], 0.5)
        @ linear.scale(1, 1, 1e-10)
        @ linear.rotate([0.0, 1.0, 1.0], 1.5)
    )
    through_product = np.sqrt(np.abs(linear.symmetric_eigen(a @ a.T)[0][0]))
    assert abs(linear.svd(a)[1][2] - 1e-10) <= 8 * EPS
    assert abs(through_product - 1e-10) > 1e6 * EPS
