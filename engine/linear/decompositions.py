"""Eigenvalues, singular values and the inverse through them (notes, sections 5.1-5.3, 6.5), by
Jacobi rotations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .vectors import Array, dot, length, power_of_two, unit

_EPSILON = np.finfo(np.float64).eps
_MAX_SWEEPS = 60
"""Far beyond what convergence takes (5-8 sweeps, a few more for columns of very different sizes).
"""


def symmetric_eigen(matrix: Array) -> tuple[Array, Array]:
    """(..., n, n) symmetric A -> eigenvalues (..., n), ascending, and Q (..., n, n) with A = Q D
    Qᵀ, QᵀQ = I (section 5.2).

    Cyclic Jacobi (Golub, Van Loan, section 8.5). Only the upper triangle counts. Meant for small n:
    a sweep takes n(n - 1)/2 rotations.
    """
    upper = np.triu(np.asarray(matrix, np.float64))
    step = power_of_two(np.max(np.abs(upper), (-2, -1)))
    a = (upper + np.swapaxes(np.triu(upper, 1), -1, -2)) / step[..., None, None]
    n = a.shape[-1]
    q = np.broadcast_to(np.eye(n), a.shape).copy()
    for _ in range(_MAX_SWEEPS):
        if not np.any(_off_diagonal(a) > 0):
            break
        for i, j in zip(*np.triu_indices(n, 1), strict=True):
            _rotate_symmetric(a, q, i, j)
    values = np.diagonal(a, axis1=-2, axis2=-1) * step[..., None]
    order = np.argsort(values, -1, kind="stable")
    return np.take_along_axis(values, order, -1), np.take_along_axis(q, order[..., None, :], -1)


def _off_diagonal(a: Array) -> Array:
    """(..., n, n) -> (...): the largest entry off the diagonal that rounding does not already hide
    beside the diagonal.
    """
    largest = np.max(np.abs(np.triu(a, 1)), (-2, -1), initial=0.0)
    diagonal = np.max(np.abs(np.diagonal(a, axis1=-2, axis2=-1)), -1, initial=0.0)
    return np.where(largest > _EPSILON / 16 * diagonal, largest, 0.0)


def _rotate_symmetric(a: Array, q: Array, i: int, j: int) -> None:
    """Clears a[i, j] by a rotation in the plane of i and j, in place, and gathers it in q."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        cotangent = (a[..., j, j] - a[..., i, i]) / (2 * a[..., i, j])
    c, s = _rotation(np.where(a[..., i, j] == 0, np.inf, cotangent))
    _mix_columns(a, i, j, c, s)
    _mix_columns(np.swapaxes(a, -1, -2), i, j, c, s)
    _mix_columns(q, i, j, c, s)
    a[..., i, j] = a[..., j, i] = 0.0


def _rotation(cotangent: Array) -> tuple[Array, Array]:
    """cot 2θ -> cos θ, sin θ for the smaller of the two angles; an infinite one means no
    rotation.
    """
    tangent = np.where(cotangent < 0, -1.0, 1.0) / (np.abs(cotangent) + np.hypot(1.0, cotangent))
    c = 1 / np.hypot(1.0, tangent)
    return c, c * tangent


def _mix_columns(a: Array, i: int, j: int, c: Array, s: Array) -> None:
    c, s = c[..., None], s[..., None]
    first, second = a[..., i].copy(), a[..., j].copy()
    a[..., i] = c * first - s * second
    a[..., j] = s * first + c * second


def svd(matrix: Array) -> tuple[Array, Array, Array]:
    """(..., m, n) A -> U (..., m, k), S (..., k), V (..., n, k), k = min(m, n), with A = U diag(S)
    Vᵀ, S descending (section 5.3).

    UᵀU = VᵀV = I also for matrices without full rank. One-sided Jacobi on A itself (Hestenes 1958):
    the eigenvalues of AAᵀ, as the notes have it, would square the condition number. Singular values
    are accurate relative to themselves when A is well-conditioned up to a scaling of its columns
    (Demmel, Veselic 1992), as placements by rotation × scale are. Raises ValueError for non-finite
    input.
    """
    matrix = np.asarray(matrix, np.float64)
    if not np.all(np.isfinite(matrix)):
        raise ValueError("the matrix has a value that is not finite")
    if matrix.shape[-2] < matrix.shape[-1]:
        v, values, u = svd(np.swapaxes(matrix, -1, -2))
        return u, values, v
    step = power_of_two(np.max(np.abs(matrix), (-2, -1)))
    columns, v = _orthogonal_columns(matrix / step[..., None, None])
    values = length(np.swapaxes(columns, -1, -2))
    order = np.argsort(-values, -1, kind="stable")
    columns, v = (np.take_along_axis(x, order[..., None, :], -1) for x in (columns, v))
    values = np.take_along_axis(values, order, -1)
    return _completed(columns, values), values * step[..., None], v


def _orthogonal_columns(a: Array) -> tuple[Array, Array]:
    """(..., m, n) A -> A V with orthogonal columns, and V. The largest columns come first, which
    speeds convergence up.
    """
    order = np.argsort(-length(np.swapaxes(a, -1, -2)), -1, kind="stable")[..., None, :]
    n = a.shape[-1]
    a = np.take_along_axis(a, order, -1)
    v = np.take_along_axis(np.broadcast_to(np.eye(n), (*a.shape[:-2], n, n)), order, -1)
    for _ in range(_MAX_SWEEPS):
        turned = [_orthogonalise(a, v, i, j) for i, j in zip(*np.triu_indices(n, 1), strict=True)]
        if not any(turned):
            break
    return a, v


def _orthogonalise(a: Array, v: Array, i: int, j: int) -> bool:
    """Makes columns i and j of a orthogonal, in place, and gathers the rotation in v. True when
    some pair was not yet so.

    Works on unit columns and the ratio of their lengths, so that no square underflows.
    """
    size_i, size_j = length(a[..., i]), length(a[..., j])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        cosine = dot(a[..., i] / size_i[..., None], a[..., j] / size_j[..., None])
        ratio = size_j / size_i
        cotangent = (ratio - 1 / ratio) / (2 * cosine)
    skew = (np.abs(cosine) > _EPSILON * a.shape[-2]) & (size_i > 0) & (size_j > 0)
    c, s = _rotation(np.where(skew, cotangent, np.inf))
    _mix_columns(a, i, j, c, s)
    _mix_columns(v, i, j, c, s)
    return bool(np.any(skew))


def _completed(columns: Array, values: Array) -> Array:
    """Unit columns; those of length 0 become unit vectors perpendicular to all before them."""
    u = np.swapaxes(unit(np.swapaxes(columns, -1, -2)), -1, -2)
    if np.all(values > 0):
        return u
    m = u.shape[-2]
    for k in range(u.shape[-1]):
        earlier = u[..., :k]
        complement = np.eye(m) - earlier @ np.swapaxes(earlier, -1, -2)
        best = np.argmax(dot(np.swapaxes(complement, -1, -2), np.swapaxes(complement, -1, -2)), -1)
        spare = np.take_along_axis(complement, best[..., None, None], -1)
        spare = unit((complement @ spare)[..., 0])
        u[..., k] = np.where(values[..., k, None] > 0, u[..., k], spare)
    return u


class Inverse(NamedTuple):
    """An inverse and how far to trust it.

    matrix: (..., n, m).  rank: (...) int, how many singular values counted.  condition: (...),
    largest over smallest singular value, infinite for a singular matrix; results lose about
    log10(condition) digits.
    """

    matrix: Array
    rank: Array
    condition: Array


def pseudo_inverse(matrix: Array, tolerance: float | None = None) -> Inverse:
    """(..., m, n) -> the Moore-Penrose inverse V S⁺ Uᵀ (sections 5.3 and 6.5): the inverse where
    there is one.

    Singular values up to tolerance × the largest count as 0; the default max(m, n) · 2⁻⁵² is what
    rounding of the matrix's own entries can hide; 0 takes every entry at its word. A flattened
    matrix gets the inverse within the plane that is left.
    """
    matrix = np.asarray(matrix, np.float64)
    least = max(matrix.shape[-2:]) * _EPSILON if tolerance is None else tolerance
    u, values, v = svd(matrix)
    counted = values > least * values[..., :1]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        reciprocal = np.where(counted, 1 / values, 0.0)
        condition = np.where(values[..., -1] > 0, values[..., 0] / values[..., -1], np.inf)
    return Inverse(
        (v * reciprocal[..., None, :]) @ np.swapaxes(u, -1, -2), np.sum(counted, -1), condition
    )


def inverse(matrix: Array) -> Array:
    """(..., n, n) -> (..., n, n): V S⁻¹ Uᵀ (section 6.5), after exact scaling of the columns to
    sizes in [1, 2).

    So rotation × scale is inverted to rounding whatever the scales. Raises ValueError for a matrix
    that is singular to working precision for every scaling of its columns.
    """
    matrix = np.asarray(matrix, np.float64)
    sizes = power_of_two(length(np.swapaxes(matrix, -1, -2)))
    result = pseudo_inverse(matrix / sizes[..., None, :])
    if np.any(result.rank < matrix.shape[-1]):
        raise ValueError("the matrix is singular: use pseudo_inverse")
    return result.matrix / sizes[..., :, None]


def affine_inverse(matrix: Array, tolerance: float | None = None) -> Inverse:
    """(..., 3, 4) target_from_source -> source_from_target (..., 3, 4) with the rank and condition
    of the linear part.

    For a flattened placement the points of the plane that is left go back exactly; others drop onto
    it first.
    """
    matrix = np.asarray(matrix, np.float64)
    linear = pseudo_inverse(matrix[..., :3], tolerance)
    translation = -np.einsum("...ij,...j->...i", linear.matrix, matrix[..., 3])
    return Inverse(
        np.concatenate([linear.matrix, translation[..., None]], -1), linear.rank, linear.condition
    )
