"""Pixels of a block on one surface share what rays of some of them find: of bounced light, from its
points and by gather rays, and of what wide lobes reflect. They look in directions of their own, or
in turn (Keller, Heidrich 2001, Interleaved sampling), and each takes what the others find as if it
had found it (Bekaert, Sbert, Halton 2002, Accelerating path tracing by re-using paths).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..sampling import GATHER_BLOCK, GLOSS_PLACES
from .surface import Surface
from .vectors import dot, pick

Array = np.ndarray

ALIKE = 0.97
"""Least cosine between the normals of points of pixels of a block that share what rays find."""
FLAT = 0.04
"""Of the way between these points, squared, the most along their normals."""
SHARP = 0.18
"""Of 1 less `ALIKE`, over the exponent of a lobe, the most."""
ALONE = GLOSS_PLACES
WAITS = ALONE + 1
"""Beside the numbers of a sample's places for rays of wide lobes."""


@dataclass(frozen=True, eq=False)
class Turns:
    """How m points share shadow rays to points of bounced light. number, count: (m,) of its rays
    each traces every `count`-th from `number` on.  group: (m,) a number of those that share.
    matt: (3, m) what each gives back of light from all sides.
    """

    number: Array
    count: Array
    group: Array
    matt: Array

    def of_all(self, found: Array) -> Array:
        """What those of each group have found together, as much of it as each gives back. found:
        (3 g, m) of each point.
        """
        matt = np.tile(self.matt, (len(found) // 3, 1))
        sums = np.zeros((len(found), self.group.max(initial=-1) + 1))
        with np.errstate(divide="ignore", invalid="ignore"):
            each = np.where(matt != 0, found / matt, 0.0)
        for row, values in zip(sums, each, strict=True):
            np.add.at(row, self.group, values)
        return np.where(matt != 0, sums[:, self.group] * matt, found)


@dataclass(frozen=True, eq=False)
class Shares:
    """Which of n pixels of a tile get what is found by others in a sample. group: (n,) its number,
    -1 for none.  members: (groups, most) pixels, -1 for none.  apart: (n,) bool, shares gather
    rays, but no shadow rays to points of bounced light.  x, normal: (3, n) where they look from.
    matt: (3, n) what each throws back of light from all sides, 1 without group.
    """

    group: Array
    members: Array
    apart: Array
    x: Array
    normal: Array
    matt: Array

    def given(self, pixel: Array, x: Array, g: Array) -> tuple[Array, Array, Array]:
        """(k,) which rays, (k,) the pixels that get something of what these find, (3, k) what of
        it: by how densely the rays of each look there (the balance heuristic). pixel: (m,) of the
        rays, x, g: (3, m) what they meet, and its normal.
        """
        group = self.group[pixel]
        members = self.members[group].copy()
        members[:, 0] = np.where(group < 0, pixel, members[:, 0])
        members[group < 0, 1:] = -1
        dense = np.zeros(members.shape)
        for number, other in enumerate(members.T):
            to = x - pick(self.x, other)
            with np.errstate(divide="ignore", invalid="ignore"):
                found = np.maximum(dot(pick(self.normal, other), to), 0.0) * np.abs(dot(g, to))
                dense[:, number] = np.where(other >= 0, found / dot(to, to) ** 2, 0.0)
        alone = (members >= 0).sum(1) == 1
        dense[alone] = members[alone] >= 0
        total = dense.sum(1)
        ray, k = np.nonzero((dense > 0) & (total > 0)[:, None])
        receiver = members[ray, k]
        return ray, receiver, dense[ray, k] / total[ray] * pick(self.matt, receiver)

    def turns(self, pixel: Array, sample: int) -> Turns:
        """Of m points, which are of these pixels (m,). Every fourth sample lies in the same part of
        its pixel, and each has its turn in all of these.
        """
        there = self.members >= 0
        place, size = np.zeros(len(self.group), int), there.sum(1)
        place[self.members[there]] = (np.cumsum(there, 1) - 1)[there]
        shared = (self.group[pixel] >= 0) & ~self.apart[pixel]
        count = np.where(shared, size[self.group[pixel]], 1)
        number = (place[pixel] + sample + sample // 4) % count
        alone = len(size) + np.arange(len(pixel))
        group = np.where(shared, self.group[pixel], alone)
        return Turns(number, count, group, np.where(shared, pick(self.matt, pixel), 1.0))


def shares_of(surface: Surface, pixel: Array, given: Array, apart: Array, blocks: Array) -> Shares:
    """How pixels of a tile share light. pixel: (m,) of the points.  given: (3, m) what
    these give back of light from all sides, 0 where they share none.  apart: (m,) bool, as `Shares`
    has it.  blocks: (n,) which block each of the tile's pixels is in.
    """
    n, some = len(blocks), np.flatnonzero(given.any(0))
    x, normal, matt = np.zeros((3, 3, n))
    x[:, pixel], normal[:, pixel], matt[:] = surface.x, surface.n, 1.0
    matt[:, pixel[some]] = pick(given, some)
    is_apart = np.zeros(n, bool)
    is_apart[pixel] = apart
    kinds = np.array([1, 2, 4, 8]) @ np.vstack([given != 0, apart])
    group, members = groups(surface.take(some), pixel[some], blocks, kinds[some])
    return Shares(group, members, is_apart, x, normal, matt)


def turns(members: Array, sample: int, n: int) -> Array:
    """(n,) to which of a sample's places in wide lobes each pixel sends its ray: of a group about
    half send one, in turn, a power of two, to places that are even by themselves. members: (groups,
    most), as `Shares` has them.
    """
    turn, there = np.full(n, ALONE), members >= 0
    number, count = np.cumsum(there, 1) - 1, there.sum(1, keepdims=True)
    count = np.maximum(count, 1)
    rays = np.minimum(2 ** np.ceil(np.log2(count)).astype(int) // 2, GLOSS_PLACES)
    at = (number + sample) % count * rays
    found = np.where(at % count < rays, (at // count + rays * sample) % GLOSS_PLACES, WAITS)
    turn[members[there]] = np.where(count == 1, ALONE, found)[there]
    return turn


def groups(
    surface: Surface,
    pixel: Array,
    blocks: Array,
    kinds: Array,
    most: int = GATHER_BLOCK * GATHER_BLOCK,
    exponents: Array | None = None,
) -> tuple[Array, Array]:
    """`Shares.group` and `members` of points of these pixels, of tiles' pixels in these blocks: in
    their order, each joins the first group of its block whose first point is on its surface and of
    its kind. kinds: (m,) of the points.  most: pixels of a block.  exponents: (m,) of the narrowest
    lobes, whose normals lie the closer together; None for matt ones.
    """
    least = np.full(len(pixel), ALIKE)
    if exponents is not None:
        least = np.maximum(ALIKE, 1 - SHARP / np.maximum(exponents, 1e-300))
    group, members = np.full(len(blocks), -1), np.full((len(pixel) + 1, most), -1)
    if not len(pixel):
        return group, members
    order = np.argsort(blocks[pixel], kind="stable")
    _, first, row = np.unique(blocks[pixel[order]], return_index=True, return_inverse=True)
    table = np.full((len(first), most), -1)  # points of each block
    table[row, np.arange(len(order)) - first[row]] = order
    count = 0
    for k in range(most):
        leads = np.flatnonzero((table[:, k] >= 0) & (group[pixel[table[:, k]]] < 0))
        lead = table[leads, k]
        for j in range(k, most):
            other = table[leads, j]
            free = (other >= 0) & (group[pixel[other]] < 0)
            alike = kinds[lead] == kinds[other]
            on = np.flatnonzero(free & alike & _is_one_surface(surface, lead, other, least))
            group[pixel[other[on]]] = count + on
            members[count + on, j] = pixel[other[on]]
        count += len(leads)
    return group, members


def _is_one_surface(surface: Surface, a: Array, b: Array, least: Array) -> Array:
    n, m, way = pick(surface.n, a), pick(surface.n, b), pick(surface.x, a) - pick(surface.x, b)
    flat = FLAT * dot(way, way)
    near = dot(n, m) >= np.maximum(least[a], least[b])
    return near & (dot(way, n) ** 2 <= flat) & (dot(way, m) ** 2 <= flat)
