"""What Cycles derives of a mesh's edges: the parts that hang together, and how pointed it is."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....engine.linear.elementary import arccos
from .hashing import random_of

_EPSILON = np.float32(np.finfo(np.float32).eps)


def islands(mesh: Any, triangles: np.ndarray) -> np.ndarray:
    """(n,) float32: a random number for each triangle (n, 3), the same over what edges join."""
    roots = _roots(edges_of(mesh).tolist(), len(mesh.vertices))
    return random_of(roots[triangles[:, 0]])


def _roots(edges: list, count: int) -> np.ndarray:
    """(count,) uint32: the vertex that stands for each vertex's part. It is hashed, so parts are
    joined by rank in the order of the edges, as Cycles joins them.
    """
    parents, ranks = list(range(count)), bytearray(count)

    def find(x: int) -> int:
        while parents[x] != x:
            parents[x] = parents[parents[x]]
            x = parents[x]
        return x

    for first, second in edges:
        a, b = find(first), find(second)
        if a == b:
            continue
        if ranks[a] < ranks[b]:
            a, b = b, a
        parents[b] = a
        ranks[a] += ranks[a] == ranks[b]
    return np.array([find(x) for x in range(count)], np.uint32)


def pointiness(mesh: Any) -> np.ndarray:
    """(v,) float32: the angle between a vertex's normal and the mean of its edges over pi, blurred
    over its neighbours. One half is flat. Vertices in one place count as one.
    """
    count = len(mesh.vertices)
    places, normals = _read(mesh.vertices, "co"), _read(mesh.vertex_normals, "vector")
    one = _welded(places)
    normals = _unit(_summed(one, normals, count))
    ends = np.unique(np.sort(one[edges_of(mesh)], 1), axis=0)
    ends = ends[ends[:, 0] != ends[:, 1]]
    along = _unit(places[ends[:, 1]] - places[ends[:, 0]])
    total = _summed(ends.ravel(), np.stack([along, -along], 1).reshape(-1, 3), count)
    number = np.bincount(ends.ravel(), minlength=count)
    cosine = (normals * total).sum(1) / np.maximum(number, 1)
    raw = np.where(number > 0, arccos(np.clip(cosine, -1, 1)) / np.pi, 0.0)
    around = raw + _summed(ends.ravel(), raw[ends[:, ::-1].ravel()], count)
    return (around / (number + 1))[one].astype(np.float32)


def edges_of(mesh: Any) -> np.ndarray:
    """(e, 2) vertices."""
    ends = np.empty((len(mesh.edges), 2), np.int32)
    mesh.edges.foreach_get("vertices", ends.reshape(-1))
    return ends


def _read(vectors: Any, name: str) -> np.ndarray:
    """(k, 3) float64."""
    found = np.empty((len(vectors), 3), np.float32)
    vectors.foreach_get(name, found.reshape(-1))
    return found.astype(np.float64)


def _welded(places: np.ndarray) -> np.ndarray:
    """(v,) the one vertex that stands for each: that of the largest sum of coordinates of those
    whose sums are within three units of the last place of 1 and which are close together.
    """
    sums = places.astype(np.float32).sum(1)
    order = np.argsort(sums, kind="stable")
    sums, places = sums[order], places[order]
    target, open_ = np.arange(len(order)), np.arange(len(order))
    for step in range(1, len(order)):
        open_ = open_[open_ + step < len(order)]
        open_ = open_[sums[open_ + step] - sums[open_] <= 3 * _EPSILON]
        if not len(open_):
            break
        apart = ((places[open_ + step] - places[open_]) ** 2).sum(1)
        target[open_[apart < _EPSILON]] = (open_ + step)[apart < _EPSILON]
        open_ = open_[apart >= _EPSILON]
    while (target != target[target]).any():
        target = target[target]
    found = np.empty_like(target)
    found[order] = order[target]
    return found


def _summed(rows: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count, ...) sums of the values of equal rows."""
    total = np.zeros((count, *values.shape[1:]))
    np.add.at(total, rows, values)
    return total


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.sqrt((vectors * vectors).sum(-1, keepdims=True))
    return vectors / np.where(length > 0, length, 1.0)


def as_four(numbers: np.ndarray) -> np.ndarray:
    """(k, 4) float32 of numbers (k,)."""
    return np.repeat(numbers.astype(np.float32)[:, None], 4, 1)
