"""Light that surfaces throw onto each other, as points that all pixels of a sample share: virtual
point lights (Keller 1997, Instant radiosity).

Quasi-random walks leave the lights; where one meets a surface that scatters light, this glows from
there on. The points do not depend on the camera.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from ..accelerator import Accelerator
from ..sampling import concentric_disc, dome_points, tabled, walk_points
from ..scene import EVERYTHING, Bounces, Light, Scene
from .mesh_lights import MeshTable, along_a_curve, box_light
from .met_surfaces import joined, met_surfaces
from .openings import sky_seen
from .same import Same
from .taken_points import LARGEST, facing, radiance_of, taken_points
from .walk_media import walk_media
from .walk_starts import FEWEST, ROUNDED, Start, cosine_around, starts

if TYPE_CHECKING:
    from ..reference.coefficients import Coefficients
    from ..reference.surface import Surface

Array = np.ndarray

POINTS = 1 << 13
"""About so many points, of all bounces together."""
BESIDE, NEIGHBOURS = 24, 8
"""A point's surroundings are a disc to the eighth of so many to each side of it."""
MERGED = 1.25
"""As `mesh_lights.MERGED`: fewer, as these points are strewn less evenly, and discs."""
GROWTH = 0.15
"""How much wider than a neighbour's a disc may be for each unit that it is away: where discs of a
radius κ times their distance lie, they cover a surface -ln(1 - κ²)/κ² times.
"""
BENT = 0.25
"""Of the radius in which a surface bends away: discs are no wider. They would light what it does
not face, up to a hard edge where their plane ends.
"""
NEAR = 4.0
"""Radii of discs within which rays look for surfaces instead."""
MOST_SMALLER = 0.65
"""Of the discs have a smaller radius than the one that is meant."""
SMALLEST = 1 / 16
"""Of their area discs keep."""
MOST_MORE, UNSEEN_MORE = 64, 8
"""Times as many walks where few of them meet anything, and where none of a pilot did."""
PILOT = 8
"""One in so many tells first how many do, so that no more set out than are needed."""
MOST_PASSED = 16
"""Transparent surfaces that a walk passes."""
INSIDE = 0.75
"""Of all weights where there are rooms that see the sky by openings."""
LEAST = 2.0**-40
"""Weight of what gives next to nothing beside others."""
GOLDEN = 0.6180339887498949
"""Apart lie the numbers of a walk's points at its steps: the golden ratio spreads them evenly."""


def bounced_light(scene: Scene, bounces: int) -> Light | None:
    """The BOUNCED light of a scene with its lights, MESH and DOME among them, after so many
    diffuse bounces; None where no light meets a surface that scatters it.
    """
    if not (bounces and scene.instances and scene.lights):
        return None
    surfaces = (*scene.geometries, *scene.instances, *scene.materials, *scene.textures)
    media = (scene.world.medium, *scene.world.textures) if scene.world.medium else (None,)
    return _light(Same(scene, *surfaces, *scene.lights, *media), bounces)


@functools.lru_cache(maxsize=2)
def _light(same: Same, bounces: int) -> Light | None:
    # near the scene: sums of large and small coordinates lose the small ones' last digits
    first = np.array(same.scene.instances[0].world_from_object[0, :, 3], np.float64)
    found = _Walks(same.scene, first, bounces).found()
    if found is None:
        return None
    light, shift = box_light("Bounced light", "BOUNCED", found.points, first)
    return replace(light, bounces=replace(found, points=found.points - shift))


def bounced_table(light: Light, samples: int, each: int, pixels: int = 1) -> MeshTable:
    """What tracers know of a BOUNCED light of which each of `samples` samples of a pixel takes
    `each` points, as `mesh_lights.mesh_table`. pixels: which deal the points among themselves, so
    that a point is one of so many times more.
    """
    assert light.bounces is not None
    dense = light.bounces
    together = each * pixels
    b = _even(dense, together)
    near = gather_reach(b, together)
    widest = np.minimum(dense.spreads, MERGED * np.pi * together * near * near)
    count = tabled(samples, each)
    u = dome_points(count)
    # neighbours in the order go to samples far from each other
    index = taken_points(b, count)
    # neighbours in the order, of those that face to one side, go to samples far from each other
    index = index[np.argsort(facing(b)[index], kind="stable")]
    index = index[np.argsort(np.argsort(u[:, 0], kind="stable"), kind="stable")]
    return MeshTable(
        b.points[index],
        b.normals[index],
        radiance_of(b, index),
        np.zeros((count, 3)),
        b.spreads[index],
        b.reaches[index],
        concentric_disc(2 * u - 1),
        each,
        b.caught[index],
        b.light_group[index],
        near,
        b.last[index],
        np.maximum(b.spreads, widest)[index],
        pixels,
    )


def _even(b: Bounces, each: int) -> Bounces:
    """The same light of discs, `each` of which a sample takes, that grow at most by GROWTH from
    one to the next and lie on what bends away.
    """
    radii = np.sqrt(b.spreads / (MERGED * np.pi * each))
    least = radii / np.maximum(radii * b.bends / BENT, 1.0)
    # in the order of a curve, by ever longer steps: what one pass misses chains of the next reach
    for _ in range(2):
        step = 1
        while step < len(radii):
            grown = GROWTH * np.sqrt(((b.points[step:] - b.points[:-step]) ** 2).sum(1))
            before = least[:-step].copy()
            least[:-step] = np.minimum(before, least[step:] + grown)
            least[step:] = np.minimum(least[step:], before + grown)
            step *= 2
    kept = np.maximum((least / radii) ** 2, SMALLEST)
    return replace(b, spreads=b.spreads * kept, radiance=b.radiance / kept[:, None])


def gather_reach(b: Bounces, each: int) -> float:
    """Within what distance, world units, rays look for surfaces that throw light on, in place of
    points, `each` of which a sample takes: NEAR times the radius that MOST_SMALLER of the discs do
    not exceed. Larger ones reach into what rays find as well.
    """
    radii = np.sqrt(b.spreads / (MERGED * np.pi * each))
    order = np.argsort(radii, kind="stable")
    share = np.cumsum(b.weights[order])
    return NEAR * float(radii[order[np.searchsorted(share, MOST_SMALLER * share[-1])]])


def _beside(points: Array) -> tuple[Array, Array]:
    """(NEIGHBOURS, m) of points (m, 3) in the order of a curve, the nearest to each of the BESIDE
    to its either side: by how many places they lie farther on in the order, by distance, and the
    squares of these, infinite where there are fewer.
    """
    x, m = points.T, len(points)
    apart = np.full((2 * BESIDE, m), np.inf)
    for step in range(1, min(BESIDE, m - 1) + 1):
        to = x[:, step:] - x[:, :-step]
        square = to[0] * to[0] + to[1] * to[1] + to[2] * to[2]
        apart[BESIDE - step, step:] = apart[BESIDE + step - 1, :-step] = square
    order = np.argsort(apart, 0, kind="stable")[:NEIGHBOURS]
    on = order - BESIDE
    return on + (on >= 0), np.take_along_axis(apart, order, 0)


def _spreads(weights: Array, on: Array, apart: Array) -> Array:
    """(m,) one over how densely, by area, points of `weights` (m,) are taken near each: the discs
    to the eighth of those beside it, over the share of the weights in it. Weak points among strong
    ones are as densely taken as these. on, apart: of `_beside`.
    """
    there = np.isfinite(apart)
    near = np.where(there, weights[np.clip(np.arange(len(weights)) + on, 0, len(weights) - 1)], 0.0)
    # half of the farthest: it is on the disc's edge
    share = weights + near.sum(0) - near[-1] / 2
    area = np.pi * np.where(there, apart, 0.0).max(0)
    # points that coincide, and a single one
    area = np.maximum(area, max(1e-9 * area.max(), 1e-150))
    return area * weights.sum() / share


def _bends(points: Array, normals: Array, on: Array, apart: Array) -> Array:
    """(m,) one over the radius in which the surface bends away from points (m, 3) in the order of a
    curve: the median over the nearest of those beside each, 0 for one that faces elsewhere. on,
    apart: of `_beside`.
    """
    x, n = points.T, normals.T
    m = len(points)
    bend = np.zeros_like(apart)
    for k in range(len(apart)):
        at = np.clip(np.arange(m) + on[k], 0, m - 1)
        to, other = x[:, at] - x, n[:, at]
        alike = n[0] * other[0] + n[1] * other[1] + n[2] * other[2] > 0
        below = -(to[0] * n[0] + to[1] * n[1] + to[2] * n[2])
        bend[k] = np.where(alike, 2 * below / np.maximum(apart[k], 1e-300), 0.0)
    return np.maximum(np.median(bend, 0), 0.0)


@dataclass(frozen=True, eq=False)
class _Steps:
    """n walks on their way. start: which began them, in order. number: among those of their start.
    o, d: (3, n).  carried: (3, n) what is left of the light, or what it is once a surface scattered
    it.  scattered: (n,) how often it was.  shadowed: (n,) bool, those that meet what casts shadows,
    not what diffuse rays see.
    """

    start: Array
    number: Array
    o: Array
    d: Array
    carried: Array
    scattered: Array
    shadowed: Array

    def take(self, index: Array) -> _Steps:
        return _Steps(**{f.name: getattr(self, f.name)[..., index] for f in fields(self)})


class _Walks:
    """Of one scene. Points count from an origin."""

    def __init__(self, scene: Scene, origin: Array, bounces: int) -> None:
        self._scene, self._origin, self._bounces = scene, origin, bounces
        self._joined = replace(scene, instances=joined(scene.instances))
        self._count = max(POINTS // bounces, FEWEST)
        self._differ = any(b.visible_diffuse != b.visible_shadow for b in scene.instances)
        self._media = walk_media(self._joined, origin)

    def found(self) -> Bounces | None:
        scene = self._joined
        with Accelerator(scene.geometries, scene.instances) as surfaces:
            if not np.isfinite(surfaces.bounds).all():
                return None
            few, self._count = self._count, max(self._count // PILOT, FEWEST)
            columns = self._points(surfaces)
            more = float(UNSEEN_MORE)
            if columns is not None:
                # a power of two, so that things that move seldom change it
                wanted = self._count * POINTS / len(columns[0]) / few
                more = min(max(2.0 ** np.ceil(np.log2(wanted) - 0.5), 1.0), MOST_MORE)
            self._count = round(few * more)
            columns = self._points(surfaces)
            if columns is None:
                return None
            weight = self._weights(surfaces, *columns[:3])
        points, normals, power, reaches, numbers, caught, group, last = columns
        good = along_a_curve(points)
        points, weight = points[good], weight[good]
        beside = _beside(points)
        spreads = _spreads(weight, *beside)
        radiance = power[good] * (weight.sum() / (weight * spreads))[:, None]
        radiance = np.clip(radiance, -LARGEST, LARGEST)
        return Bounces(
            points,
            normals[good],
            radiance,
            spreads,
            weight,
            reaches[good],
            numbers[good],
            caught[good],
            group[good],
            _bends(points, normals[good], *beside),
            last[good],
        )

    def _weights(self, surfaces: Accelerator, points: Array, normals: Array, power: Array) -> Array:
        """Weights (m,) of points (m, 3), as the roots of their power (m, 3): where it is bright
        errors show less. Where rooms have openings, as their power itself, and INSIDE of them go to
        points that see less than half of the sky: else the few that light a room are lost among
        those on what is outside.
        """
        given = np.maximum((np.abs(power) / np.abs(power).max()).mean(1), LEAST)
        if not any(light.openings for light in self._scene.lights):
            return np.sqrt(given)
        seen = sky_seen(self._joined, surfaces, self._origin, points, normals)
        within = np.maximum(1 - 2 * seen, 0.0) * given
        without = given - within
        return INSIDE * within / max(within.sum(), LEAST) + (1 - INSIDE) * without / max(
            without.sum(), LEAST
        )

    def _points(self, surfaces: Accelerator) -> list[Array] | None:
        """Columns as of `_walk`, of all lights; None where there are none."""
        begun = list(starts(self._scene, self._origin, surfaces.bounds, self._count))
        parts = list(self._walk(surfaces, begun)) if begun else []
        if not parts:
            return None
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        power = columns[2]
        good = np.flatnonzero(np.isfinite(power).all(1) & power.any(1))
        return [column[good] for column in columns] if len(good) else None

    def _walk(self, surfaces: Accelerator, begun: list[Start]) -> Iterator[tuple[Array, ...]]:
        """Columns of points, normals, power (radiance times area), reaches, numbers, which are on
        catchers, light groups and which end their walk, a part for each step.
        """
        counts = [start.origin.shape[1] for start in begun]
        totals, n = np.array(counts), sum(counts)
        steps = _Steps(
            np.repeat(np.arange(len(begun)), counts),
            np.concatenate([np.arange(count) for count in counts]),
            np.concatenate([start.origin for start in begun], 1),
            np.concatenate([start.direction for start in begun], 1),
            np.ones((3, n)),
            np.zeros(n, np.intp),
            np.concatenate([_shadowed(start) for start in begun]),
        )
        for number in range(self._bounces + MOST_PASSED):
            hit, surface, k, sets, caught = self._met(surfaces, steps)
            if not len(hit):
                return
            steps = self._dimmed(steps.take(hit), surface, begun, number)
            white = steps.carried.copy()
            passed = np.zeros(len(hit), bool)
            ends = np.searchsorted(steps.start, np.arange(len(begun) + 1))
            spans = list(zip(begun, ends[:-1], ends[1:], strict=True))
            for start, first, end in spans:
                fresh = first + np.flatnonzero(steps.scattered[first:end] == 0)
                if not len(fresh):
                    continue
                white[:, fresh] *= start.given(surface.x[:, fresh], steps.number[fresh])
                white[:, fresh[_without(start.receivers, sets[fresh])]] = 0.0
                passed[fresh] = _without(start.blockers, sets[fresh])
            k = _let_through(k, np.flatnonzero(passed))
            numbers = (steps.number + 0.5) / totals[steps.start] + number * GOLDEN
            group = np.concatenate([start.light_group[steps.number[a:b]] for start, a, b in spans])
            last = steps.scattered + 1 == self._bounces
            for given, normal, own in self._sides(surface, k, numbers):
                parts = surface.x.T, normal.T, (white * given).T, surface.offset, own % 1.0
                yield (*parts, caught, group, last)
            steps = self._onward(steps, surface, k, white, number)

    def _sides(
        self, surface: Surface, k: Coefficients, numbers: Array
    ) -> Iterator[tuple[Array, Array, Array]]:
        """What of light each side throws on, (3, m), its normals and the numbers of its points."""
        yield k.diffuse, surface.g, numbers
        if k.translucent.any():
            yield k.translucent, -surface.g, numbers + 0.5

    def _met(
        self, surfaces: Accelerator, steps: _Steps
    ) -> tuple[Array, Surface, Coefficients, Array, Array]:
        """Of the walks that meet something: those that are `shadowed` light what diffuse rays see
        and go on where it casts no shadow, and end where it does and is not seen.
        """
        o, d = (steps.o + self._origin[:, None]).T, steps.d.T
        if not self._differ:
            hits = surfaces.closest(o, d, visibility="shadow")
            return met_surfaces(self._joined, self._origin, steps.o, steps.d, hits)
        hits = surfaces.closest(o, d, visibility="diffuse")
        first = np.flatnonzero(steps.shadowed)
        other = surfaces.closest(o[first], d[first], visibility="shadow")
        nearer = other.t < hits.t[first]
        for field in fields(hits):
            getattr(hits, field.name)[first[nearer]] = getattr(other, field.name)[nearer]
        hit, surface, k, sets, caught = met_surfaces(
            self._joined, self._origin, steps.o, steps.d, hits
        )
        instances = self._joined.instances
        ends = np.cumsum([len(block.world_from_object) for block in instances])
        block = np.searchsorted(ends, hits.instance[hit], "right")
        seen, casts = (
            np.array([getattr(b, name) for b in instances])[block]
            for name in ("visible_diffuse", "visible_shadow")
        )
        k = replace(
            k,
            diffuse=np.where(seen, k.diffuse, 0.0),
            translucent=np.where(seen, k.translucent, 0.0),
            transparent=np.where(steps.shadowed[hit] & ~casts, 1.0, k.transparent),
        )
        return hit, surface, k, sets, caught

    def _dimmed(self, steps: _Steps, surface: Surface, begun: list[Start], number: int) -> _Steps:
        """After media on their way to a surface."""
        if self._media is None:
            return steps
        to = surface.x - steps.o
        way = np.sqrt((to * to).sum(0))
        if number == 0:
            way[np.array([start.endless for start in begun], bool)[steps.start]] = np.inf
        passed = self._media.passed(surface.x, steps.d, way)
        return replace(steps, carried=steps.carried * passed)

    def _clear(self, surface: Surface) -> Array:
        """How far from the surface walks go on: the queries' is that of single precision."""
        return ROUNDED * np.abs(surface.x + self._origin[:, None]).max(0) + surface.offset

    def _onward(
        self,
        steps: _Steps,
        surface: Surface,
        k: Coefficients,
        white: Array,
        number: int,
    ) -> _Steps:
        """Each walk goes straight on through what is transparent or is scattered, to this side or
        the other, by chance in proportion to how much does; those end that have no bounce left.
        white: (3, n) what surfaces get of the light.
        """
        passing = np.clip(k.transparent, 0.0, 1.0)
        straight, scattering = passing.max(0), np.abs(k.diffuse).max(0)
        through = np.abs(k.translucent).max(0)
        total = straight + scattering + through
        u, v = walk_points(self._count, 2 + number)[steps.number % self._count].T
        at = walk_points(self._count, 128 + number)[steps.number % self._count, 0] * total
        passes, behind = at < straight, at >= straight + scattering
        behind &= through > 0
        chosen = np.where(passes, straight, np.where(behind, through, scattering))
        share = total / np.where(chosen > 0, chosen, 1.0)
        given = np.where(behind, k.translucent, k.diffuse)
        side = np.where(behind, -1.0, 1.0)
        next_ones = _Steps(
            steps.start,
            steps.number,
            surface.x + np.where(passes, -1.0, side) * self._clear(surface) * surface.g,
            np.where(passes, steps.d, cosine_around(side * surface.g, u, v)),
            share * np.where(passes, steps.carried * passing, white * given),
            steps.scattered + ~passes,
            steps.shadowed & passes,
        )
        go = next_ones.carried.any(0) & (next_ones.scattered < self._bounces)
        return next_ones.take(np.flatnonzero(go))


def _shadowed(start: Start) -> Array:
    n = start.origin.shape[1]
    return np.ones(n, bool) if start.shadowed is None else start.shadowed[:n]


def _without(bits: int, sets: Array) -> Array:
    """(m,) bool: which of the sets have no bit."""
    if bits == EVERYTHING:
        return np.zeros(len(sets), bool)
    return np.array([not bits >> int(number) & 1 for number in sets], bool)


def _let_through(k: Coefficients, points: Array) -> Coefficients:
    """The same where light passes some points as if nothing were there."""
    if not len(points):
        return k
    lobes = (k.diffuse, k.translucent, k.transparent)
    diffuse, translucent, transparent = (total.copy() for total in lobes)
    diffuse[:, points], translucent[:, points], transparent[:, points] = 0.0, 0.0, 1.0
    return replace(k, diffuse=diffuse, translucent=translucent, transparent=transparent)
