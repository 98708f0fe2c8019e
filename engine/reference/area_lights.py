"""Rectangles that points see large, and area lights that shine in a cone, as a soft box behind a
grid of slats does: the farther aside it is seen from, the more of it they hide (Blender's Spread).

Letters: h half of the angle, T its tangent.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..linear.columns import dot, length, pick, unit
from ..scene import Light
from .rectangle import rectangle_point

if TYPE_CHECKING:
    from .lights import LightSample, Source

Array = np.ndarray

NEAR = 4.0
"""Half diagonals of a rectangle within which it is seen large."""
_LEAST, _FULL = 1e-4, np.pi / 2 - 5e-5
"""Half angles: narrower ones count as the least, wider ones as no cone."""


def half_spread(light: Light) -> float | None:
    """h in radians; None for a light that shines all before it."""
    if light.kind != "AREA":
        return None
    half = max(min(light.spread, 2 * np.pi) / 2, _LEAST)
    return half if half < _FULL else None


def beyond(half: float) -> float:
    """T - h."""
    h2 = half * half
    if h2 < 0.01:
        return half * h2 / 3 * (1 + h2 * (2 / 5 + h2 * (17 / 105)))
    return float(np.tan(half) - half)


def between(half: float, direction: Array, axis: Array, physical: bool) -> Array:
    """(n,) what of the light's radiance leaves against the unit directions (3, n) to it: in all as
    much as without slats, or 1 along its axis (3, 1) where it is not physical.
    """
    z = -dot(direction, axis)
    tangent = length(direction + z * axis) / z
    even = beyond(half) if physical else np.tan(half)
    return np.maximum(np.tan(half) - tangent, 0.0) / even


def seen_rectangle(
    source: Source, x: Array, square: Array | None, n: int, even: LightSample
) -> LightSample:
    """`even`, the sample of n at the points x (3, k), but where the rectangle is seen large, or
    between slats only in part, its point `square` (2,) of [-1, 1]² is even over the solid angle
    that is seen. square: None for directions that are drawn.
    """
    light, to = source.light, source.position - x
    sides = np.array([light.size_x, light.size_y]) / 2
    size = np.hypot(*sides)
    right, up = unit(source.right), unit(source.up)
    along = np.array([dot(to, axis) / size for axis in (right, up)])
    high = -dot(to, source.axis) / size
    low, top = along - sides[:, None] / size, along + sides[:, None] / size
    seen = length(to) < NEAR * size
    if source.half_spread is not None:
        reach = np.tan(source.half_spread) * high
        seen |= ((low < -reach) | (top > reach)).any(0)
        low, top = np.maximum(low, -reach), np.minimum(top, reach)
    large = np.flatnonzero(seen & (high > 1e-30))
    if not len(large):
        return even
    some, k = (low < top).all(0)[large], high[large]
    edges = np.where(some, [low[:, large], top[:, large]], [[[0.0]], [[1.0]]])
    u, v = (0.5, 0.5) if square is None else (square + 1) / 2
    i, j, solid_angle = rectangle_point(edges[:, 0], edges[:, 1], k, u, v)
    direction, intensity, spread = even.direction.copy(), even.intensity.copy(), even.spread.copy()
    assert even.end is not None
    end = even.end if even.end.shape[1] > 1 else np.repeat(even.end, x.shape[1], 1)
    if square is not None:
        way = i * right + j * up - k * source.axis
        direction[:, large], end[:, large] = unit(way), pick(x, large) + size * way
        some &= light.shape == "RECTANGLE" or _on_ellipse(source, end[:, large])
    intensity[large] = np.where(some, solid_angle / (np.pi**2 * source.area * n), 0.0)
    spread[large] = solid_angle
    return replace(even, direction=direction, intensity=intensity, end=end, spread=spread)


def _on_ellipse(source: Source, q: Array) -> Array:
    a, b = (dot(q - source.position, side) / dot(side, side) for side in (source.right, source.up))
    return a * a + b * b <= 1
