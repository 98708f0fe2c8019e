"""Vectors in columns: an array (3, n) holds n vectors, component by component, which is the layout
NumPy is fastest on.

Every sum is written out, so that a vector's bits never depend on how many others lie beside it
(BLAS and `sum` promise no order).
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def dot(a: Array, b: Array) -> Array:
    """(3, n) · (3, n) -> (n,) (notes, section 2.2)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Array, b: Array) -> Array:
    """(3, n) × (3, n) -> (3, n), right-handed (section 2.3)."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def length(a: Array) -> Array:
    """(3, n) -> (n,) Euclidean length."""
    return np.sqrt(dot(a, a))


def unit(a: Array) -> Array:
    """(3, n) -> (3, n) a / |a|, at any scale; the zero vector stays zero."""
    largest = np.abs(a).max(0)
    scaled = a / np.where(largest > 0, largest, 1.0)
    size = length(scaled)
    return scaled / np.where(size > 0, size, 1.0)


def transform(matrix: Array, a: Array) -> Array:
    """Linear part of `matrix` (3, 3) or (3, 4) times (3, ...)."""
    m = matrix
    return np.stack([m[i, 0] * a[0] + m[i, 1] * a[1] + m[i, 2] * a[2] for i in range(3)])


def transform_each(matrices: Array, a: Array) -> Array:
    """A matrix (n, 3, 3+) for each vector of (3, n)."""
    m = matrices
    return np.stack([m[:, i, 0] * a[0] + m[:, i, 1] * a[1] + m[:, i, 2] * a[2] for i in range(3)])


def pick(a: Array, index: Array) -> Array:
    """The columns `index` of (3, n); unlike a[:, index] its rows are contiguous, which is several
    times faster, now and later.
    """
    return a.take(index, 1)


def add_at(total: Array, index: Array, values: Array) -> None:
    """total[:, index] += values, row by row; no index twice."""
    for row, value in zip(total, np.broadcast_to(values, (len(total), len(index))), strict=True):
        row[index] += value


def around(n: Array, point: Array) -> Array:
    """(3, k) the unit vectors over a point (2,), or points (2, k), of the discs below the unit
    vectors n (3, k): as densely as their cosine for points even over the disc (Malley's method).
    """
    x, y = point
    first, second = basis_around(n)
    return np.sqrt(np.maximum(1 - x * x - y * y, 0.0)) * n + x * first + y * second


def basis_around(n: Array) -> tuple[Array, Array]:
    """Two unit vectors (3, k) that make a right-handed frame with the unit vectors n (Duff et al.
    2017, section 2.5 of the notes).
    """
    sign = np.copysign(1.0, n[2])
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    first = np.stack([1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]])
    second = np.stack([b, sign + n[1] * n[1] * a, -n[1]])
    return first, second


def explode(counts: Array) -> tuple[Array, Array]:
    """Row numbers and places within the row of a ragged table with `counts` (n,) entries in its
    rows.
    """
    row = np.repeat(np.arange(len(counts)), counts)
    ends = np.cumsum(counts)
    place = np.arange(len(row)) - np.repeat(ends - counts, counts)
    return row, place


def ragged_blocks(counts: Array, most: int) -> list[tuple[int, int]]:
    """Row ranges of a ragged table, each of at most `most` entries or a single row."""
    ends = np.cumsum(counts)
    blocks, start = [], 0
    while start < len(counts):
        before = ends[start - 1] if start else 0
        stop = max(int(np.searchsorted(ends, before + most, "right")), start + 1)
        blocks.append((start, stop))
        start = stop
    return blocks


_AXIS = np.array([[1.0], [2.0], [3.0]])
"""Round it the directions of neighbours that face along it turn fast."""


def across_normals(n: Array) -> tuple[Array, Array]:
    """Two unit vectors (3, n) each across the unit vectors n."""
    first = cross(_AXIS + 0 * n, n)
    other = cross(np.array([[1.0], [0.0], [0.0]]) + 0 * n, n)
    t = unit(np.where(first.any(0), first, other))
    return t, cross(n, t)
