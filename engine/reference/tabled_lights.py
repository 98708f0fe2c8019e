"""Lights whose samples are rows of a table that all pixels share: the sky, and what glows.

Letters: x shaded point, q point on the light, d distance, z cosine at the light.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..lights.dome import DomeTable
from ..lights.mesh_lights import MeshTable, merged
from ..lights.openings import density, opening_table, points_on
from ..linear.columns import cross, dot, unit
from ..scene import Light, Openings
from .lights import HUGE, LightSample, Source

Array = np.ndarray

SKY_PARTS = 2
"""In so many parts the sky's samples are taken, one by each pixel sample in turn, by what gather
rays and reflections of rough surfaces meet: that is seen blurred.
"""
FEW_PARTS = 4
"""The same of all lights that have tables, by strands, as each sample of a pixel meets others of
them, and by what bounced rays meet that bring less than `FAINT` of it.
"""
FAINT = 1 / 16
"""The largest channel of T from which on it is not."""
LEAST_WIDE = 8.0
"""Exponents from here on draw directions beside the points of lights that may be all around."""
NEAREST = 1e-12
"""Of the least square of the distance of points of MESH lights, the same of what draws directions
to them.
"""
MOST_PAIRS = 1 << 21
"""Of rays and triangles that are tested at once."""
ROUNDED = 8 * 2.0**-24
"""Of coordinates: what single precision may move things by."""


@dataclass(frozen=True, eq=False)
class DomePoint:
    """A direction (3,) from which a DOME light shines, what comes from there (3,), one over the
    density of such directions, a point of the unit disc, and whose visibility rays there obey.
    """

    direction: Array
    color: Array
    spread: float
    disc: Array
    met_by: str


@dataclass(frozen=True, eq=False)
class OpeningPoint:
    """A point (3, 1) on an opening, and its normal (3,)."""

    at: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class OpeningPoints:
    """Points on the openings of a DOME light, `each` for a sample of a pixel beside `directions`
    directions. number: (n,) on which opening, at: (3, n).  Openings and points count from the eye.
    """

    openings: Openings
    number: Array
    at: Array
    each: int
    directions: int

    @staticmethod
    def of(
        light: Light, eye: Array, samples: int, each: int, directions: int
    ) -> OpeningPoints | None:
        """None where there are no openings."""
        if light.openings is None:
            return None
        found = replace(light.openings, centers=light.openings.centers - eye)
        number, place = opening_table(found, samples, each)
        return OpeningPoints(found, number, points_on(found, number, place).T, each, directions)

    def points(self) -> list[OpeningPoint]:
        normals = self.openings.normals[self.number]
        return [OpeningPoint(at[:, None], n) for at, n in zip(self.at.T, normals, strict=True)]

    def per_direction(self, x: Array, d: Array) -> Array:
        """(m,) how densely, a steradian, they lie in the directions d (3, m) from the points x
        (3, m), times how many there are for each direction of a sample.
        """
        return self.each / self.directions * density(self.openings, x, d)


class Dome(Source):
    """A light from all around. samples: directions a sample of a pixel; points on openings come
    after those of all samples.  every: of the directions highlights draw one beside so many.
    """

    def __init__(
        self,
        light: Light,
        eye: Array,
        table: DomeTable,
        samples: int,
        every: int,
        openings: OpeningPoints | None = None,
    ):
        super().__init__(light, eye, physical=True)
        self._table, self._samples, self._openings = table, samples, openings
        self.every, self.draws = every, 1 / every
        rows = zip(table.along, table.light, table.points, table.shadowed, strict=True)
        points = [
            DomePoint(along, row[:3], row[3], disc, "shadow" if shadowed else "diffuse")
            for along, row, disc, shadowed in rows
        ]
        self._directions, self._parts = len(points), 1
        self.points = points if openings is None else [*points, *openings.points()]

    def drawn_at(self, number: int, point: DomePoint | OpeningPoint) -> DomePoint | None:
        each, row = self._samples // self._parts, number // self._samples
        if (row * each + number % each) % self.every or number >= self._directions:
            return None
        return self.points[number % each // self.every * (self._directions // self._samples) + row]

    def in_parts(self, parts: int) -> Dome:
        """The same of which each sample of a pixel takes another part of its directions and points;
        itself where these cannot be divided.
        """
        counts = [self._samples, *([self._openings.each] if self._openings else [])]
        if any(count % parts for count in counts):
            return self
        found = copy.copy(self)
        found._parts = parts
        return found

    @property
    def hidden_counts(self) -> int:
        """How many open directions a hidden one outweighs: of few directions one tells enough."""
        return 1 << 16 if self._parts > 1 else 1

    def sample_count(self, light_samples: int) -> int:
        return self._samples // self._parts

    def is_soft(self, light_samples: int) -> bool:
        """Four samples of a pixel take 32 directions or more."""
        return False

    def is_cut(self, x: Array, n: Array) -> Array:
        """Never: every horizon cuts it, and neighbours see the same of its points."""
        return np.zeros(x.shape[1], bool)

    def least_exponent(self, x: Array) -> Array:
        return np.full(x.shape[1], LEAST_WIDE)

    def numbers(self, sample: int, n: int) -> range:
        each = n * self._parts
        first = sample % (self._directions // each) * each + sample % self._parts * n
        return range(first, first + n)

    def surface_numbers(self, sample: int, n: int) -> list[int]:
        more = self._openings
        if more is None:
            return [*self.numbers(sample, n)]
        count = more.each // self._parts
        first = self._directions + sample % (len(more.number) // more.each) * more.each
        first += sample % self._parts * count
        return [*self.numbers(sample, n), *range(first, first + count)]

    def seen_from(
        self, x: Array, n: Array, numbers: Sequence[int], count: int
    ) -> Callable[[DomePoint | OpeningPoint], LightSample]:
        return lambda point: (
            self._beside(x, self.sample(x, point, count))
            if isinstance(point, DomePoint)
            else self._on_opening(x, point, count)
        )

    def rest(self, x: Array, n: Array, sample: int) -> Array:
        """(3, k) what the whole sky gives to surfaces at x with normals n (3, k) that nothing hides
        it from, less what the points of a pixel's sample give them; of irradiance over π.
        """
        given = np.zeros_like(n)
        count = self._samples // self._parts
        numbers = self.surface_numbers(sample, count)
        seen_from = self.seen_from(x, n, numbers, count)
        for number in numbers:
            seen = seen_from(self.points[number])
            given += np.maximum(dot(seen.direction, n), 0.0) * seen.light_of(self)
        return self._table.unhidden(n) - given

    def sample(self, x: Array, point: DomePoint, n: int) -> LightSample:
        some = np.ones(x.shape[1])
        direction = np.repeat(point.direction[:, None], x.shape[1], 1)
        spread, color = point.spread * some, point.color[:, None]
        return LightSample(direction, some / n, None, spread, color, met_by=point.met_by)

    def sample_at(self, x: Array, direction: Array, n: int) -> LightSample:
        radiance, spread = self._table.seen(direction)
        return self._beside(x, LightSample(direction, spread / n, None, spread, radiance))

    def _on_opening(self, x: Array, point: OpeningPoint, n: int) -> LightSample:
        direction = unit(point.at - x)
        seen = self.sample_at(x, direction, n)
        outward = point.normal @ direction > 0
        given = np.where(outward, seen.intensity, 0.0)
        return replace(seen, intensity=given, counts=False, met_by="diffuse")

    def _beside(self, x: Array, seen: LightSample) -> LightSample:
        """The same where points on openings are taken beside directions (the balance heuristic)."""
        if self._openings is None:
            return seen
        less = 1 + self._openings.per_direction(x, seen.direction) * seen.spread
        return replace(seen, intensity=seen.intensity / less, spread=seen.spread / less)


@dataclass(frozen=True, eq=False)
class MeshPoint:
    """Row `number` of a `MeshTable`, and its point of the unit disc."""

    number: int
    disc: Array


class MeshSource(Source):
    """Surfaces that glow."""

    def to_matt(self, seen: LightSample, n: Array, g: Array, count: int) -> Array:
        """(k,) the intensity that what is matt with the normals n and faces g (3, k) sees of one of
        `count` samples, beside which it draws a direction by its cosine, or of that direction, if
        it is before the face: both are weighed (the power heuristic).
        """
        is_drawn, before = seen.met_by == "diffuse", dot(g, seen.direction) > 0
        assert seen.whole is not None
        whole = np.where(seen.intensity != 0, seen.whole / (np.pi * count), 0.0)
        times = dot(n, seen.direction) * whole
        given = whole * (times if is_drawn else 1.0) / (1 + times * times)
        return np.where(before, given, 0.0 if is_drawn else seen.intensity)

    def __init__(self, light: Light, eye: Array, table: MeshTable):
        super().__init__(light, eye, physical=True)
        self._eye, self.parts = eye, 1
        self._table, self._emitters = table, light.emitters
        self._axes = np.asarray(light.world_from_light, np.float64)[:, :3]
        self.draws = 1 / table.each
        self.points = [MeshPoint(k, disc) for k, disc in enumerate(table.disc)]

    def in_parts(self, parts: int) -> Self:
        """As `Dome.in_parts`, of its points."""
        if self._table.each % parts:
            return self
        found = copy.copy(self)
        found.parts = parts
        found.draws = parts / self._table.each
        return found

    def sample_count(self, light_samples: int) -> int:
        return self._table.each // self.parts

    def numbers(self, sample: int, n: int) -> range:
        each = n * self.parts
        first = sample % (len(self.points) // each) * each + sample % self.parts * n
        return range(first, first + n)

    def drawn_at(self, number: int, point: MeshPoint) -> MeshPoint | None:
        return point if number % (self._table.each // self.parts) == 0 else None

    def least_exponent(self, x: Array) -> Array:
        return np.full(x.shape[1], LEAST_WIDE)

    def is_cut(self, x: Array, n: Array) -> Array:
        light, to = self.light, self.position - x
        half = np.array([light.size_x / 2, light.size_y / 2, light.radius])
        return dot(n, to) ** 2 < (half @ np.abs(self._axes.T @ n)) ** 2

    def place(self, point: MeshPoint) -> Array:
        return self._axes @ self._table.point[point.number][:, None] + self.position

    def least_distance(self, point: MeshPoint) -> float:
        """From which a point is seen as if it were no nearer."""
        spread = self._table.spread[point.number]
        return float(np.sqrt(merged(spread, self._table.each)))

    def sample(self, x: Array, point: MeshPoint, n: int) -> LightSample:
        row = [column[point.number] for column in vars(self._table).values() if np.ndim(column)]
        at, normal, front, back, spread, *_ = (np.atleast_1d(value)[:, None] for value in row)
        q = self._axes @ at + self.position
        seen = self._seen(x, q, self._axes @ normal, front, back, spread[0])
        return replace(seen, group=self._group(point.number))

    def _group(self, number: int) -> Array:
        return self._table.light_group[number : number + 1]

    def sample_at(self, x: Array, direction: Array, n: int) -> LightSample:
        local = self._axes.T @ (x - self.position), self._axes.T @ direction
        t, index = _nearest(self._emitters.corners.T, *local)
        met, k = np.isfinite(t), np.maximum(index, 0)
        given = self._emitters.take(k)
        seen = self._seen(
            x,
            np.where(met, x + np.where(met, t, 1.0) * direction, x + direction),
            self._axes @ given.normals.T,
            given.front.T,
            given.back.T,
            self._emitters.spreads[k],
        )
        intensity = np.where(met, seen.intensity, 0.0)
        return replace(seen, direction=direction, intensity=intensity, group=given.light_group)

    def _seen(
        self, x: Array, q: Array, normal: Array, front: Array, back: Array, spread: Array
    ) -> LightSample:
        """The points q (3, k) or (3, 1) with these normals, radiances and shares of the area."""
        to = q - x
        direction, near2 = unit(to), merged(spread, self._table.each)
        z = -dot(direction, normal)
        d2 = dot(to, to)
        solid_angle = spread * np.abs(z) / np.maximum(d2, near2)
        light = np.where(z > 0, front, back)
        with np.errstate(over="ignore"):
            color = np.clip(light, -HUGE, HUGE)
        share = self.parts * solid_angle / (np.pi * self._table.each)
        return LightSample(
            direction,
            np.where(color.any(0), share, 0.0),  # nobody asks for what is dark on that side
            q,
            solid_angle,
            color,
            z <= 0,
            ROUNDED,
            whole=spread * np.abs(z) / np.maximum(d2, NEAREST * near2),
        )


def _nearest(corners: Array, x: Array, direction: Array) -> tuple[Array, Array]:
    """Distance (k,), infinite for none, and number of the first of the triangles (3, 3, m), by
    component and corner, that rays from x (3, k) meet away from there (Möller, Trumbore 1997).
    """
    distance, index = np.full(x.shape[1], np.inf), np.full(x.shape[1], -1)
    apart = ROUNDED * np.abs(x).max(0)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    step = max(MOST_PAIRS // max(a.shape[1], 1), 1)
    for first in range(0, x.shape[1], step):
        here = slice(first, first + step)
        d = direction[:, here, None]
        across = cross(d, (c - a)[:, None])
        from_a = x[:, here, None] - a[:, None]
        beside = cross(from_a, (b - a)[:, None])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            scale = 1 / dot(across, (b - a)[:, None])
            u, v = dot(across, from_a) * scale, dot(beside, d) * scale
            t = dot(beside, (c - a)[:, None]) * scale
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > apart[here, None])
        t = np.where(hit, t, np.inf)
        index[here], distance[here] = t.argmin(1), t.min(1)
    return distance, index
