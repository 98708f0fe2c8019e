"""Linear, affine and windowing transformations (notes, sections 6.1-6.4) and what they do to
normals.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .frames import basis_from_vector, canonical_from_frame
from .vectors import Array, cross, dot, power_of_two, unit


def scale(*factors: float) -> Array:
    """(n, n) diagonal matrix of n factors (section 6.2)."""
    return np.diag(np.asarray(factors, np.float64))


def shear(axis: int, by: int, amount: float, n: int = 3) -> Array:
    """(n, n): adds amount × coordinate `by` to coordinate `axis` (section 6.1). The two must
    differ.
    """
    if axis == by:
        raise ValueError("a shear needs two different axes")
    matrix = np.eye(n)
    matrix[axis, by] = amount
    return matrix


def reflect(normal: Array) -> Array:
    """(n,) -> (n, n): reflection in the plane (line) through the origin with that normal, I - 2 n
    nᵀ / |n|² (section 6.1).
    """
    n = unit(normal)
    return np.eye(len(n)) - 2 * np.outer(n, n)


def rotate_2d(phi: float) -> Array:
    """(2, 2): counter-clockwise by phi (section 6.1)."""
    return rotate_z(phi)[:2, :2]


def rotate_x(phi: float) -> Array:
    """(3, 3): about x, right-handed (section 6.2)."""
    return _rotate_about(0, phi)


def rotate_y(phi: float) -> Array:
    """(3, 3): about y, right-handed (section 6.2)."""
    return _rotate_about(1, phi)


def rotate_z(phi: float) -> Array:
    """(3, 3): about z, right-handed (section 6.2)."""
    return _rotate_about(2, phi)


def _rotate_about(axis: int, phi: float) -> Array:
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = np.cos(phi)
    matrix[second, first] = np.sin(phi)
    matrix[first, second] = -matrix[second, first]
    return matrix


def rotate(axis: Array, phi: float) -> Array:
    """(3,) non-zero axis -> (3, 3): Rodrigues' cos φ I + (1 - cos φ) a aᵀ + sin φ [a]× (section
    6.2, arbitrary rotations).

    1 - cos φ is taken as 2 sin²(φ/2), which keeps small angles exact. Raises ValueError for a zero
    or non-finite axis.
    """
    a = basis_from_vector(axis)[:, 2]
    skew = cross(a, np.eye(3)).T
    return np.cos(phi) * np.eye(3) + 2 * np.sin(phi / 2) ** 2 * np.outer(a, a) + np.sin(phi) * skew


def rotate_by_frame(axis: Array, phi: float) -> Array:
    """The same rotation by a change of frame: to a basis whose w is the axis, about z there, and
    back (section 6.2).
    """
    basis = basis_from_vector(axis)
    return basis @ rotate_z(phi) @ basis.T


def translate(*offset: float) -> Array:
    """(n + 1, n + 1) homogeneous translation by n offsets (section 6.3)."""
    return canonical_from_frame(np.asarray(offset, np.float64), np.eye(len(offset)))


def affine(linear: Array, translation: Array) -> Array:
    """(..., n, n), (..., n) -> (..., n + 1, n + 1): the linear map, then the translation (section
    6.3).
    """
    return canonical_from_frame(translation, linear)


def homogeneous(matrix: Array) -> Array:
    """(..., 3, 4) placement of `engine.scene` -> (..., 4, 4)."""
    matrix = np.asarray(matrix, np.float64)
    return affine(matrix[..., :3], matrix[..., 3])


def transform_points(matrix: Array, points: Array) -> Array:
    """(..., n or n + 1, n + 1), (..., n) -> (..., n): homogeneous coordinate 1, divided by the last
    one where the matrix has that row (sections 6.3, 7.4). Points that a perspective sends to
    infinity come out non-finite.
    """
    matrix, points = np.asarray(matrix, np.float64), np.asarray(points, np.float64)
    n = points.shape[-1]
    moved = np.einsum("...ij,...j->...i", matrix[..., :n], points) + matrix[..., n]
    if moved.shape[-1] == n:
        return moved
    with np.errstate(divide="ignore", invalid="ignore"):
        return moved[..., :n] / moved[..., n:]


def transform_directions(matrix: Array, directions: Array) -> Array:
    """(..., n or n + 1, n + 1), (..., n) -> (..., n): homogeneous coordinate 0, so translations
    leave directions alone (section 6.3).
    """
    matrix, directions = np.asarray(matrix, np.float64), np.asarray(directions, np.float64)
    n = directions.shape[-1]
    return np.einsum("...ij,...j->...i", matrix[..., :n, :n], directions)


def normal_matrix(matrix: Array) -> Array:
    """(..., 3, 3) M -> (..., 3, 3): the matrix that carries normals, as M⁻ᵀ does up to a positive
    factor (section 6.2).

    The cofactor matrix of M / 2^k with the sign of det M (0 counts as +): exists for flattened
    matrices too, where it gives the normal of the plane that is left, and neither overflows nor
    underflows with the size of M. Zero when M has rank 1 or 0.
    """
    matrix = np.asarray(matrix, np.float64)
    columns = matrix / power_of_two(np.max(np.abs(matrix), (-2, -1)))[..., None, None]
    a, b, c = columns[..., 0], columns[..., 1], columns[..., 2]
    cofactors = np.stack([cross(b, c), cross(c, a), cross(a, b)], -1)
    mirrored = dot(a, cofactors[..., 0]) < 0
    return np.where(mirrored[..., None, None], -cofactors, cofactors)


def transform_normals(matrix: Array, normals: Array) -> Array:
    """(..., 3, 3), (..., 3) -> (..., 3): unit normals of the transformed surface; zero where the
    surface collapses to a line.
    """
    return unit(
        np.einsum("...ij,...j->...i", normal_matrix(matrix), np.asarray(normals, np.float64))
    )


def window(low: ArrayLike, high: ArrayLike, new_low: ArrayLike, new_high: ArrayLike) -> Array:
    """(n,) each -> (n + 1, n + 1): takes the box [low, high] to [new_low, new_high], axis by axis
    (section 6.4, with its erratum).

    The product translate(new_low) · scale(...) · translate(-low), written out; no side of the box
    may have length 0.
    """
    a, b, new_a, new_b = (np.asarray(v, np.float64) for v in (low, high, new_low, new_high))
    side = b - a
    return affine(np.diag((new_b - new_a) / side), (new_a * b - new_b * a) / side)
