"""Photons from lamps through what is specular to what is not (semantics/photons.md)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..linear.columns import dot, pick
from ..scene import EVERYTHING, Material
from .paths import Interaction, Paths, joined, met, sent, straight_on
from .photon_emission import Beam, find_beams, find_casters
from .photon_map import Bundle, PhotonMap, Photons
from .rays import IncoherentRays
from .shadows import ALIKE, MOST_BENT
from .surface import surface_at
from .visibility import NOTHING, Hits

if TYPE_CHECKING:
    from .stage import Stage

Array = np.ndarray

AT_ONCE = 4096
"""Photons that are followed together: they arrive in the order of their bounces."""
_LARGEST = 1 - 2.0**-53
_FOLDED = ("AMBIENT", "DIFFUSE", "EMISSION", "SPECULAR", "SHEEN")
"""Kinds of lobes that send no rays on and are the same all over a surface, unless they vary."""


def trace_photons(stage: Stage) -> PhotonMap | None:
    """The photons of a picture; None where nothing throws any."""
    settings = stage.settings
    on = "ON" in (settings.reflective_caustics, settings.refractive_caustics)
    is_physical = settings.illumination == "PHYSICAL"
    if not (settings.photons and is_physical and stage.bounces and settings.max_bounces and on):
        return None
    tracer, bundles = _PhotonTracer(stage), []
    casters = find_casters(stage.scene, stage.geometry, settings)
    for beam in find_beams(stage.sources, casters, settings.photons):
        if beam.place == 0:
            bundles.append(Bundle(beam.source.light.light_group))
        firsts = range(0, beam.count, AT_ONCE)
        parts = [tracer.trace(beam, k, min(k + AT_ONCE, beam.count)) for k in firsts]
        bundles[-1].places.append(Photons.joined(parts))
    arrived = any(len(photons) for bundle in bundles for photons in bundle.places)
    return PhotonMap(bundles) if arrived else None


@dataclass(frozen=True, eq=False)
class _Ways:
    """What is known of n photons. sent_from, along: (3, n) where they left the lamp, and how.
    color: (3, n) of the lamp, as much as they carry of it. choice: (n,) by which they are mirrored
    or refracted, in [0, 1). narrowed: (n,) as shadows have it. passed: (n,) bool, by nothing but
    what lets light pass straight as well.
    """

    sent_from: Array
    along: Array
    color: Array
    choice: Array
    narrowed: Array
    passed: Array


@dataclass(frozen=True, eq=False)
class _Queue:
    """n photons that go on together, those that nothing bent so far or others. paths: their pixels
    are numbers among `_Ways`, their depth is that of none; depth: (n,).
    """

    paths: Paths
    depth: Array
    bent: bool

    def __len__(self) -> int:
        return len(self.paths)


@dataclass(frozen=True, eq=False)
class _Leaving:
    """Rays that leave surfaces, at most one of each photon. turned: whether they were mirrored or
    refracted there. lobe: how many others leave each point before these. row: (n,) of the queue.
    size: (n,) how much they carry, 0 for those that may not go on. x: (3, n) where they leave.
    narrowed: (n,) what refracted light is times there. is_dense: (n,) bool, straight light sees
    something denser there.
    """

    paths: Paths
    turned: bool
    lobe: int
    row: Array
    size: Array
    x: Array
    narrowed: Array
    is_dense: Array


class _PhotonTracer:
    """Follows the photons of beams."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        materials = stage.shader.materials
        self._rough = np.array([any(x.is_rough_glass for x in m.lobes) for m in materials])
        self._dense = np.array([_is_dense(m) for m in materials])
        self._apart = np.array([_is_apart(m) for m in materials])

    def trace(self, beam: Beam, first: int, last: int) -> Photons:
        """Where the photons [first, last) of a beam light what is matt."""
        self._beam = beam
        now, arrived = [self._emit(first, last)], []
        while now:
            self._stage.cancellation.check()
            later: dict[bool, list[_Queue]] = {False: [], True: []}
            for queue in now:
                found, onward = self._follow(queue)
                arrived.append(found)
                for one in onward:
                    later[one.bent].append(one)
            now = [_together(queues) for queues in later.values() if queues]
        return Photons.joined(arrived)

    def _emit(self, first: int, last: int) -> _Queue:
        beam = self._beam
        emitted = beam.photons(np.arange(first, last))
        go = np.flatnonzero(emitted.share > 0)
        n, zero = len(go), np.zeros(len(go), np.intp)
        color = emitted.share[go] * beam.source.color[:, None]
        along = pick(emitted.direction, go)
        self._ways = _Ways(
            pick(emitted.at, go), along, color, emitted.choice[go], np.ones(n), np.ones(n, bool)
        )
        far = np.full(n, np.inf)
        rays = IncoherentRays.of(pick(emitted.origin, go), along, emitted.near[go], far)
        no = np.zeros(n, bool)
        one = np.ones(n)
        paths = Paths(rays, np.ones((3, n)), np.arange(n), zero, 0, no, far, zero, no, one)
        return _Queue(paths, zero, False)

    def _follow(self, queue: _Queue) -> tuple[Photons, list[_Queue]]:
        """The queue's photons to their next surfaces: those that arrive there, and those that go on
        from there.
        """
        hits = self._closest(queue)
        queue = replace(queue, paths=self._dim(queue, hits.depth))
        arrived: list[tuple[Array, Photons]] = []
        leaving: list[_Leaving] = []
        for at in self._surfaces(queue, hits):
            if queue.bent:
                arrived.append(self._arrive(at))
            leaving += self._leave(queue, at, hits.depth[at.hit])
        runs = self._runs(hits)
        found = Photons.joined([photons for _, photons in arrived])
        rows = [row for row, _ in arrived]
        order = np.argsort(np.concatenate(rows), kind="stable") if rows else np.zeros(0, np.intp)
        return found.take(order), self._go_on(queue, leaving, runs)

    def _closest(self, queue: _Queue) -> Hits:
        """What casts no shadow in the lamp's light does not stop it."""
        stage, beam = self._stage, self._beam
        rays, kind = queue.paths.rays, "mirror" if queue.bent else "shadow"
        blockers = beam.source.light.blockers
        if queue.bent or blockers == EVERYTHING:
            return stage.visibility.closest(rays, kind)
        rows = np.arange(len(stage.lighting.sets))
        stops = beam.caster.has(rows) | self._is_in(blockers, rows)
        mine, seen = stops[stage.geometry.row], stage.geometry.visible[kind]
        assert isinstance(rays, IncoherentRays)
        return stage.visibility.closest_of(rays, mine if seen is None else mine & seen)

    def _is_in(self, sets: int, row: Array) -> Array:
        """(n,) bool: rows of the placements whose set has a bit."""
        return np.array(
            [sets >> int(number) & 1 for number in self._stage.lighting.sets[row]], bool
        )

    def _dim(self, queue: _Queue, depth: Array) -> Paths:
        """The paths with what media on the way leave of them."""
        media, paths = self._stage.media, queue.paths
        if not media:
            return paths
        media.moment.sample = 0
        spans = media.spans(paths.rays, "mirror" if queue.bent else "shadow", depth)
        passed = media.passed(spans, paths.rays.near, depth)
        return replace(paths, weight=paths.weight * passed)

    def _surfaces(self, queue: _Queue, hits: Hits) -> Iterator[Interaction]:
        """What the photons meet, those of one depth and material together."""
        stage = self._stage
        hit = np.flatnonzero(hits.primitive != NOTHING)
        material = stage.geometry.material[hits.primitive[hit]]
        for depth in np.unique(queue.depth[hit]):
            for number in np.unique(material[queue.depth[hit] == depth]):
                some = hit[(queue.depth[hit] == depth) & (material == number)]
                paths = replace(queue.paths, depth=int(depth))
                primitive = hits.primitive[some]
                place = stage.geometry, stage.attributes, paths.rays
                surface = surface_at(*place, some, primitive, hits.depth[some], stage.cancellation)
                queries = stage.queries(0)
                surface = stage.shader.bent(met(paths, some, surface), "mirror", queries)
                lobes = stage.shader.coefficients(surface, "mirror", queries)
                yield Interaction(paths, some, surface, lobes)

    def _arrive(self, at: Interaction) -> tuple[Array, Photons]:
        """Rows of the queue, and the photons that were mirrored or refracted where they meet what
        is matt.
        """
        slot, weight = at.pixel, at.weight
        lobes = at.coefficients
        matt = (weight * lobes.diffuse).any(0) | (weight * lobes.translucent).any(0)
        flux = weight * pick(self._ways.color, slot)
        _, along = at.paths.rays.lines(at.hit)
        counts = matt & flux.any(0) & np.isfinite(flux).all(0) & ~self._comes_straight(slot, along)
        here = np.flatnonzero(counts)
        x, g = pick(at.surface.x, here), pick(at.surface.g, here)
        return at.hit[here], Photons(x, g, pick(flux, here), np.zeros(len(here)))

    def _comes_straight(self, slot: Array, along: Array) -> Array:
        """(n,) bool: whether the lamp's own light is counted that takes this way as if nothing bent
        it.
        """
        turned = along - pick(self._ways.along, slot)
        is_out = np.abs(self._ways.narrowed[slot] - 1) < ALIKE
        return self._ways.passed[slot] & (~is_out | (dot(turned, turned) <= MOST_BENT**2))

    def _leave(self, queue: _Queue, at: Interaction, depth: Array) -> Iterator[_Leaving]:
        """All rays that leave these surfaces: refracted, mirrored and straight on."""
        stage, surface = self._stage, at.surface
        row_of = np.zeros(len(self._ways.choice), np.intp)
        row_of[at.pixel] = np.arange(len(at.hit))
        deep = at.paths.depth >= stage.settings.max_bounces
        onward = straight_on(at, depth, np.zeros(len(at.hit), bool))
        rays, narrowed = [] if deep else sent(stage, at), _narrowing(at)
        numbered = list(enumerate(rays)) + ([(0, onward)] if onward is not None else [])
        for lobe, paths in numbered:
            here = row_of[paths.pixel]
            turned = paths is not onward
            size = np.abs(paths.weight).max(0, initial=0.0)
            size = np.where(np.isfinite(paths.weight).all(0), size, 0.0)
            if turned:
                size = np.where(self._may_turn(queue, at, paths, here), size, 0.0)
            dense, x = self._dense[surface.material[here]], pick(surface.x, here)
            yield _Leaving(paths, turned, lobe, at.hit[here], size, x, narrowed[here], dense)

    def _may_turn(self, queue: _Queue, at: Interaction, paths: Paths, here: Array) -> Array:
        """(n,) bool whether rays from these of the points count that were mirrored or refracted."""
        settings, surface, light = self._stage.settings, at.surface, self._beam.source.light
        mirrors = np.full(len(here), settings.reflective_caustics == "ON")
        clear = ~self._rough[surface.material[here]] & (settings.refractive_caustics == "ON")
        good = np.where(paths.refracted, clear, mirrors)
        if queue.bent:
            return good
        row = surface.row[here]
        return good & self._beam.caster.has(row) & self._is_in(light.receivers, row)

    def _runs(self, hits: Hits) -> Array:
        """(n,) numbers of runs of photons that meet one material; what is the same all over its
        surface and sends no rays on ends none.
        """
        geometry, run = self._stage.geometry, np.zeros(len(hits.primitive), np.intp)
        hit = np.flatnonzero(hits.primitive != NOTHING)
        material = geometry.material[hits.primitive[hit]]
        kept = self._apart[material]
        hit, material = hit[kept], material[kept]
        run[hit[1:]] = np.cumsum(np.diff(material) != 0)
        return run

    def _go_on(self, queue: _Queue, leaving: list[_Leaving], runs: Array) -> list[_Queue]:
        """Of the rays that leave a surface one goes on."""
        count = len(self._ways.choice)
        total, before = np.zeros((2, count))
        for rays in leaving:
            total[rays.paths.pixel] += rays.size
        # what was never bent goes on in any case; then as much as surfaces give back (roulette)
        if queue.bent:
            came = np.abs(queue.paths.weight).max(0, initial=0.0)
            slots = queue.paths.pixel
            total[slots] = np.maximum(total[slots], came)
        choice = self._ways.choice.copy()
        onward: list[tuple[_Queue, Array]] = []
        for rays in leaving:
            slot = rays.paths.pixel
            at, start = self._ways.choice[slot] * total[slot], before[slot]
            end = start + np.where(rays.size > 0, rays.size, 0.0)
            go = np.flatnonzero((at >= start) & (at < end))
            before[slot] = end
            before[slot[go]] = np.inf  # no other
            size, slot = rays.size[go], slot[go]
            choice[slot] = np.minimum((at[go] - start[go]) / size, _LARGEST)
            paths = rays.paths.take(go)
            paths = replace(paths, weight=total[slot] / size * paths.weight)
            if rays.turned:
                paths = self._turn(rays, go, paths)
                if not queue.bent:
                    self._apply_program(queue, rays, go)
            depth = np.full(len(go), paths.depth)
            kind, row = 0 * go, rays.row[go]
            key = np.array([kind + (not rays.turned), runs[row], kind + rays.lobe, row])
            one = _Queue(replace(paths, depth=0), depth, rays.turned or queue.bent)
            onward.append((one, key))
        self._ways = replace(self._ways, choice=choice)
        return [
            _sorted([pair for pair in onward if pair[0].bent == bent])
            for bent in (False, True)
            if any(len(one) for one, _ in onward if one.bent == bent)
        ]

    def _turn(self, rays: _Leaving, go: Array, paths: Paths) -> Paths:
        """Notes that surfaces mirrored or refracted photons."""
        slot, ways = paths.pixel, self._ways
        ways.passed[slot] &= paths.refracted & rays.is_dense[go]
        narrowed = np.where(paths.refracted, rays.narrowed[go], 1.0)
        ways.narrowed[slot] *= narrowed
        return replace(paths, weight=narrowed * paths.weight)

    def _apply_program(self, queue: _Queue, rays: _Leaving, go: Array) -> None:
        """What the lamp's program says of its light where photons are bent first."""
        source, ways, slot = self._beam.source, self._ways, rays.paths.pixel[go]
        if source.emission is None or not len(slot):
            return
        x, (_, along) = pick(rays.x, go), queue.paths.rays.lines(rays.row[go])
        end = None if source.light.kind == "SUN" else pick(ways.sent_from, slot)
        ways.color[:, slot] *= source.emission.seen(source, x, -along, end, "shadow")


def _is_dense(material: Material) -> bool:
    """Whether light to lamps goes into something denser, or out of it."""
    lobes = [lobe for lobe in material.lobes if lobe.kind == "TRANSPARENT"]
    return any(lobe.ior != 1 or lobe.ior_output >= 0 for lobe in lobes)


def _is_apart(material: Material) -> bool:
    """Whether it varies over the surface, or sends rays on."""
    for lobe in material.lobes:
        varies = any(x.texture >= 0 or x.attribute or x.output >= 0 for x in lobe.factors)
        varies |= any(output >= 0 for _, output in lobe.parameters)
        varies |= lobe.normal_output >= 0 or lobe.stretch_output >= 0
        if varies or lobe.goes_below or lobe.kind not in _FOLDED:
            return True
    return material.normal_output >= 0


def _narrowing(at: Interaction) -> Array:
    """(m,) what refracted photons are times, so that light in what is dense is counted as other
    light is there: radiance over the square of the index stays.
    """
    ior = np.ones(len(at.surface))
    for term in reversed(at.coefficients.refractions):
        ior[term.index] = term.ior
    return np.where(at.surface.outside, 1 / (ior * ior), ior * ior)


def _together(queues: list[_Queue]) -> _Queue:
    paths = joined([queue.paths for queue in queues])
    return _Queue(paths, np.concatenate([queue.depth for queue in queues]), queues[0].bent)


def _sorted(onward: list[tuple[_Queue, Array]]) -> _Queue:
    """As one, in the order of their keys (4, n)."""
    queue = _together([one for one, _ in onward])
    order = np.lexsort(np.concatenate([key for _, key in onward], 1)[::-1])
    return _Queue(queue.paths.take(order), queue.depth[order], queue.bent)
