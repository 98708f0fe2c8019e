"""What rays lose in the media that they pass through: where rays are inside of closed surfaces, and
the transmittance e^(-σ s) of what fills these (Beer and Lambert).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import numpy as np

from ..scene import Mesh, Polygons, Scene, Spheres, Strands
from .attributes import Attributes
from .geometry import Geometry
from .rays import Rays
from .surface import surface_at
from .vectors import length
from .visibility import Visibility

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Spans:
    """Where n rays are inside of media: ray (m,), medium (m,) numbers, start and end (m,) along the
    rays. speed: (n,) world units for one of these.
    """

    ray: Array
    medium: Array
    start: Array
    end: Array
    speed: Array

    def paths(self, near: Array, far: Array) -> tuple[Array, Array, Array]:
        """Rays and media (m,), and how much of each lies between near and far (n,), world units."""
        start, end = np.maximum(self.start, near[self.ray]), np.minimum(self.end, far[self.ray])
        some = np.flatnonzero(end > start)
        return self.ray[some], self.medium[some], (end - start)[some] * self.speed[self.ray[some]]


class Media:
    """The media of a scene, as rays meet them."""

    def __init__(self, scene: Scene, attributes: Attributes, visibility: Visibility):
        self._attributes, self._visibility = attributes, visibility
        self._geometry = visibility.geometry
        placements = self._geometry.placements
        inside = [scene.medium_of(instances) for instances in scene.instances]
        number = 0 if scene.world.medium is None else 1
        self._world = number - 1
        self._media = [scene.world.medium] * number + [m for m in inside if m is not None]
        found = np.array([medium is not None for medium in inside], bool)
        of_block = np.where(found, number - 1 + np.cumsum(found), -1)
        self._of_row = of_block[placements.block]
        self._boxes = _boxes(scene, self._geometry, self._of_row)
        self._extinction = _columns([medium.extinction for medium in self._media])

    def __bool__(self) -> bool:
        return bool(self._media)

    def of(self, rows: Array) -> Media:
        """Those of some rows of the placements alone, (r,) bool, and of the world."""
        result = copy.copy(self)
        result._of_row = np.where(rows, self._of_row, -1)
        return result

    def spans(self, rays: Rays, kind: str) -> Spans:
        """Where rays of a kind are, from where they begin to look on, beyond what they meet too."""
        n = len(rays)
        origin, along = rays.lines(np.arange(n))
        everywhere = np.arange(n if self._world >= 0 else 0)
        spans = [(everywhere, np.full(len(everywhere), self._world), -np.inf, np.inf)]
        if (self._of_row >= 0).any() and n:
            ray, row, start, end = self._inside(rays, kind)
            start, end = _clipped(origin[:, ray], along[:, ray], self._boxes[row], start, end)
            spans.append((ray, self._of_row[row], start, end))
        sizes = [len(span[0]) for span in spans]
        columns = zip(*spans, strict=True)
        parts = [
            np.concatenate([np.full(k, v) for k, v in zip(sizes, c, strict=True)]) for c in columns
        ]
        return Spans(*parts, length(along))

    def depth(self, spans: Spans, near: Array, far: Array) -> Array:
        """(3, n) optical depths between near and far (n,) of each ray."""
        ray, medium, way = spans.paths(near, far)
        total = np.zeros((3, len(near)))
        for sigma, sums in zip(self._extinction[:, medium], total, strict=True):
            some = sigma > 0
            np.add.at(sums, ray[some], sigma[some] * way[some])
        return total

    def passed(self, spans: Spans, near: Array, far: Array) -> Array:
        """(3, n) how much light goes straight on from near to far (n,)."""
        return np.exp(-self.depth(spans, near, far))

    def _inside(self, rays: Rays, kind: str) -> tuple[Array, Array, Array, Array]:
        """Ray, row of the placements, start and end of each span: where a ray goes out further on
        more often than in.
        """
        ray, row, depth, step = self._crossings(rays, kind)
        count = len(ray)
        if not count:
            return ray, row, depth, depth
        new = np.concatenate([[True], (np.diff(ray) != 0) | (np.diff(row) != 0)])
        left = np.cumsum(-step)
        apart = -(2 * count + 2) * np.cumsum(new)  # keeps each ray and row above those after it
        most = np.maximum.accumulate((left + apart)[::-1])[::-1] - apart
        inside = np.flatnonzero(most > left + step)
        start = np.where(new, -np.inf, np.roll(depth, 1))
        return ray[inside], row[inside], start[inside], depth[inside]

    def _crossings(self, rays: Rays, kind: str) -> tuple[Array, Array, Array, Array]:
        """Rays, rows, depths and +1 where they go in, -1 where out, 0 where both, sorted by ray,
        row and depth. What rounding cannot tell apart is one.
        """
        geometry = self._geometry
        bounds = self._of_row[geometry.row] >= 0
        seen = geometry.visible[kind]
        rays = replace(rays, far=np.full(len(rays), np.inf))
        ray, primitive, depth = self._visibility.crossings(
            rays, bounds if seen is None else bounds & seen
        )
        outside = surface_at(
            geometry, self._attributes, rays, ray, primitive, depth, self._visibility.pulse
        ).outside
        row = geometry.row[primitive].astype(np.intp)
        order = np.lexsort((depth, row, ray))
        ray, row, depth, outside = ray[order], row[order], depth[order], outside[order]
        if not len(ray):
            return ray, row, depth, depth
        same = (np.diff(ray) == 0) & (np.diff(row) == 0)
        same &= np.diff(depth) <= rays.tie(ray[:-1], depth[:-1])
        first = np.flatnonzero(np.concatenate([[True], ~same]))
        enters = np.logical_or.reduceat(outside, first)
        leaves = np.logical_or.reduceat(~outside, first)
        return ray[first], row[first], depth[first], enters.astype(np.intp) - leaves


def _columns(colors: list[tuple[float, float, float]]) -> Array:
    return np.array(colors, np.float64).reshape(-1, 3).T


def _boxes(scene: Scene, geometry: Geometry, of_row: Array) -> Array:
    """(r, 2, 3) lower and upper corner round the corners of each row's box in its object, for rows
    with a medium.
    """
    placements = geometry.placements
    boxes = np.zeros((len(of_row), 2, 3))
    local = {}
    for row in np.flatnonzero(of_row >= 0):
        number = placements.geometry[row]
        if number not in local:
            local[number] = _box_corners(scene.geometries[number])
        m = placements.world_from_object[row]
        corners = local[number] @ m[:, :3].T + m[:, 3]
        boxes[row] = corners.min(0), corners.max(0)
    return boxes


def _box_corners(geometry: Mesh | Spheres | Polygons | Strands) -> Array:
    """(8, 3) of the box round all finite points in the object; zeros where there are none."""
    is_round = isinstance(geometry, Spheres)
    points = np.asarray(geometry.centers if is_round else geometry.vertices, np.float64)
    radii = np.asarray(geometry.radii, np.float64) if is_round else np.zeros(len(points))
    sound = np.isfinite(points).all(1) & np.isfinite(radii)
    points, radii = points[sound], radii[sound, None]
    if not len(points):
        return np.zeros((8, 3))
    ends = np.stack([(points - radii).min(0), (points + radii).max(0)])
    return np.array([[ends[k & 1, 0], ends[k >> 1 & 1, 1], ends[k >> 2, 2]] for k in range(8)])


def _clipped(
    origin: Array, along: Array, boxes: Array, start: Array, end: Array
) -> tuple[Array, Array]:
    """Spans cut to boxes (m, 2, 3): a surface that is not closed bounds nothing beyond its own."""
    for axis in range(3):
        low, high = boxes[:, 0, axis], boxes[:, 1, axis]
        o, d = origin[axis], along[axis]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            a, b = (low - o) / d, (high - o) / d
        beside = (d == 0) & ((o < low) | (o > high))
        start = np.maximum(start, np.where(d == 0, -np.inf, np.minimum(a, b)))
        end = np.where(beside, -np.inf, np.minimum(end, np.where(d == 0, np.inf, np.maximum(a, b))))
    return start, end
