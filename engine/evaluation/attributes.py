"""Attributes of all meshes, pooled so that hits on many meshes are interpolated in one go (notes,
section 2.7).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..linear.columns import pick
from ..scene import CORNER, FACE, POINT, Attribute, Mesh, Polygons, Scene, Spheres, Strands

Array = np.ndarray

_DOMAINS = {POINT: 0, CORNER: 1, FACE: 2}
_MISSING = -1


@dataclass(frozen=True, eq=False)
class Corners:
    """Rows of POINT and of CORNER attributes at the corners of all triangles of all meshes and at
    the ends of all segments, (3, t) each; 0 of spheres. first (g,) of each geometry.
    """

    point: Array
    corner: Array
    first: Array

    @classmethod
    def of(cls, scene: Scene) -> Corners:
        point, corner, first, count = [], [], [], 0
        for geometry in scene.geometries:
            first.append(count)
            if isinstance(geometry, Mesh):
                point.append(geometry.triangles)
                corner.append(geometry.triangles if geometry.corners is None else geometry.corners)
                count += len(geometry.triangles)
            elif isinstance(geometry, Strands) and geometry.attributes:
                point.append(geometry.ends)
                corner.append(geometry.ends)
                count += len(geometry.starts)
            elif isinstance(geometry, Spheres) and geometry.attributes:
                point.append(np.zeros((len(geometry.radii), 3), np.uint32))
                corner.append(point[-1])
                count += len(geometry.radii)
        points, corners = (
            np.ascontiguousarray(
                np.concatenate([np.zeros((0, 3), np.uint32), *rows]).T.astype(np.intp)
            )
            for rows in (point, corner)
        )
        return cls(points, corners, np.array(first, np.intp))


Find = Callable[[Mesh | Strands | Spheres], Attribute | None]


@dataclass(frozen=True, eq=False)
class Pool:
    """One attribute of many meshes. values (c, k) float64; first (g,) row of each geometry,
    _MISSING for those that lack it; domain (g,) code.
    """

    corners: Corners
    values: Array
    first: Array
    domain: Array

    @classmethod
    def of(
        cls,
        scene: Scene,
        corners: Corners,
        find: Find,
        channels: int,
    ) -> Pool:
        """find: picks the attribute of a mesh. It is padded with 1 (the alpha of colours) or cut to
        `channels`.
        """
        values, first, domain, count = [np.zeros((channels, 0))], [], [], 0
        for geometry in scene.geometries:
            attribute = None if isinstance(geometry, Polygons) else find(geometry)
            first.append(_MISSING if attribute is None else count)
            domain.append(0 if attribute is None else _DOMAINS[attribute.domain])
            if attribute is not None:
                values.append(_padded(attribute.values, channels))
                count += len(attribute.values)
        return cls(
            corners, np.concatenate(values, 1), np.array(first, np.intp), np.array(domain, np.intp)
        )

    def has(self, geometry: Array) -> Array:
        """Which geometries (n,) have the attribute."""
        return self.first[geometry] != _MISSING

    def at_corners(self, geometry: Array, primitive: Array) -> list[Array]:
        """Three times (c, n): values at the corners of the triangles; 0 where there are none."""
        if not self.values.shape[1]:
            return [np.zeros((len(self.values), len(primitive)))] * 3
        has, domain = self.has(geometry), self.domain[geometry]
        triangle = np.where(has, self.corners.first[geometry] + primitive, 0)
        primitive = np.where(has, primitive, 0)
        base = np.where(has, self.first[geometry], 0)
        result = []
        for point, corner in zip(self.corners.point, self.corners.corner, strict=True):
            row = base + np.choose(domain, (point[triangle], corner[triangle], primitive))
            result.append(np.where(has, pick(self.values, np.where(has, row, 0)), 0.0))
        return result

    def at(self, geometry: Array, primitive: Array, weights: Array) -> Array:
        """(c, n): interpolated with the barycentric weights (3, n)."""
        a, b, c = self.at_corners(geometry, primitive)
        return weights[0] * a + weights[1] * b + weights[2] * c


def _padded(values: Array, channels: int) -> Array:
    values = np.where(np.isfinite(values), values, 0).astype(np.float64).T
    result = np.zeros((channels, values.shape[1]))
    result[:channels][: len(values)] = values[:channels]
    if len(values) < 4 <= channels:
        result[3] = 1.0
    return result


class Attributes:
    """The pools of a scene, made when first asked for."""

    def __init__(self, scene: Scene):
        self._scene = scene
        self._corners = Corners.of(scene)
        self._pools: dict[tuple[str, str], Pool] = {}

    def _pool(
        self,
        kind: str,
        name: str,
        find: Find,
        channels: int,
    ) -> Pool:
        if (kind, name) not in self._pools:
            self._pools[kind, name] = Pool.of(self._scene, self._corners, find, channels)
        return self._pools[kind, name]

    def normals(self) -> Pool:
        """Shading normals, 3 channels."""
        return self._pool("normals", "", lambda mesh: getattr(mesh, "normals", None), 3)

    def uv(self, name: str) -> Pool:
        """The UV map of this name, "" for the active one, 2 channels."""
        maps = partial(_first, lambda a: is_uv(a, name))
        return self._pool("uv", name, maps, 2)

    def color(self, name: str) -> Pool:
        """The colour attribute of this name, 4 channels."""
        return self._pool("color", name, partial(_first, lambda a: a.name == name), 4)


def _first(fits: Callable[[Attribute], bool], mesh: Mesh | Strands | Spheres) -> Attribute | None:
    return next(filter(fits, mesh.attributes), None)


def is_uv(attribute: Attribute, name: str) -> bool:
    """Whether it is the UV map of this name, "" for the active one, which comes first."""
    return attribute.name == name if name else attribute.values.shape[1] == 2
