"""Tangents of UV maps, as normal maps are baked for: those of Mikkelsen, "Simulation of wrinkled
surfaces revisited" (2008), which Cycles uses too.

Each triangle's direction of growing u, laid into the plane of a corner's normal and weighed by the
corner's angle, is added up over all triangles whose corners share vertex, normal, (u, v) and
orientation. Two triangles of one polygon have one tangent at a corner that they share: the mean,
where the polygon is bent or its map is, and Cycles has one for each.
"""

from __future__ import annotations

import numpy as np


def tangents(
    vertices: np.ndarray, triangles: np.ndarray, corners: np.ndarray, normals: np.ndarray,
    uv: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """(k, 4) float32: unit tangent, and the sign of the bitangent, of each of k corners of a mesh.

    vertices (v, 3); triangles, corners (n, 3) rows of vertices and of what is returned; normals
    (n, 3, 3) unit, of each triangle's corners; uv (k, 2).
    """
    p, at = vertices.astype(np.float64)[triangles], uv.astype(np.float64)[corners]
    edges, steps = np.roll(p, -1, 1) - p, np.roll(at, -1, 1) - at
    e, f = edges[:, 0], -edges[:, 2]
    s, t = steps[:, 0], -steps[:, 2]
    area = s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]
    sign = np.where(area > 0, 1.0, -1.0)
    across = _unit((t[:, 1:] * e - s[:, 1:] * f) * sign[:, None])
    flat = _unit(across[:, None] - normals * _dot(normals, across[:, None]))
    ahead = _unit(edges - normals * _dot(normals, edges))
    back = -np.roll(edges, 1, 1)
    back = _unit(back - normals * _dot(normals, back))
    weight = np.arccos(np.clip(_dot(ahead, back), -1.0, 1.0)) * (area != 0)[:, None, None]
    group = _groups(triangles, at, normals, sign)
    total = np.zeros((group.max(initial=-1) + 1, 3))
    np.add.at(total, group.ravel(), (flat * weight).reshape(-1, 3))
    sums = np.zeros((len(uv), 3))
    np.add.at(sums, corners.ravel(), _unit(total)[group.ravel()])
    result = np.ones((len(uv), 4), np.float32)
    result[:, :3] = _unit(sums)
    result[corners.ravel(), 3] = np.repeat(sign, 3)
    return result


def _groups(
    triangles: np.ndarray, uv: np.ndarray, normals: np.ndarray, sign: np.ndarray
) -> np.ndarray:
    """(n, 3) numbers of what shares one tangent."""
    keys = np.concatenate(
        [
            triangles.astype(np.float64)[..., None],
            uv,
            normals,
            np.broadcast_to(sign[:, None, None], (*triangles.shape, 1)),
        ],
        -1,
    )
    rows = np.ascontiguousarray(keys + 0.0).reshape(-1, keys.shape[-1])
    _, numbers = np.unique(
        rows.view(f"V{rows.itemsize * rows.shape[1]}").ravel(), return_inverse=True
    )
    return numbers.reshape(triangles.shape)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(-1, keepdims=True)


def _unit(a: np.ndarray) -> np.ndarray:
    length = np.sqrt(_dot(a, a))
    return a / np.where(length > 0, length, 1.0)
