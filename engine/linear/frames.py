"""Orthonormal bases and coordinate frames (notes, sections 2.4, 2.5, 6.6). The columns of a basis
are its vectors u, v, w.
"""

from __future__ import annotations

import numpy as np

from .vectors import Array, cross, dot, length, unit

_EPSILON = np.finfo(np.float64).eps


def coordinates_in(basis: Array, vectors: Array) -> Array:
    """(..., n, n) orthonormal basis, (..., n) vectors -> (..., n): the coordinates <q, b> of
    section 2.4; Σ <q, b> q gives b back.
    """
    return np.einsum(
        "...ij,...i->...j", np.asarray(basis, np.float64), np.asarray(vectors, np.float64)
    )


def gram_schmidt(columns: Array) -> Array:
    """(m, n) -> (m, n): orthonormal columns that span what the given ones span, one by one (section
    2.5).

    Each column is cleared of the earlier ones twice, which keeps the result orthogonal to rounding
    for any independent input (Giraud, Langou, Rozloznik 2005). Raises ValueError when a column
    depends on the earlier ones to working precision.
    """
    columns = np.asarray(columns, np.float64)
    basis = np.zeros_like(columns)
    for k in range(columns.shape[1]):
        vector = unit(columns[:, k])
        for _ in range(2):
            vector = vector - basis[:, :k] @ (basis[:, :k].T @ vector)
        if not length(vector) > _EPSILON * columns.shape[0]:
            raise ValueError(f"column {k} depends on the columns before it")
        basis[:, k] = unit(vector)
    return basis


def basis_from_vector(w: Array) -> Array:
    """(..., 3) non-zero -> (..., 3, 3): a right-handed orthonormal basis whose third vector is w /
    |w| (section 2.5).

    The smallest component of w decides which axis is safely away from it. Raises ValueError for a
    zero or non-finite vector.
    """
    w = _direction(w, "w")
    away = np.zeros_like(w)
    np.put_along_axis(away, np.argmin(np.abs(w), -1)[..., None], 1.0, -1)
    return _right_handed(away, w)


def basis_from_vectors(w: Array, t: Array) -> Array:
    """(..., 3), (..., 3) -> (..., 3, 3): third vector w / |w|, second in the plane of w and t, on
    t's side (section 2.5).

    Raises ValueError when w or t is zero or non-finite or both are parallel to working precision.
    """
    w, t = _direction(w, "w"), _direction(t, "t")
    if not np.all(length(cross(t, w)) > 4 * _EPSILON):
        raise ValueError("t is parallel to w: choose another t")
    return _right_handed(t, w)


def _right_handed(t: Array, w: Array) -> Array:
    u = unit(cross(t, w))
    # A second pass clears what rounding left of w in u when t is nearly parallel to w.
    u = unit(u - dot(u, w)[..., None] * w)
    return np.stack([u, cross(w, u), w], -1)


def _direction(vector: Array, name: str) -> Array:
    vector = unit(vector)
    if not np.all(dot(vector, vector) > 0.5):
        raise ValueError(f"{name} must be a non-zero, finite vector")
    return vector


def canonical_from_frame(origin: Array, basis: Array) -> Array:
    """(..., n), (..., n, n) -> (..., n + 1, n + 1): the frame-to-canonical matrix of section 6.6;
    the last row is (0, ..., 0, 1).
    """
    origin, basis = np.asarray(origin, np.float64), np.asarray(basis, np.float64)
    n = basis.shape[-1]
    matrix = np.zeros((*np.broadcast_shapes(origin.shape[:-1], basis.shape[:-2]), n + 1, n + 1))
    matrix[..., :n, :n] = basis
    matrix[..., :n, n] = origin
    matrix[..., n, n] = 1.0
    return matrix


def rigid_inverse(canonical_from_frame_matrix: Array) -> Array:
    """(..., n + 1, n + 1) -> the same: the inverse of a frame with an orthonormal basis, by its
    transpose (sections 6.5, 6.6, 7.5).

    Exact up to the rounding of one product; wrong for bases that are not orthonormal (use `inverse`
    there).
    """
    matrix = np.asarray(canonical_from_frame_matrix, np.float64)
    n = matrix.shape[-1] - 1
    transpose = np.swapaxes(matrix[..., :n, :n], -1, -2)
    return canonical_from_frame(
        -np.einsum("...ij,...j->...i", transpose, matrix[..., :n, n]), transpose
    )
