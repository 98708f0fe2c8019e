"""Tangents of UV maps, as normal maps are baked for: those of Mikkelsen, "Simulation of wrinkled
surfaces revisited" (2008), which Cycles uses too.

Each triangle's direction of growing u, laid into the plane of a corner's normal and weighed by the
corner's angle, is added up over all triangles whose corners share vertex, normal, (u, v) and
orientation. Two triangles of one polygon have one tangent at a corner that they share: the mean,
where the polygon is bent or its map is, and Cycles has one for each.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from ctypes import byref

import numpy as np

from .linear.elementary import arccos
from .native import binding
from .native.core_types import TangentData
from .native.packer import address

_MIX = 0x9E3779B97F4A7C15
"""Of Fibonacci hashing (Knuth, The Art of Computer Programming 3, 6.4)."""


def tangents(
    vertices: np.ndarray, triangles: np.ndarray, corners: np.ndarray, normals: np.ndarray,
    uv: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """(k, 4) float32: unit tangent, and the sign of the bitangent, of each of k corners of a mesh.
    By the core where it loads, to the same bits.

    vertices (v, 3); triangles, corners (n, 3) rows of vertices and of what is returned; normals
    (n, 3, 3) unit, of each triangle's corners; uv (k, 2). Raises IndexError where a row is not
    there, MemoryError.
    """
    core = _core_function()
    given = {
        name: np.ascontiguousarray(values, dtype)
        for name, values, dtype in (
            ("vertices", vertices, np.float64),
            ("triangles", triangles, np.uint32),
            ("corners", corners, np.uint32),
            ("normals", normals, np.float64),
            ("uv", uv, np.float64),
        )
    }
    found = np.empty((len(uv), 4), np.float32)
    counts = len(triangles), len(vertices), len(uv)
    data = TangentData(*map(address, given.values()), *counts)
    if core is None or core(byref(data), address(found)) != 0:  # NumPy tells what is wrong
        return tangents_by_numpy(**given)
    return found


@functools.cache
def _core_function() -> Callable[..., int] | None:
    return None if binding.load_error() else binding.library().glint_tangents


def tangents_by_numpy(
    vertices: np.ndarray, triangles: np.ndarray, corners: np.ndarray, normals: np.ndarray,
    uv: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """As `tangents`."""
    normal, at = _columns(normals), _columns(uv)[:, corners]
    edges, (s, t) = _steps(_columns(vertices)[:, triangles]), _steps(at)
    area = s[:, 2] * t[:, 0] - s[:, 0] * t[:, 2]
    sign = np.where(area > 0, 1.0, -1.0)
    across = _unit((t[:, 0] * edges[:, :, 2] - t[:, 2] * edges[:, :, 0]) * sign)
    flat = _unit(_laid(across[:, :, None], normal))
    ahead, back = _unit(_laid(edges, normal)), _unit(_laid(-np.roll(edges, 1, -1), normal))
    weight = arccos(np.clip(_dot(ahead, back), -1.0, 1.0)) * (area != 0)[:, None]
    group = _groups([triangles, *at, *normal, np.repeat(sign, 3).reshape(-1, 3)])
    total = _unit(_sums(group, flat * weight, group.max(initial=-1) + 1))
    result = np.ones((len(uv), 4), np.float32)
    result[:, :3] = _unit(_sums(corners.ravel(), total[:, group], len(uv))).T
    result[corners.ravel(), 3] = np.repeat(sign, 3)
    return result


def _columns(rows: np.ndarray) -> np.ndarray:
    """Float64, the last axis first: a column is contiguous."""
    return np.ascontiguousarray(np.moveaxis(rows, -1, 0), np.float64)


def _steps(corners: np.ndarray) -> np.ndarray:
    """From each corner of triangles to the next one, (…, n, 3)."""
    return np.roll(corners, -1, -1) - corners


def _laid(vectors: np.ndarray, normals: np.ndarray) -> np.ndarray:
    return vectors - normals * _dot(normals, vectors)


def _groups(columns: list[np.ndarray]) -> np.ndarray:
    """A number for each entry, the same where all columns are equal."""
    words = [(column + 0.0).ravel().view(np.uint64) for column in columns]
    for factor in range(_MIX, 1 << 64, 2):
        key = np.zeros(len(words[0]), np.uint64)
        for word in words:
            key = (key ^ word) * np.uint64(factor)
            key ^= key >> np.uint64(32)
        _, first, number = np.unique(key, return_index=True, return_inverse=True)
        if all((word[first][number] == word).all() for word in words):
            break
    return number


def _sums(number: np.ndarray, columns: np.ndarray, count: int) -> np.ndarray:
    """(3, count), of all entries of each number. columns (3, …)."""
    return np.stack([np.bincount(number, column.ravel(), count) for column in columns])


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _unit(a: np.ndarray) -> np.ndarray:
    length = np.sqrt(_dot(a, a))
    return a / np.where(length > 0, length, 1.0)
