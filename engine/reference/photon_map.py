"""Light of lamps by way of mirrors and glass, as photons on what is matt (Jensen 1996, Global
illumination using photon maps). What they come to is known at some of them and read from these
(Christensen 1999, Faster photon map global illumination).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..linear.columns import dot, explode, pick

Array = np.ndarray

THIN = 0.25
"""Of a photon's reach, how far off its plane it lights."""
ALIKE = 0.5
"""Cosine between the normals of what a photon lights."""
OF_ONE, OF_MANY = 32, 8
"""How many others say how far a photon's light reaches: fewer where those of many places of a lamp
meet, as these are even by themselves.
"""
NODES = 8
"""So many, about, count at a point."""
PAIRS = 1 << 23
"""Of points and photons that are looked at together, at most."""
_HALVINGS = 20
_CELLS = 1 << 21
"""Along each axis, at most."""


@dataclass(frozen=True, eq=False)
class Photons:
    """Where light of a lamp arrives at n points x (3, n). normal: (3, n) the faces', on the side
    that it comes to. flux: (3, n) over pi; of nodes the irradiance there, over pi. radius: (n,)
    within which they count.
    """

    x: Array
    normal: Array
    flux: Array
    radius: Array

    def __len__(self) -> int:
        return self.x.shape[1]

    def take(self, index: Array) -> Photons:
        """Those at these places."""
        x, normal, flux = (pick(a, index) for a in (self.x, self.normal, self.flux))
        return Photons(x, normal, flux, self.radius[index])

    @staticmethod
    def joined(parts: list[Photons]) -> Photons:
        """One after the other."""
        rows = [np.zeros((3, 0)), np.zeros((3, 0)), np.zeros((3, 0)), np.zeros(0)]
        for part in parts:
            new = part.x, part.normal, part.flux, part.radius
            rows = [np.concatenate(pair, -1) for pair in zip(rows, new, strict=True)]
        return Photons(*rows)


@dataclass(frozen=True, eq=False)
class Bundle:
    """The photons of one lamp by way of one caster. group: of lights, the lamp's; -1 for none.
    places: those from each place on the lamp.
    """

    group: int
    places: list[Photons] = field(default_factory=list)


class PhotonMap:
    """Tells what photons bring to points."""

    def __init__(self, bundles: list[Bundle]) -> None:
        self._nodes = [(bundle.group, _Cells.by_size(_nodes(bundle))) for bundle in bundles]

    def find(self, x: Array, normal: Array) -> Iterator[tuple[int, Array]]:
        """Irradiance over pi (3, n) at points x (3, n), on the side of the normals (3, n): of each
        bundle its light group, and what it brings. It ends gently where nodes do.
        """
        for group, cells in self._nodes:
            total, weight = np.zeros((3, x.shape[1])), np.zeros(x.shape[1])
            for photons, number, here, share in _counting(cells, x, normal):
                weight += np.bincount(here, share, len(weight))
                for sums, values in zip(total, photons.flux, strict=True):
                    sums += np.bincount(here, share * values[number], len(weight))
            if weight.any():
                yield group, total / np.maximum(weight, 0.5)


def _nodes(bundle: Bundle) -> Photons:
    """The photons of a bundle that know how much light all of them bring there."""
    places = bundle.places
    total = sum(len(photons) for photons in places)
    if not (len(places) > 1 and total >= OF_ONE * len(places)):
        places = [Photons.joined(places)]  # few tell more together
    count = OF_MANY if len(places) > 1 else OF_ONE
    photons = Photons.joined([_reaching(part, count) for part in places])
    step = count * len(places) // NODES
    nodes = photons.take(np.arange(step // 2, len(photons), step))
    sums = np.zeros_like(nodes.flux)
    for some, number, here, share in _counting(_Cells.by_size(photons), nodes.x, nodes.normal):
        share = 2 * share / (np.pi * np.square(some.radius[number]))
        for total_of, values in zip(sums, some.flux, strict=True):
            total_of += np.bincount(here, share * values[number], len(nodes))
    return _reaching(replace(nodes, flux=sums), NODES)


def _alike(normals: Array, to: Array, distance2: Array, others: Array) -> Array:
    """(n,) bool: whether photons of these normals light surfaces of other ones at `to` (3, n) from
    them.
    """
    off = dot(to, normals)
    return (dot(normals, others) > ALIKE) & (off * off <= THIN * THIN * distance2)


class _Cells:
    """Photons in cubes with sides of one length."""

    def __init__(self, photons: Photons, side: float) -> None:
        self.photons, self.side = photons, side
        self._low = photons.x.min(1, initial=0.0)[:, None]
        keys = self._key(self._cell(photons.x))
        self._order = np.argsort(keys, kind="stable")
        self._keys = keys[self._order]
        self.fullest = int(np.unique(keys, return_counts=True)[1].max(initial=0))

    @staticmethod
    def by_size(photons: Photons) -> list[_Cells]:
        """Those that count anywhere, in cubes no smaller than their reach."""
        _, exponents = np.frexp(photons.radius)
        return [
            _Cells(photons.take(some), float(np.ldexp(1.0, exponent)))
            for exponent in np.unique(exponents)
            if len(some := np.flatnonzero((exponents == exponent) & (photons.radius > 0)))
        ]

    @property
    def at_once(self) -> int:
        """Of so many points `near` tells together."""
        return max(PAIRS // (27 * max(self.fullest, 1)), 1)

    def near(self, x: Array) -> tuple[Array, Array]:
        """Pairs of points x (3, n) and of the photons in the cubes round theirs, numbers (m,)
        each: of all that are no farther than a side, and others.
        """
        cell, found = self._cell(x), []
        for z in (-1, 0, 1):
            for y in (-1, 0, 1):
                key = self._key(cell + np.array([[0], [y], [z]]))
                first = np.searchsorted(self._keys, key - 1, "left")
                last = np.searchsorted(self._keys, key + 1, "right")
                point, place = explode(last - first)
                found.append((point, self._order[first[point] + place]))
        point, photon = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return point, photon

    def _cell(self, x: Array) -> Array:
        """(3, n) numbers of cubes: far ones together, which parts none that are neighbours."""
        at = np.floor((x - self._low) / self.side)
        return np.clip(at, 2, _CELLS - 3).astype(np.int64)

    @staticmethod
    def _key(cell: Array) -> Array:
        return (cell[2] * _CELLS + cell[1]) * _CELLS + cell[0]


def _counting(
    cells: list[_Cells], x: Array, normal: Array
) -> Iterator[tuple[Photons, Array, Array, Array]]:
    """Photons, and which of them count at which of the points x (3, n) of surfaces with these
    normals (3, n), and how much, (m,) each: 1 - d² / r² within their radii r, a kernel of
    Epanechnikov.
    """
    for some in cells:
        photons = some.photons
        for first in range(0, x.shape[1], some.at_once):
            part = slice(first, first + some.at_once)
            here, number = some.near(x[:, part])
            to = pick(x[:, part], here) - pick(photons.x, number)
            distance2, reach2 = dot(to, to), np.square(photons.radius[number])
            alike = _alike(pick(photons.normal, number), to, reach2, pick(normal[:, part], here))
            counts = np.flatnonzero((distance2 < reach2) & alike)
            weight = 1 - distance2[counts] / reach2[counts]
            yield photons, number[counts], first + here[counts], weight


def _reaching(photons: Photons, count: int) -> Photons:
    """With radii: how far the count-th nearest is on the same surface, or of what fewer come near
    the farthest of these; 0 for one alone.
    """
    n, radius = len(photons), np.zeros(len(photons))
    whole = float((photons.x.max(1, initial=0.0) - photons.x.min(1, initial=0.0)).max())
    cells = _Cells(photons, whole or 1.0)
    for _ in range(_HALVINGS):
        if cells.fullest > 2 * count:
            cells = _Cells(photons, cells.side / 2)
    pending = np.arange(n)
    while len(pending):
        for first in range(0, len(pending), cells.at_once):
            some = pending[first : first + cells.at_once]
            radius[some] = _nearest(cells, some, count, cells.side >= whole)
        pending = pending[np.isinf(radius[pending])]
        cells = _Cells(photons, 2 * cells.side)
    return replace(photons, radius=radius)


def _nearest(cells: _Cells, some: Array, count: int, all_near: bool) -> Array:
    """(n,) what `_reaching` has of some of the photons; infinity where more of them may be near
    than the cubes tell. all_near: none are farther than a side.
    """
    photons = cells.photons
    here, number = cells.near(pick(photons.x, some))
    mine = some[here]
    to = pick(photons.x, number) - pick(photons.x, mine)
    distance2 = dot(to, to)
    alike = _alike(pick(photons.normal, mine), to, distance2, pick(photons.normal, number))
    sure = np.flatnonzero((number != mine) & alike & (all_near | (distance2 <= cells.side**2)))
    here, distance2 = here[sure], distance2[sure]
    order = np.lexsort((distance2, here))
    here, distance2 = here[order], distance2[order]
    start = np.searchsorted(here, np.arange(len(some)))
    known = np.searchsorted(here, np.arange(len(some)), "right") - start
    found, left = np.full(len(some), np.inf), np.ones(len(some), bool)
    while count > 0:
        enough = np.flatnonzero(left & (known >= count))
        found[enough] = np.sqrt(distance2[start[enough] + count - 1])
        left[enough] = False
        if not all_near:
            return found
        count //= 2
    found[left] = 0.0
    return found
