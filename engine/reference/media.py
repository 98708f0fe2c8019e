"""What rays lose in the media that they pass through: where rays are inside of closed surfaces, and
the transmittance e^(-σ s) of what fills these (Beer and Lambert).
"""

from __future__ import annotations

import copy
from collections import Counter
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ..linear.columns import dot, length, pick
from ..scene import EVERYTHING, Mesh, Polygons, Scene, Spheres, Strands
from .attributes import Attributes
from .cancellation import Cancellation
from .geometry import Geometry
from .lights import Source
from .march import Marching, Matter
from .rays import Rays
from .surface import surface_at

Array = np.ndarray

SLIGHT = 2.0**-20
"""Of a medium's distance: what is thinner scatters nothing."""


@dataclass(frozen=True, eq=False)
class Spans:
    """Where n rays are inside of media: ray (m,), medium (m,) numbers, row (m,) of the placements,
    -1 for the world, start and end (m,) along the rays, whole (2, m) of what they are cells of.
    matter: what is there. speed: (n,) world units for one of these. origin: (n,) the largest
    coordinate of where they begin.
    """

    ray: Array
    medium: Array
    row: Array
    start: Array
    end: Array
    whole: Array
    matter: Matter
    speed: Array
    origin: Array

    def take(self, rays: Array) -> Spans:
        """Those of the rays at these places, no place twice."""
        places = np.full(len(self.speed), -1)
        places[rays] = np.arange(len(rays))
        some = np.flatnonzero(places[self.ray] >= 0)
        columns = (getattr(self, name)[some] for name in ("medium", "row", "start", "end"))
        return Spans(
            places[self.ray[some]],
            *columns,
            self.whole[:, some],
            self.matter.take(some),
            self.speed[rays],
            self.origin[rays],
        )

    def paths(self, near: Array, far: Array) -> tuple[Array, Array, Array]:
        """Numbers and rays (m,) of the spans between near and far (n,), and how much of each lies
        there, world units.
        """
        start, end = np.maximum(self.start, near[self.ray]), np.minimum(self.end, far[self.ray])
        some = np.flatnonzero(end > start)
        return some, self.ray[some], (end - start)[some] * self.speed[self.ray[some]]


@dataclass(frozen=True, eq=False)
class Pieces:
    """What lies along n rays: breaks (n, p + 1), and of each piece between two, (3, n, p) a world
    unit. speed: (n,) world units along the rays.
    """

    breaks: Array
    speed: Array
    extinction: Array
    scattering: Array
    emission: Array

    @property
    def ways(self) -> Array:
        """(n, p) world units of each piece."""
        first, last = self.breaks[:, :-1], self.breaks[:, 1:]
        some = first < last
        return np.where(some, last - np.where(some, first, 0.0), 0.0) * self.speed[:, None]

    def edges(self, depths: Array) -> Array:
        """(n, m) the breaks, and where the largest of the three optical depths is one of these."""
        most = self.extinction.max(0)
        after = np.cumsum(_times(most, self.ways), 1)
        before = np.concatenate([np.zeros_like(after[:, :1]), after[:, :-1]], 1)
        end = self.breaks[:, -1:, None]
        met = (depths > before[..., None]) & (depths < after[..., None])
        with np.errstate(over="ignore"):
            way = (depths - before[..., None]) / np.where(most > 0, most, 1.0)[..., None]
        at = np.where(met, self.breaks[:, :-1, None] + way / self.speed[:, None, None], end)
        edges = np.sort(np.concatenate([self.breaks, at.reshape(len(at), -1)], 1), 1)
        edges = np.minimum(edges, self.breaks[:, -1:])
        return edges[:, : (edges < self.breaks[:, -1:]).sum(1).max(initial=1) + 1]

    def depth_at(self, t: Array) -> Array:
        """(3, n, m) optical depth at t (n, m)."""
        depth = np.zeros((3, *t.shape))
        for k in range(self.breaks.shape[1] - 1):
            first, last = self.breaks[:, k, None], self.breaks[:, k + 1, None]
            way = np.clip(t - first, 0.0, last - first) * self.speed[:, None]
            depth += self.extinction[:, :, k, None] * way
        return depth

    def scattering_at(self, t: Array) -> Array:
        """(3, n, m) at t (n, m), which lie on no break."""
        scattering = np.zeros((3, *t.shape))
        for k in range(self.breaks.shape[1] - 1):
            first, last = self.breaks[:, k, None], self.breaks[:, k + 1, None]
            scattering += self.scattering[:, :, k, None] * ((t > first) & (t < last))
        return scattering

    def glow(self) -> Array:
        """(3, n) what they give of themselves; nothing where that would be endless."""
        way = self.ways
        depths = _times(self.extinction, way)
        before = np.cumsum(np.concatenate([np.zeros_like(depths[..., :1]), depths], 2), 2)[..., :-1]
        clear = np.where(np.isinf(way), 0.0, way) * (self.extinction == 0)
        with np.errstate(over="ignore", invalid="ignore"):
            thick = -np.expm1(-depths) / np.where(self.extinction > 0, self.extinction, 1.0)
            some = np.where(self.extinction > 0, thick, clear)
            given = self.emission * some * np.exp(-before)
        return np.where(self.emission != 0, given, 0.0).sum(2)


def _times(sigma: Array, way: Array) -> Array:
    """Their product where the way may be endless."""
    with np.errstate(invalid="ignore"):
        return np.where(sigma > 0, sigma * way, 0.0)


@dataclass
class Moment:
    """Which sample of the pixels is traced."""

    sample: int = 0


class Surfaces(Protocol):
    """What `Visibility` tells of the surfaces that enclose media."""

    @property
    def geometry(self) -> Geometry: ...

    @property
    def cancellation(self) -> Cancellation: ...

    def crossings(self, rays: Rays, seen: Array) -> tuple[Array, Array, Array]: ...


class Media:
    """The media of a scene, as rays meet them. moment: what those have in common that are made of
    one. boxes: (r, 2, 3) lower and upper corners round the rows of the placements.
    """

    def __init__(self, scene: Scene, attributes: Attributes, visibility: Surfaces):
        self.moment = Moment()
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
        self.boxes = _boxes(scene, self._geometry, self._of_row)
        self._matter = Matter.of(self._media)
        self._scatters = np.array([medium.scatters for medium in self._media], bool)
        self._shines = np.ones(len(self._media), bool)
        self._marching = Marching.of(scene, self._media, self._geometry, self._attributes)
        own = [
            block.light_group for block, some in zip(scene.instances, found, strict=True) if some
        ]
        self._groups = np.array([scene.world.light_group] * number + own, np.intp)

    def __bool__(self) -> bool:
        return bool(self._media)

    @property
    def varies(self) -> bool:
        """Whether some medium does from place to place."""
        return any(medium.program is not None for medium in self._media)

    @property
    def asked(self) -> Counter[str]:
        """How many points the programs of media ran at, if any did."""
        return self._marching.asked if self._marching is not None else Counter()

    def cells(self, spans: Spans) -> int:
        """How many of the spans are cells of media that vary."""
        return sum(self._media[number].program is not None for number in spans.medium)

    def of(self, rows: Array) -> Media:
        """Those of some rows of the placements alone, (r,) bool, and of the world."""
        result = copy.copy(self)
        result._of_row = np.where(rows, self._of_row, -1)
        return result

    def of_group(self, number: int) -> Media:
        """The same, of which none but those of a light group give light."""
        result = copy.copy(self)
        result._shines = self._groups == number
        return result

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

    def depth(self, spans: Spans, near: Array, far: Array) -> Array:
        """(3, n) optical depths between near and far (n,) of each ray."""
        some, ray, way = spans.paths(near, far)
        total = np.zeros((3, len(near)))
        for sigma, sums in zip(spans.matter.extinction[:, some], total, strict=True):
            some = sigma > 0
            np.add.at(sums, ray[some], sigma[some] * way[some])
        return total

    def passed(self, spans: Spans, near: Array, far: Array) -> Array:
        """(3, n) how much light goes straight on from near to far (n,)."""
        return np.exp(-self.depth(spans, near, far))

    def pieces(self, spans: Spans, near: Array, far: Array) -> Pieces:
        """What lies along n rays from near to far (n,)."""
        n = len(near)
        order = np.argsort(spans.ray, kind="stable")
        rank = np.arange(len(order)) - np.searchsorted(spans.ray[order], spans.ray[order])
        breaks = np.repeat(far[:, None], 2 + 2 * (rank.max(initial=-1) + 1), 1)
        breaks[:, 0] = near
        ray = spans.ray[order]
        for column, name in ((2, "start"), (3, "end")):
            value = getattr(spans, name)[order]
            breaks[ray, 2 * rank + column] = np.clip(value, near[ray], np.maximum(far, near)[ray])
        breaks.sort(1)
        shape = 3, n, breaks.shape[1] - 1
        sums = {name: np.zeros(shape) for name in ("extinction", "scattering", "emission")}
        begin, finish = breaks[:, :-1], breaks[:, 1:]
        inside = np.where(np.isinf(finish), begin + 1, (begin + finish) / 2)
        for r in range(rank.max(initial=-1) + 1):
            some = order[rank == r]
            row, medium = spans.ray[some], spans.medium[some]
            here = (inside[row] > spans.start[some, None]) & (inside[row] < spans.end[some, None])
            for name, total in sums.items():
                value = getattr(spans.matter, name)[:, some, None]
                shown = self._shines[medium][:, None] if name == "emission" else True
                total[:, row] += (here & shown) * value
        return Pieces(breaks, spans.speed, **sums)

    def scattering_rays(self, spans: Spans, near: Array, far: Array) -> Array:
        """Rays along which light is scattered, on more than what rounding leaves of a medium behind
        its end.
        """
        ray, way, (first, last) = spans.ray, spans.speed[spans.ray], spans.whole
        end = np.minimum(last, far[spans.ray])
        least = SLIGHT * (end * way + spans.origin[ray])
        long = (end - np.maximum(first, near[ray])) * way > np.where(end < np.inf, least, 0.0)
        return np.unique(ray[long & self._scatters[spans.medium]])

    @property
    def emits(self) -> bool:
        """Whether one of them gives light."""
        return any(medium.emits for medium in self._media)

    def reach(self, spans: Spans, near: Array, far: Array, dark: float) -> Array:
        """far (n,), or where endless rays see next to nothing any more."""
        if not np.isinf(far).any():
            return far
        last = near.copy()
        finite = np.isfinite(spans.end)
        np.maximum.at(last, spans.ray[finite], spans.end[finite])
        if self._world < 0 or self._media[self._world].program is not None:
            return np.where(np.isinf(far), last, far)
        world = self._matter.take([self._world])
        least = world.extinction[world.scattering > 0].min(initial=np.inf)
        return np.where(np.isinf(far), last + dark / least / spans.speed, far)

    def scattering(
        self, spans: Spans, t: Array, to_light: Array, along: Array, source: Source | None
    ) -> Array:
        """(3, n) how much light from the unit directions to_light (3, n) is scattered at t of each
        ray, against its unit direction, a world unit and steradian. source: None for no light.
        """
        at = t[spans.ray]
        here = (spans.start < at) | ((spans.start == at) & (spans.start == spans.whole[0]))
        here &= at <= spans.end
        if source is not None and source.light.receivers != EVERYTHING:
            reached = self._lit_rows(source.light.receivers)
            here &= (spans.row < 0) | reached[spans.row]
        ray, matter = spans.ray[here], spans.matter.take(np.flatnonzero(here))
        g = matter.anisotropy
        cosine = dot(pick(along, ray), pick(to_light, ray))
        base = 1 + g * g - 2 * g * cosine
        with np.errstate(
            invalid="ignore"
        ):  # straight on of an anisotropy of 1: no such light counts
            phase = (1 - g * g) / (4 * np.pi * base * np.sqrt(base))
        total = np.zeros((3, len(t)))
        for sums, sigma in zip(total, matter.scattering, strict=True):
            np.add.at(sums, ray, sigma * phase)
        return total

    def _lit_rows(self, receivers: int) -> Array:
        """(r,) bool: placements that a light is for."""
        placements = self._geometry.placements
        lit = [receivers >> block.light_set & 1 for block in placements.instances]
        return np.array(lit, bool)[placements.block]

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
            geometry, self._attributes, rays, ray, primitive, depth, self._visibility.cancellation
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
