"""Meshes, rays and a brute-force tracer for the tests of ray queries."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def icosphere(level: int) -> tuple[Array, Array]:
    """(v, 3) float64 on the unit sphere and (n, 3) uint32, closed: an icosahedron split `level`
    times.
    """
    g = (1 + np.sqrt(5)) / 2
    vertices = np.array([[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0]], float)
    vertices = np.concatenate([np.roll(vertices, k, 1) for k in range(3)])
    # The faces: triples of vertices at the shortest distance, turned outwards.
    near = np.isclose(np.linalg.norm(vertices[:, None] - vertices, axis=2), 2)
    triples = [
        (a, b, c)
        for a in range(12)
        for b in range(a)
        for c in range(b)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    triangles = np.array(triples)
    p, q, r = (vertices[triangles[:, k]] for k in range(3))
    inward = (np.cross(q - p, r - p) * p).sum(1) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    for _ in range(level):
        vertices, triangles = _split(vertices, triangles)
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), triangles.astype(np.uint32)


def _split(vertices: Array, triangles: Array) -> tuple[Array, Array]:
    vertices = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    edges = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), 1
    )
    unique, place = np.unique(edges, axis=0, return_inverse=True)
    middle = len(vertices) + place.reshape(3, -1)
    a, b, c = triangles.T
    ab, bc, ca = middle
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([vertices, vertices[unique].mean(1)]), np.concatenate(
        [np.stack(part, 1) for part in parts]
    )


def box_grid(n: int) -> tuple[Array, Array]:
    """The surface of [-1, 1]³, closed, n x n squares a side."""
    line = np.linspace(-1, 1, n + 1)
    x, y = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    sides = [
        np.roll(np.stack([x, y, np.full_like(x, z)], 1), k, 1)
        for k in range(3)
        for z in (-1.0, 1.0)
    ]
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = np.stack([corner, corner + n + 1, corner + n + 2, corner + 1], 1)
    one = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    triangles = [side * len(x) + (one if side % 2 else one[:, ::-1]) for side in range(6)]
    vertices, place = np.unique(np.concatenate(sides), axis=0, return_inverse=True)
    return vertices, place.ravel()[np.concatenate(triangles)].astype(np.uint32)


def bumpy(rows: int = 40) -> tuple[Array, Array]:
    """Closed and star-shaped: latitudes and longitudes with a radius of 0.75 to 1.25, slivers at
    the poles.
    """
    theta, phi = (
        np.linspace(0, np.pi, rows + 1)[1:-1, None],
        np.arange(2 * rows)[None] * np.pi / rows,
    )
    radius = 1 + 0.25 * np.sin(5 * theta) * np.cos(7 * phi)
    ring = radius[..., None] * np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], -1
    )
    vertices = np.concatenate([[[0, 0, 1]], ring.reshape(-1, 3), [[0, 0, -1]]])
    n, last, triangles = 2 * rows, len(vertices) - 1, []
    for k in range(n):
        m = (k + 1) % n
        triangles += [[0, 1 + k, 1 + m], [last, last - n + m, last - n + k]]
        for r in range(rows - 2):
            a, b = 1 + r * n, 1 + (r + 1) * n
            triangles += [[a + k, b + k, b + m], [a + k, b + m, a + m]]
    return vertices, np.array(triangles, np.uint32)


def oblique_grid(n: int = 64) -> tuple[Array, Array]:
    """An open grid over [-1, 1]² in a tilted plane."""
    line = np.linspace(-1, 1, n + 1)
    x, y = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = np.stack([corner, corner + n + 1, corner + n + 2, corner + 1], 1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.uint32)
    return np.stack([x, 0.6 * y - 0.3 * x, 0.8 * y + 0.2 * x], 1), triangles


def brute_force(
    corners: Array, origins: Array, directions: Array, t_min: Array, t_max: Array
) -> tuple[Array, Array, Array]:
    """Of n rays and m triangles (m, 3, 3), float64 (Möller and Trumbore 1997): (n, m) the parameter
    where they meet, NaN where they miss; (n, m) how far everything would have to move, in world
    units, to change that; (n, m) |cosine| between ray and normal.

    The second is 0 for triangles that are all but flat and infinite for those with two equal
    corners, which nothing meets.
    """
    a, b, c = (corners[None, :, k] for k in range(3))
    d, o = directions[:, None], origins[:, None]
    length = np.sqrt((d * d).sum(2))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        p = np.cross(d, c - a)
        det = (p * (b - a)).sum(2)
        u = ((o - a) * p).sum(2) / det
        q = np.cross(o - a, b - a)
        v = (d * q).sum(2) / det
        t = ((c - a) * q).sum(2) / det
        area = np.linalg.norm(np.cross(b - a, c - a), axis=2)
        cosine = np.abs(det) / (area * length)
        heights = [area / np.linalg.norm(side, axis=2) for side in (c - a, b - a, c - b)]
        edges = np.minimum.reduce(
            [np.abs(w) * h for w, h in zip((u, v, 1 - u - v), heights, strict=True)]
        )
        ends = np.minimum(np.abs(t - t_min[:, None]), np.abs(t - t_max[:, None])) * length
        inside = (u >= 0) & (v >= 0) & (u + v <= 1)
        meets = inside & (t > t_min[:, None]) & (t < t_max[:, None])
        clear = cosine * np.where(inside, np.minimum(edges, ends), edges)
    none = (a == b).all(2) | (b == c).all(2) | (c == a).all(2)
    clear = np.where(none, np.inf, np.where(np.isfinite(clear), clear, 0))
    return np.where(meets & ~none, t, np.nan), clear, cosine
