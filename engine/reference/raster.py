"""Which triangles coherent rays may hit, ray by ray: triangles and rays are projected and meet in
strips of the image.

Rays are sorted into strips of like v (the rows of pixels, or strips of equally many rays) and by u
within a strip. Triangle by triangle, the part of the triangle that lies over a strip covers a range
of u, hence a run of consecutive rays. All margins are wide enough for rounding, so the pairs
contain every hit; the exact test decides (notes, section 7: object-order rendering of an
image-order picture).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..evaluation.geometry import Geometry
from ..linear.columns import explode, pick, ragged_blocks, transform
from .cancellation import Cancellation
from .rays import CoherentRays, Frame

Array = np.ndarray
Pairs = Iterator[tuple[Array, Array]]

PAIRS = 1 << 16  # pairs per block: their arrays fit into the processor's cache
TRIANGLES = 1 << 15
# of projected coordinates: well beyond the rounding of a division, a product and a sum
MARGIN = 2.0**-46


@dataclass(frozen=True, eq=False)
class Strips:
    """s strips of rays: lower and upper v (s,), start (s + 1,) of each strip's rays.

    search: sorted keys of the rays, strip · width + u − least, or None where the rays are evenly
    spaced pixels: then ray k of a strip lies at u = first + k · step.
    """

    lower: Array
    upper: Array
    start: Array
    search: Array | None
    width: float
    first: float
    step: float
    slack: float

    def run(self, strip: Array, low: Array, high: Array) -> tuple[Array, Array]:
        """Range of rays of each strip whose u may lie in [low, high]."""
        if self.search is None:
            size = float(self.start[1] - self.start[0])
            begin = np.ceil((low - self.first) / self.step - 1e-6)
            end = np.floor((high - self.first) / self.step + 1e-6) + 1
            row = self.start[strip]
            return row + np.clip(begin, 0, size).astype(np.intp), row + np.clip(
                end, 0, size
            ).astype(np.intp)
        base = strip * self.width
        low = base + np.clip(low - self.first - self.slack, 0, self.width)
        high = base + np.clip(high - self.first + self.slack, 0, self.width)
        return np.searchsorted(self.search, low, "left"), np.searchsorted(
            self.search, high, "right"
        )


def pixel_strips(u: Array, v: Array) -> Strips:
    """Strips of whole rows of pixels: u (w,) of a row, evenly spaced and ascending, v (h,) of the
    rows, ascending.
    """
    step = (u[-1] - u[0]) / max(len(u) - 1, 1) or 1.0
    return Strips(v, v, len(u) * np.arange(len(v) + 1), None, 0.0, float(u[0]), float(step), 0.0)


def sorted_strips(u: Array, v: Array) -> tuple[Array, Strips]:
    """Order that sorts rays into strips, and the strips of the sorted rays."""
    n = len(u)
    count = int(np.clip(np.sqrt(n), 1, 60000))
    start = np.linspace(0, n, count + 1).astype(np.intp)
    strip = np.empty(n, np.uint16)
    strip[_order(v)] = np.repeat(np.arange(count, dtype=np.uint16), np.diff(start))
    near_u = u.astype(np.float32)
    order = _order(near_u)
    order = order[np.argsort(strip[order], kind="stable")]
    v, near_u = v[order], near_u[order].astype(np.float64)
    lower, upper = np.minimum.reduceat(v, start[:-1]), np.maximum.reduceat(v, start[:-1])
    lower, upper = np.minimum.accumulate(lower[::-1])[::-1], np.maximum.accumulate(upper)
    least, span = near_u.min(), float(near_u.max() - near_u.min())
    slack = 2.0**-22 * float(np.abs(u).max()) + 2.0**-120
    width = span + 4 * slack
    search = strip[order] * width + (near_u - least)
    slack += 2.0**-50 * width * count
    return order, Strips(lower, upper, start, search, width, float(least), 0.0, slack)


def _order(values: Array) -> Array:
    """The order that sorts by values rounded to float32: radix sort on the two halves of their
    order-preserving bits.
    """
    bits = values.astype(np.float32).view(np.uint32)
    bits = np.where(bits >> 31, ~bits, bits | np.uint32(1 << 31))
    order = np.argsort(bits.astype(np.uint16), kind="stable")
    return order[np.argsort((bits >> 16).astype(np.uint16)[order], kind="stable")]


def raster_pairs(
    coherent: CoherentRays,
    strips: Strips,
    geometry: Geometry,
    seen: Array | None,
    limit: Array,
    cancellation: Cancellation,
) -> Pairs:
    """Blocks of (ray, primitive) that may meet. `limit` (n,) is the depth beyond which a ray no
    longer looks; the caller lowers it.
    """
    window = _Window.of(coherent)
    for begin in range(0, geometry.triangle_count, TRIANGLES):
        chunk = np.arange(begin, min(begin + TRIANGLES, geometry.triangle_count))
        chunk = chunk if seen is None else chunk[seen[chunk]]
        cancellation.check()
        outlines, all_over = _outlines(coherent.frame, geometry, chunk, window)
        yield from _covered(coherent, strips, outlines, limit, cancellation)
        yield from _everywhere(len(coherent), all_over, cancellation)
    if len(geometry.lower[0]):
        outlines, all_over = _boxes(coherent.frame, geometry, seen, window)
        yield from _covered(coherent, strips, outlines, limit, cancellation)
        yield from _everywhere(len(coherent), all_over, cancellation)


@dataclass(frozen=True)
class _Window:
    """What coherent rays span: least and most u and v, the nearest `near`, the farthest
    `far`.
    """

    u0: float
    u1: float
    v0: float
    v1: float
    near: float
    far: float

    @classmethod
    def of(cls, coherent: CoherentRays) -> _Window:
        u, v = coherent.u, coherent.v
        return cls(u.min(), u.max(), v.min(), v.max(), coherent.near.min(), coherent.far.max())

    def sees(self, u0: Array, u1: Array, v0: Array, v1: Array, z0: Array, z1: Array) -> Array:
        """Which of the boxes in u, v and depth the rays may meet."""
        du, dv = MARGIN * (np.abs(u0) + np.abs(u1)), MARGIN * (np.abs(v0) + np.abs(v1))
        across = (
            (u1 + du >= self.u0)
            & (u0 - du <= self.u1)
            & (v1 + dv >= self.v0)
            & (v0 - dv <= self.v1)
        )
        dz = MARGIN * (np.abs(z0) + np.abs(z1))
        return across & (z1 + dz > self.near) & (z0 - dz < self.far)


@dataclass(frozen=True, eq=False)
class _Outlines:
    """Projected shapes: u, v (k, m) of the k corners of triangles, or None; bounds (m,); depth z0
    (m,) that no part is nearer than.
    """

    primitive: Array
    u: Array | None
    v: Array | None
    u0: Array
    u1: Array
    v0: Array
    v1: Array
    z0: Array

    def take(self, index: Array) -> _Outlines:
        u, v = (None if a is None else pick(a, index) for a in (self.u, self.v))
        rest = (a[index] for a in (self.u0, self.u1, self.v0, self.v1, self.z0))
        return _Outlines(self.primitive[index], u, v, *rest)


def _outlines(
    frame: Frame, geometry: Geometry, chunk: Array, window: _Window
) -> tuple[_Outlines, Array]:
    """Triangles in front of the rays' origin as outlines, and those that reach behind it and may
    still be seen.
    """
    corners = pick(geometry.triangles, chunk)
    u, v = frame.projected[0].take(corners), frame.projected[1].take(corners)
    z = frame.points[2].take(corners)
    z0, z1 = z.min(0), z.max(0)
    bounds = u.min(0), u.max(0), v.min(0), v.max(0)
    front = np.isfinite(bounds[1])
    with np.errstate(invalid="ignore"):
        kept = np.flatnonzero(front & window.sees(*bounds, z0, z1))
    outlines = _Outlines(chunk, u, v, *bounds, z0 - _slack(z0, z1)).take(kept)
    crossing = np.flatnonzero(~front & (z1 > max(window.near, 0.0)) & (z0 < window.far))
    return outlines, chunk[crossing[_in_cone(frame, window, pick(corners, crossing))]]


def _in_cone(frame: Frame, window: _Window, corners: Array) -> Array:
    """Which triangles no single side plane of the window's cone separates from it."""
    x, y, z = (axis.take(corners) for axis in frame.points)
    outside = ((x > window.u1 * z + _slack(x, window.u1 * z)).all(0)) | (
        (x < window.u0 * z - _slack(x, window.u0 * z)).all(0)
    )
    outside |= ((y > window.v1 * z + _slack(y, window.v1 * z)).all(0)) | (
        (y < window.v0 * z - _slack(y, window.v0 * z)).all(0)
    )
    return ~outside


def _slack(a: Array, b: Array) -> Array:
    return MARGIN * (np.abs(a) + np.abs(b))


def _boxes(
    frame: Frame, geometry: Geometry, seen: Array | None, window: _Window
) -> tuple[_Outlines, Array]:
    """Spheres, polygons and strands by the projection of their boxes."""
    primitive = geometry.triangle_count + np.arange(len(geometry.lower[0]))
    corners = np.stack(
        [
            np.stack([(geometry.lower, geometry.upper)[k >> a & 1][a] for a in range(3)])
            for k in range(8)
        ],
        1,
    )
    points = transform(frame.matrix, corners - frame.origin[:, None, None])
    u, v = Frame.project(points) if frame.perspective else points[:2]
    z0, z1 = points[2].min(0), points[2].max(0)
    bounds = u.min(0), u.max(0), v.min(0), v.max(0)
    front = np.isfinite(bounds[1])
    wanted = np.ones(len(primitive), bool) if seen is None else seen[primitive]
    with np.errstate(invalid="ignore"):
        kept = np.flatnonzero(wanted & front & window.sees(*bounds, z0, z1))
    all_over = primitive[wanted & ~front & (z1 > max(window.near, 0.0))]
    return _Outlines(primitive, None, None, *bounds, z0 - _slack(z0, z1)).take(kept), all_over


def _everywhere(rays: int, primitives: Array, cancellation: Cancellation) -> Pairs:
    """Every ray with each of these primitives."""
    for primitive in primitives:
        for begin in range(0, rays, PAIRS):
            cancellation.check()
            ray = np.arange(begin, min(begin + PAIRS, rays))
            yield ray, np.full(len(ray), primitive)


def _covered(
    coherent: CoherentRays,
    strips: Strips,
    outlines: _Outlines,
    limit: Array,
    cancellation: Cancellation,
) -> Pairs:
    """The pairs of outlines with the rays that they may cover."""
    dv = MARGIN * (np.abs(outlines.v0) + np.abs(outlines.v1))
    top = np.searchsorted(strips.upper, outlines.v0 - dv, "left")
    count = np.maximum(np.searchsorted(strips.lower, outlines.v1 + dv, "right") - top, 0)
    edges = None if outlines.u is None else _Edges.of(outlines)
    for begin, end in ragged_blocks(count, PAIRS):
        shape, place = explode(count[begin:end])
        shape += begin
        strip = top[shape] + place
        if edges is None:
            low, high = outlines.u0[shape], outlines.u1[shape]
        else:
            low, high = edges.span(shape, strips.lower[strip], strips.upper[strip])
        start, stop = strips.run(strip, low, high)
        used = np.flatnonzero(stop > start)
        yield from _pairs(
            coherent,
            outlines,
            shape[used],
            start[used],
            stop[used],
            limit,
            cancellation,
            strips.search is not None,
        )


def _pairs(coherent, outlines, shape, start, stop, limit, cancellation, tall) -> Pairs:
    """Runs of rays spelled out; those outside the outline's v (where strips are `tall`) or behind
    what the ray has met are dropped.
    """
    size = stop - start
    for begin, end in ragged_blocks(size, PAIRS):
        cancellation.check()
        ray = np.arange(size[begin:end].sum()) + np.repeat(
            start[begin:end] - np.cumsum(size[begin:end]) + size[begin:end], size[begin:end]
        )
        mine = np.repeat(shape[begin:end], size[begin:end])
        good = outlines.z0.take(mine) <= limit.take(ray)
        if tall:
            v, v0, v1 = coherent.v.take(ray), outlines.v0.take(mine), outlines.v1.take(mine)
            dv = MARGIN * (np.abs(v0) + np.abs(v1))
            good &= (v >= v0 - dv) & (v <= v1 + dv)
        kept = np.flatnonzero(good)
        yield ray.take(kept), outlines.primitive.take(mine.take(kept))


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edges of triangles, (3, m) each: from the lower end (u, v) to v = top with du/dv = slope;
    margins du, dv (m,).
    """

    u: Array
    v: Array
    top: Array
    slope: Array
    du: Array
    dv: Array

    @classmethod
    def of(cls, outlines: _Outlines) -> _Edges:
        u, v = outlines.u, outlines.v
        assert u is not None and v is not None
        other_u, other_v = u[[1, 2, 0]], v[[1, 2, 0]]
        up = v <= other_v
        low_u, low_v = np.where(up, u, other_u), np.where(up, v, other_v)
        high_u, high_v = np.where(up, other_u, u), np.where(up, other_v, v)
        rise = high_v - low_v
        slope = (high_u - low_u) / np.where(rise > 0, rise, np.inf)
        du = 4 * MARGIN * np.maximum(np.abs(outlines.u0), np.abs(outlines.u1))
        dv = MARGIN * (np.abs(outlines.v0) + np.abs(outlines.v1))
        return cls(low_u, low_v, high_v, slope, du, dv)

    def span(self, shape: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Least and most u of the triangles between v = lower and upper: each edge's ends, cut to
        the strip.
        """
        dv = self.dv.take(shape)
        lower, upper = lower - dv, upper + dv
        low, high = np.full(len(shape), np.inf), np.full(len(shape), -np.inf)
        for u, v, top, slope in zip(self.u, self.v, self.top, self.slope, strict=True):
            u, v, slope = u.take(shape), v.take(shape), slope.take(shape)
            begin, end = np.maximum(v, lower), np.minimum(top.take(shape), upper)
            missed = begin > end
            at_begin, at_end = u + (begin - v) * slope, u + (end - v) * slope
            low = np.where(missed, low, np.minimum(low, np.minimum(at_begin, at_end)))
            high = np.where(missed, high, np.maximum(high, np.maximum(at_begin, at_end)))
        du = self.du.take(shape)
        return low - du, high + du
