"""Points of a rectangle, even over the solid angle that it fills from where it is seen (Ureña,
Fajardo, King 2013, "An Area-Preserving Parametrization for Spherical Rectangles"), with the angles
themselves where the core has turns.

Letters: x, y in the rectangle's plane from the foot of the point that sees it, z its distance from
that plane, b the solid angle to the left of x and between y0 and y1.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def rectangle_point(x: Array, y: Array, z: Array, u: float, v: float) -> tuple[Array, Array, Array]:
    """x, y of the point (u, v) of [0, 1]² and the solid angle in steradians, (n,) each. The
    rectangle's sides are at x (2, n) and y (2, n), the lower one first, and at the distance z (n,)
    > 0. Lengths of about 1 keep squares within range.
    """
    first, last = (_strip(edge, y, z) for edge in x)
    solid_angle = last - first
    across = _x_at(first + u * solid_angle, y, z).clip(*x)
    return across, _y_at(across, y, z, v).clip(*y), solid_angle


def _strip(x: Array, y: Array, z: Array) -> Array:
    """b at x: the angle between the corners at y0 and y1, in (-π, π)."""
    below, above = (z * np.sqrt(x * x + edge * edge + z * z) + 1j * x * edge for edge in y)
    return np.angle(above * below.conj())


def _x_at(b: Array, y: Array, z: Array) -> Array:
    """Where the solid angle is b. h is how high the rectangle seems, m twice the angle to its
    middle.
    """
    h, m = (
        np.arctan2(z * (y[1] - y[0]), z * z + y[0] * y[1]),
        np.arctan2(z * (y[1] + y[0]), z * z - y[0] * y[1]),
    )
    product = np.sin((h + b) / 2) * np.sin((h - b) / 2) * np.cos((m + b) / 2) * np.cos((m - b) / 2)
    return z * np.sin(b) / (2 * np.sqrt(np.maximum(product, 0)))


def _y_at(x: Array, y: Array, z: Array, v: float) -> Array:
    """Below which the share v of the light from x comes."""
    q2 = x * x + z * z
    low, high = y / np.sqrt(q2 + y * y)
    h = low + v * (high - low)
    return h * np.sqrt(q2 / ((1 - h) * (1 + h)))
