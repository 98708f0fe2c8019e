"""What rays meet first, and how much light passes along them (notes, sections 4.10 and 4.16)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..evaluation.geometry import Geometry
from .cancellation import Cancellation
from .raster import Strips, raster_pairs, sorted_strips
from .rays import CoherentRays, IncoherentRays, Rays, hit_triangles
from .shapes import meet_ball, meet_face, meet_rod
from .tree import Tree, build, tree_pairs

Array = np.ndarray

NOTHING = -1


class Hits(NamedTuple):
    """The closest hits of n rays: primitive (n,), NOTHING for none; depth (n,) along the ray,
    infinite for none.
    """

    primitive: Array
    depth: Array


class _Meetings(NamedTuple):
    """Rays, primitives and depths (m,) where they meet."""

    ray: Array
    primitive: Array
    depth: Array


class Passed(NamedTuple):
    """What surfaces let through. passed: (m, 4), the share of light, and by how much it is
    narrowed. bent: (m, 3) by how much they change its optical momentum across its way.
    """

    passed: Array
    bent: Array


@dataclass(frozen=True, eq=False)
class Visibility:
    """Answers rays about one geometry. opaque: (p,) bool, primitives that let no light through."""

    geometry: Geometry
    opaque: Array
    cancellation: Cancellation

    @cached_property
    def tree(self) -> Tree:
        """Built when the first rays come that are not coherent."""
        return build(self.geometry, self.cancellation)

    @property
    def built_tree(self) -> Tree | None:
        """The tree, if it was needed so far."""
        return vars(self).get("tree")

    def closest(self, rays: Rays, kind: str, strips: Strips | None = None) -> Hits:
        """The first hit of each ray; of hits in a tie (coincident faces, neighbours met in their
        common edge) that of the lowest primitive.

        strips: of coherent rays that are sorted already.
        """
        if not len(rays) or not self.geometry.count:
            return Hits(np.full(len(rays), NOTHING), np.full(len(rays), np.inf))
        seen = self.geometry.visible[kind]
        if isinstance(rays, CoherentRays) and strips is None:
            order, strips = sorted_strips(rays.u, rays.v)
            return Hits(
                *(_unsorted(a, order) for a in self._closest(rays.take(order), seen, strips))
            )
        return self._closest(rays, seen, strips)

    def closest_of(self, rays: IncoherentRays, seen: Array | None) -> Hits:
        """The same of rays that meet the primitives (p,) bool, or all."""
        return self._closest(rays, seen, None)

    def _closest(self, rays: Rays, seen: Array | None, strips: Strips | None) -> Hits:
        limit, found = rays.far.copy(), []
        for meetings in self._meetings(rays, seen, strips, limit):
            np.minimum.at(
                limit, meetings.ray, meetings.depth + rays.tie(meetings.ray, meetings.depth)
            )
            found.append(meetings)
        ray, primitive, depth = _together(found)
        return _lowest(self.geometry, len(rays), ray, primitive, depth, limit)

    def crossings(self, rays: Rays, seen: Array) -> tuple[Array, Array, Array]:
        """Rays, primitives and depths (m,) of all meetings with the primitives (p,) bool."""
        order, strips = np.arange(len(rays)), None
        if not len(rays) or not self.geometry.count:
            return _together([])
        if isinstance(rays, CoherentRays):
            order, strips = sorted_strips(rays.u, rays.v)
            rays = rays.take(order)
        ray, primitive, depth = _together([*self._meetings(rays, seen, strips, rays.far)])
        return order[ray], primitive.astype(np.intp), depth

    def layers(self, rays: Rays, seen: Array) -> tuple[Array, Array, Array]:
        """The same, sorted by ray and depth; of those in a tie that of the lowest primitive."""
        return _once(self.geometry, rays, *self.crossings(rays, seen))

    def blocked(
        self,
        rays: Rays,
        transmittance: Callable[[Rays, Array, Array, Array], Passed],
        seen: Array | None = None,
    ) -> Passed:
        """What passes along each ray.
        transmittance(rays, ray, primitive, depth): of m surfaces met.  seen: (p,) bool, primitives
        that they meet, or None for all.
        """
        if not len(rays) or not self.geometry.count:
            return Passed(np.ones((len(rays), 4)), np.zeros((len(rays), 3)))
        if isinstance(rays, CoherentRays):
            order, strips = sorted_strips(rays.u, rays.v)
            passed = self._blocked(rays.take(order), transmittance, seen, strips)
            return Passed(*(_unsorted(part, order) for part in passed))
        return self._blocked(rays, transmittance, seen, None)

    def _blocked(
        self, rays: Rays, transmittance, seen: Array | None, strips: Strips | None
    ) -> Passed:
        limit, found = rays.far.copy(), []
        from_light = isinstance(rays, CoherentRays) and rays.frame.perspective
        for meetings in self._meetings(rays, seen, strips, limit, backwards=from_light):
            opaque = self.opaque[meetings.primitive]
            limit[meetings.ray[opaque]] = -np.inf
            found.append(_Meetings(*(a[~opaque] for a in meetings)))
        passed = np.where(limit == -np.inf, 0.0, 1.0)[:, None] * np.ones(4)
        ray, primitive, depth = _together(found)
        open_ray = limit[ray] > -np.inf
        ray, primitive, depth = _once(
            self.geometry, rays, ray[open_ray], primitive[open_ray], depth[open_ray]
        )
        bent = np.zeros((len(rays), 3))
        if len(ray):
            some = transmittance(rays, ray, primitive, depth)
            np.multiply.at(passed, ray, some.passed)
            np.add.at(bent, ray, some.bent)
        return Passed(passed, bent)

    def _meetings(
        self,
        rays: Rays,
        seen: Array | None,
        strips: Strips | None,
        limit: Array,
        backwards: bool = False,
    ) -> Iterator[_Meetings]:
        """backwards: what rays meet that come from their far ends."""
        if isinstance(rays, IncoherentRays):
            pairs = tree_pairs(self.tree, rays, seen, limit, self.cancellation)
        else:
            assert strips is not None
            pairs = raster_pairs(rays, strips, self.geometry, seen, limit, self.cancellation)
        for ray, primitive in pairs:
            if self.geometry.triangle_count == self.geometry.count:
                which, depth = hit_triangles(rays, self.geometry, ray, primitive, limit)
                yield _Meetings(ray.take(which), primitive.take(which), depth)
            else:
                yield from self._meet_all(rays, ray, primitive, limit, -1.0 if backwards else 1.0)

    def _meet_all(
        self, rays: Rays, ray: Array, primitive: Array, limit: Array, way: float
    ) -> Iterator[_Meetings]:
        """Pairs of rays with primitives of every sort. way: -1 for rays that come the other way,
        which strands, seen from outside alone, are not the same for.
        """
        triangles, balls = self.geometry.triangle_count, self.geometry.ball_count
        flat = primitive < triangles
        which, depth = hit_triangles(rays, self.geometry, ray[flat], primitive[flat], limit)
        yield _Meetings(ray[flat][which], primitive[flat][which], depth)
        round_ = ~flat & (primitive < triangles + balls)
        rod = primitive >= self.geometry.first_rod
        for some, first, meet in (
            (round_, triangles, lambda k, o, d: meet_ball(self.geometry.balls, k, o, d)),
            (
                ~flat & ~round_ & ~rod,
                triangles + balls,
                lambda k, o, d: meet_face(self.geometry.faces, k, o, d)[None],
            ),
            (
                rod,
                self.geometry.first_rod,
                lambda k, o, d: way * meet_rod(self.geometry.rods, k, o, way * d)[None],
            ),
        ):
            mine = ray[some]
            if len(mine):
                for depth in meet(primitive[some] - first, *rays.lines(mine)):
                    good = (
                        (depth > rays.near[mine])
                        & (depth < rays.far[mine])
                        & (depth <= limit[mine])
                    )
                    yield _Meetings(mine[good], primitive[some][good], depth[good])


def _unsorted(values: Array, order: Array) -> Array:
    result = np.empty_like(values)
    result[order] = values
    return result


def _together(found: list[_Meetings]) -> _Meetings:
    if not found:
        return _Meetings(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))
    return _Meetings(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _lowest(
    geometry: Geometry, rays: int, ray: Array, primitive: Array, depth: Array, limit: Array
) -> Hits:
    """Of all meetings not beyond `limit` (the closest of each ray, with its tie) the primitive of
    the lowest number.
    """
    close = np.flatnonzero(depth <= limit[ray])
    ray, primitive, depth = ray[close], primitive[close], depth[close]
    number = geometry.number[primitive]
    lowest = np.full(rays, np.iinfo(np.intp).max)
    np.minimum.at(lowest, ray, number)
    winner = number == lowest[ray]
    result = Hits(np.full(rays, NOTHING), np.full(rays, np.inf))
    result.primitive[ray[winner]] = primitive[winner]
    np.minimum.at(result.depth, ray[winner], depth[winner])
    return result


def _once(geometry: Geometry, rays: Rays, ray: Array, primitive: Array, depth: Array) -> _Meetings:
    """Meetings sorted by ray and depth, of those in a tie only that of the lowest primitive."""
    order = np.lexsort((geometry.number[primitive], depth, ray))
    ray, primitive, depth = ray[order], primitive[order], depth[order]
    same = (ray[1:] == ray[:-1]) & (depth[1:] <= depth[:-1] + rays.tie(ray[:-1], depth[:-1]))
    start = np.flatnonzero(np.concatenate([np.ones(min(len(ray), 1), bool), ~same]))
    if not len(start):
        return _Meetings(ray, primitive, depth)
    lowest = np.minimum.reduceat(geometry.number[primitive], start)
    group = np.repeat(np.arange(len(start)), np.diff(np.append(start, len(ray))))
    winner = np.flatnonzero(geometry.number[primitive] == lowest[group])
    winner = winner[
        np.concatenate([np.ones(min(len(winner), 1), bool), np.diff(group[winner]) > 0])
    ]
    return _Meetings(ray[winner], primitive[winner], depth[winner])
