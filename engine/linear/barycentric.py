"""Barycentric coordinates of triangles (notes, section 2.7), in the plane and in space."""

from __future__ import annotations

import numpy as np

from .vectors import Array, cross, dot, length


def barycentric_by_solve(p: Array, a: Array, b: Array, c: Array) -> Array:
    """(..., n) each, n = 2 or 3 -> (..., 3): (α, β, γ) with p = α a + β b + γ c, from p - a = β (b
    - a) + γ (c - a) by Cramer's rule.

    In space the coordinate along which the triangle is seen at its smallest is dropped, which
    projects p onto the plane along that axis. A triangle without area gives non-finite coordinates.
    """
    p, a, b, c = _in_plane(*(np.asarray(v, np.float64) for v in (p, a, b, c)))
    ab, ac, ap = b - a, c - a, p - a
    with np.errstate(divide="ignore", invalid="ignore"):
        beta = _determinant(ap, ac) / _determinant(ab, ac)
        gamma = _determinant(ab, ap) / _determinant(ab, ac)
    return np.stack([1 - beta - gamma, beta, gamma], -1)


def barycentric_by_areas(p: Array, a: Array, b: Array, c: Array) -> Array:
    """As `barycentric_by_solve`, by the signed areas A_α / A, A_β / A, A_γ / A of the triangles
    that p makes with each edge.

    In space, areas count along the triangle's normal, which projects p at right angles onto the
    plane. Each coordinate has its own numerator, so a point on an edge line gets 0 to the rounding
    of that numerator alone.
    """
    p, a, b, c = np.broadcast_arrays(*(np.asarray(v, np.float64) for v in (p, a, b, c)))
    parts = [_signed_area(b - p, c - p), _signed_area(c - p, a - p), _signed_area(a - p, b - p)]
    whole = _signed_area(b - a, c - a)
    if p.shape[-1] == 3:
        parts, whole = [dot(part, whole) for part in parts], dot(whole, whole)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack(parts, -1) / whole[..., None]


def triangle_area(a: Array, b: Array, c: Array) -> Array:
    """(..., n) each -> (...): the area; signed in the plane (positive for counter-clockwise), never
    negative in space.
    """
    a, b, c = (np.asarray(v, np.float64) for v in (a, b, c))
    doubled = _signed_area(b - a, c - a)
    return (length(doubled) if a.shape[-1] == 3 else doubled) / 2


def interpolate(weights: Array, values: Array) -> Array:
    """(..., 3) barycentric coordinates, (..., 3, c) values at the vertices -> (..., c): smooth over
    the triangle, exact at its vertices.
    """
    return np.einsum(
        "...v,...vc->...c", np.asarray(weights, np.float64), np.asarray(values, np.float64)
    )


def is_inside(weights: Array, closed: bool = True) -> Array:
    """(..., 3) -> (...) bool. Closed counts edges and vertices; the notes' open test (4.8) leaves
    them out, and with them the rays that meet a shared edge. NaN is outside.
    """
    weights = np.asarray(weights)
    return np.all(weights >= 0 if closed else weights > 0, -1)


def _determinant(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _signed_area(a: Array, b: Array) -> Array:
    """Twice the area: a number in the plane, a vector along the normal in space."""
    return _determinant(a, b) if a.shape[-1] == 2 else cross(a, b)


def _in_plane(p: Array, a: Array, b: Array, c: Array) -> tuple[Array, ...]:
    """Drops the coordinate with the largest normal component; points of the plane pass through."""
    if a.shape[-1] == 2:
        return p, a, b, c
    p, a, b, c = np.broadcast_arrays(p, a, b, c)
    dropped = np.argmax(np.abs(cross(b - a, c - a)), -1)
    kept = np.stack([(dropped + 1) % 3, (dropped + 2) % 3], -1)
    return tuple(np.take_along_axis(v, kept, -1) for v in (p, a, b, c))
