"""Media that vary from place to place: rays in them are cut to cells, and the media's programs run
once in each (semantics/media.md).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, fields, replace

import numpy as np

from ..linear.columns import explode, length, pick
from ..program.execute.run import run
from ..scene import Medium, Scene
from .attributes import Attributes
from .geometry import Geometry
from .points import SurfacePoints, Surroundings
from .textures import Image

Array = np.ndarray

GOLDEN = 0.6180339887498949
LEAST_STEP = 3 / 1024
"""Of a medium: so rays take about 1024 steps at most."""
FEW_RAYS = 8
"""Depths along so many rays at most, the longest, are summed ray by ray, not cell by cell."""
MOST_PAIRS = 2048
"""Of cells of a span, whatever its numbers are."""
NEAR, FAR = 1 / 8, 1 / 32
"""How far a world's cells go: at least so much of its step, and of the way to them, while that is
less than a step; of the way to them, where that is more.
"""
GAUSS = 3**-0.5
"""Of a pair of cells, where they are asked."""
FARTHEST = 16384
"""Steps of a world, beyond which there is one cell more."""
SHADOW_STEPS = 2.0
"""Steps of rays to lights, over those of others."""
OPAQUE = 12.0
"""Optical depth beyond which it is dark."""
MOST_DENSE = 1e30
"""A world unit."""
MOST_ANISOTROPY = 1 - 1e-3


@dataclass(frozen=True, eq=False)
class Matter:
    """What there is in m places: extinction, scattering, emission (3, m) a world unit, anisotropy
    (m,).
    """

    extinction: Array
    scattering: Array
    emission: Array
    anisotropy: Array

    @classmethod
    def of(cls, media: list[Medium]) -> Matter:
        """What media are where they do not vary."""
        colors = (
            np.array([getattr(m, name) for m in media], np.float64).reshape(-1, 3).T
            for name in ("extinction", "scattering", "emission")
        )
        return cls(*colors, np.array([medium.anisotropy for medium in media], np.float64))

    def take(self, index: Array) -> Matter:
        """That of some places."""
        return Matter(**{f.name: getattr(self, f.name).take(index, -1) for f in fields(self)})

    def put(self, index: Array, other: Matter) -> None:
        """Sets that of some places."""
        for f in fields(self):
            getattr(self, f.name)[..., index] = getattr(other, f.name)


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
class _Places:
    """m points inside of media as programs read them, in place of a surface: `Surface` has the
    fields.
    """

    row: Array
    x: Array
    v: Array
    far: Array

    @property
    def g(self) -> Array:
        return self.v

    n = mesh_n = g

    @property
    def outside(self) -> Array:
        return np.ones(len(self.row), bool)

    @property
    def past(self) -> Array:
        return np.zeros((4, len(self.row)))


class _MediumPoints(SurfacePoints):
    """Points of things; of the world where their row is -1, whose space is that of the object."""

    def _matrices(self) -> Array:
        rows = self._row()
        if (rows >= 0).all():
            return super()._matrices()
        world = np.concatenate([np.eye(3), -self._around.eye], 1)
        return np.repeat(world[None], len(rows), 0)

    def object_position(self, shift: int) -> Array:
        matrices = self._matrices()
        return self._into(matrices[:, :, :3], self._x(shift) - matrices[:, :, 3].T)

    def object_normal(self) -> Array:
        return self.normal_to_object(self.normal())

    def object_location(self) -> Array:
        return self._matrices()[:, :, 3].T + self._around.eye

    def normal_to_world(self, normal: Array) -> Array:
        return super().normal_to_world(normal) if (self._row() >= 0).all() else normal


@dataclass(frozen=True, eq=False)
class Marching:
    """How rays go through the media of a scene, some of which vary. asked: at how many points."""

    media: list[Medium]
    around: list[Surroundings]
    asked: Counter[str]

    @classmethod
    def of(
        cls, scene: Scene, media: list[Medium], geometry: Geometry, attributes: Attributes
    ) -> Marching | None:
        """None where none of them does."""
        if all(medium.program is None for medium in media):
            return None
        first = [] if scene.world.medium is None else [scene.world.textures]
        textures = first + [scene.textures] * (len(media) - len(first))
        around = [
            Surroundings(
                attributes,
                [Image(t) for t in own] if medium.program is not None else [],
                geometry,
                scene.camera,
            )
            for own, medium in zip(textures, media, strict=True)
        ]
        return cls(media, around, Counter())

    def marched(
        self,
        spans: Spans,
        boxes: Array,
        lines: tuple[Array, Array],
        near: Array,
        far: Array,
        sample: int,
        kind: str,
    ) -> Spans:
        """The spans, those that vary between near and far (n,) cut to cells, in place of the whole.

        boxes: (r, 2, 3) of the rows.  lines: of the rays.
        """
        varies = np.array([medium.program is not None for medium in self.media], bool)
        whole = np.flatnonzero(varies[spans.medium])
        ray = spans.ray[whole]
        low, high = (
            np.maximum(spans.start[whole], near[ray]),
            np.minimum(spans.end[whole], far[ray]),
        )
        whole, low, high = (column[low < high] for column in (whole, low, high))
        shift = (0.5 + GOLDEN * sample) % 1.0
        number, cuts = self._cuts(spans, whole, boxes, near, low, high, shift, kind)
        number, start, end = _between(number, cuts, low, high)
        number = whole[number]
        cells = replace(
            spans,
            ray=spans.ray[number],
            medium=spans.medium[number],
            row=spans.row[number],
            start=start,
            end=end,
            whole=spans.whole[:, number],
            matter=spans.matter.take(number),
        )
        # halves of pairs, one after the other, are asked where Gauss would for the whole
        some = np.flatnonzero(start < end)
        side = np.where(np.arange(len(start)) % 2, 1.0, -1.0)[some]
        cells = _some(cells, some)
        start, end, ends = cells.start, cells.end, np.isfinite(cells.end)
        way = np.where(ends, end, start) - start
        self._fill(cells, start + (0.5 + side * (GAUSS - 0.5)) * way, lines, kind)
        cells.matter.emission[:, ~ends] = 0.0
        _end_in_the_dark(cells)
        return _joined(_some(spans, np.flatnonzero(~varies[spans.medium])), cells)

    def _cuts(
        self,
        spans: Spans,
        whole: Array,
        boxes: Array,
        near: Array,
        low: Array,
        high: Array,
        shift: float,
        kind: str,
    ) -> tuple[Array, Array]:
        """Where pairs of cells of the spans `whole` (n,) end between low and high (n,), along their
        rays in the rays' own units: (m,) which of the n, rising, and (m,) where.
        """
        coarse = SHADOW_STEPS if kind == "shadow" else 1.0
        ray, row = spans.ray[whole], spans.row[whole]
        speed = spans.speed[ray]
        step = coarse * np.array([medium.step for medium in self.media])[spans.medium[whole]]
        outside = row < 0
        parts = [(np.zeros(0, np.intp), np.zeros(0))]
        if not outside.all():
            some = np.flatnonzero(~outside)
            box = boxes[row[some]]
            side = (box[:, 1] - box[:, 0]).mean(1)
            own, at = _even(
                low[some] * speed[some],
                high[some] * speed[some],
                np.maximum(step[some], coarse * LEAST_STEP) * side,
                shift,
            )
            parts.append((some[own], at / speed[some][own]))
        for each in np.unique(step[outside]):
            some = np.flatnonzero(outside & (step == each))
            way = (high[some] - near[ray[some]]) * speed[some]
            longest = _growing(way.max(), each, shift, coarse)
            count = np.searchsorted(longest, np.minimum(way, FARTHEST * each))
            own, place = explode(count)
            own = some[own]
            parts.append((own, near[ray[own]] + longest[place] / speed[own]))
        number, at = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        kept = np.flatnonzero((at > low[number]) & (at < high[number]))
        kept = kept[np.argsort(number[kept], kind="stable")]
        return number[kept], at[kept]

    def _fill(self, cells: Spans, at: Array, lines: tuple[Array, Array], kind: str) -> None:
        """Asks the programs at a place (m,) in each cell."""
        for number in np.unique(cells.medium):
            some = np.flatnonzero(cells.medium == number)
            medium, ray = self.media[number], cells.ray[some]
            o, d = (pick(line, ray) for line in lines)
            v = -d / length(d)
            far = at[some] * cells.speed[ray]
            places = _Places(cells.row[some], o + at[some] * d, v, far)
            points = _MediumPoints(self.around[number], places, np.arange(len(some)), kind)
            values = run(medium.program, points, len(some))
            self.asked["media points"] += len(some)
            cells.matter.put(some, _matter(medium, values, len(some)))


def _matter(medium: Medium, values: list[Array], count: int) -> Matter:
    def color(name: str, least: float = 0.0) -> Array:
        output = getattr(medium, f"{name}_output")
        if output < 0:
            return np.repeat(np.array(getattr(medium, name), np.float64)[:, None], count, 1)
        value = values[output]
        return np.where(np.isfinite(value), np.clip(value, least, MOST_DENSE), 0.0)

    scattering, anisotropy = color("scattering"), np.full(count, float(medium.anisotropy))
    if medium.anisotropy_output >= 0:
        value = values[medium.anisotropy_output][0]
        kept = np.clip(value, -MOST_ANISOTROPY, MOST_ANISOTROPY)
        anisotropy = np.where(np.isfinite(value), kept, 0.0)
    emission = color("emission", -MOST_DENSE)
    return Matter(color("absorption") + scattering, scattering, emission, anisotropy)


def _between(number: Array, cuts: Array, low: Array, high: Array) -> tuple[Array, Array, Array]:
    """Halves of the pairs of cells between the cuts (m,) of n spans from low to high (n,): of which
    span each is, where it begins and ends.
    """
    own, place = explode(np.bincount(number, minlength=len(low)) + 1)
    first, last = np.empty(len(own)), np.empty(len(own))
    begins = place == 0
    ends = np.append(begins[1:], True)[: len(own)]
    first[begins], first[~begins] = low, cuts
    last[ends], last[~ends] = high, cuts
    middle = np.where(np.isinf(last), last, (first + last) / 2)
    start, end = np.stack([first, middle], 1).ravel(), np.stack([middle, last], 1).ravel()
    return np.repeat(own, 2), start, end


def _even(low: Array, high: Array, step: Array, shift: float) -> tuple[Array, Array]:
    """Where pairs of cells of one step end, from where each ray begins: what is beside it has its
    cells beside. Of which of the n spans, and where; some lie beyond them.
    """
    pair = 2 * step
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        pairs = (high - low) / pair
        good = (pair > 0) & (high < np.inf) & (pairs < MOST_PAIRS)
        first = np.floor(low / pair - shift) + 1
    own, place = explode(np.where(good, pairs + 3, 0).astype(np.intp))
    return own, ((first[own] + place) + shift) * pair[own]


def _end_in_the_dark(cells: Spans) -> None:
    """Nothing gets on through cells before which those of their ray, in order, leave next to
    nothing in any channel.
    """
    order = np.lexsort((cells.start, cells.ray))
    ray, way = cells.ray[order], (cells.end - cells.start)[order] * cells.speed[cells.ray[order]]
    sigma = cells.matter.extinction[:, order]
    with np.errstate(invalid="ignore"):
        depth = np.where(sigma > 0, sigma * way, 0.0)
    first = np.flatnonzero(np.diff(ray, prepend=-1))
    count = np.diff(np.append(first, len(ray)))
    # the cells of all rays side by side, sums in order; the few longest rays one by one
    longest = np.argsort(-count, kind="stable")
    first, count = first[longest], count[longest]
    before, ended = np.zeros((3, len(first))), np.zeros(len(first), bool)
    is_dark = np.zeros(len(ray), bool)
    step = 0
    while (going := int(np.searchsorted(-count, -step))) > FEW_RAYS:
        at = first[:going] + step
        ended[:going] |= (before[:, :going] > OPAQUE).all(0)
        is_dark[at] = ended[:going]
        before[:, :going] += depth[:, at]
        step += 1
    for k in range(going):
        at = np.arange(first[k] + step, first[k] + count[k])
        reached = np.cumsum(np.column_stack([before[:, k], depth[:, at[:-1]]]), 1)
        is_dark[at] = ended[k] | np.maximum.accumulate((reached > OPAQUE).all(0))
    dark = order[is_dark]
    cells.matter.extinction[:, dark] = MOST_DENSE
    cells.matter.scattering[:, dark] = cells.matter.emission[:, dark] = 0.0


def _growing(way: float, step: float, shift: float, coarse: float) -> Array:
    """Where pairs of cells end that grow with the way, up to where one is the rest."""
    near, far = coarse * NEAR, coarse * FAR
    cuts, most, following = [], min(way, FARTHEST * step), 2 * shift * near * step
    while following < most:
        cuts.append(following)
        following += 2 * max(near * step, min(step, near * following), far * following)
    return np.array(cuts)


_COLUMNS = ("ray", "medium", "row", "start", "end")


def _some(spans: Spans, index: Array) -> Spans:
    columns = {name: getattr(spans, name)[index] for name in _COLUMNS}
    return replace(spans, **columns, whole=spans.whole[:, index], matter=spans.matter.take(index))


def _joined(a: Spans, b: Spans) -> Spans:
    columns = {name: np.concatenate([getattr(a, name), getattr(b, name)]) for name in _COLUMNS}
    matter = Matter(
        *(
            np.concatenate([getattr(a.matter, f.name), getattr(b.matter, f.name)], -1)
            for f in fields(Matter)
        )
    )
    return replace(a, **columns, whole=np.concatenate([a.whole, b.whole], 1), matter=matter)
