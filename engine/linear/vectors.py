"""Products of vectors and linear interpolation (notes, sections 2.1-2.3 and 2.6)."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def dot(a: Array, b: Array) -> Array:
    """(..., n) · (..., n) -> (...): a·b = |a||b| cos φ (section 2.2)."""
    return np.einsum("...i,...i->...", np.asarray(a, np.float64), np.asarray(b, np.float64))


def cross(a: Array, b: Array) -> Array:
    """(..., 3) × (..., 3) -> (..., 3): |a||b| sin φ along the right-handed perpendicular (section
    2.3).
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    ax, ay, az, bx, by, bz = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], -1)


def determinant(a: Array) -> Array:
    """(..., 3, 3) -> (...): a_x · (a_y × a_z) of the columns, the volume that they span (section
    2.3).
    """
    a = np.asarray(a, np.float64)
    return dot(a[..., 0], cross(a[..., 1], a[..., 2]))


def power_of_two(magnitude: Array) -> Array:
    """(...) -> (...): the power of two s with 1 <= magnitude / s < 2, so that dividing by it is
    exact; 1 for 0, infinities and NaN.
    """
    magnitude = np.asarray(magnitude, np.float64)
    sound = (magnitude > 0) & np.isfinite(magnitude)
    _, exponent = np.frexp(np.where(sound, magnitude, 1.0))
    return np.ldexp(1.0, exponent - 1)


def length(a: Array) -> Array:
    """(..., n) -> (...): Euclidean length, without overflow or underflow on the way."""
    a = np.asarray(a, np.float64)
    step = power_of_two(np.max(np.abs(a), -1, initial=0.0))
    scaled = a / step[..., None]
    return np.sqrt(dot(scaled, scaled)) * step


def unit(a: Array) -> Array:
    """(..., n) -> (..., n): a / |a| at any scale; the zero vector stays zero, non-finite components
    give NaN.
    """
    a = np.asarray(a, np.float64)
    scaled = a / power_of_two(np.max(np.abs(a), -1, initial=0.0))[..., None]
    size = np.sqrt(dot(scaled, scaled))[..., None]
    with np.errstate(invalid="ignore"):
        return scaled / np.where(size == 0, 1.0, size)


def angle_between(a: Array, b: Array) -> Array:
    """(..., n), (..., n) -> (...): φ in [0, π] of section 2.2.

    Kahan's 2 atan2(|â - b̂|, |â + b̂|) keeps full relative precision near 0 and π, where the arc
    cosine of a·b loses half the digits.
    """
    a, b = unit(a), unit(b)
    return 2 * np.arctan2(length(a - b), length(a + b))


def projected_length(a: Array, b: Array) -> Array:
    """(..., n), (..., n) -> (...): signed length |a| cos φ = a·b / |b| of the projection **of a
    onto b** (section 2.2, erratum).
    """
    return dot(a, unit(b))


def project(a: Array, b: Array) -> Array:
    """(..., n), (..., n) -> (..., n): the vector projection of a onto b; zero when b is."""
    return projected_length(a, b)[..., None] * unit(b)


def lerp(x: Array, x0: float, x1: float, y0: Array, y1: Array) -> Array:
    """Linear interpolation through (x0, y0) and (x1, y1) (section 2.6); exact at both ends,
    extrapolates outside. x0 and x1 must differ.
    """
    share = (np.asarray(x, np.float64) - x0) / (x1 - x0)
    return (1 - share) * np.asarray(y0, np.float64) + share * np.asarray(y1, np.float64)


def piecewise_linear(x: Array, knots: Array, values: Array) -> Array:
    """The function through (knots[k], values[k]), straight between neighbours and constant beyond
    the ends (section 2.6).

    x: (...).  knots: (k,) strictly increasing.  values: (k,) or (k, c).  Returns (...) or (..., c).
    Raises ValueError for other knots.
    """
    x, knots, values = (np.asarray(v, np.float64) for v in (x, knots, values))
    if (
        knots.ndim != 1
        or len(knots) != len(values)
        or not np.all(np.diff(knots) > 0)
        or len(knots) == 0
    ):
        raise ValueError("knots must be strictly increasing, with one value each")
    if len(knots) == 1:
        return np.broadcast_to(values[0], x.shape + values.shape[1:]).copy()
    left = np.clip(np.searchsorted(knots, x, "right") - 1, 0, len(knots) - 2)
    share = np.clip((x - knots[left]) / (knots[left + 1] - knots[left]), 0.0, 1.0)
    share = share.reshape(share.shape + (1,) * (values.ndim - 1))
    return (1 - share) * values[left] + share * values[left + 1]
