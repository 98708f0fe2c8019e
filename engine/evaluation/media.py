"""Where rays are inside of closed surfaces that media fill, and what there is of these along them
(semantics/media.md).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..linear.columns import dot, length, pick, unit
from ..scene import Mesh, Polygons, Scene, Spheres, Strands
from .attributes import Attributes
from .geometry import ULPS, Geometry
from .march import Marching, Matter, Spans
from .surface import points_on

Array = np.ndarray


@dataclass
class Moment:
    """Which sample of the pixels is traced."""

    sample: int = 0


class Rays(Protocol):
    """n rays. near: (n,) where they begin to look."""

    @property
    def near(self) -> Array: ...

    def __len__(self) -> int: ...

    def lines(self, rays: Array) -> tuple[Array, Array]:
        """Origins and directions (3, m) of the rays at these places."""

    def tie(self, ray: Array, depth: Array) -> Array:
        """(m,) how far apart two hits of rays `ray` (m,) at `depth` may lie and be one to
        rounding.
        """


@dataclass(frozen=True, eq=False)
class Lines:
    """n rays of which no more is known: origins and directions (3, n), near (n,); `Rays`."""

    origin: Array
    direction: Array
    near: Array

    def __len__(self) -> int:
        return len(self.near)

    def lines(self, rays: Array) -> tuple[Array, Array]:
        """As of `Rays`, with t as parameter."""
        return pick(self.origin, rays), pick(self.direction, rays)

    def tie(self, ray: Array, depth: Array) -> Array:
        """As of `Rays`: ULPS of the coordinates there."""
        return ULPS * (np.abs(self.origin).max(0).take(ray) + np.abs(depth))


class MediaSpans:
    """The media of a scene, as rays meet them. moment: what those have in common that are made of
    one. boxes: (r, 2, 3) lower and upper corners round the rows of the placements.
    """

    def __init__(
        self,
        scene: Scene,
        attributes: Attributes,
        geometry: Geometry,
        meet: Callable[[Rays, Array], tuple[Array, Array, Array]],
    ) -> None:
        """meet: rays, primitives and depths (m,) of all hits of rays, however far, on the
        primitives (p,) bool.
        """
        self.moment = Moment()
        self._geometry, self._meet = geometry, meet
        placements = geometry.placements
        inside = [scene.medium_of(instances) for instances in scene.instances]
        number = 0 if scene.world.medium is None else 1
        self._world = number - 1
        self._media = [scene.world.medium] * number + [m for m in inside if m is not None]
        found = np.array([medium is not None for medium in inside], bool)
        of_block = np.where(found, number - 1 + np.cumsum(found), -1)
        self._of_row = of_block[placements.block]
        self.boxes = _boxes(scene, geometry, self._of_row)
        self._matter = Matter.of(self._media)
        self._marching = Marching.of(scene, self._media, geometry, attributes)

    @property
    def asked(self) -> Counter[str]:
        """How many points the programs of media ran at, if any did."""
        return self._marching.asked if self._marching is not None else Counter()

    def spans(self, rays: Rays, kind: str, far: Array) -> Spans:
        """Where rays that obey visible_<kind> are, from where they begin to look on, beyond what
        they meet at far (n,) too; media that vary only up to there, cut as the present sample cuts
        them.
        """
        n = len(rays)
        origin, along = rays.lines(np.arange(n))
        everywhere = np.arange(n if self._world >= 0 else 0)
        spans = [(everywhere, np.full(len(everywhere), self._world), -1, -np.inf, np.inf)]
        if (self._of_row >= 0).any() and n:
            ray, row, start, end = self._inside(rays, kind)
            start, end = _clipped(origin[:, ray], along[:, ray], self.boxes[row], start, end)
            spans.append((ray, self._of_row[row], row, start, end))
        sizes = [len(span[0]) for span in spans]
        columns = zip(*spans, strict=True)
        parts = [
            np.concatenate([np.full(k, v) for k, v in zip(sizes, c, strict=True)]) for c in columns
        ]
        whole, matter = np.stack(parts[3:]), self._matter.take(parts[1])
        speed, largest = length(along), np.abs(origin).max(0, initial=0.0)
        spans = Spans(*parts, whole, matter, speed, largest)
        if self._marching is None:
            return spans
        lines = origin, along
        kind = "mirror" if kind in ("transmission", "diffuse") else kind  # as programs have it
        return self._marching.marched(
            spans, self.boxes, lines, rays.near, far, self.moment.sample, kind
        )

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
        ray, primitive, depth = self._meet(rays, bounds if seen is None else bounds & seen)
        o, d = rays.lines(ray)
        _, g, _ = points_on(geometry, primitive, np.zeros((3, len(ray))), o, d, depth)
        outside = dot(g, unit(-d)) >= 0
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
