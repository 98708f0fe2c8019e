"""A bounding volume hierarchy without pointers, and the pairs of rays and primitives that it
leaves.

The primitives are halved again and again at the median along the longest axis of their centres, all
segments of a level at once, so that the tree is complete: node i of a level has the children 8i ...
8i + 7 on the next one, and leaf k holds a fixed run of primitives. Rays go down breadth first: a
level is one array of (ray, node) pairs, tested against the eight child boxes of each node.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..evaluation.geometry import Geometry
from ..linear.columns import pick
from .cancellation import Cancellation
from .rays import IncoherentRays

Array = np.ndarray

LEAF = 4
CHUNK = 1 << 13  # rays that go down together
PAIRS = 1 << 16
WIDEN = 2.0**-18
"""Boxes and rays are float32: boxes grow by this share of the largest coordinate, distances by this
share of themselves.
"""
NONE = -1


@dataclass(frozen=True, eq=False)
class Tree:
    """levels: (6, 8, n) float32 per level from the root down: lower x y z, upper x y z of the eight
    children of each of n nodes. leaves: (l, k) primitives of each leaf, NONE where there is none.
    reach: largest coordinate of any box.
    """

    levels: list[Array]
    leaves: Array
    reach: float

    @property
    def bytes(self) -> int:
        return self.leaves.nbytes + sum(level.nbytes for level in self.levels)


def build(geometry: Geometry, cancellation: Cancellation) -> Tree:
    """The tree over all primitives."""
    lower, upper = _bounds(geometry)
    depth = 0
    while LEAF * 8**depth < geometry.count:
        depth += 1
    order = _median_order((lower + upper) / 2, 8**depth, cancellation)
    empty = order == NONE
    grow = WIDEN * geometry.reach
    low = np.where(empty, np.inf, pick(lower, order) - grow).min(2)
    high = np.where(empty, -np.inf, pick(upper, order) + grow).max(2)
    levels = []
    for _ in range(depth):
        levels.append(
            np.concatenate([low, high]).reshape(6, -1, 8).swapaxes(1, 2).astype(np.float32)
        )
        low, high = low.reshape(3, -1, 8).min(2), high.reshape(3, -1, 8).max(2)
    return Tree([np.ascontiguousarray(level) for level in levels[::-1]], order, geometry.reach)


def _bounds(geometry: Geometry) -> tuple[Array, Array]:
    """Boxes (3, p) of all primitives."""
    a, b, c = (pick(geometry.points, corner) for corner in geometry.triangles)
    lower, upper = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    return np.concatenate([lower, geometry.lower], 1), np.concatenate([upper, geometry.upper], 1)


def _median_order(centers: Array, leaves: int, cancellation: Cancellation) -> Array:
    """(leaves, k) primitives sorted into equal leaves, the last places NONE."""
    count = centers.shape[1]
    size = max(-(-count // leaves), 1)
    order = np.full(leaves * size, NONE)
    order[:count] = np.arange(count)
    segments = order[None]
    while len(segments) < leaves:
        cancellation.check()
        segments = _halved(centers, segments)
    return segments


def _halved(centers: Array, segments: Array) -> Array:
    """(s, m) -> (2s, m/2): each segment cut at its median along its longest axis; empty places go
    last.
    """
    empty = segments == NONE
    places = pick(centers, segments)
    with np.errstate(invalid="ignore"):
        extent = np.where(empty, -np.inf, places).max(2) - np.where(empty, np.inf, places).min(2)
    key = np.take_along_axis(places, extent.argmax(0)[None, :, None], 0)[0]
    key[empty] = np.inf
    half = segments.shape[1] // 2
    cut = np.argpartition(key, half, 1) if segments.shape[1] > 16 else np.argsort(key, 1)
    return np.take_along_axis(segments, cut, 1).reshape(2 * len(segments), half)


def tree_pairs(
    tree: Tree, rays: IncoherentRays, seen: Array | None, limit: Array, cancellation: Cancellation
) -> Iterator[tuple[Array, Array]]:
    """Blocks of (ray, primitive) that may meet. `limit` (n,) is the distance beyond which a ray no
    longer looks; the caller lowers it.
    """
    for begin in range(0, len(rays), CHUNK):
        chosen = np.arange(begin, min(begin + CHUNK, len(rays)))
        chosen = chosen[limit[chosen] > rays.near[chosen]]
        for octant in _octants(rays, chosen):
            yield from _descend(tree, octant, seen, limit, cancellation)


@dataclass(frozen=True, eq=False)
class _Octant:
    """Rays whose directions have the same signs: near and far sides of a box are the same rows of
    it for all of them.
    """

    ray: Array
    origin: Array
    inverse: Array
    begin: Array
    near_side: tuple[int, ...]
    far_side: tuple[int, ...]


def _octants(rays: IncoherentRays, chosen: Array) -> Iterator[_Octant]:
    origin, direction = pick(rays.origin, chosen), pick(rays.direction, chosen)
    signs = (direction[0] < 0) + 2 * (direction[1] < 0) + 4 * (direction[2] < 0)
    with np.errstate(divide="ignore", over="ignore"):
        # Of a component 0 too: huge times 0 is 0, infinite times 0 is not. + 0: `signs` takes -0
        # for 0.
        inverse = np.clip(1 / (direction + 0.0), -1e30, 1e30).astype(np.float32)
        origin, begin = (
            origin.astype(np.float32),
            (rays.near[chosen] * (1 - WIDEN)).astype(np.float32),
        )
    for sign in range(8):
        mine = np.flatnonzero(signs == sign)
        if len(mine):
            negative = [sign >> a & 1 for a in range(3)]
            yield _Octant(
                chosen[mine],
                pick(origin, mine),
                pick(inverse, mine),
                begin[mine],
                tuple(a + 3 * n for a, n in enumerate(negative)),
                tuple(a + 3 - 3 * n for a, n in enumerate(negative)),
            )


def _descend(
    tree: Tree, octant: _Octant, seen: Array | None, limit: Array, cancellation: Cancellation
) -> Iterator[tuple[Array, Array]]:
    """From the root to the leaves, a level at a time; blocks that grow too long are cut and
    finished one after the other.
    """
    stack = [(0, np.arange(len(octant.ray)), np.zeros(len(octant.ray), np.intp), octant.begin)]
    while stack:
        cancellation.check()
        level, which, node, enter = stack.pop()
        alive = enter <= limit[octant.ray[which]]
        which, node, enter = which[alive], node[alive], enter[alive]
        if level == len(tree.levels):
            yield from _leaf_pairs(tree, octant.ray[which], node, enter, seen, limit)
            continue
        for begin in reversed(range(0, len(which), PAIRS // 8)):
            part = slice(begin, begin + PAIRS // 8)
            stack.append(
                (level + 1, *_children(tree.levels[level], octant, which[part], node[part], limit))
            )


def _children(
    boxes: Array, octant: _Octant, which: Array, node: Array, limit: Array
) -> tuple[Array, Array, Array]:
    """Pairs (place in the octant, child) whose box the ray enters before `limit`, and where it
    enters.
    """
    near = octant.begin.take(which)
    far = (limit.take(octant.ray.take(which)) * (1 + WIDEN)).astype(np.float32)
    for axis in range(3):
        o, inverse = octant.origin[axis].take(which), octant.inverse[axis].take(which)
        with np.errstate(over="ignore"):  # far boxes beside rays along an axis are endlessly far
            near = np.maximum((boxes[octant.near_side[axis]].take(node, 1) - o) * inverse, near)
            far = np.minimum((boxes[octant.far_side[axis]].take(node, 1) - o) * inverse, far)
    met = np.flatnonzero(near <= far)
    child, place = np.divmod(met, len(node))
    return which.take(place), node.take(place) * 8 + child, near.ravel().take(met)


def _leaf_pairs(
    tree: Tree, ray: Array, leaf: Array, enter: Array, seen: Array | None, limit: Array
) -> Iterator[tuple[Array, Array]]:
    """The primitives of the leaves: first of the leaf that each ray enters first, so that most of
    the rest is out of reach by then.
    """
    if not len(ray):
        return
    first = np.full(ray.max() - ray.min() + 1, np.inf, np.float32)
    np.minimum.at(first, ray - ray.min(), enter)
    nearest = enter == first[ray - ray.min()]
    for chosen in (np.flatnonzero(nearest), np.flatnonzero(~nearest)):
        for begin in range(0, len(chosen), PAIRS // LEAF):
            part = chosen[begin : begin + PAIRS // LEAF]
            part = part[enter[part] <= limit[ray[part]]]
            primitive = tree.leaves.take(leaf[part], 0)
            pair_ray = np.repeat(ray[part], primitive.shape[1])
            primitive = primitive.ravel()
            good = primitive != NONE
            if seen is not None:
                good &= seen[primitive]
            yield pair_ray[good], primitive[good]
