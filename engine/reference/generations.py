"""One sample of a tile of pixels, generation by generation: camera rays, what passes straight
through, then bounce after bounce.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ..film import CATCHER, OCCLUSION, VOLUME
from . import catchers
from .gathering import Shares, gathering, seen_lobes
from .gloss import reflecting
from .lighting import DirectLight
from .lights import Source
from .materials import Coefficients
from .media import Spans
from .motion_vectors import motion_vectors
from .occlusion import openness
from .paths import (
    Paths,
    beyond,
    bounced,
    camera_paths,
    gives,
    joined,
    met,
    reflected_by_lobes,
    straight_on,
)
from .picture import Tile
from .raster import Strips
from .rays import Rays
from .scattering import scattered
from .scene_queries import SceneQueries
from .seen_lights import distance_seen, has_shape, seen_radiance
from .stage import Stage
from .surface import Surface, surface_at
from .translucent import other_side
from .vectors import dot, length, pick
from .visibility import NOTHING

Array = np.ndarray

NEAR_SHARE = 0.5
"""Of 1 - d² / R², from where gather rays bring light: pixels wait for more light samples."""
AT_ONCE = 1 << 13
"""Rays whose scattered light is worked out together."""


def reflected(
    stage: Stage,
    paths: Paths,
    hit: Array,
    surface: Surface,
    coefficients: Coefficients,
    sample: int,
) -> list[Paths]:
    """What leaves rough surfaces towards others."""
    settings = stage.settings
    terms = reflecting(coefficients.highlights, settings.reflecting)
    if not terms:
        return []
    point = stage.lobe_point(sample, paths.reflections)
    found = reflected_by_lobes(paths, hit, surface, terms, point, settings.cutoff)
    return [] if found is None else [found]


def _alike(paths: list[Paths]) -> Iterator[Paths]:
    """Those with the same past as one."""
    pasts = [(p.reflections, p.glossy, p.transmitted, p.gathers, p.shared) for p in paths]
    for past in dict.fromkeys(pasts):
        yield joined([p for p, own in zip(paths, pasts, strict=True) if own == past])


class Generations:
    """Follows the rays of one sample of a tile and adds what they bring to it."""

    def __init__(
        self, stage: Stage, tile: Tile, sample: int, places: Array, blocks: Array | None = None
    ):
        """places: (pixels,) of each in its block of `gather_points`.  blocks: (pixels,) which
        blocks these are, where their pixels share what gather rays find.
        """
        self._stage, self._tile, self._sample, self._places = stage, tile, sample, places
        self._blocks = blocks
        self._shares: Shares | None = None
        stage.media.moment.sample = sample

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
                    here = self._step(here, strips, deeper)
                    strips = None
            generation = list(_alike(deeper))

    def _step(self, paths: Paths, strips: Strips | None, deeper: list[Paths]) -> Paths | None:
        """Traces the paths to their hits; bounces go to `deeper`, rays that go straight on are
        returned.
        """
        stage, blocks = self._stage, self._blocks
        self._blocks = None  # only what camera rays meet first is shared
        stage.rays["gather" if paths.gathers else paths.kind] += len(paths)
        self._tile.charge(paths.pixel)
        hits = stage.visibility.closest(paths.rays, paths.kind, strips)
        if stage.media:
            paths = self._dim(paths, hits.depth)
        else:
            self._see_lights(paths, hits.depth)
        self._miss(paths, np.flatnonzero(hits.primitive == NOTHING))
        hit = np.flatnonzero(hits.primitive != NOTHING)
        if not len(hit):
            return None
        depth = hits.depth[hit]
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
        self._record(paths, hit, surface, depth, coefficients)
        if "Gap" in self._tile.data and paths.depth == 0 and not paths.straight.any():
            self._find_gaps(paths, hit, surface, depth)
        stage.cancellation.check()
        shown = self._cut_holdouts(paths, hit, surface)
        if len(shown) < len(hit):
            hit, depth, surface = hit[shown], depth[shown], surface.take(shown)
            coefficients = stage.shader.coefficients(surface, paths.kind, again)
        if paths.depth == 0 and stage.sees:
            self._see(paths, hit, surface, coefficients)
        if paths.depth == 0 and stage.scene.aovs:
            self._give_aovs(paths, hit, surface, coefficients.transparent)
        passed = straight_on(
            paths, hit, surface, depth, coefficients.transparent, self._wants_data(paths, hit)
        )
        hit, surface, coefficients = self._catch(paths, hit, surface, coefficients)
        self._add_openness(paths, hit, surface, coefficients)
        coefficients = seen_lobes(stage, paths, hit, surface, coefficients)
        self._light(paths, hit, surface, coefficients)
        near, shares = gathering(
            stage, paths, hit, surface, coefficients, self._sample, self._places, blocks
        )
        self._shares = shares or self._shares
        deeper += near
        if coefficients.translucent.any():
            behind = other_side(stage, paths, hit, hits.depth[hit], surface, coefficients)
            self._light(paths, *behind)
            deeper += gathering(stage, paths, *behind, self._sample, self._places)[0]
        if paths.depth < stage.settings.max_bounces and not paths.gathers:
            point = stage.lobe_point(self._sample, paths.depth)
            deeper += bounced(
                paths, hit, surface, coefficients, stage.settings.cutoff, point, stage.splits
            )
            self._note_rough_glass(paths, hit, coefficients)
            reflections = reflected(stage, paths, hit, surface, coefficients, self._sample)
            for some in reflections:
                self._tile.soft_light[some.pixel] = True
            deeper += reflections
        return passed

    def _queries(self, pixel: Array, surface: Surface) -> SceneQueries | None:
        """How programs ask for rays at a surface's points, of these pixels; those of holdouts do
        not count.
        """
        if not self._stage.asks_rays:
            return None
        shown = ~self._stage.per_object("holdout", surface.row).astype(bool)

        def on_rays(index: Array) -> None:
            here = pixel[index[shown[index]]]
            self._stage.rays["shadow"] += len(here)
            self._tile.charge(here)
            self._tile.soft_light[here] = True

        return self._stage.queries(self._sample, on_rays)

    def _catch(
        self, paths: Paths, hit: Array, surface: Surface, coefficients: Coefficients
    ) -> tuple[Array, Surface, Coefficients]:
        """Adds what shadow catchers show; what is left are the other surfaces."""
        stage = self._stage
        if paths.depth > 0 or not stage.catches:
            return hit, surface, coefficients
        is_caught = stage.per_object("catcher", surface.row)
        here = np.flatnonzero(is_caught)
        if not len(here):
            return hit, surface, coefficients
        some, weight, pixel = surface.take(here), pick(paths.weight, hit[here]), paths.pixel[hit]
        queries = stage.queries(self._sample)
        given = stage.shader.coefficients(some, paths.kind, queries)
        on_reach, on_cut = self._listeners(pixel[here])
        ratio = catchers.ratio(stage, some, given, weight, self._sample, on_reach, on_cut)
        self._show_caught(paths, hit[here], weight * catchers.opacity(given), ratio)
        rest = np.flatnonzero(~is_caught)
        surface = surface.take(rest)
        return hit[rest], surface, stage.shader.coefficients(surface, paths.kind, queries)

    def _add_openness(
        self, paths: Paths, hit: Array, surface: Surface, coefficients: Coefficients
    ) -> None:
        """What is open over points that camera rays meet, of what of the rays stays there, where
        the pass is asked for.
        """
        if paths.depth > 0 or OCCLUSION not in self._stage.settings.passes:
            return
        pixel = paths.pixel[hit]
        stays = pick(paths.weight, hit) * catchers.opacity(coefficients)
        found = openness(self._stage, surface, self._sample, lambda: self._tile.charge(pixel))
        self._tile.add_openness(pixel, stays * found)

    def _show_caught(self, paths: Paths, hit: Array, seen: Array, ratio: Array) -> None:
        """The surroundings behind catchers, and over them their shadows; or nothing, where the
        pass has these. seen: (3, m) what of the rays ends there.
        """
        stage, pixel = self._stage, paths.pixel[hit]
        if CATCHER in stage.settings.passes:
            self._tile.catch(pixel, seen * (1 - ratio))
            self._tile.lose(pixel, seen)
            return
        shown = catchers.light_left(ratio) * seen
        if stage.scene.world.transparent:
            self._tile.lose(pixel, shown)
            return
        _, along = paths.rays.lines(hit)
        behind = shown * stage.background_of(along, paths.kind)
        self._tile.add("Environment", pixel, behind)
        self._tile.add_to_groups(stage.scene.world.light_group, pixel, behind)

    def _note_rough_glass(self, paths: Paths, hit: Array, coefficients: Coefficients) -> None:
        """More samples may see something else through it."""
        for term in coefficients.refractions:
            if term.lobe.is_rough_glass:
                self._tile.cut[paths.pixel[hit[term.index]]] = True

    def _dim(self, paths: Paths, depth: Array) -> Paths:
        """The paths with what media let through of them, once lights before these are seen."""
        media = self._stage.media
        spans = media.spans(paths.rays, paths.kind, depth)
        self._see_lights(paths, depth, spans)
        if media.emits and not paths.gathers:
            glow = media.pieces(spans, paths.rays.near, depth).glow()
            self._add(paths, "Emission", paths.pixel, paths.weight * glow)
            for group in range(len(self._stage.scene.light_groups)):
                part = media.of_group(group).pieces(spans, paths.rays.near, depth).glow()
                self._tile.add_to_groups(group, paths.pixel, paths.weight * part)
        if not paths.gathers:
            self._scatter(paths, spans, depth)
        passed = media.passed(spans, paths.rays.near, depth)
        return replace(paths, weight=paths.weight * passed)

    def _scatter(self, paths: Paths, spans: Spans, depth: Array) -> None:
        """What media along the rays scatter of the lights."""
        stage, tile = self._stage, self._tile
        scattering = stage.media.scattering_rays(spans, paths.rays.near, depth)
        tile.soft_light[paths.pixel[scattering]] = tile.cut[paths.pixel[scattering]] = True
        for first in range(0, len(scattering), AT_ONCE):
            some = scattering[first : first + AT_ONCE]
            rays, weight, pixel = paths.rays.take(some), pick(paths.weight, some), paths.pixel[some]
            for found in scattered(stage, rays, spans.take(some), depth[some], self._sample):
                here, light = pixel[found.ray], pick(weight, found.ray) * found.light
                self._add(paths, "Diffuse", here, light)
                if found.source.light.cast_shadow:
                    tile.charge(here)
                    dark = light * (found.shadow.T - 1.0)
                    self._add(paths, "Shadow", here, dark)
                    light = light + dark
                tile.add_to_groups(found.group, here, light)
                if stage.splits and paths.depth == 0:
                    is_bounced = found.source.light.kind == "BOUNCED"
                    tile.add(VOLUME[is_bounced], here, light)

    def _see_lights(self, paths: Paths, depth: Array, spans: Spans | None = None) -> None:
        """spans: of the media between, or None."""
        if paths.reflections:
            return
        flag = "visible_" + paths.kind
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
        if paths.glossy:
            return
        weight, pixel = pick(paths.weight, missed), paths.pixel[missed]
        if paths.depth == 0 and self._stage.scene.world.transparent:
            self._tile.lose(pixel, weight)
            return
        _, along = paths.rays.lines(missed)
        background = self._stage.background_of(along, paths.kind)
        if background.any():
            group = self._stage.scene.world.light_group
            self._add(paths, "Environment", pixel, weight * background, group)

    def _cut_holdouts(self, paths: Paths, hit: Array, surface: Surface) -> Array:
        """Places of the surfaces that are no holdouts; at those that are the rays end."""
        holdout = self._stage.per_object("holdout", surface.row)
        if paths.depth == 0:
            cut = hit[holdout]
            self._tile.lose(paths.pixel[cut], pick(paths.weight, cut))
        return np.flatnonzero(~holdout)

    def _wants_data(self, paths: Paths, hit: Array) -> Array:
        """Which hits belong to pixels whose data passes are still to come."""
        return self._tile.wanted[paths.pixel[hit]] & (paths.depth == 0)

    def _record(
        self, paths: Paths, hit: Array, surface: Surface, depth: Array, coefficients: Coefficients
    ) -> None:
        """Data passes of pixels that have none yet, where less than half of the light passes
        straight through.
        """
        k = coefficients.transparent
        chosen = np.flatnonzero(self._wants_data(paths, hit) & ((k[0] + k[1] + k[2]) / 3 < 0.5))
        if not len(chosen):
            return
        stage, some = self._stage, surface.take(chosen)
        uv = stage.attributes.uv("")
        moved = {"Vector": motion_vectors(stage, some)} if "Vector" in self._tile.data else {}
        self._tile.record(
            paths.pixel[hit[chosen]],
            Depth=depth[chosen] * stage.camera.along
            if stage.scene.camera.motion is None and stage.camera.panorama is None
            else stage.camera.depth(some.x) * stage.camera.unit,
            Position=some.x + stage.eye[:, None],
            Normal=some.n,
            Grazing=np.abs(dot(some.n, some.v))[None],
            UV=np.concatenate(
                [uv.at(some.geometry, some.local, some.weights), uv.has(some.geometry)[None]]
            ),
            Object_Index=stage.per_object("object_index", some.row),
            Material_Index=stage.shader.pass_index(some.material),
            **moved,
        )

    def _see(self, paths: Paths, hit: Array, surface: Surface, coefficients: Coefficients) -> None:
        """What passes that are means of what is seen have of these surfaces."""
        stage, weight, pixel = self._stage, pick(paths.weight, hit), paths.pixel[hit]
        passed = coefficients.transparent
        share = weight.mean(0) * (1 - passed.mean(0))
        self._tile.denoise(
            pixel,
            Normal=share * stage.camera.along_axes(surface.n),
            Albedo=weight * coefficients.albedo(),
            Depth=(share * stage.camera.distance_seen(surface.x))[None],
        )
        seen = (weight * (1 - np.clip(passed, 0.0, 1.0))).mean(0)
        self._tile.see(
            pixel,
            seen * (1 - stage.mist(stage.camera.distance(surface.x))),
            share,
            stage.crypto_ids(surface),
        )

    def _give_aovs(self, paths: Paths, hit: Array, surface: Surface, passed: Array) -> None:
        """What surfaces give to AOVs, up to the first that lets less than half through."""
        tile, pixel = self._tile, paths.pixel[hit]
        chosen = np.flatnonzero(tile.wants_aovs[pixel])
        some, here = surface.take(chosen), pixel[chosen]
        queries = self._queries(here, some)
        given = self._stage.shader.aovs(some, paths.kind, len(tile.aovs) // 4, queries)
        tile.aovs[:, here] += given * pick(paths.weight, hit[chosen]).mean(0)
        opaque = (passed[0] + passed[1] + passed[2]) / 3 < 0.5
        tile.wants_aovs[pixel[opaque]] = False

    def _find_gaps(self, paths: Paths, hit: Array, surface: Surface, depth: Array) -> None:
        """How far behind the first hits the rays' next ones lie."""
        rays = beyond(paths.rays.take(hit), surface, depth)
        again = self._stage.visibility.closest(rays, paths.kind)
        found = np.flatnonzero(again.primitive != NOTHING)
        _, d = rays.lines(found)
        self._tile.data["Gap"][0, paths.pixel[hit[found]]] = (
            again.depth[found] - depth[found]
        ) * length(d)

    def _light(
        self, paths: Paths, hit: Array, surface: Surface, coefficients: Coefficients
    ) -> None:
        (self._share if paths.shared else self._shade)(paths, hit, surface, coefficients)

    def _shade(
        self, paths: Paths, hit: Array, surface: Surface, coefficients: Coefficients
    ) -> None:
        """L = k_a I_a + Σ (k_d I max(0, n·l) + k_s I max(0, n·h)^p) S + k_e (section 4.15), each
        part by itself.
        """
        stage, weight, pixel = self._stage, pick(paths.weight, hit), paths.pixel[hit]

        def add(part: str, values: Array, group: Array | int = -1) -> None:
            if values.any():
                self._add(paths, part, pixel, weight * values, group)

        world = stage.scene.world.light_group
        add("Ambient", coefficients.ambient * self._stage.ambient, world)
        if not (paths.reflections and self._stage.is_lit_by_meshes):
            group = stage.per_object("light_group", surface.row)
            add("Emission", coefficients.emission, group)
        if stage.shared_bounced[0]:
            # the few points of the first samples may miss what is matt
            matt = pixel[coefficients.diffuse.any(0)]
            self._tile.soft_light[matt] = self._tile.bounced[matt] = True
        on_reach, on_cut = self._listeners(pixel)
        light = self._stage.lighting_of(paths).direct(
            surface, coefficients, weight, self._sample, on_reach, on_cut
        )
        if paths.gathers:
            to = surface.x - paths.rays.lines(hit)[0]
            is_near = 1 - dot(to, to) / stage.reach**2 >= NEAR_SHARE
            self._tile.near[pixel[is_near & coefficients.diffuse.any(0)]] = True
        add("Diffuse", light.diffuse)
        add("Specular", light.specular)
        add("Shadow", light.shadow)
        for number in range(len(stage.scene.light_groups)):
            given = weight * light.groups[3 * number : 3 * number + 3]
            self._tile.add_to_groups(number, pixel, given)
        if stage.splits and paths.depth == 0:
            self._split(pixel, weight, surface, coefficients, light)

    def _share(
        self, paths: Paths, hit: Array, surface: Surface, coefficients: Coefficients
    ) -> None:
        """The same for all pixels that get a share of it."""
        tile, pixel = self._tile, paths.pixel[hit]
        number = np.zeros(len(paths), np.intp)
        number[hit] = np.arange(len(hit))
        self._tile = Tile(len(hit), frozenset(), 0, len(self._stage.scene.light_groups))
        self._shade(replace(paths, pixel=number), hit, surface, coefficients)
        found, self._tile = self._tile, tile
        assert self._shares is not None
        ray, receiver, share = self._shares.given(pixel, surface.x, surface.g)
        tile.take(found, pixel, ray, receiver, share)

    def _add(
        self, paths: Paths, part: str, pixel: Array, values: Array, group: Array | int = -1
    ) -> None:
        """Adds (3, m) to a part of the picture, to its light group and, where it came by way of
        mirrors or glass, to what these bring.
        """
        self._tile.add(paths.part(part), pixel, values)
        self._tile.add_to_groups(group, pixel, values)
        if self._stage.splits and paths.depth > 0:
            if paths.gathers and paths.depth == 1:
                self._tile.add("Diffuse Indirect", pixel, values)
                return
            is_direct = paths.depth == 1 and part in ("Emission", "Environment")
            surface = "Transmission" if paths.transmitted else "Glossy"
            self._tile.add(f"{surface} {'Direct' if is_direct else 'Indirect'}", pixel, values)

    def _split(
        self,
        pixel: Array,
        weight: Array,
        surface: Surface,
        coefficients: Coefficients,
        light: DirectLight,
    ) -> None:
        """The light that camera rays meet, by the kind of lobe that gives it back, and what of it
        these give back.
        """
        mirrored, refracted = gives(surface, coefficients)
        ambient = coefficients.ambient * self._stage.ambient
        found = {
            "Diffuse Direct": ambient + light.lit_diffuse,
            "Diffuse Indirect": light.lit_bounced,
            "Diffuse Color": coefficients.matt(),
            "Glossy Direct": light.lit_specular,
            "Glossy Indirect": light.lit_glossy_bounced,
            "Glossy Color": coefficients.glossy() + mirrored,
            "Transmission Color": refracted,
        }
        for name, values in found.items():
            self._tile.add(name, pixel, weight * values)

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
            if source.light.kind == "BOUNCED":
                self._tile.bounced[pixel[seen]] = True

        def on_cut(seen: Array) -> None:
            self._tile.cut[pixel[seen]] = True

        return on_reach, on_cut
