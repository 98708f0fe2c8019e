"""Smooth curves in segments.

A smooth curve goes through its keys as a Catmull-Rom spline, in Cycles as here; it becomes as many
segments as keep it within `NEAR` of its radius of the spline and turn no more than `TURN` each.
Where two meet they lie a little outside of the bend, so that it has the spline's place in the mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

NEAR = 0.05
"""How far a chord of the spline may be from it, of the radius; segments are at most two thirds as
far, on both sides."""
TURN = 0.25
"""How much a segment may turn from the one before it, radians, about."""
MOST = 16
"""Segments between two keys."""
_BLOCK = 1 << 17
"""Pairs of keys that are made smooth in one go."""


@dataclass(frozen=True, eq=False)
class Keys:
    """What curves are given by. positions (k, 3) float32, radii (k,) float32 of all keys in the
    order of the curves; offsets (c + 1,) of the first key of each; slots (c,) uint16.  is_linear:
    curves go straight between keys.  precision: how far positions may be off.
    """

    positions: np.ndarray
    radii: np.ndarray
    offsets: np.ndarray
    slots: np.ndarray
    is_linear: bool = False
    precision: float = 0.0

    @property
    def curve(self) -> np.ndarray:
        """(k,) the number of each key's curve."""
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))

    @property
    def lengths(self) -> tuple[np.ndarray, np.ndarray]:
        """(k,) how far along its curve each key is, of its length, 0 to 1; (c,) the lengths."""
        first = self.offsets[:-1][np.diff(self.offsets) > 0]
        steps = np.zeros(len(self.positions))
        with np.errstate(invalid="ignore", over="ignore"):
            apart = np.diff(np.ascontiguousarray(self.positions.T, np.float64))
            steps[1:] = np.sqrt((apart * apart).sum(0))
        steps[first] = 0
        steps[~np.isfinite(steps)] = 0
        along = np.cumsum(steps)
        curve = self.curve
        along -= along[np.minimum(self.offsets[:-1], len(along) - 1)][curve]
        length = np.bincount(curve, steps, len(self.offsets) - 1)
        return along / np.where(length > 0, length, 1.0)[curve], length


class Cut(NamedTuple):
    """Curves in segments. key, share: (v,) of each vertex the key before it and how far it is
    towards the next one, 1 at the end of a curve.  step: (v,) how far the next vertex is from there
    on this part of the curve.  at: (v, 4) float32 position and radius.
    """

    key: np.ndarray
    share: np.ndarray
    step: np.ndarray
    at: np.ndarray

    def of(self, keys: Keys) -> np.ndarray:
        """(v, 4) float32 of the same vertices when their curves have these keys."""
        b = _bezier(keys, self.key)
        at = _along_splines(b, self.share.astype(np.float64), keys.is_linear)
        return _rows(at + self.outward(keys, b))

    def outward(self, keys: Keys, b: list[np.ndarray]) -> np.ndarray:
        """(4, v) by how much vertices of parts that are cut lie beside the curves, so that chords
        are half outside: a chord of a n-th is off by 2/3 of |p''| / 8 n² in the mean. b: the
        control points at each vertex.
        """
        by, b = np.zeros((4, len(self.key))), [points[:3] for points in b]
        if keys.is_linear or (self.step == 1).all():
            return by
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            t = self.share.astype(np.float64)
            after = 6 * ((1 - t) * (b[0] - 2 * b[1] + b[2]) + t * (b[1] - 2 * b[2] + b[3]))
            tangent = (1 - t) ** 2 * (b[1] - b[0]) + 2 * t * (1 - t) * (b[2] - b[1])
            tangent += t * t * (b[3] - b[2])
            # where the part before ends at a key, its own bend and step
            before, step = after.copy(), self.step.astype(np.float64)
            new = np.flatnonzero(self.key[1:] != self.key[:-1]) + 1
            b1, b2, b3 = (points[:, new - 1] for points in b[1:])
            before[:, new] = 6 * (b1 - 2 * b2 + b3)
            last = step.copy()
            last[new] = step[new - 1]
            bend = (before * last * last + after * step * step) / 2
            along = tangent / np.sqrt((tangent**2).sum(0))
            by[:3] = -(bend - (bend * along).sum(0) * along) / 12
        # between parts that are one chord each keys stay as they are
        by[:, self.ends | (np.minimum(last, step) == 1) | ~np.isfinite(by).all(0)] = 0.0
        return by

    @property
    def ends(self) -> np.ndarray:
        """(v,) bool: which begin or end a curve."""
        last = self.share == 1
        return last | np.append(True, last[:-1])


def cut(keys: Keys) -> Cut | None:
    """Curves in segments; None without any."""
    pairs = _pairs(keys)
    if not len(pairs):
        return None
    blocks = [pairs[first : first + _BLOCK] for first in range(0, len(pairs), _BLOCK)]
    parts = [_smooth(keys, block) for block in blocks]
    found = Cut(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    for first in range(0, len(found.key), _BLOCK):
        if (found.step[max(first - 1, 0) : first + _BLOCK] == 1).all():
            continue
        found.at[first : first + _BLOCK] += _outward(keys, found, first)
    return found


def _outward(keys: Keys, found: Cut, first: int) -> np.ndarray:
    """`Cut.outward` of a block of vertices."""
    before, end = max(first - 1, 0), first + _BLOCK
    some = Cut(*(column[before:end] for column in found))
    return _rows(some.outward(keys, _bezier(keys, some.key))[:, first - before :])


def _rows(columns: np.ndarray) -> np.ndarray:
    """(v, 4) float32 of (4, v)."""
    return columns.T.astype(np.float32, order="C")


def _pairs(keys: Keys) -> np.ndarray:
    """(p,) keys that have a next one on their curve, elsewhere than they are."""
    first = np.ones(max(len(keys.positions) - 1, 0), bool)
    ends = keys.offsets[1:-1]
    first[ends[(ends > 0) & (ends <= len(first))] - 1] = False
    # NaN differs from itself: what is not finite goes on to whoever tells of it
    apart = (keys.positions[1:] != keys.positions[:-1]).any(1)
    return np.flatnonzero(first & apart)


def _smooth(keys: Keys, pairs: np.ndarray) -> Cut:
    """Vertices along the curve between some pairs of keys."""
    b = _bezier(keys, pairs)
    count = np.ones(len(pairs), np.intp) if keys.is_linear else _pieces(b)
    curve = keys.curve[pairs]
    last = np.append(curve[1:] != curve[:-1], True)
    if len(pairs):  # the next block may go on where this one ends
        last[-1] = not _goes_on(keys, pairs[-1])
    total = count + last
    which = np.repeat(np.arange(len(pairs)), total)
    place = np.arange(len(which)) - np.repeat(np.cumsum(total) - total, total)
    t = place / count[which]
    at = _along_splines([points.take(which, 1) for points in b], t, keys.is_linear)
    # keys as they are: one that is not finite leaves its neighbours in place
    at[:, place == 0] = b[0]
    at[:, t == 1] = b[3][:, last]
    step = (1 / count[which]).astype(np.float32)
    return Cut(pairs[which], t.astype(np.float32), step, _rows(at))


def _along_splines(b: list[np.ndarray], t: np.ndarray, is_linear: bool) -> np.ndarray:
    """(4, v) at t (v,) between the control points of each."""
    s = 1 - t
    with np.errstate(invalid="ignore", over="ignore"):  # of keys that are not finite
        if is_linear:
            return s * b[0] + t * b[3]
        at = s**3 * b[0] + 3 * s * s * t * b[1]
        at += 3 * s * t * t * b[2] + t**3 * b[3]
        return at


def _goes_on(keys: Keys, pair: int) -> bool:
    """Whether the curve of this key has a pair after it."""
    end = keys.offsets[np.searchsorted(keys.offsets, pair, "right")]
    rest = keys.positions[pair + 1 : end]
    return bool((rest[1:] != rest[:-1]).any())


def _bezier(keys: Keys, pairs: np.ndarray) -> list[np.ndarray]:
    """Four (4, p) control points, position and radius, of the Catmull-Rom spline from each key to
    the next; at its ends a curve's first and last key count twice. Column by column: NumPy is slow
    along rows of four.
    """
    curve = np.searchsorted(keys.offsets, pairs, "right") - 1
    rows = (
        np.maximum(pairs - 1, keys.offsets[curve]),
        pairs,
        pairs + 1,
        np.minimum(pairs + 2, keys.offsets[curve + 1] - 1),
    )
    before, a, b, after = (
        np.array([*keys.positions.take(row, 0).T, keys.radii[row]], np.float64) for row in rows
    )
    before = np.where(np.isfinite(before).all(0), before, a)
    after = np.where(np.isfinite(after).all(0), after, b)
    with np.errstate(invalid="ignore", over="ignore"):
        return [a, a + (b - before) / 6, b - (after - a) / 6, b]


def _pieces(b: list[np.ndarray]) -> np.ndarray:
    """(p,) how many segments stand for each part of the spline. A chord of a n-th of it is off by
    at most |p''| / 8 n²; what of p'' lies along the chord bends nothing.
    """
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        chord = b[3] - b[0]
        chord = chord / np.sqrt((chord**2).sum(0))
        bend = np.zeros(chord.shape[1])
        for second in (b[0] - 2 * b[1] + b[2], b[1] - 2 * b[2] + b[3]):
            across = second - (second * chord).sum(0) * chord
            bend = np.maximum(bend, 6 * np.sqrt((across**2).sum(0)))
        radius = np.maximum(b[0][3], b[3][3])
        length = np.sqrt(((b[3] - b[0])[:3] ** 2).sum(0))
        count = np.maximum(np.sqrt(bend / (8 * NEAR * radius)), bend / (TURN * length))
    return np.ceil(np.clip(np.nan_to_num(count, nan=1.0) - 1e-3, 1, MOST)).astype(np.intp)
