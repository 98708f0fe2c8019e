"""Light that media scatter towards the eye, once: points along rays, where they lie for a light,
and what comes from there.

Letters: t along a ray, s from its point nearest to a light, D how far that is, v = s / (D + √(D² +
s²)), in which the light of a lamp is spread nearly evenly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..evaluation.march import Spans
from ..linear.columns import dot, length, pick, unit
from ..sampling import scatter_share
from .lights import CENTER, LightPoint, LightSample, Source
from .media import Media, Pieces
from .paths import Paths, thrown_on
from .rays import IncoherentRays, Rays

Array = np.ndarray

DEPTHS = 0.1 * 1.5 ** np.arange(36)
"""Optical depths, of the channel that is dimmed most, that bound the rungs."""
DARK = 40.0
"""Optical depth beyond which an endless ray has no points."""
LEAST = 2.0**-20
"""Of the longest way to a ray's ends: it is not taken to pass lights nearer than that."""


@dataclass(frozen=True, eq=False)
class Ladder:
    """Rungs along n rays: edges (n, m + 1), and how much light a world unit scatters at the
    beginning and the end of each, (2, n, m). o, d: (3, n) lines of the rays.  speed: (n,) of d.
    """

    edges: Array
    density: Array
    o: Array
    d: Array
    speed: Array

    @classmethod
    def of(cls, pieces: Pieces, rays: Rays) -> Ladder:
        edges = pieces.edges(DEPTHS)
        middle = (edges[:, 1:] + edges[:, :-1]) / 2
        scattering, passed = pieces.scattering_at(middle), np.exp(-pieces.depth_at(edges))
        density = np.stack([(scattering * p).sum(0) for p in (passed[..., :-1], passed[..., 1:])])
        o, d = rays.lines(np.arange(len(rays)))
        return cls(edges, density, o, d, length(d))

    def aimed(self, source: Source, point: LightPoint, x_of: Array | None) -> Aim:
        """The rungs as a light has them. x_of: (3, 1) its place, None for an endless one."""
        low, high = lit_part(source, self.o, self.d)
        low, high = np.minimum(low, self.edges[:, -1]), np.maximum(high, self.edges[:, 0])
        edges = np.clip(self.edges, low[:, None], np.maximum(high, low)[:, None])
        ends = self._density(edges)
        if x_of is None:
            return Aim(self, edges, edges * self.speed[:, None], ends, None, None)
        to = x_of - self.o
        nearest = dot(to, self.d) / self.speed**2
        off = length(to - nearest * self.d)
        s = (edges - nearest[:, None]) * self.speed[:, None]
        least = np.maximum(LEAST * np.abs(s[:, [0, -1]]).max(1), nearness(source, point))
        off = np.maximum(off, least)[:, None]
        v = s / (off + np.sqrt(off * off + s * s))
        nearer = 2 / (1 + v * v)
        ends = ends * np.stack([nearer[:, :-1], nearer[:, 1:]])
        return Aim(self, edges, v, ends, nearest, off[:, 0])

    def even(self) -> Aim:
        """The rungs as light from everywhere has them."""
        return Aim(self, self.edges, self.edges * self.speed[:, None], self.density, None, None)

    def _density(self, cut: Array) -> Array:
        """(2, n, m) at the ends of the rungs where they are cut to these edges."""
        first, way = self.edges[:, :-1], np.diff(self.edges)
        safe = np.where(way > 0, way, 1.0)
        along = (np.stack([cut[:, :-1], cut[:, 1:]]) - first) / safe
        return self.density[0] + (self.density[1] - self.density[0]) * along


@dataclass(frozen=True, eq=False)
class Aim:
    """Rungs as a light has them. places: (n, m + 1) their edges as points are chosen in them, a
    length along the ray or v.  ends: (2, n, m) how densely at the ends of each.
    """

    ladder: Ladder
    edges: Array
    places: Array
    ends: Array
    nearest: Array | None
    off: Array | None

    def at(self, share: float) -> tuple[Array, Array]:
        """t (n,) below which a share of all lies, and one over how densely points fall there a
        world unit, 0 where nothing does.
        """
        weight = (self.ends[0] + self.ends[1]) / 2 * np.diff(self.places)
        rows = np.arange(len(weight))
        total = np.cumsum(weight, 1)
        whole = total[:, -1]
        x = share * whole
        rung = np.minimum((total <= x[:, None]).sum(1), weight.shape[1] - 1)
        own = weight[rows, rung]
        good = (own > 0) & np.isfinite(whole)
        part = np.clip(1 - (total[rows, rung] - x) / np.where(good, own, 1.0), 0.0, 1.0)
        low, high = np.where(good, self.ends[:, rows, rung], 1.0)
        # as many below as a density that goes straight from one to the other has
        inside = part * (low + high) / (low + np.sqrt(low * low + part * (high * high - low * low)))
        first, last = self.places[rows, rung], self.places[rows, rung + 1]
        v, off = first + inside * (last - first), self.off
        spread = np.where(good, whole / (low + inside * (high - low)), 0.0)
        spread = np.where(np.isfinite(spread), spread, 0.0)
        if self.nearest is None or off is None:
            return v / self.ladder.speed, spread
        rest = (1 - v) * (1 + v)
        t = self.nearest + 2 * v * off / rest / self.ladder.speed
        t = np.clip(t, self.edges[rows, rung], self.edges[rows, rung + 1])
        return t, spread * 2 * off * (1 + v * v) / (rest * rest)


def nearness(source: Source, point: LightPoint) -> float:
    """Half of how near a light is before it seems no brighter."""
    light = source.light
    if light.kind in ("MESH", "MEDIUM"):
        return source.least_distance(point) / 2
    if light.kind == "AREA":
        return float(np.hypot(light.size_x, light.size_y)) / 4
    return light.radius / 2


def lit_part(source: Source, o: Array, d: Array) -> tuple[Array, Array]:
    """(n,) each: from where to where a light shines on the lines o + t d."""
    n = o.shape[1]
    if source.light.kind == "AREA":
        return _before(o - source.position, d, source.axis)
    edge = np.cos(source.light.spot_size / 2)
    if source.light.kind != "SPOT" or edge <= 0:
        return np.full(n, -np.inf), np.full(n, np.inf)
    behind = source.light.radius / max(np.sin(source.light.spot_size / 2), 1e-30)
    return _within_cone(o - source.position + behind * source.axis, d, source.axis, edge * edge)


def _before(o: Array, d: Array, axis: Array) -> tuple[Array, Array]:
    """Where a line is in front of the plane through the origin across the axis."""
    height, rise = dot(o, axis), dot(d, axis)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = -height / rise
    low = np.where(rise > 0, at, np.where((rise == 0) & (height <= 0), np.inf, -np.inf))
    return low, np.where(rise < 0, at, np.inf)


def _within_cone(o: Array, d: Array, axis: Array, cosine2: float) -> tuple[Array, Array]:
    """Where a line is in the cone at the origin round the axis."""
    height, rise = dot(o, axis), dot(d, axis)
    a = rise * rise - cosine2 * dot(d, d)
    b = rise * height - cosine2 * dot(o, d)
    c = height * height - cosine2 * dot(o, o)
    with np.errstate(divide="ignore", invalid="ignore"):
        q = -(b + np.copysign(np.sqrt(np.maximum(b * b - a * c, 0.0)), b))
        roots = np.stack([q / a, c / q])
    none = np.isnan(roots).any(0) | (a == 0)
    first, last = roots.min(0), roots.max(0)
    along = np.where(rise > 0, last, -np.inf), np.where(rise > 0, np.inf, first)
    middle = (first + last) / 2
    misses = (b * b < a * c) | (height + middle * rise <= 0)
    low = np.where(a > 0, along[0], np.where(misses, np.inf, first))
    high = np.where(a > 0, along[1], np.where(misses, -np.inf, last))
    return np.where(none, -np.inf, low), np.where(none, np.inf, high)


@dataclass(frozen=True, eq=False)
class Scattered:
    """What a sample of a light brings along some rays: ray (m,), light (3, m) before shadows and S
    (m, 3).  group: of lights, as `LightSample.group_of`.
    """

    source: Source
    ray: Array
    light: Array
    shadow: Array
    group: Array | int


def scattered(
    stage, rays: Rays, spans: Spans, far: Array, sample: int, once: bool
) -> Iterator[Scattered]:
    """The light of all lights that media along rays, up to far (n,), scatter towards their
    beginnings. once: of one sample of each.
    """
    media: Media = stage.media
    chosen = media.scattering_rays(spans, rays.near, far)
    if not len(chosen):
        return
    rays, spans, far = rays.take(chosen), spans.take(chosen), far[chosen]
    pieces = media.pieces(spans, rays.near, media.reach(spans, rays.near, far, DARK))
    ladder = Ladder.of(pieces, rays)
    for source in stage.lighting.scattered_sources:
        if not source.color.any():
            continue
        for point, share, n, count in _points(stage, source, sample, once):
            stage.cancellation.check()
            aim = ladder.aimed(source, point, source.place(point))
            t, spread = aim.at(share)
            found = np.flatnonzero(spread > 0)
            x = pick(ladder.o, found) + t[found] * pick(ladder.d, found)
            seen = source.sample(x, point, n)
            at = media.scattering(
                spans.take(found), t[found], seen.direction, unit(pick(ladder.d, found)), source
            )
            passed = media.passed(spans.take(found), rays.near[found], t[found])
            light = seen.light_of(source) * at * passed * (np.pi * spread[found] / count)
            lit = np.flatnonzero(light.any(0) & np.isfinite(light).all(0))
            shadow = _shadow(stage, source, pick(x, lit), _some(seen, lit))
            ray, group = chosen[found[lit]], seen.group_of(source)
            yield Scattered(source, ray, pick(light, lit), shadow, group)


def scattered_on(
    stage, paths: Paths, spans: Spans, far: Array, sample: int, places: Array
) -> Paths | None:
    """A ray from a place on each of the rays at which media scatter light, up to far (n,), on to
    where light comes from that surfaces throw there, to all sides alike; None for no ray. places:
    (n,) of their pixels, as `Stage.places`.
    """
    media: Media = stage.media
    if not stage.settings.volume_bounces or not stage.gathers(paths):
        return None
    chosen = media.scattering_rays(spans, paths.rays.near, far)
    if not len(chosen):
        return None
    rays, spans, far = paths.rays.take(chosen), spans.take(chosen), far[chosen]
    ladder = Ladder.of(
        media.pieces(spans, rays.near, media.reach(spans, rays.near, far, DARK)), rays
    )
    t, spread = ladder.even().at(float(scatter_share(stage.scatter_offsets, sample, 0, 1)))
    x, y, _ = stage.bounce_points(sample, paths.bounced, places[chosen])
    r2 = np.minimum(x * x + y * y, 1.0)
    across = 2 * np.sqrt(1 - r2)
    direction = np.stack([across * x, across * y, 1 - 2 * r2])
    k = media.scattering(spans, t, direction, unit(ladder.d), None)
    k = 4 * np.pi * spread * media.passed(spans, rays.near, t) * k
    weight = pick(paths.weight, chosen) * k
    go = np.flatnonzero(weight.any(0) & np.isfinite(weight).all(0))
    if not len(go):
        return None
    hit, none = chosen[go], np.zeros(len(go))
    start = pick(ladder.o, go) + t[go] * pick(ladder.d, go)
    gone = replace(
        paths,
        rays=IncoherentRays.of(start, pick(direction, go), none, none + np.inf),
        weight=pick(weight, go),
        pixel=paths.pixel[hit],
        straight=np.zeros(len(go), np.intp),
        depth=paths.depth + 1,
        skyless=paths.skyless[hit],
        widest=paths.widest[hit],
        refractions=paths.refractions[hit],
        refracted=np.zeros(len(go), bool),
        share=paths.share[hit],
        in_medium=paths.in_medium or not paths.bounced,
    )
    return thrown_on(gone)


def _points(
    stage, source: Source, sample: int, once: bool
) -> Iterator[tuple[LightPoint, float, int, float]]:
    """Points of a light, shares of the light along rays, points in all and shares for each, less
    than one where these points stand for others as well.
    """
    n = source.sample_count(stage.settings.light_samples)
    least = 1 if once else stage.settings.volume_samples
    in_parts = once or source.light.kind in ("SUN", "DOME")
    count = n // (parts := parts_of_light(n, least) if in_parts else 1)
    each = -(-least // count)
    points = stage.lighting.points if source.points is None else source.points
    single = n == 1 and source.points is None
    numbers = [0] if single else source.numbers(sample, n)[sample % parts * count :][:count]
    for j, number in enumerate(numbers):
        for k in range(j * each, (j + 1) * each):
            share = scatter_share(stage.scatter_offsets, sample, k, count * each)
            yield CENTER if single else points[number], share, n, each / parts


def parts_of_light(samples: int, least: int) -> int:
    """In how many parts the samples of what is endlessly far are taken, one by each pixel sample in
    turn: as many as leave `least` in each.
    """
    return next(k for k in range(max(samples // least, 1), 0, -1) if samples % k == 0)


def _some(seen: LightSample, index: Array) -> LightSample:
    """The sample as some of the points see it."""
    end = seen.end
    if end is not None and end.shape[1] > 1:
        end = pick(end, index)
    return LightSample(
        pick(np.broadcast_to(seen.direction, (3, seen.direction.shape[1])), index),
        seen.intensity[index],
        end,
        seen.intensity[index],
        short=seen.short,
    )


def _shadow(stage, source: Source, x: Array, seen: LightSample) -> Array:
    if not source.light.cast_shadow or not x.shape[1]:
        return np.ones((x.shape[1], 3))
    return stage.lighting.shadows_of(source).from_points(x, seen)
