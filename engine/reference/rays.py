"""Two kinds of ray sets and their exact triangle test.

`CoherentRays` (all through one point, or all parallel) are described in a `Frame` where they run
along z: their hits are a rasterisation, exact for camera rays and for the shadow rays of a hard
light. `IncoherentRays` are any others.

The test (notes, section 4.8, made watertight; Woop, Benthin, Wald 2013): the triangle is sheared so
that the ray becomes the z axis; the 2D edge functions p_x q_y − p_y q_x of its corners are then
differences of two rounded products, whose sign is right or zero because rounding keeps order.
Corners shared by triangles are sheared to the same bits, so with zero counting as inside (closed
triangles) a ray cannot slip through between neighbours. Nothing may contract these products into
fused multiply-adds.

Letters: a b c corners relative to the ray, u v w edge functions opposite to them, z depth along the
ray.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..evaluation.geometry import ULPS, Geometry
from ..evaluation.media import Lines
from ..linear.columns import pick, transform

Array = np.ndarray

FAR_AWAY = 1e9
"""Projected coordinates beyond this (all but sideways) lose too many digits; such triangles are
tested against every ray.
"""


class Weights(NamedTuple):
    """Edge functions u v w (m,), their sum, and the depth of the point that they weigh."""

    u: Array
    v: Array
    w: Array
    total: Array
    depth: Array

    def barycentric(self) -> Array:
        """(3, m) weights of the corners (notes, section 2.7), clipped to the triangle and summing
        to 1.
        """
        b, c = (np.clip(part / self.total, 0.0, 1.0) for part in (self.v, self.w))
        c = np.minimum(c, 1.0 - b)
        return np.stack([1.0 - b - c, b, c])


@dataclass(frozen=True, eq=False)
class Frame:
    """Where coherent rays run along z.

    matrix: (3, 3) frame from world.  origin: (3,) the common point in the world, 0 for parallel
    rays. perspective: rays through the origin (u, v, 1) z; else parallel ones (u, v, z). points:
    (3, v) all vertices in the frame.  projected: (2, v) their u and v, infinite where they are not
    in front.
    """

    matrix: Array
    origin: Array
    perspective: bool
    points: Array
    projected: Array

    @classmethod
    def of(cls, geometry: Geometry, matrix: Array, origin: Array, perspective: bool) -> Frame:
        points = transform(matrix, geometry.points - origin[:, None])
        return cls(
            matrix, origin, perspective, points, cls.project(points) if perspective else points[:2]
        )

    @staticmethod
    def project(points: Array) -> Array:
        """(3, n) in the frame -> (2, n): x/z and y/z where z > 0, infinite elsewhere and where the
        quotient is huge.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            projected = points[:2] / points[2]
        front = (points[2] > 0) & (np.abs(projected[0]) + np.abs(projected[1]) < FAR_AWAY)
        return np.where(front, projected, np.inf)


@dataclass(frozen=True, eq=False)
class CoherentRays:
    """n rays of a frame: u, v (n,) where they run; hits count where near < z < far, (n,) each."""

    frame: Frame
    u: Array
    v: Array
    near: Array
    far: Array

    def __len__(self) -> int:
        return len(self.u)

    def take(self, rays: Array) -> CoherentRays:
        """The rays at these places."""
        return replace(
            self, u=self.u[rays], v=self.v[rays], near=self.near[rays], far=self.far[rays]
        )

    def tie(self, ray: Array, depth: Array) -> Array:
        """(m,) how far apart two hits of rays `ray` (m,) at `depth` may lie and be one to rounding:
        ULPS of the coordinates there.
        """
        reach = (
            np.abs(self.frame.origin).max()
            if self.frame.perspective
            else np.maximum(np.abs(self.u), np.abs(self.v)).take(ray)
        )
        return ULPS * (reach + np.abs(depth))

    def lines(self, rays: Array) -> tuple[Array, Array]:
        """World origins and directions (3, m) with depth z as parameter."""
        world = np.linalg.inv(self.frame.matrix)
        u, v = self.u[rays], self.v[rays]
        if self.frame.perspective:
            return np.repeat(self.frame.origin[:, None], len(rays), 1), transform(
                world, np.stack([u, v, np.ones(len(rays))])
            )
        start = transform(world, np.stack([u, v, np.zeros(len(rays))]))
        return start, np.repeat(world[:, 2:], len(rays), 1)

    def corners(
        self, geometry: Geometry, ray: Array, triangle: Array
    ) -> list[tuple[Array, Array, Array]]:
        """Corners relative to the rays, sheared; z as depth."""
        u, v = self.u.take(ray), self.v.take(ray)
        x, y, z = self.frame.points
        result = []
        for corner in geometry.triangles:
            k = corner.take(triangle)
            d = z.take(k)
            if self.frame.perspective:
                result.append((x.take(k) - u * d, y.take(k) - v * d, d))
            else:
                result.append((x.take(k) - u, y.take(k) - v, d))
        return result


@dataclass(frozen=True, eq=False)
class IncoherentRays(Lines):
    """n rays with origins and unit directions (3, n) in the world; hits count where near < t < far,
    (n,) each.

    axes: (3, n) Woop's order of the coordinates, the direction's largest last.  shear: (3, n)
    dx/dz, dy/dz, 1/dz in that order.
    """

    far: Array
    axes: Array
    shear: Array

    @classmethod
    def of(cls, origin: Array, direction: Array, near: Array, far: Array) -> IncoherentRays:
        largest = np.abs(direction).argmax(0)
        axes = np.stack([(largest + 1) % 3, (largest + 2) % 3, largest])
        dx, dy, dz = np.take_along_axis(direction, axes, 0)
        return cls(origin, direction, near, far, axes, np.stack([dx / dz, dy / dz, 1 / dz]))

    def take(self, rays: Array) -> IncoherentRays:
        """The rays at these places."""
        o, d, axes, shear = (
            pick(a, rays) for a in (self.origin, self.direction, self.axes, self.shear)
        )
        return IncoherentRays(o, d, self.near[rays], self.far[rays], axes, shear)

    def corners(
        self, geometry: Geometry, ray: Array, triangle: Array
    ) -> list[tuple[Array, Array, Array]]:
        """Corners relative to the rays, sheared; z as t."""
        points, count = geometry.points.ravel(), geometry.points.shape[1]
        axes = [axis.take(ray) for axis in self.axes]
        start = [self.origin.ravel().take(axis * len(self) + ray) for axis in axes]
        sx, sy, sz = (s.take(ray) for s in self.shear)
        result = []
        for corner in geometry.triangles:
            k = corner.take(triangle)
            x, y, z = (
                points.take(axis * count + k) - o for axis, o in zip(axes, start, strict=True)
            )
            result.append((x - sx * z, y - sy * z, z * sz))
        return result


Rays = CoherentRays | IncoherentRays


def weigh(rays: Rays, geometry: Geometry, ray: Array, triangle: Array) -> Weights:
    """Edge functions and depth of pairs of a ray and a triangle that the ray hits."""
    return _with_depth(*_edges(rays, geometry, ray, triangle))


def _edges(rays: Rays, geometry: Geometry, ray: Array, triangle: Array):
    corners = rays.corners(geometry, ray, triangle)
    (ax, ay, _), (bx, by, _), (cx, cy, _) = corners
    return (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax), [z for _, _, z in corners]


def _with_depth(edges, depths) -> Weights:
    (u, v, w), (za, zb, zc) = edges, depths
    total = u + v + w
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return Weights(u, v, w, total, (u * za + v * zb + w * zc) / total)


def hit_triangles(
    rays: Rays, geometry: Geometry, ray: Array, triangle: Array, limit: Array
) -> tuple[Array, Array]:
    """Which of the pairs (ray, triangle) (m,) meet in near < z <= limit, as places in the arrays,
    and at which depth.

    Triangles seen exactly edge on (all of u v w zero) are never met.
    """
    (u, v, w), depths = _edges(rays, geometry, ray, triangle)
    least, most = np.minimum(np.minimum(u, v), w), np.maximum(np.maximum(u, v), w)
    inside = np.flatnonzero(((least >= 0) & (most > 0)) | ((most <= 0) & (least < 0)))
    weights = _with_depth([e.take(inside) for e in (u, v, w)], [z.take(inside) for z in depths])
    mine = ray.take(inside)
    good = (
        (weights.depth > rays.near.take(mine))
        & (weights.depth < rays.far.take(mine))
        & (weights.depth <= limit.take(mine))
    )
    return inside[good], weights.depth[good]
