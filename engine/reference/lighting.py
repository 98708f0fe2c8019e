"""Direct light at surfaces (notes, sections 4.12-4.16): k_d I max(0, n·l) + k_s I max(0, n·h)^p,
times the shadow, summed over lights.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..evaluation.surface import Surface
from ..lights.lamps import may_share
from ..linear.columns import add_at, around, dot, pick
from ..sampling import BOUNCE_PARTS
from ..scene import EVERYTHING
from .bumps import bump_shadow
from .cancellation import Cancellation
from .coefficients import Coefficients
from .gloss import Narrow, even_gloss
from .glowing_media import MediumSource
from .lamp_clusters import FarLight, LampClusters
from .light_groups import add_to_groups
from .lights import CENTER, LightPoint, LightSample, Source
from .lobe_light import fibres, highlights, is_apart, is_toon, matt_lobes, ways_through
from .photon_emission import throws_photons
from .shadows import Shadows
from .shared_lamps import Given, Sharing, share_shadows
from .tabled_lights import FEW_PARTS, Dome, MeshSource
from .terminator import lowered, mean_lowered

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class DirectLight:
    """(3, n) each: light before shadows, and what blockers take away. lit_*: what is left of light
    from where it is made. groups: (3 g, n) what is left of that of light groups.
    """

    diffuse: Array
    specular: Array
    shadow: Array
    lit_diffuse: Array
    lit_specular: Array
    groups: Array


@dataclass(frozen=True, eq=False)
class _Receivers:
    """n points that get light in one sample of their pixels. weight: (3, n) T of the rays that see
    them.  given: (n,) bool, those that light is for.
    """

    surface: Surface
    coefficients: Coefficients
    weight: Array
    sample: int
    given: Array


@dataclass(frozen=True, eq=False)
class Lighting:
    """The lights of a scene. points: the samples on extended lights, light_samples for each sample
    of a pixel. sets: (r,) `Instances.light_set` of each row of the placements. marks: how many
    shadow rays of a point and sample lamps share; 0 where each sample of a lamp has its own.
    medium_marks: how many the points of media share. reflecting: what reflected rays show of gloss,
    which shows their light evenly but for that. light_groups: how many light is told apart by.
    first_rod: the first primitive that is of strands. faint: weights of points below this take few
    samples. dealt: pixels of a block deal the samples among themselves, so that each sees few of
    the sky. each_once: of its samples each light takes one, another in each sample of a pixel.
    draws_matt: what is matt draws directions to MESH lights. lobe_points: (samples, 2) of the unit
    disc, where in lobes rays are reflected, and highlights draw the first of a sample's directions
    to the sky where samples are dealt. has_photons: they bring the light of lamps that mirrors
    throw on to what is matt, so that lamps do not light these. hides: else nothing is in the way of
    lights.
    """

    sources: tuple[Source, ...]
    light_samples: int
    points: list[LightPoint]
    shadows: Shadows
    cancellation: Cancellation
    sets: Array
    lobe_points: Array
    marks: int = 0
    medium_marks: int = 1
    light_groups: int = 0
    reflecting: str = "OFF"
    first_rod: int = 0
    faint: float = 0.0
    dealt: bool = False
    each_once: bool = False
    draws_matt: bool = False
    has_photons: bool = False
    hides: bool = True

    @cached_property
    def of_few_samples(self) -> Lighting:
        """Of lights that have tables."""
        tabled = (Dome, MeshSource)
        parts = [s.in_parts(FEW_PARTS) if isinstance(s, tabled) else s for s in self.sources]

        divisors = (s.parts for s in parts if isinstance(s, MediumSource))
        media = max(self.medium_marks // max(divisors, default=1), 1)
        return replace(self, sources=tuple(parts), medium_marks=media)

    def kinds(self, surface: Surface, weight: Array) -> Iterator[tuple[Lighting, Array]]:
        """What lights points of a kind, and (n,) bool which points these are. weight: (3, n) T."""
        few = (surface.primitive >= self.first_rod) | (np.abs(weight).max(0) < self.faint)
        few &= not self.each_once
        yield self, ~few
        yield self.of_few_samples, few

    @cached_property
    def _clusters(self) -> LampClusters:
        return LampClusters(self.sources, self.light_samples)

    @cached_property
    def scattered_sources(self) -> tuple[Source, ...]:
        """Those that light media: each point has a ray of its own there, so few of MEDIUM ones."""
        lit = (source for source in self.sources if source.light.lights_media)
        return tuple(s.fewer(self.medium_marks) if isinstance(s, MediumSource) else s for s in lit)

    def lights(self, source: Source, surface: Surface) -> Array:
        """(n,) bool: points of instances that a light is for."""
        receivers = source.light.receivers
        if receivers == EVERYTHING:
            return np.ones(len(surface), bool)
        return self._in(receivers)[surface.row]

    def shadows_of(self, source: Source) -> Shadows:
        """What casts shadows in a light."""
        blockers = source.light.blockers
        shadows = self.shadows if source.light.kind == "DOME" else self.shadows.of_lamp()
        return shadows if blockers == EVERYTHING else shadows.cast_by(self._in(blockers))

    def of_catchers(self, caught: Array) -> Lighting:
        """As if the rows (r,) bool of the placements were the only things there; none of them
        glows.
        """
        sources = tuple(source for source in self.sources if not isinstance(source, MeshSource))
        shadows = self.shadows.cast_by(caught)
        return replace(self, sources=sources, shadows=shadows)

    @cached_property
    def _by_photons(self) -> tuple[Lighting, Lighting]:
        """Of the lights that throw photons, and of others."""
        lamps = [throws_photons(source) for source in self.sources]
        parts = (
            tuple(x for x, own in zip(self.sources, lamps, strict=True) if own == is_lamp)
            for is_lamp in (True, False)
        )
        of_lamps, of_others = (replace(self, sources=p, has_photons=False) for p in parts)
        return of_lamps, of_others

    def _in(self, sets: int) -> Array:
        """(r,) bool: rows of the placements whose set has a bit."""
        return np.array([sets >> int(number) & 1 for number in self.sets], bool)

    def direct(
        self,
        surface: Surface,
        coefficients: Coefficients,
        weight: Array,
        sample: int,
        on_reach: Callable[[Source, Array, bool], None],
        on_cut: Callable[[Array], None],
    ) -> DirectLight:
        """What all lights add at the points of `surface` in sample `sample` of their pixels.
        weight: (3, n) T of the rays that see them. on_reach: told which points each sample of a
        light reaches, or which ask for its shadow, and whether its pixels take more samples before
        they may stop.  on_cut: told the points whose horizon cuts a light of more than one sample.
        """
        if self.has_photons:
            told = weight, sample, on_reach, on_cut
            lamps, others = self._by_photons
            lit = lamps.direct(surface, coefficients.without_thrown(), *told)
            rest = others.direct(surface, coefficients, *told)
            return DirectLight(*(getattr(lit, x.name) + getattr(rest, x.name) for x in fields(lit)))
        rows = (3,) * 5 + (3 * self.light_groups,)
        total = DirectLight(*(np.zeros((count, len(surface))) for count in rows))
        given = coefficients.diffuse.any(0)
        for term in (*coefficients.highlights, *coefficients.sheens, *coefficients.fibres):
            given[term.index] |= np.broadcast_to(term.k, (3, len(term.index))).any(0)
        for lighting, points in self.kinds(surface, weight):
            if (given & points).any():
                at = _Receivers(surface, coefficients, weight, sample, given & points)
                lighting._light(at, on_reach, on_cut, total)
        return total

    def _light(
        self,
        at: _Receivers,
        on_reach: Callable[[Source, Array, bool], None],
        on_cut: Callable[[Array], None],
        total: DirectLight,
    ) -> None:
        """Adds all lights."""
        surface = at.surface
        for source in self.sources:
            lit = at.given & self.lights(source, surface)
            several = source.sample_count(self.light_samples) > 1 and not self.each_once
            if several and source.color.any():
                on_cut(np.flatnonzero(lit & source.is_cut(surface.x, surface.n)))
            if self._shares(source):
                continue
            balance = np.zeros(len(surface), np.intp)  # directions open less hidden
            for brought, light_sample, is_drawn in self._samples_given(at, source, lit):
                seen, dimmed = self._add(source, brought, total)
                on_reach(source, seen, several and source.is_soft(self.light_samples))
                if not is_drawn and light_sample.counts:
                    hidden = source.hidden_counts if isinstance(source, Dome) else 1
                    balance[seen] += np.where(dimmed, -hidden, 1)
            is_whole = not self.dealt and not self.each_once
            if isinstance(source, Dome) and source.light.lights_matt and is_whole:
                open_ = np.flatnonzero(lit & (balance >= 0))
                rest = source.rest(pick(surface.x, open_), pick(surface.n, open_), at.sample)
                low = mean_lowered(surface.lowering[open_])
                rest = low * pick(at.coefficients.diffuse, open_) * rest
                add_at(total.diffuse, open_, rest)
                add_at(total.lit_diffuse, open_, rest)
                add_to_groups(total.groups, source.light.light_group, open_, rest)
        for group in self._groups(at, total):
            self._share(group, at, on_reach, total)

    def _samples_given(
        self, at: _Receivers, source: Source, lit: Array
    ) -> Iterator[tuple[Given, LightSample, bool]]:
        """What each sample of a light gives to the points `lit` (n,) bool, and whether lobes draw
        it.
        """
        surface, coefficients = at.surface, at.coefficients
        for narrow, light_sample, lobes in self.samples(
            surface, coefficients, at.weight, source, at.sample
        ):
            self.cancellation.check()
            is_drawn = lobes is not coefficients
            brought = self._given(surface, lobes, is_drawn, lit, source, narrow, light_sample)
            if not self.hides:
                brought = replace(brought, open=lambda places: np.ones((3, len(places))))
            yield brought, light_sample, is_drawn

    def _shares(self, source: Source) -> bool:
        return isinstance(source, MediumSource) or (self.marks > 0 and may_share(source.light))

    def _groups(self, at: _Receivers, total: DirectLight) -> Iterator[Sharing]:
        """Lamps that share shadow rays, and media that glow, the points of which do."""
        if self.marks:
            lit = total.lit_diffuse, total.lit_specular
            marks = self.marks
            if self.each_once and self.dealt:  # over blocks of more pixels
                marks = max(marks // BOUNCE_PARTS, 1)
            yield Sharing(lambda: self._lamps(at), marks, *lit)
        media = [(x, None) for x in self.sources if isinstance(x, MediumSource)]
        if media:
            lit = total.lit_diffuse, total.lit_specular
            yield Sharing(lambda: media, self.medium_marks, *lit)

    def _share(
        self,
        group: Sharing,
        at: _Receivers,
        on_reach: Callable[[Source, Array, bool], None],
        total: DirectLight,
    ) -> None:
        """Adds lights that share shadow rays."""
        current: list[Source] = []

        def samples() -> Iterator[Given]:
            for source, far in group.sources():
                current[:] = [source]
                lit = at.given & self.lights(source, at.surface)
                for each, light_sample, is_drawn in self._samples_given(at, source, lit):
                    if far is not None:
                        white = dot(at.surface.n, light_sample.direction) * light_sample.intensity
                        each = self._from_afar(each, source, far, white, is_drawn)
                    yield each

        diffuse, specular, passed, groups = share_shadows(
            samples,
            at.weight,
            group.marks,
            at.sample,
            lambda points: on_reach(current[0], points, True),
            self.light_groups,
        )
        for sums, light in (
            (total.diffuse, diffuse),
            (total.specular, specular),
            (total.shadow, (passed - 1) * (diffuse + specular)),
            (group.matt, passed * diffuse),
            (group.glossy, passed * specular),
            (total.groups, groups),
        ):
            sums += light

    def _lamps(self, at: _Receivers) -> Iterator[tuple[Source, FarLight | None]]:
        """The lamps that share shadow rays, and what points get of those that they see in
        clusters.
        """
        surface, coefficients = at.surface, at.coefficients
        for number, source in enumerate(self.sources):
            if may_share(source.light) and number not in self._clusters.holds:
                yield source, None

        def lobes(seen: Array, direction: Array) -> tuple[Array, Array]:
            return (
                matt_lobes(surface, coefficients, seen, direction),
                highlights(surface, coefficients.highlights, seen, direction),
            )

        apart = surface.lowering > 1
        turned = [
            term
            for term in coefficients.highlights
            if term.normal is not None or term.stretch is not None or is_toon(term)
        ]
        turned += [term for term in coefficients.sheens if is_toon(term)]
        for term in (*coefficients.fibres, *turned):
            has = np.broadcast_to(term.k, (3, len(term.index))).any(0)
            apart[term.index] |= has & is_apart(term, surface)
        yield from self._clusters.lights(
            surface, coefficients.highlights, coefficients.diffuse, at.given, apart, lobes
        )

    def _from_afar(
        self, given: Given, source: Source, far: FarLight, white: Array, is_drawn: bool
    ) -> Given:
        """With what points get that see the lamp in a cluster, which draw no directions. white:
        (n,) what the sample gives to white points for a colour of 1.
        """
        n = source.sample_count(self.light_samples)
        color = (0.0 if is_drawn else 1 / n) * source.color[:, None]
        below = far.seen.copy()  # lamps that are, of clusters that are not
        below[given.seen] = False
        seen = np.concatenate([given.seen, np.flatnonzero(below)])
        afar, reached = far.seen[seen], np.arange(len(seen)) < len(given.seen)
        middle = np.where(afar & reached, far.middle[seen], 1.0)

        def light(of_cluster: Array, own: Array) -> Array:
            own = np.pad(own, ((0, 0), (0, len(seen) - len(given.seen))))
            return np.where(afar, color * pick(of_cluster, seen), own)

        return replace(
            given,
            seen=seen,
            diffuse=light(far.diffuse, given.diffuse),
            specular=light(far.specular, given.specular),
            asked=np.where(reached, np.where(afar, n * white[seen] / middle, 1.0), 0.0),
        )

    def samples(
        self,
        surface: Surface,
        coefficients: Coefficients,
        weight: Array,
        source: Source,
        sample: int,
    ) -> Iterator[tuple[Narrow | None, LightSample, Coefficients]]:
        """The samples of a light: highlights narrower than it, if there are any, the sample, and
        the lobes that it lights, not all where these draw it.
        """
        n = source.sample_count(self.light_samples)
        points = self.points if source.points is None else source.points
        if n == 1 and source.points is None:
            yield None, source.sample(surface.x, CENTER, n), coefficients
            return
        glossy = source.has_highlights and source.light.lights_gloss
        terms = coefficients.highlights if glossy else []
        once = self.each_once and not self._shares(source)  # where all lobes are wide
        mirrors_differ = self.shadows.mirrors_differ(source)
        narrow = None if once else Narrow(surface, terms, weight, source, mirrors_differ)
        numbers = source.surface_numbers(sample, n)
        seen: Callable[[Any], LightSample] = source.seen_from(surface.x, surface.n, numbers, n)
        numbers = numbers[sample % n :: n] if once else numbers
        glows = None
        if self.draws_matt and isinstance(source, MeshSource) and source.light.kind == "MESH":
            glows = source if source.light.lights_matt else None
        count = 1 if once else n
        of_matt = replace(coefficients, highlights=[])
        of_gloss = replace(
            coefficients, diffuse=np.zeros_like(coefficients.diffuse), sheens=[], fibres=[]
        )
        for number in numbers:
            point = points[number]
            given = seen(point)
            given = replace(given, intensity=n * given.intensity) if once else given
            if glows:
                to_matt = glows.to_matt(given, surface.n, surface.g, count)
                given = replace(given, to_matt=to_matt)
            yield narrow, given, coefficients
            place = source.drawn_at(number, point)
            if self.dealt and place and isinstance(source, Dome) and number == numbers[0]:
                at = self.lobe_points[sample % len(self.lobe_points)]
                place = LightPoint(CENTER.square, at)
            if glows and (once or place is not None):
                direction = around(surface.n, point.disc)
                met = replace(glows.sample_at(surface.x, direction, n), met_by="diffuse")
                to_matt = glows.to_matt(met, surface.n, surface.g, count)
                yield None, replace(met, intensity=to_matt), of_matt
            if narrow and place is not None:
                direction, drawn, _ = narrow.draw(place)
                chosen = source.sample_at(surface.x, direction, n)
                yield (
                    narrow,
                    replace(
                        chosen,
                        intensity=np.where(drawn, chosen.intensity, 0.0),
                        met_by="mirror",
                    ),
                    of_gloss,
                )

    def _add(self, source: Source, given: Given, total: DirectLight) -> tuple[Array, Array]:
        """Takes in what one sample of a light gives; the points that it reaches, whatever stands
        between, and (m,) bool which of them something hides it from or dims it for.
        """
        seen = given.seen
        if not len(seen):
            return seen, np.zeros(0, bool)
        add_at(total.diffuse, seen, given.diffuse)
        add_at(total.specular, seen, given.specular)
        dimmed, passed = np.zeros(len(seen), bool), np.ones((3, len(seen)))
        if source.light.cast_shadow and self.hides:
            self.cancellation.check()
            passed = given.open(np.arange(len(seen)))
            lost = (passed - 1.0) * (given.diffuse + given.specular)
            add_at(total.shadow, seen, lost)
            dimmed = lost.any(0)
        add_at(total.lit_diffuse, seen, passed * given.diffuse)
        add_at(total.lit_specular, seen, passed * given.specular)
        add_to_groups(total.groups, given.group, seen, passed * (given.diffuse + given.specular))
        return seen, dimmed

    def even_gloss(self, source: Source, surface: Surface, coefficients: Coefficients) -> Array:
        """(3, n) what gloss gives back of a light as if it were matt."""
        if not isinstance(source, MediumSource):
            return np.zeros((3, len(surface)))
        shown = "NONE" if self.each_once else self.reflecting
        return even_gloss(dot(surface.n, surface.v), coefficients.highlights, shown)

    def _given(
        self,
        surface: Surface,
        coefficients: Coefficients,
        is_drawn: bool,
        lit: Array,
        source: Source,
        narrow: Narrow | None,
        sample: LightSample,
    ) -> Given:
        """What one sample of one light gives to the points that it reaches, whatever stands
        between.
        """
        self.cancellation.check()
        cosine = sample.cosine(surface.n)
        glossy = source.has_highlights
        passing = (glossy or bool(coefficients.fibres)) and not is_drawn
        through = coefficients.lets_through() if passing else False
        leaves = through is not False
        if glossy:
            through = through | coefficients.turned_to(sample.direction)
        hidden, matt = bump_shadow(surface.n, surface.unbent, surface.bump, sample.direction)
        low = lowered(surface.lowering, dot(surface.n, sample.direction))
        seen = np.flatnonzero(lit & sample.reaches(surface.g, surface.n, through) & ~hidden)
        if not source.color.any():
            seen = seen[:0]
        chosen = replace(sample.taken(seen), inner=None, leaves=leaves)
        light, to_matt = chosen.light_of(source), chosen.matt_light_of(source)
        terms = coefficients.highlights if glossy else []
        front = cosine[seen] > 0
        diffuse = pick(coefficients.diffuse, seen) * np.where(front, cosine[seen], 0.0)
        diffuse = diffuse + matt_lobes(surface, coefficients, seen, chosen.direction)
        diffuse = low[seen] * matt[seen] * diffuse * to_matt
        specular = (
            highlights(surface, terms, seen, chosen.direction)
            * light
            * (narrow.balance(seen, chosen) if narrow else 1.0)
        )
        gloss = pick(self.even_gloss(source, surface, coefficients), seen)
        gloss = low[seen] * gloss
        specular = specular + gloss * light * np.where(front, cosine[seen], 0.0)
        if not is_drawn and coefficients.fibres:
            shine = fibres(surface, coefficients.fibres, seen, chosen.direction, matt=False)
            specular = specular + shine * light
        diffuse, specular = source.on_lobes(diffuse, specular)
        all_lobes = source.light.lights_matt and source.light.lights_gloss
        if not all_lobes or (surface.lowering > 1).any():
            some = np.flatnonzero((diffuse != 0).any(0) | (specular != 0).any(0))
            seen, chosen = seen[some], chosen.taken(some)
            diffuse, specular = pick(diffuse, some), pick(specular, some)

        def open_(places: Array) -> Array:
            shadows = self.shadows_of(source)
            some, at = seen[places], chosen.taken(places)
            through = ways_through(surface, coefficients.fibres, some, at)
            return shadows.towards(surface, some, at, through).T

        return Given(seen, diffuse, specular, open_, np.ones(len(seen)), chosen.group_of(source))
