"""Bases and frames: orthonormal to rounding for every input that has a basis, an error for every
other.
"""

import numpy as np
import pytest

from glint.engine import linear

EPS = np.finfo(np.float64).eps
RNG = np.random.default_rng(3)
VECTORS = np.concatenate(
    [
        RNG.normal(size=(200, 3)),
        np.eye(3),
        -np.eye(3),
        [[1, 1, 1], [1e-300, 0, 1e-290], [1e300, 1e299, -1e300]],
    ]
)


def assert_right_handed(basis):
    np.testing.assert_allclose(
        np.swapaxes(basis, -1, -2) @ basis,
        np.broadcast_to(np.eye(3), basis.shape),
        rtol=0,
        atol=8 * EPS,
    )
    np.testing.assert_allclose(np.linalg.det(basis), 1.0, rtol=0, atol=16 * EPS)


def test_a_basis_from_one_vector_is_right_handed_with_it_last():
    basis = linear.basis_from_vector(VECTORS)
    assert_right_handed(basis)
    np.testing.assert_allclose(basis[..., 2], linear.unit(VECTORS), rtol=0, atol=EPS)


@pytest.mark.parametrize("nearness", [1.0, 1e-6, 1e-12])
def test_a_basis_from_two_vectors_keeps_t_on_the_side_of_v(nearness):
    w = linear.unit(RNG.normal(size=(100, 3)))
    t = w + nearness * RNG.normal(size=(100, 3))
    basis = linear.basis_from_vectors(w, t)
    assert_right_handed(basis)
    u, v = basis[..., 0], basis[..., 1]
    assert np.all(linear.dot(t, v) > 0)
    # t has no part along u, up to the rounding of t itself beside its part off w.
    assert np.max(np.abs(linear.dot(t, u))) <= 8 * EPS * np.max(linear.length(t))


@pytest.mark.parametrize("bad", [[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [np.inf, 0.0, 0.0]])
def test_no_basis_from_nothing(bad):
    with pytest.raises(ValueError, match="non-zero, finite"):
        linear.basis_from_vector(bad)
    with pytest.raises(ValueError, match="non-zero, finite"):
        linear.basis_from_vectors([0.0, 0.0, 1.0], bad)


def test_no_basis_from_parallel_vectors():
    w = np.array([0.3, -0.4, 0.8])
    with pytest.raises(ValueError, match="parallel"):
        linear.basis_from_vectors(w, -3 * w)


def test_gram_schmidt_stays_orthogonal_where_one_pass_fails():
    e = 1e-8  # Läuchli's matrix: a single pass leaves columns 2 and 3 at 60°
    lauchli = np.array([[1, 1, 1], [e, 0, 0], [0, e, 0], [0, 0, e]], np.float64)
    basis = linear.gram_schmidt(lauchli)
    np.testing.assert_allclose(basis.T @ basis, np.eye(3), rtol=0, atol=8 * EPS)


@pytest.mark.parametrize(
    "columns", [np.ones((3, 2)), np.zeros((3, 1)), RNG.normal(size=(2, 3)), [[1, np.nan], [0, 1]]]
)
def test_gram_schmidt_names_the_dependent_column(columns):
    with pytest.raises(ValueError, match=r"column . depends"):
        linear.gram_schmidt(columns)


def test_the_rigid_inverse_undoes_frames_of_any_stack():
    frames = linear.canonical_from_frame(
        1e3 * RNG.normal(size=(200, 3)), linear.basis_from_vector(VECTORS[:200])
    )
    product = linear.rigid_inverse(frames) @ frames
    np.testing.assert_allclose(
        product, np.broadcast_to(np.eye(4), product.shape), rtol=0, atol=16 * EPS * 4e3
    )


def test_one_basis_serves_many_origins_and_one_origin_many_bases():
    bases, origins = linear.basis_from_vector(VECTORS[:5]), RNG.normal(size=(4, 5, 3))
    one_basis = linear.canonical_from_frame(origins, bases[0])
    assert one_basis.shape == (4, 5, 4, 4)
    np.testing.assert_array_equal(
        one_basis[2, 3], linear.canonical_from_frame(origins[2, 3], bases[0])
    )
    one_origin = linear.canonical_from_frame(origins[0, 0], bases)
    assert one_origin.shape == (5, 4, 4)
    np.testing.assert_array_equal(
        one_origin[3], linear.canonical_from_frame(origins[0, 0], bases[3])
    )
