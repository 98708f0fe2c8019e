"""Which points of bounced light a table takes, and what these give for the others."""

from __future__ import annotations

import numpy as np

from ..sampling import chosen
from ..scene import Bounces

Array = np.ndarray

LARGEST = 1e100
ASIDE, HEIGHT = 16, 16.0
"""Taken points to each side of one along the curve, of which the nearest get its power, and how
many times as far off they count for what they lie above or below it.
"""
MOST_BRIGHTER = 2.0
"""Powers of two that a point which stands for itself gives more than one that stands for it: what
lies in the sun outside gives nothing to what is in a room.
"""


def taken_points(b: Bounces, count: int) -> Array:
    """Which `count` points are taken, in their order.

    Each point has a number of its own, and those are taken whose number over their weight is least
    (Duffield, Lund, Thorup 2007, Priority sampling): where an object moves, the points of walks
    that it does not meet stay.
    """
    if count >= len(b.weights):
        return chosen(b.weights, (np.arange(count) + 0.5) / count)[0]
    key = b.numbers / b.weights
    least = np.partition(key, count)[count]
    index = np.flatnonzero(key < least)
    if len(index) < count:
        ties = np.flatnonzero(key == least)
        index = np.sort(np.concatenate([index, ties[: count - len(index)]]))
    return index


def radiance_of(b: Bounces, index: Array) -> Array:
    """(n, 3) of the taken points index (n,): they give what all points together do. Each of these
    goes to the taken ones beside it, so that a part of a scene throws on what it gets however few
    points it has.
    """
    taken, place, times = np.unique(index, return_inverse=True, return_counts=True)
    power = b.radiance * (b.spreads * b.weights / b.weights.sum())[:, None]
    given = np.zeros((len(taken), 3))
    for nearest, share in zip(*_nearest_two(b, taken), strict=True):
        np.add.at(given, nearest, power * share[:, None])
    given *= (len(index) / (times * b.spreads[taken]))[:, None]
    return np.clip(given, -LARGEST, LARGEST)[place]


def _nearest_two(b: Bounces, taken: Array) -> tuple[Array, Array]:
    """(2, m) which of the taken points (n,), ascending, are nearest to each point, and (2, m) its
    shares for them, all for itself where it is taken (Franke, Nielson 1980). Both are of one light
    group, and end their walk or not, if any of those that face to the point's side are, and else
    to that side, if any do. Where all are much darker it has no shares.
    """
    side = facing(b) + 6 * b.caught
    of_group = side + 12 * b.light_group.astype(np.int64)
    which, shares = np.zeros((2, len(b.points)), np.intp), np.zeros((2, len(b.points)))
    left = np.arange(len(b.points))
    for kinds in (2 * of_group + b.last, of_group, side, np.zeros_like(side)):
        if not len(left):
            break
        at, share, found = _nearest_of_kind(b, kinds, left, taken)
        which[:, left], shares[:, left] = at, share
        left = left[~found]
    return which, shares


def _nearest_of_kind(
    b: Bounces, kinds: Array, points: Array, taken: Array
) -> tuple[Array, Array, Array]:
    """The same of some points (k,), of the ASIDE taken ones before and behind each along the curve
    that have its kind, and (k,) bool, which have any.
    """
    m, size = len(kinds), max(np.ptp(b.points, 0).max(), 1e-150)
    codes = kinds.astype(np.int64) * m + np.arange(m)
    among = np.argsort(codes[taken], kind="stable")
    x, n, to = b.points[points].T / size, b.normals[points].T, b.points[taken[among]].T / size
    of, own = kinds[taken[among]], kinds[points]
    first = np.searchsorted(codes[taken[among]], codes[points]) - ASIDE
    given = np.log2(np.maximum(np.abs(b.radiance).sum(1) * b.spreads, 1e-300))  # for itself
    bright, others = given[points], given[taken[among]]
    apart = np.full((3, len(points)), np.inf)
    which = np.zeros((3, len(points)), np.intp)
    for step in range(2 * ASIDE):
        at: Array = np.clip(first + step, 0, len(among) - 1)
        d = to[:, at] - x
        h = HEIGHT * (d[0] * n[0] + d[1] * n[1] + d[2] * n[2])
        square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + h * h
        other = (of[at] != own) | (bright - others[at] > MOST_BRIGHTER)
        square[other | (at != first + step)] = np.inf
        for k in range(3):
            closer = square < apart[k]
            apart[k], square = np.where(closer, [square, apart[k]], [apart[k], square])
            which[k], at = np.where(closer, [at, which[k]], [which[k], at])
    near, next_one, third = np.where(np.isfinite(apart[2]), apart, 0.0)
    shares = np.array([(third - near) * next_one, (third - next_one) * near])
    total = shares[0] + shares[1]
    shares[1] /= np.where(total > 0, total, 1.0)
    shares[0] = 1 - shares[1]
    return among[which[:2]], shares, np.isfinite(apart[0])


def facing(b: Bounces) -> Array:
    """(m,) int from 0 to 5: along which axis each point's normal lies most, and to which side."""
    axis: Array = np.abs(b.normals).argmax(1)
    return 2 * axis + (np.take_along_axis(b.normals, axis[:, None], 1)[:, 0] < 0)
