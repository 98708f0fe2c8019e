"""The Voronoi Texture in one to four dimensions, as Cycles (kernel/svm/voronoi.h).

Points are (d, n) float64; cells whole numbers, hashed modulo 2^32 by PCG, or by Jenkins' lookup3 as
before Blender 5.0 and always in one dimension.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..operations_voronoi import CellHash, CellOrder, VoronoiFeature, VoronoiMetric
from .hashing import hash_color, hash_numbers
from .noise import coordinates

Array = np.ndarray

LEAST_EXPONENT = 1 / 32
"""Of Minkowski's metric, on either side of 0; one over it is the largest."""

AT_ONCE = 8192
"""Hashes."""

_MULTIPLIER, _INCREMENT = np.uint32(1664525), np.uint32(1013904223)
_FACTORS = {2: ((0, 1, None), (1, 0, None)), 3: ((0, 1, 2), (1, 2, 0), (2, 0, 1)),
            4: ((0, 1, 3), (1, 2, 0), (2, 0, 1), (3, 1, 2))}  # fmt: skip
"""Of a round of PCG: which word gains the product of which two; None is the multiplier."""


@dataclass(frozen=True)
class Cells:
    """What is the same for all octaves: numbers (n,)."""

    randomness: Array
    smoothness: Array
    exponent: Array
    metric: VoronoiMetric
    cell_hash: CellHash
    order: CellOrder

    def distance(self, a: Array, b: Array) -> Array:
        away = np.abs(a - b)
        if len(away) == 1 or self.metric == VoronoiMetric.MANHATTAN:
            return away.sum(0)
        if self.metric == VoronoiMetric.EUCLIDEAN:
            return np.sqrt((away * away).sum(0))
        if self.metric == VoronoiMetric.CHEBYCHEV:
            return away.max(0)
        with np.errstate(divide="ignore"):  # 0 to a power below 0 is infinite, and back again 0
            return (away**self.exponent).sum(0) ** (1 / self.exponent)

    def turn(self, dimensions: int) -> Array | float:
        """-1 where F1 is the farthest point: sums under the root with an exponent below 0 fall."""
        by_distance = self.order == CellOrder.DISTANCE
        if by_distance or dimensions == 1 or self.metric != VoronoiMetric.MINKOWSKI:
            return 1.0
        return np.where(self.exponent < 0, -1.0, 1.0)

    def points(self, cell: Array, reach: int) -> Iterator[tuple[Array, Array]]:
        """Offsets (d, 1) of cells around, the first axis fastest, and where their points are."""
        for offsets in _offsets(cell, reach):
            points = offsets + self.place(cell[:, None] + offsets) * self.randomness
            yield from zip(offsets.swapaxes(0, 1), points.swapaxes(0, 1), strict=True)

    def colors(self, cell: Array, reach: int) -> Iterator[Array]:
        """Of the same cells, (3, n) each."""
        for offsets in _offsets(cell, reach):
            yield from self.color(cell[:, None] + offsets).swapaxes(0, 1)

    def place(self, cell: Array) -> Array:
        """(d, ...) in [0, 1] of whole numbers (d, ...): where in them their points are."""
        if len(cell) == 1:
            return hash_numbers(cell[0])[None]
        if self.cell_hash == CellHash.PCG:
            return np.stack(_pcg(_words(cell)))
        if len(cell) < 4:
            return hash_color(*cell)[: len(cell)]
        x, y, z, w = cell
        turned = ((x, y, z, w), (w, x, y, z), (z, w, x, y), (y, z, w, x))
        return np.stack([hash_numbers(*numbers) for numbers in turned])

    def color(self, cell: Array) -> Array:
        """(3, ...) in [0, 1]."""
        if len(cell) == 1 or self.cell_hash == CellHash.JENKINS:
            return hash_color(*cell)
        words = _words(cell)
        return np.stack(_pcg([*words, np.zeros_like(words[0])] if len(words) == 2 else words)[:3])


def _offsets(cell: Array, reach: int) -> Iterator[Array]:
    """Those of `Cells.points`, so many at a time, (d, m, 1), that hashes of few points (d, n) take
    no longer to begin than to compute.
    """
    turned = np.array(list(product(range(-reach, reach + 1), repeat=len(cell))), np.float64)
    at_once = max(AT_ONCE // max(cell.shape[1], 1), 1)
    for first in range(0, len(turned), at_once):
        yield turned[first : first + at_once, ::-1].T[..., None]


def _words(cell: Array) -> list[Array]:
    return [np.asarray(c).astype(np.int64).astype(np.uint32) for c in cell]


def _pcg(words: list[Array]) -> list[Array]:
    """PCG of two, three or four words (Jarzynski and Olano 2020), as fractions of 2^31."""
    v = [w * _MULTIPLIER + _INCREMENT for w in words]

    def turn() -> None:
        for k, a, b in _FACTORS[len(v)]:
            first, second = (a, b) if len(v) > 2 else (1 - k, None)
            v[k] = v[k] + v[first] * (_MULTIPLIER if second is None else v[second])

    turn()
    v = [w ^ (w.view(np.int32) >> 16).view(np.uint32) for w in v]
    turn()
    kept = (w & np.uint32(0x7FFFFFFF) for w in v)
    return [w.astype(np.float32).astype(np.float64) / 2.0**31 for w in kept]


Octave = tuple[Array, Array, Array]
"""Distance (n,), colour (3, n), position (d, n)."""


def _nearest(p: Array, cells: Cells, second: bool) -> Octave:
    cell = np.floor(p)
    local = p - cell
    count = p.shape[1]
    best = [np.full(count, np.inf), np.full(count, np.inf)]
    offsets = [np.zeros_like(p), np.zeros_like(p)]
    points = [np.zeros_like(p), np.zeros_like(p)]
    turn = 1.0 if second else cells.turn(len(p))
    for offset, point in cells.points(cell, 1):
        d = turn * cells.distance(point, local)
        first = d < best[0]
        then = ~first & (d < best[1])
        best[1] = np.where(first, best[0], np.where(then, d, best[1]))
        offsets[1] = np.where(first, offsets[0], np.where(then, offset, offsets[1]))
        points[1] = np.where(first, points[0], np.where(then, point, points[1]))
        best[0] = np.where(first, d, best[0])
        offsets[0] = np.where(first, offset, offsets[0])
        points[0] = np.where(first, point, points[0])
    k = int(second)
    return np.abs(best[k]), cells.color(cell + offsets[k]), points[k] + cell


def _smooth(p: Array, cells: Cells) -> Octave:
    cell = np.floor(p)
    local, s = p - cell, cells.smoothness
    distance, color, position = np.zeros(p.shape[1]), np.zeros((3, p.shape[1])), np.zeros_like(p)
    around = zip(cells.points(cell, 2), cells.colors(cell, 2), strict=True)
    for number, ((_, point), own) in enumerate(around):
        d = cells.distance(point, local)
        t = np.clip(0.5 + 0.5 * (distance - d) / np.where(s > 0, s, 1.0), 0.0, 1.0)
        h = np.ones_like(d) if number == 0 else t * t * (3 - 2 * t)
        less = s * h * (1 - h)
        distance = distance + (d - distance) * h - less
        less = less / (1 + 3 * s)
        color = color + (own - color) * h - less
        position = position + (point - position) * h - less
    return distance, color, cell + position


def _to_edge(p: Array, cells: Cells) -> Array:
    cell = np.floor(p)
    local = p - cell
    if len(p) == 1:
        left, middle, right = (
            k + cells.place(cell + k)[0] * cells.randomness for k in (-1.0, 0.0, 1.0)
        )
        sides = ((middle + side) / 2 - local[0] for side in (left, right))
        return np.minimum(*(np.abs(side) for side in sides))
    ways = [point - local for _, point in cells.points(cell, 1)]
    nearest, least = np.zeros_like(p), np.full(p.shape[1], np.inf)
    for way in ways:
        d = (way * way).sum(0)
        nearest, least = np.where(d < least, way, nearest), np.minimum(d, least)
    found = np.full(p.shape[1], np.inf)
    for way in ways:
        across = way - nearest
        size = (across * across).sum(0)
        edge = ((nearest + way) / 2 * across).sum(0) / np.sqrt(np.where(size > 0, size, 1.0))
        found = np.where(size > 0.0001, np.minimum(found, edge), found)
    return found


def _radius(p: Array, cells: Cells) -> Array:
    """Half the way from the nearest point to the point nearest to it."""
    cell = np.floor(p)
    local = p - cell
    nearest, own, least = np.zeros_like(p), np.zeros_like(p), np.full(p.shape[1], np.inf)
    for offset, point in cells.points(cell, 1):
        d = ((point - local) ** 2).sum(0)
        nearest, own = np.where(d < least, point, nearest), np.where(d < least, offset, own)
        least = np.minimum(d, least)
    least = np.full(p.shape[1], np.inf)
    for offset, point in cells.points(cell + own, 1):
        if offset.any():
            least = np.minimum(((point + own - nearest) ** 2).sum(0), least)
    return np.sqrt(least) / 2


def _octaves(detail: Array) -> Iterator[tuple[Array, Array]]:
    """Which points (n,) an octave is whole for, and the share of it for others."""
    for i in range(int(np.ceil(np.max(detail, initial=0.0))) + 1):
        rest = detail - np.floor(detail)
        yield i <= detail, np.where((i > detail) & (i <= np.ceil(detail)), rest, 0.0)


def _lerp(a: Array, b: Array, t: Array) -> Array:
    return a + (b - a) * t


def _inverse(x: Array) -> Array:
    """1 / x, 0 where x is 0."""
    return np.where(x != 0, 1 / np.where(x != 0, x, 1.0), 0.0)


def _fractal(
    p: Array, octave: Callable[[Array], Octave], detail, roughness, lacunarity
) -> tuple[Array, Octave]:
    """The largest amplitude, and the octaves added up."""
    single = (detail == 0) | (roughness == 0)
    amplitude, most, scale = np.ones(p.shape[1]), np.zeros(p.shape[1]), np.ones(p.shape[1])
    distance, color, position = np.zeros(p.shape[1]), np.zeros((3, p.shape[1])), np.zeros_like(p)
    for number, (whole, rest) in enumerate(_octaves(detail)):
        whole = whole & (~single | (number == 0))
        share = np.where(whole, 1.0, np.where(single, 0.0, rest))
        d, c, at = octave(p * scale)
        most = most + share * amplitude
        distance, color = distance + share * (d * amplitude), color + share * (c * amplitude)
        position = _lerp(position, _lerp(position, at * _inverse(scale), amplitude), share)
        scale = np.where(whole, scale * lacunarity, scale)
        amplitude = np.where(whole, amplitude * roughness, amplitude)
    return most, (distance, color, position)


def _fractal_edge(p: Array, cells: Cells, detail, roughness, lacunarity) -> tuple[Array, Array]:
    """The largest distance, and the distance to the nearest edge of all octaves."""
    single = (detail == 0) | (roughness == 0)
    reach = 0.5 + 0.5 * cells.randomness
    amplitude, most, scale = np.ones(p.shape[1]), reach, np.ones(p.shape[1])
    distance = np.full(p.shape[1], 8.0)
    for number, (whole, rest) in enumerate(_octaves(detail)):
        whole = whole & (~single | (number == 0))
        share = np.where(single & (number > 0), 0.0, rest)
        near = _to_edge(p * scale, cells) * _inverse(scale)
        most_now = _lerp(most, reach * _inverse(scale), amplitude)
        now = _lerp(distance, np.minimum(distance, near), amplitude)
        most = np.where(whole, most_now, _lerp(most, most_now, share))
        partly = _lerp(distance, np.minimum(distance, now), share)
        distance = np.where(whole, now, partly)
        scale = np.where(whole, scale * lacunarity, scale)
        amplitude = np.where(whole, amplitude * roughness, amplitude)
    return most, distance


def voronoi_texture(
    vector,
    w,
    scale,
    detail,
    roughness,
    lacunarity,
    smoothness,
    exponent,
    randomness,
    *,
    dimensions: int,
    feature: int,
    metric: int,
    normalize: int,
    cell_hash: int,
    cell_order: int,
) -> tuple[Array, ...]:
    """Distance (n,), colour (3, n), position (3, n), w (n,) and radius (n,)."""
    p = coordinates(vector, w, dimensions) * scale
    detail, roughness = np.clip(detail, 0.0, 15.0), np.clip(roughness, 0.0, 1.0)
    cells = Cells(
        np.clip(randomness, 0.0, 1.0),
        np.clip(smoothness / 2, 0.0, 0.5),
        np.where(exponent < 0, -1.0, 1.0)
        * np.clip(np.abs(exponent), LEAST_EXPONENT, 1 / LEAST_EXPONENT),
        VoronoiMetric(metric),
        CellHash(cell_hash),
        CellOrder(cell_order),
    )
    none, black = np.zeros(p.shape[1]), np.zeros((3, p.shape[1]))
    if feature == VoronoiFeature.N_SPHERE_RADIUS:
        return none, black, black, none, _radius(p, cells)
    if feature == VoronoiFeature.DISTANCE_TO_EDGE:
        most, distance = _fractal_edge(p, cells, detail, roughness, lacunarity)
        return (distance * _inverse(most) if normalize else distance), black, black, none, none

    def octave(at: Array) -> Octave:
        if feature != VoronoiFeature.SMOOTH_F1:
            return _nearest(at, cells, feature == VoronoiFeature.F2)
        sharp, smooth = _nearest(at, cells, False), _smooth(at, cells)
        flat = cells.smoothness == 0
        distance, color, position = (
            np.where(flat, a, b) for a, b in zip(sharp, smooth, strict=True)
        )
        return distance, color, position

    most, (distance, color, position) = _fractal(p, octave, detail, roughness, lacunarity)
    if normalize:
        reach = np.broadcast_to(0.5 + 0.5 * cells.randomness, p.shape)
        farthest = cells.distance(np.zeros_like(p), reach)
        farthest = farthest * (2 if feature == VoronoiFeature.F2 else 1)
        distance, color = distance * _inverse(most * farthest), color * _inverse(most)
    position = position * _inverse(scale)
    return distance, color, *_placed(position), none


def _placed(position: Array) -> tuple[Array, Array]:
    """XYZ (3, n) and W (n,) of a position (d, n)."""
    found = np.zeros((4, position.shape[1]))
    if len(position) == 1:
        found[3] = position[0]
    else:
        found[: len(position)] = position
    return found[:3], found[3]
