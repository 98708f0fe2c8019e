"""One sample of a tile of pixels, generation by generation: camera rays, what passes straight
through, then bounce after bounce.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from ..evaluation.march import Spans
from ..evaluation.surface import Surface
from ..film import CATCHER, VOLUME
from ..linear.columns import pick
from . import catchers
from .gathering import bouncing, seen_lobes
from .lighting import DirectLight
from .lights import Source
from .paths import (
    Interaction,
    Paths,
    bounced,
    camera_paths,
    gives,
    held_share,
    joined,
    met,
    straight_on,
)
from .picture import Tile
from .raster import Strips
from .rays import Rays
from .reflections import reflected, shown
from .resolve import ALONE, CAUGHT, OTHERS, PHOTON_LIGHT, SHARP, UNSHADED, UNSHADOWED
from .scattering import scattered, scattered_on
from .scene_queries import SceneQueries
from .seen_lights import distance_seen, has_shape, seen_radiance
from .seen_passes import SeenPasses
from .stage import Stage
from .subsurface import coming_out, entering
from .surface import surface_at
from .translucent import other_side
from .visibility import NOTHING, Hits

Array = np.ndarray

AT_ONCE = 1 << 13
"""Rays whose scattered light is worked out together."""


def _alike(paths: list[Paths]) -> Iterator[Paths]:
    """Those with the same past as one."""
    names = ["reflections", "transmitted", "gathers", "bounced", "through_glass", "in_medium"]
    names += ["caught"]
    pasts = [tuple(getattr(p, name) for name in names) for p in paths]
    for past in dict.fromkeys(pasts):
        yield joined([p for p, own in zip(paths, pasts, strict=True) if own == past])


def _each_pixel_once(paths: Paths) -> Iterator[Paths]:
    """In parts in which no pixel comes again."""
    order = np.argsort(paths.pixel, kind="stable")
    _, first, count = np.unique(paths.pixel[order], return_index=True, return_counts=True)
    again = np.empty(len(paths), np.intp)
    again[order] = np.arange(len(paths)) - np.repeat(first, count)
    for number in range(count.max(initial=0)):
        yield paths.take(np.flatnonzero(again == number))


class Caught:
    """What shadow catchers show to n pixels, (3, n) each: how much of the rays ends there, what is
    behind, and the catchers' light with all things there and as if they were alone.
    """

    def __init__(self, count: int) -> None:
        self.seen, self.behind, self.with_all, self.alone = np.zeros((4, 3, count))

    def meet(self, pixel: Array, seen: Array, behind: Array, with_all: Array, alone: Array) -> None:
        """Rays of pixels (m,) meet catchers."""
        self.behind[:, pixel] = behind
        for total, values in ((self.seen, seen), (self.with_all, with_all), (self.alone, alone)):
            total[:, pixel] += values

    def bring(self, caught: str, pixel: Array, light: Array) -> None:
        """Light (3, m) that bounced there; caught: of the paths."""
        total = self.alone if caught == "alone" else self.with_all
        for sums, values in zip(total, light, strict=True):
            sums += np.bincount(pixel, values, len(sums))


class Generations:
    """Follows the rays of one sample of a tile and adds what they bring to it."""

    def __init__(
        self,
        stage: Stage,
        tile: Tile,
        sample: int,
        dealt: int,
        places: Array,
    ) -> None:
        """sample: of the pixels, which is `dealt` in the tables.  places: (pixels,) as
        `Stage.places`.
        """
        self._stage, self._tile, self._sample, self._places = stage, tile, dealt, places
        self._number = sample
        self._gloss = Tile(len(places), frozenset(), 0, len(stage.scene.light_groups))
        self._caught = Caught(len(places)) if stage.catches else None
        self._thrown = np.zeros(len(places))
        self._exits: list[Interaction] = []
        self._seen = SeenPasses(stage, tile, dealt, self._queries)
        stage.media.moment.sample = dealt

    def run(self, rays: Rays, strips: Strips | None) -> None:
        """Follows the camera rays, one for each pixel of the tile, to their ends."""
        seen = self._stage.camera.weights(rays)
        generation = [camera_paths(rays, seen)]
        while generation:
            deeper: list[Paths] = []
            for paths in generation:
                here: Paths | None = paths
                while here is not None:
                    self._stage.cancellation.check()
                    here = self._follow(here, strips, deeper)
                    strips = None
            generation = list(_alike(deeper))
            if self._stage.settings.clamp_indirect:
                generation = [one for paths in generation for one in _each_pixel_once(paths)]
        self._show_caught()
        part = shown(self._tile, self._gloss, self._thrown, self._number)
        self._tile.take(self._gloss, part)

    def see(self, rays: Rays) -> None:
        """What the camera rays show, one for each pixel of the tile, but for light."""
        paths: Paths | None = camera_paths(rays, self._stage.camera.weights(rays))
        while paths is not None:
            paths = self._see(paths)

    def _see(self, paths: Paths) -> Paths | None:
        """The same of their next hits; those that go straight on are returned."""
        stage = self._stage
        met = self._meet(paths, None, None)
        if met is None:
            return None
        at, hits, passed = met
        self._seen.guide(at)
        self._tile.lose(at.pixel, at.weight * at.coefficients.holdout)
        self._seen.note_asked(at)
        self._add_caustics(at)
        at, _ = entering(stage, at)
        self._glow(at)
        sides = [at]
        if at.coefficients.translucent.any():
            sides.append(other_side(stage, at, hits.depth[at.hit]))
        for side in sides:
            self._note_colors(side)
            self._note_unshadowed(side, stage.unshadowed(side, self._sample))
        return passed

    def _follow(self, paths: Paths, strips: Strips | None, deeper: list[Paths]) -> Paths | None:
        """A step of the paths; what rough surfaces reflect is kept apart."""
        if not paths.is_gloss:
            return self._step(paths, strips, deeper)
        tile, self._tile = self._tile, self._gloss
        passed = self._step(paths, strips, deeper)
        self._tile = tile
        return passed

    def _step(self, paths: Paths, strips: Strips | None, deeper: list[Paths]) -> Paths | None:
        """Traces the paths to their hits; bounces go to `deeper`, rays that go straight on are
        returned. What they bring is held to the most that is wanted.
        """
        clamps = self._stage.settings.clamp_indirect and paths.depth
        before = self._tile.light() if clamps else {}
        passed = self._trace(paths, strips, deeper)
        if clamps:
            self._tile.hold(before, partial(held_share, self._stage.settings, paths))
        while self._exits:
            deeper += self._light(self._exits.pop())
        return passed

    def _trace(self, paths: Paths, strips: Strips | None, deeper: list[Paths]) -> Paths | None:
        """The same, whatever they bring."""
        stage = self._stage
        met = self._meet(paths, strips, deeper)
        if met is None:
            return None
        at, hits, passed = met
        if not paths.depth:
            at = self._cut_holdouts(at)
            self._seen.guide(at)
            if stage.sees:
                self._seen.see(at)
            if stage.scene.aovs:
                self._seen.give_aovs(at)
            at = self._catch(at, deeper)
            self._tile.lose(at.pixel, at.weight * at.coefficients.holdout)
            self._seen.add_openness(at)
        elif stage.resolves and not paths.reflections:
            self._seen.guide_image(at)
        at = seen_lobes(stage, at)
        at, below = entering(stage, at)
        deeper += self._light(at)
        self._add_caustics(at)
        if below is not None and (out := self._coming_out(below)) is not None:
            self._exits.append(out)
        if at.coefficients.translucent.any():
            deeper += self._light(other_side(stage, at, hits.depth[at.hit]))
        if paths.depth < stage.settings.max_bounces and not paths.gathers:
            deeper += self._bounce(at)
        return passed

    def _meet(
        self, paths: Paths, strips: Strips | None, deeper: list[Paths] | None
    ) -> tuple[Interaction, Hits, Paths | None] | None:
        """The surfaces that the paths meet, with all hits, and those that go straight on from
        there, if any; None where nothing is met. What is seen before them, and in their place, is
        added. deeper: as `_dim`.
        """
        stage = self._stage
        stage.rays["gather" if paths.gathers else paths.kind] += len(paths)
        self._tile.charge(paths.pixel)
        hits = stage.closest(paths, strips)
        if stage.media:
            paths = self._dim(paths, hits.depth, deeper)
        else:
            self._see_lights(paths, hits.depth)
        self._miss(paths, np.flatnonzero(hits.primitive == NOTHING))
        hit = np.flatnonzero(hits.primitive != NOTHING)
        if not len(hit):
            return None
        at, depth = self._interaction(paths, hit, hits)
        return at, hits, straight_on(at, depth, self._seen.wants_data(at))

    def _interaction(self, paths: Paths, hit: Array, hits: Hits) -> tuple[Interaction, Array]:
        """Where the rays `hit` meet surfaces, and how far along them; data passes have what they
        meet first.
        """
        stage, depth = self._stage, hits.depth[hit]
        stage.cancellation.check()
        surface = surface_at(
            stage.geometry,
            stage.attributes,
            paths.rays,
            hit,
            hits.primitive[hit],
            depth,
            stage.cancellation,
        )
        again = stage.queries(self._sample)
        surface = stage.shader.bent(met(paths, hit, surface), paths.kind, again)
        queries = self._queries(paths.pixel[hit], surface)
        coefficients = stage.shader.coefficients(surface, paths.kind, queries)
        stage.cancellation.check()
        at = Interaction(paths, hit, surface, coefficients)
        if not paths.depth:
            self._seen.record(at, depth)
            self._seen.find_gaps(at, depth)
        return at, depth

    def _bounce(self, at: Interaction) -> list[Paths]:
        """Rays of mirrors, glass and rough surfaces."""
        stage = self._stage
        deeper = bounced(stage, at, self._sample)
        self._note_rough_glass(at)
        reflections = reflected(stage, at, self._sample)
        for some in reflections:
            np.maximum.at(self._thrown, some.pixel, np.abs(some.weight).max(0))
            self._tile.soft_light[some.pixel] = True
        return deeper + reflections

    def _coming_out(self, below: Interaction) -> Interaction | None:
        """Where light comes out again that went below the surface at these points."""
        stage, pixel = self._stage, below.pixel
        self._tile.soft_light[pixel] = True

        def on_rays(index: Array) -> None:
            stage.rays["probe"] += len(index)
            self._tile.charge(pixel[index])

        row = stage.subsurface_row(self._sample)
        return coming_out(stage, below, stage.probes(self._sample, on_rays), row)

    def _queries(self, pixel: Array, surface: Surface) -> SceneQueries | None:
        """How programs ask for rays at a surface's points, of these pixels."""
        if not self._stage.asks_rays:
            return None

        def on_rays(index: Array) -> None:
            here = pixel[index]
            self._stage.rays["shadow"] += len(here)
            self._tile.charge(here)
            self._tile.soft_light[here] = True

        return self._stage.queries(self._sample, on_rays)

    def _catch(self, at: Interaction, deeper: list[Paths]) -> Interaction:
        """Keeps the light of shadow catchers, and the rays to `deeper` by which more of it bounces
        to them; what is left are the other surfaces.
        """
        stage, paths, hit, surface = self._stage, at.paths, at.hit, at.surface
        if self._caught is None:
            return at
        is_caught = stage.per_object("catcher", surface.row)
        here = np.flatnonzero(is_caught)
        if not len(here):
            return at
        some, weight = surface.take(here), pick(at.weight, here)
        given = stage.shader.coefficients(some, paths.kind, stage.queries(self._sample))
        on_reach, on_cut = self._listeners(at.pixel[here])
        lights = catchers.lights(stage, some, given, weight, self._sample, on_reach, on_cut)
        behind = np.zeros((3, len(here)))
        if CATCHER not in stage.settings.passes and not stage.scene.world.transparent:
            behind = behind + stage.background_of(paths, hit[here])
        seen = weight * catchers.opacity(given)
        self._caught.meet(at.pixel[here], seen, behind, *lights)
        for caught in ("with all", "alone"):
            mine = Interaction(replace(paths, caught=caught), hit[here], some, given)
            deeper += bouncing(stage, mine, self._sample, self._places)
        return self._of(at, np.flatnonzero(~is_caught))

    def _show_caught(self) -> None:
        """The surroundings behind catchers, and over them their shadows; or nothing, where the
        pass has these.
        """
        stage, caught = self._stage, self._caught
        if caught is None:
            return
        pixel = np.flatnonzero(caught.seen.any(0))
        seen, left = caught.seen[:, pixel], catchers.ratio(caught.with_all, caught.alone)[:, pixel]
        unshaded = seen
        if CATCHER in stage.settings.passes:
            self._tile.lose(pixel, seen)
        else:
            left = catchers.light_left(left)[None]
            if stage.scene.world.transparent:
                self._tile.lose(pixel, left * seen)
            else:
                unshaded = seen * caught.behind[:, pixel]
                self._tile.add("Environment", pixel, left * unshaded)
                group = stage.scene.world.light_group
                self._tile.add_to_groups(group, pixel, left * unshaded)
        self._tile.add(CATCHER, pixel, left * unshaded - unshaded)
        self._tile.add(UNSHADED, pixel, unshaded)
        self._tile.add(CAUGHT, pixel, caught.with_all[:, pixel])
        self._tile.add(ALONE, pixel, caught.alone[:, pixel])

    def _note_rough_glass(self, at: Interaction) -> None:
        """More samples may see something else through it."""
        for term in at.coefficients.refractions:
            if term.lobe.is_rough_glass:
                self._tile.cut[at.pixel[term.index]] = True

    def _dim(self, paths: Paths, depth: Array, deeper: list[Paths] | None) -> Paths:
        """The paths with what media let through of them, once lights before these are seen; rays
        that bring bounced light to media go to `deeper`. None: nothing lights media.
        """
        media = self._stage.media
        spans = media.spans(paths.rays, paths.visibility, depth)
        self._see_lights(paths, depth, spans)
        if media.emits and not paths.gathers:
            glow = media.pieces(spans, paths.rays.near, depth).glow()
            self._add(paths, "Emission", paths.pixel, paths.weight * glow)
            for group in range(len(self._stage.scene.light_groups)):
                part = media.of_group(group).pieces(spans, paths.rays.near, depth).glow()
                self._tile.add_to_groups(group, paths.pixel, paths.weight * part)
        if deeper is not None and not paths.caught:
            self._scatter(paths, spans, depth, deeper)
        passed = media.passed(spans, paths.rays.near, depth)
        return replace(paths, weight=paths.weight * passed)

    def _scatter(self, paths: Paths, spans: Spans, depth: Array, deeper: list[Paths]) -> None:
        """What media along the rays scatter of the lights, and of what bounced."""
        stage, tile = self._stage, self._tile
        scattering = stage.media.scattering_rays(spans, paths.rays.near, depth)
        tile.soft_light[paths.pixel[scattering]] = tile.cut[paths.pixel[scattering]] = True
        for first in range(0, len(scattering), AT_ONCE):
            some = scattering[first : first + AT_ONCE]
            rays, weight, pixel = paths.rays.take(some), pick(paths.weight, some), paths.pixel[some]
            part = spans.take(some), depth[some], self._sample, paths.gathers
            for found in scattered(stage, rays, *part):
                here, light = pixel[found.ray], pick(weight, found.ray) * found.light
                self._add(paths, "Diffuse", here, light)
                if found.source.light.cast_shadow:
                    tile.charge(here)
                    dark = light * (found.shadow.T - 1.0)
                    self._add(paths, "Shadow", here, dark)
                    light = light + dark
                tile.add_to_groups(found.group, here, light)
                if stage.splits and paths.depth == 0:
                    tile.add(VOLUME[0], here, light)
        gone = scattered_on(stage, paths, spans, depth, self._sample, self._places[paths.pixel])
        if gone is not None:
            deeper.append(gone)

    def _see_lights(self, paths: Paths, depth: Array, spans: Spans | None = None) -> None:
        """spans: of the media between, or None."""
        if paths.reflections:
            return
        flag = "visible_" + paths.visibility
        sources = [s for s in self._stage.sources if getattr(s.light, flag) and has_shape(s)]
        if sources:
            o, d = paths.rays.lines(np.arange(len(paths)))
            for source in sources:
                near = paths.rays.near
                seen = seen_radiance(source, o, d, near, depth, paths.kind)
                if spans is not None:
                    seen = seen * self._stage.media.passed(spans, near, distance_seen(source, o, d))
                group = source.light.light_group
                self._add(paths, "Emission", paths.pixel, paths.weight * seen, group)

    def _miss(self, paths: Paths, missed: Array) -> None:
        missed = missed[~paths.skyless[missed]]
        weight, pixel = pick(paths.weight, missed), paths.pixel[missed]
        if paths.depth == 0 and self._stage.scene.world.transparent:
            self._tile.lose(pixel, weight)
            return
        background = self._stage.background_of(paths, missed)
        if background.any():
            group = self._stage.scene.world.light_group
            self._add(paths, "Environment", pixel, weight * background, group)

    def _cut_holdouts(self, at: Interaction) -> Interaction:
        """The surfaces that are no holdouts; those that are leave a hole of what ends there."""
        holdout = self._stage.per_object("holdout", at.surface.row).astype(bool)
        if not holdout.any():
            return at
        held = at.weight * catchers.opacity(at.coefficients)
        self._tile.lose(at.pixel[holdout], held[:, holdout])
        if self._stage.scene.aovs:
            ends = holdout & (at.coefficients.transparent.mean(0) < 0.5)
            self._tile.wants_aovs[at.pixel[ends]] = False
        return self._of(at, np.flatnonzero(~holdout))

    def _of(self, at: Interaction, places: Array) -> Interaction:
        """Some of the surfaces."""
        surface, queries = at.surface.take(places), self._stage.queries(self._sample)
        coefficients = self._stage.shader.coefficients(surface, at.paths.kind, queries)
        return Interaction(at.paths, at.hit[places], surface, coefficients)

    def _light(self, at: Interaction) -> list[Paths]:
        """Adds the light there; the rays along which more of it bounces to there."""
        if at.paths.caught:
            self._light_caught(at)
        else:
            self._shade(at)
        found = bouncing(self._stage, at, self._sample, self._places)
        for paths in found:
            self._tile.soft_light[paths.pixel] = True
        return found

    def _add_caustics(self, at: Interaction) -> None:
        """Adds the light of lamps that mirrors and glass throw there, of the picture's photons."""
        stage, paths, surface = self._stage, at.paths, at.surface
        if stage.photon_map is None or paths.caught or not stage.gathers(paths):
            return
        lobes = at.coefficients
        for side, given in ((surface.g, lobes.diffuse), (-surface.g, lobes.translucent)):
            given = at.weight * given
            here = np.flatnonzero(given.any(0))
            pixel, given = at.pixel[here], pick(given, here)
            for group, light in stage.photon_map.find(pick(surface.x, here), pick(side, here)):
                self._add(paths, "Diffuse", pixel, given * light, group)
                if stage.splits and paths.depth == 0:
                    self._tile.add(PHOTON_LIGHT, pixel, given * light)

    def _light_caught(self, at: Interaction) -> None:
        """The same to the light of catchers."""
        assert self._caught is not None
        light = self._stage.lighting_of(at.paths).direct(
            at.surface, at.coefficients, at.weight, self._sample, *self._listeners(at.pixel)
        )
        found = at.weight * (light.diffuse + light.specular + light.shadow)
        self._caught.bring(at.paths.caught, at.pixel, found)

    def _shade(self, at: Interaction) -> None:
        """L = k_a I_a + Σ (k_d I max(0, n·l) + k_s I max(0, n·h)^p) S + k_e (section 4.15), each
        part by itself.
        """
        paths, surface, coefficients = at.paths, at.surface, at.coefficients
        stage, weight, pixel = self._stage, at.weight, at.pixel

        def add(part: str, values: Array, group: Array | int = -1) -> None:
            if values.any():
                self._add(paths, part, pixel, weight * values, group)

        world = stage.scene.world.light_group
        add("Ambient", self._stage.even_light(surface, coefficients), world)
        if not (paths.reflections and self._stage.is_lit_by_meshes):
            self._glow(at)
        on_reach, on_cut = self._listeners(pixel)
        light = self._stage.lighting_of(paths).direct(
            surface, coefficients, weight, self._sample, on_reach, on_cut
        )
        add("Diffuse", light.diffuse)
        add("Specular", light.specular)
        add("Shadow", light.shadow)
        for number in range(len(stage.scene.light_groups)):
            given = weight * light.groups[3 * number : 3 * number + 3]
            self._tile.add_to_groups(number, pixel, given)
        if stage.splits and paths.depth == 0:
            self._split(at, light)

    def _glow(self, at: Interaction) -> None:
        """What surfaces give of themselves."""
        given, group = (
            at.coefficients.emission,
            self._stage.per_object("light_group", at.surface.row),
        )
        if given.any():
            self._add(at.paths, "Emission", at.pixel, at.weight * given, group)

    def _add(
        self, paths: Paths, part: str, pixel: Array, values: Array, group: Array | int = -1
    ) -> None:
        """Adds (3, m) to a part of the picture, to its light group and, where it came by way of
        mirrors or glass, to what these bring.
        """
        self._tile.add(paths.part(part), pixel, values)
        self._tile.add_to_groups(group, pixel, values)
        if self._stage.splits and paths.depth > 0:
            if paths.gathers and paths.depth == paths.bounced:
                self._tile.add(VOLUME[1] if paths.in_medium else "Diffuse Indirect", pixel, values)
                return
            is_made = part in ("Emission", "Environment")
            surface = "Transmission" if paths.transmitted else "Glossy"
            if is_made and (paths.depth == 1 or not paths.reflections):
                name = f"{surface} {'Direct' if paths.depth == 1 else 'Indirect'}"
                self._tile.add(self._other(name), pixel, values)
                return
            images = paths.image(self._tile.is_rough_glass[pixel])
            for name in np.unique(images) if self._stage.resolves else [""]:
                here = (images == name) if self._stage.resolves else slice(None)
                self._tile.add(name or f"{surface} Indirect", pixel[here], values[:, here])

    def _split(self, at: Interaction, light: DirectLight) -> None:
        """The light that camera rays meet, by the kind of lobe that gives it back."""
        ambient, matt = self._stage.even_light(at.surface, at.coefficients), "Diffuse Direct"
        self._tile.add(self._other(matt), at.pixel, at.weight * ambient)
        lit = self._other(matt) if at.paths.comes_out else matt
        self._tile.add(lit, at.pixel, at.weight * light.lit_diffuse)
        self._tile.add("Glossy Direct", at.pixel, at.weight * light.lit_specular)
        if not at.paths.comes_out:
            self._note_unshadowed(at, light)
        self._note_colors(at)

    def _other(self, name: str) -> str:
        """Where what is in a pass but not of lights there goes."""
        return OTHERS.get(name, name) if self._stage.resolves else name

    def _note_unshadowed(self, at: Interaction, light: DirectLight) -> None:
        """What lights would give to the surfaces that camera rays meet if nothing hid them."""
        for name, given in (("Diffuse Direct", light.diffuse), ("Glossy Direct", light.specular)):
            self._tile.add(UNSHADOWED[name], at.pixel, at.weight * given)

    def _note_colors(self, at: Interaction) -> None:
        """What of light the surfaces give back that camera rays meet."""
        coefficients, weight = at.coefficients, at.weight
        mirrored, refracted, clear = gives(at.surface, coefficients)
        below = -coefficients.diffuse if at.paths.comes_out else coefficients.below
        found = {
            "Diffuse Color": coefficients.matt()
            + coefficients.round_fibres()
            + (0.0 if below is None else below),
            "Glossy Color": coefficients.glossy() + mirrored,
            "Transmission Color": refracted,
            SHARP["Glossy Color"]: mirrored,
            SHARP["Transmission Color"]: clear,
        }
        for name, values in found.items():
            self._tile.add(name, at.pixel, weight * values)
        self._tile.is_rough_glass[at.pixel] |= (refracted != clear).any(0)

    def _listeners(
        self, pixel: Array
    ) -> tuple[Callable[[Source, Array, bool], None], Callable[[Array], None]]:
        """What the lighting of points of these pixels is to tell which light reaches them, and
        whose horizon cuts one.
        """

        def on_reach(source: Source, seen: Array, is_soft: bool) -> None:
            if source.light.cast_shadow:
                self._tile.charge(pixel[seen])
            if is_soft:
                self._tile.soft_light[pixel[seen]] = True

        def on_cut(seen: Array) -> None:
            self._tile.cut[pixel[seen]] = True

        return on_reach, on_cut
