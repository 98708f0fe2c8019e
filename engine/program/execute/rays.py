"""Operations that ask the scene for rays; the first argument is `Points`. Where these know no
scene, or rays to lights meet them, nothing is there.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...linear.columns import across_normals, dot, length, unit

Array = np.ndarray
_FARTHEST = 1e30
"""Where rays start that lead anywhere."""
_SHARES = np.array([[0.5], [0.25], [0.25]])
"""Of the rays of a bevel along each axis."""


class Asked(NamedTuple):
    """Rays: starts and unit directions (3, m), relative to the eye, and how far (m,); none is
    traced where that is not above 0.
    """

    start: Array
    direction: Array
    reach: Array


class Met(NamedTuple):
    """Hits: of which rays (k,), how far away (k,), and the surfaces, seen along the rays."""

    ray: Array
    depth: Array
    surface: Any


def _queries(points):
    """How the points ask; None where they do not."""
    return getattr(points, "queries", None)


def _finite(vector: Array) -> Array:
    return np.where(np.isfinite(vector), vector, 0.0)


def ambient_occlusion(
    points,
    distance: Array,
    normal: Array,
    *,
    samples: int,
    inside: int,
    only_local: int,
    of_world: int,
) -> Array:
    """(n,) the share of the directions in which nothing is near."""
    queries = _queries(points)
    if queries is None:
        return np.ones(normal.shape[1])
    n = unit(_finite(normal)) * (-1.0 if inside else 1.0)
    reach = np.full(n.shape[1], queries.reach) if of_world else distance
    reach = np.where(n.any(0) & (reach > 0), reach, 0.0)
    across, upward = across_normals(n)
    hidden = np.zeros(n.shape[1])
    for x, y in queries.rows(samples)[:, :2]:
        direction = x * across + y * upward + _height(x, y) * n
        asked = Asked(points.beside(direction), direction, reach)
        hidden += points.blocked(asked, "own" if only_local else "shadow")
    return 1 - hidden / samples


def _height(x: float, y: float) -> float:
    """Of the unit half ball over a point of the disc."""
    return float(np.sqrt(max(0.0, 1 - x * x - y * y)))


def bevel(points, radius: Array, *, samples: int) -> Array:
    """(3, n) unit."""
    queries = _queries(points)
    if queries is None:
        return points.normal()
    radius = np.where(np.isfinite(radius) & (radius > 0), radius, 0.0)
    g, x = points.face_normal(), points.relative(points.position(0))
    axes = np.stack([g, *across_normals(g)])
    total = np.zeros_like(g)
    for row in queries.rows(samples):
        (a, b), axis = row[2:4], int(row[4])
        height = _height(a, b)
        w, u, v = (axes[(axis + k) % 3] for k in range(3))
        start = x + radius * (a * u + b * v + height * w)
        met = points.crossings(Asked(start, -w, 2 * height * radius))
        weight = _weights(met, axes, axis, x, radius, 1 - float(np.hypot(a, b)))
        np.add.at(total.T, met.ray, (weight * met.surface.n).T)
    outward = unit(total)
    found = outward * (1 - 2 * points.backfacing())
    return np.where(outward.any(0), found, points.normal())


def _weights(met, axes: Array, axis: int, x: Array, radius: Array, off: float) -> Array:
    """(k,) of the outward normals that rays along an axis meet: (1 - r / radius)³ over how dense
    the rays are there, and the power heuristic of the three axes. off: 1 less how far across the
    axis they are, in radii.
    """
    hit = met.surface
    density = _SHARES * np.abs((axes[:, :, met.ray] * hit.g).sum(1))
    near = 1 - length(hit.x - x[:, met.ray]) / radius[met.ray]
    sum_of_squares = (density**2).sum(0)
    side = np.where(hit.outside, 1.0, -1.0)
    good = (near > 0) & (off > 0) & (sum_of_squares > 0)
    return np.where(good, side * density[axis] / sum_of_squares * (near / off) ** 3, 0.0)


def raycast(
    points, position: Array, direction: Array, distance: Array, *, only_local: int, from_point: int
) -> tuple[Array, ...]:
    """Hit, own, distance, position, normal."""
    n = len(distance)
    hit, own, far = np.zeros(n), np.zeros(n), np.array(distance, np.float64)
    place, normal = np.zeros((2, 3, n))
    if _queries(points) is None:
        return hit, own, far, place, normal
    d, size = unit(_finite(direction)), length(_finite(direction))
    met = _end(points, position, direction, distance, only_local, from_point)
    from_origin = met.surface.x - points.relative(position)[:, met.ray]
    hit[met.ray] = 1.0
    own[met.ray] = points.is_own(met.ray, met.surface)
    far[met.ray] = dot(from_origin, d[:, met.ray]) / size[met.ray]
    place[:, met.ray] = points.in_world(met.surface.x)
    normal[:, met.ray] = met.surface.n
    return hit, own, far, place, normal


def raycast_attribute(
    points,
    position: Array,
    direction: Array,
    distance: Array,
    *,
    only_local: int,
    from_point: int,
    attribute: str,
) -> tuple[Array, Array]:
    """Channels (3, n) and alpha (n,)."""
    found = np.zeros((4, len(distance)))
    if _queries(points) is not None:
        met = _end(points, position, direction, distance, only_local, from_point)
        found[:, met.ray] = points.attribute_on(met.surface, attribute)
    return found[:3], found[3]


def _end(
    points, position: Array, direction: Array, distance: Array, only_local: int, from_point: int
) -> Met:
    """What the rays meet."""
    along = _finite(direction)
    d, size = unit(along), length(along)
    start = points.beside(d) if from_point else points.relative(position)
    reach = size * distance
    sound = d.any(0) & (size > 0) & (np.abs(start).max(0) < _FARTHEST)
    reach = np.where(sound & (reach > 0), reach, 0.0)
    return points.nearest(Asked(start, d, reach), "own" if only_local else "any")
