"""Which triangles bound bodies without holes: from outside nobody sees the inner sides of these."""

from __future__ import annotations

import numpy as np

Array = np.ndarray

MOST = 1 << 14
"""Triangles of which this is found out: a sorting of their edges."""


def closed_bodies(corners: Array) -> tuple[Array, Array]:
    """Of triangles (n, 3, 3): (n,) 1 where they are of a body whose every edge two triangles share
    and are counter-clockwise from outside, -1 where they are clockwise from there, 0 of all others;
    and (n,) the least side of the box round the body. Corners are the same where they are equal.
    """
    if not 4 <= len(corners) <= MOST:
        return np.zeros(len(corners)), np.zeros(len(corners))
    points, triangles = _numbered(corners.reshape(-1, 3))
    triangles = triangles.reshape(-1, 3)
    body = _connected(triangles, len(points))[triangles[:, 0]]
    count = len(points)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    for corner in range(3):
        np.minimum.at(low, body, corners[:, corner])
        np.maximum.at(high, body, corners[:, corner])
    first = points[body]
    a, b, c = (corners[:, k] - first for k in range(3))
    volume = np.bincount(body, (a * np.cross(b, c)).sum(1), count)
    holes = np.bincount(body, ~_is_paired(triangles), count)
    sign = np.where(holes[body] == 0, np.sign(volume[body]), 0.0)
    return sign, (high - low)[body].min(1)


def _numbered(points: Array) -> tuple[Array, Array]:
    """Those of points (n, 3) that differ, and which each is, (n,)."""
    order = np.lexsort(points.T)
    new = np.append(True, (np.diff(points[order], axis=0) != 0).any(1))
    number = np.empty(len(points), np.intp)
    number[order] = np.cumsum(new) - 1
    return points[order[new]], number


def _connected(triangles: Array, count: int) -> Array:
    """(count,) the least of the points that each is connected with."""
    least = np.arange(count)
    while True:
        before = least
        least = before.copy()
        lowest = before[triangles].min(1)
        for corner in range(3):
            np.minimum.at(least, triangles[:, corner], lowest)
        least = least[least]
        if (least == before).all():
            return least


def _is_paired(triangles: Array) -> Array:
    """(n,) bool: each edge is one of exactly one other triangle, which goes along it the other
    way.
    """
    start, end = triangles, np.roll(triangles, -1, 1)
    codes = start * (triangles.max() + 1) + end
    turned = end * (triangles.max() + 1) + start
    found, counts = np.unique(codes, return_counts=True)
    place = np.minimum(np.searchsorted(found, turned), len(found) - 1)
    alone = counts[np.searchsorted(found, codes)] == 1
    return (alone & (found[place] == turned) & (counts[place] == 1)).all(1)
