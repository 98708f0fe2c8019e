"""One pixel's rays with every term of the notes' formulas in numbers (sections 4.12-4.17)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..evaluation.march import Spans
from ..evaluation.surface import Surface
from ..explained import Bounce, Hit, LightTerm, Numbers, Ray
from ..film import OCCLUSION
from ..lights.interleaving import interleaving
from ..lights.lit import lit_scene
from ..linear.columns import dot, length, unit
from ..sampling import (
    dealt_sample,
    interleaving_classes,
)
from ..sampling.motion import is_moving, moment, sample_times
from ..scene import Scene
from ..settings import Settings
from . import catchers
from .bumps import bump_shadow
from .camera import Spread
from .cancellation import Cancellation
from .closures import Term, evaluate
from .coefficients import Coefficients
from .explain_shadows import shadow_of
from .gathering import bounce, bouncing, seen_lobes
from .gloss import Narrow
from .lighting import Lighting
from .lights import LightSample, Source
from .lobe_light import fibres, matt_lobes
from .motion_vectors import motion_vectors
from .occlusion import openness
from .paths import Interaction, Paths, bounced, camera_paths, held_share, met, straight_on
from .reflections import reflected
from .scattering import scattered, scattered_on
from .seen_lights import distance_seen, has_shape, seen_radiance
from .stage import Stage
from .subsurface import coming_out, entering, one_by_one
from .surface import surface_at
from .tabled_lights import Dome
from .terminator import lowered, mean_lowered
from .translucent import other_side
from .visibility import NOTHING

Array = np.ndarray


class Explainer:
    """Follows single rays of a scene, no photons; the order of work is that of `Generations`."""

    def __init__(self, scene: Scene, settings: Settings) -> None:
        lit = lit_scene(scene, **settings.lighting)
        if is_moving(scene):
            lit = moment(lit, sample_times(scene, settings.samples)[0, 0])
        self.stage = Stage(
            lit,
            replace(settings, samples=1, region=None, passes=frozenset(), photons=0),
            Cancellation(lambda: False),
        )
        resolves = settings.soft_light == "RESOLVED"
        self._resolved = interleaving(lit, settings) if resolves else 1
        self._photons = settings.photons
        self._spread = Spread.samples(scene, settings.samples)[0]
        self._looks_round = OCCLUSION in settings.passes
        self._places = np.zeros(1, np.intp)
        self._sample = 0  # of the tables

    def pixel(self, x: int, y: int) -> Ray:
        """The camera ray through the centre of pixel (x, y) of the full frame, bottom left first,
        and its point of the lens: the first sample of a picture.
        """
        here, side = ((x, x + 1), (y, y + 1)), self.stage.interleaving
        self._places = self.stage.places(*here)
        number = int(interleaving_classes(*here, side)[0])
        self._sample = dealt_sample(0, number, self.stage.settings.samples, side)
        self.stage.media.moment.sample = self._sample
        paths = self._camera_paths(*here)
        return self.follow(paths, "camera" if self._spread.lens is None else "lens")

    def _camera_paths(self, x: tuple[int, int], y: tuple[int, int]) -> Paths:
        rays = self.stage.camera.rays(x, y, np.zeros(2), self._spread)[0]
        return camera_paths(rays, self.stage.camera.weights(rays))

    def _surface(self, paths: Paths, hit: Array, primitive: Array, depth: Array) -> Surface:
        stage = self.stage
        surface = surface_at(
            stage.geometry,
            stage.attributes,
            paths.rays,
            hit,
            primitive,
            depth,
            stage.cancellation,
        )
        return stage.shader.bent(met(paths, hit, surface), paths.kind, stage.queries(self._sample))

    def follow(self, paths: Paths, kind: str) -> Ray:
        """One ray and all that follow from it."""
        stage = self.stage
        o, d = paths.rays.lines(np.zeros(1, np.intp))
        found = stage.closest(paths)
        spans = (
            stage.media.spans(paths.rays, paths.visibility, found.depth) if stage.media else None
        )
        shapes = tuple(self._shapes(paths, o, d, found.depth, spans))
        sent, passed = paths.weight[:, 0], np.ones((3, 1))
        media: tuple[tuple[str, Numbers], ...] = ()
        if spans is not None:
            passed = stage.media.passed(spans, paths.rays.near, found.depth)
            media = tuple(self._media(paths, spans, found.depth))
        scattered_rays = self._bounced_in_media(paths, spans, found.depth)
        paths = replace(paths, weight=paths.weight * passed)
        ray = Ray(
            kind,
            paths.depth,
            _numbers(sent),
            _numbers(o[:, 0] + stage.eye),
            _numbers(unit(d)[:, 0]),
            None,
            _numbers(self._background(paths)),
            shapes,
            (),
            (),
            (),
            _numbers(passed[:, 0]),
            media,
            stage.media.cells(spans) if spans is not None else 0,
        )
        own = sent * sum((np.array(light) for _, light in (*shapes, *media)), np.zeros(3))
        if found.primitive[0] == NOTHING:
            own = own + paths.weight[:, 0] * np.array(ray.background)
            return self._finished(ray, paths, own, scattered_rays)
        ray = replace(ray, background=(0.0, 0.0, 0.0))
        return self._at_surface(ray, paths, found, own, scattered_rays)

    def _bounced_in_media(self, paths: Paths, spans: Spans | None, depth: Array) -> tuple[Ray, ...]:
        """What bounces to media on the way."""
        if spans is None or paths.caught:
            return ()
        found = scattered_on(self.stage, paths, spans, depth, self._sample, self._places)
        return () if found is None else (self.follow(found, "bounce"),)

    def _at_surface(
        self, ray: Ray, paths: Paths, found, own: Array, scattered_rays: tuple[Ray, ...]
    ) -> Ray:
        stage, hit, depth = self.stage, np.zeros(1, np.intp), found.depth
        surface = self._surface(paths, hit, found.primitive, depth)
        coefficients = stage.shader.coefficients(surface, paths.kind, stage.queries(self._sample))
        at = seen_lobes(stage, Interaction(paths, hit, surface, coefficients))
        at, below = (at, None) if self._is_unseen(at) else entering(stage, at)
        coefficients = at.coefficients
        if paths.reflections and stage.is_lit_by_meshes:
            coefficients = replace(coefficients, emission=np.zeros_like(coefficients.emission))
        about = self._hit(surface, coefficients, depth, paths, ray.kind in ("camera", "lens"))
        near: tuple[Ray, ...] = ()
        if self._is_unseen(at):
            if not about.holdout:
                about, near = self._caught(at, about)
            coefficients = replace(coefficients, mirrors=[], refractions=[], highlights=[])
            at = replace(at, coefficients=coefficients)
        else:
            near, about = self._bouncing(at, about)
            if coefficients.translucent.any():
                other = other_side(stage, at, depth)
                near = (*near, *self._gathered(bouncing(stage, other, self._sample, self._places)))
        after = self._next(at, depth)
        out = () if below is None else self._coming_out(below)
        if about.caught is not None:
            caught = self._behind(paths, coefficients, np.array(about.caught))
            own, ray = own + paths.weight[:, 0] * caught, replace(ray, background=_numbers(caught))
        elif not about.holdout:
            own = own + paths.weight[:, 0] * np.array(about.light)
        told = replace(ray, hit=about)
        return self._finished(told, paths, own, (*scattered_rays, *near, *out, *after))

    def _finished(self, ray: Ray, paths: Paths, own: Array, follow: tuple[Ray, ...]) -> Ray:
        """With what it brings itself (3,), and what follows from it."""
        held = float(held_share(self.stage.settings, paths, own[:, None])[0])
        color = held * own + sum((np.array(after.color) for after in follow), np.zeros(3))
        return replace(
            ray, own=_numbers(held * own), color=_numbers(color), follow=follow, held=held
        )

    def _bouncing(self, at: Interaction, about: Hit) -> tuple[tuple[Ray, ...], Hit]:
        """The rays along which light bounced to the point, and what is told of them."""
        stage, paths = self.stage, at.paths
        found = tuple(self._gathered(bouncing(stage, at, self._sample, self._places)))
        fibrous = any(not term.is_matt for term in at.coefficients.fibres)
        most = stage.fibre_bounces if fibrous else stage.bounces
        if most == 0:
            return found, about
        alone = fibrous and not stage.gathers(paths)
        _, k, share, number = bounce(stage, at, self._sample, self._places, alone)
        if not k.any():
            return found, about
        told = Bounce(paths.bounced, most, float(share[0]), float(number[0]))
        return found, replace(about, bounce=told)

    def _gathered(self, near: list[Paths]) -> Iterator[Ray]:
        """What rays of bounced light find."""
        return (self.follow(one, "bounce") for one in near)

    def _is_unseen(self, at: Interaction) -> bool:
        kinds = ("holdout", "catcher") if at.paths.depth == 0 else ()
        return any(self.stage.per_object(kind, at.surface.row)[0] for kind in kinds)

    def _coming_out(self, below: Interaction) -> Iterator[Ray]:
        """Where light comes out again."""
        stage, start = self.stage, below.surface.x
        row = stage.subsurface_row(self._sample)
        found = coming_out(stage, below, stage.probes(self._sample, lambda index: None), row)
        for at in () if found is None else one_by_one(found):
            way = at.surface.x - start
            about = self._hit(at.surface, at.coefficients, length(way), at.paths, False)
            follow, about = self._bouncing(at, about)
            own = at.weight[:, 0] * np.array(about.light)
            color = own + sum((np.array(after.color) for after in follow), np.zeros(3))
            place = (_numbers(start[:, 0] + stage.eye), _numbers(unit(way)[:, 0]))
            yield Ray(
                "subsurface",
                at.paths.depth,
                _numbers(at.weight[:, 0]),
                *place,
                about,
                (0.0, 0.0, 0.0),
                (),
                _numbers(own),
                _numbers(color),
                follow,
            )

    def _shapes(
        self, paths: Paths, o: Array, d: Array, depth: Array, spans: Spans | None
    ) -> Iterator[tuple[str, Numbers]]:
        for source in () if paths.reflections else self.stage.sources:
            if getattr(source.light, "visible_" + paths.visibility) and has_shape(source):
                near = paths.rays.near
                radiance = seen_radiance(source, o, d, near, depth, paths.kind)
                if spans is not None:
                    met = distance_seen(source, o, d)
                    radiance = radiance * self.stage.media.passed(spans, near, met)
                if radiance.any():
                    yield source.light.name, _numbers(radiance[:, 0])

    def _media(self, paths: Paths, spans: Spans, depth: Array) -> Iterator[tuple[str, Numbers]]:
        """What comes from media on the way."""
        stage, near = self.stage, paths.rays.near
        given: dict[str, Array] = {}
        if paths.caught:
            return
        if stage.media.emits and not paths.gathers:  # to these they are lights
            given[""] = stage.media.pieces(spans, near, depth).glow()[:, 0]
        part = spans, depth, self._sample, paths.gathers
        for found in scattered(stage, paths.rays, *part):
            name = found.source.light.name
            light = (found.light * found.shadow.T).sum(1)
            given[name] = given.get(name, np.zeros(3)) + light
        yield from ((name, _numbers(light)) for name, light in given.items() if light.any())

    def _background(self, paths: Paths) -> Array:
        hidden = paths.skyless[0] or (paths.depth == 0 and self.stage.scene.world.transparent)
        if hidden:
            return np.zeros(3)
        return self.stage.background_of(paths, np.arange(1))[:, 0]

    def _behind(self, paths: Paths, coefficients: Coefficients, ratio: Array) -> Array:
        """(3,) what a shadow catcher shows of the surroundings behind it."""
        left = catchers.light_left(ratio[:, None]) * catchers.opacity(coefficients)
        return left[:, 0] * self._background(paths)

    def _caught(self, at: Interaction, about: Hit) -> tuple[Hit, tuple[Ray, ...]]:
        """What is told of a shadow catcher, and the rays by which light bounces to it; what these
        bring is in the ratio of its light.
        """
        stage, paths = self.stage, at.paths
        lights = catchers.lights(stage, at.surface, at.coefficients, paths.weight, self._sample)
        rays: list[Ray] = []
        for caught, light in zip(("with all", "alone"), lights, strict=True):
            mine = replace(at, paths=replace(paths, caught=caught))
            for ray in self._gathered(bouncing(stage, mine, self._sample, self._places)):
                light += np.array(ray.color)[:, None]
                rays.append(ray.times((0.0, 0.0, 0.0)))
        return replace(about, caught=_numbers(catchers.ratio(*lights)[:, 0])), tuple(rays)

    def _next(self, at: Interaction, depth: Array) -> Iterator[Ray]:
        paths = at.paths
        if paths.depth < self.stage.settings.max_bounces and not paths.gathers:
            for after in bounced(self.stage, at, self._sample):
                _, d = after.rays.lines(np.zeros(1, np.intp))
                is_mirror = dot(d, at.surface.g)[0] > 0
                yield self.follow(after, "mirror" if is_mirror else "refraction")
            for after in reflected(self.stage, at, self._sample):
                yield self.follow(after, "reflection")
        straight = straight_on(at, depth, np.zeros(1, bool))
        if straight is not None:
            yield self.follow(straight, "transparent")

    def _hit(
        self,
        surface: Surface,
        coefficients: Coefficients,
        depth: Array,
        paths: Paths,
        is_first: bool,
    ) -> Hit:
        stage, row = self.stage, surface.row[0]
        block = int(stage.geometry.placements.block[row])
        instances = stage.scene.instances[block]
        first = int(np.flatnonzero(stage.geometry.placements.block == block)[0])
        number = int(surface.material[0])
        materials = stage.scene.materials
        return Hit(
            thing=instances.name,
            place=int(row) - first,
            primitive=int(surface.local[0]),
            material=materials[number].name if 0 <= number < len(materials) else "",
            barycentric=_numbers(surface.weights[:, 0]),
            depth=float(
                (stage.camera.hit_depth(surface.x, depth) if paths.depth == 0 else depth)[0]
            ),
            position=_numbers(surface.x[:, 0] + stage.eye),
            normal=_numbers(surface.n[:, 0]),
            geometric_normal=_numbers(surface.g[:, 0]),
            ambient=_numbers(stage.even_light(surface, coefficients)[:, 0]),
            emission=_numbers(coefficients.emission[:, 0]),
            lights=(
                *self._lights(surface, coefficients, paths),
                *self._lights_behind(surface, coefficients, depth, paths),
            ),
            holdout=instances.holdout and paths.depth == 0,
            hole=_numbers(coefficients.holdout[:, 0] * (paths.depth == 0)),
            caught=None,
            moved=_numbers(motion_vectors(stage, surface)[:, 0])
            if paths.depth == 0 and stage.scene.neighbours is not None
            else None,
            shared=(stage.lighting.marks, stage.shared_samples),
            shared_media=stage.shared_media,
            resolved=self._resolved if is_first else 1,
            photons=self._photons if is_first else 0,
            open=_numbers(openness(stage, surface, self._sample, lambda: None)[:, 0])
            if paths.depth == 0 and self._looks_round
            else None,
        )

    # --- lights
    # ----------------------------------------------------------------------------------------------

    def _lights(
        self,
        surface: Surface,
        coefficients: Coefficients,
        paths: Paths,
    ) -> Iterator[LightTerm]:
        lighting, weight = self._lighting(surface, paths), paths.weight
        for source in lighting.sources:
            margin, j = 0, 0
            hidden = source.hidden_counts if isinstance(source, Dome) else 1
            for j, (narrow, sample, lobes) in enumerate(
                lighting.samples(surface, coefficients, weight, source, self._sample)
            ):
                if lobes is coefficients or sample.intensity[0]:
                    term = self._light(surface, lobes, source, narrow, sample, j, lighting)
                    lost = np.array(term.shadow) != 1.0
                    light = np.array(term.diffuse) + np.array(term.specular)
                    if lobes is coefficients and sample.counts and light.any():
                        margin += -hidden if (lost * light).any() else 1
                    yield term
            if (
                isinstance(source, Dome)
                and margin >= 0
                and not (lighting.dealt or lighting.each_once)
            ):
                yield self._rest(surface, coefficients, source, j + 1)

    def _lighting(self, surface: Surface, paths: Paths) -> Lighting:
        kinds = self.stage.lighting_of(paths).kinds(surface, paths.weight)
        return next(lighting for lighting, points in kinds if points[0])

    def _lights_behind(
        self, surface: Surface, coefficients: Coefficients, depth: Array, paths: Paths
    ) -> Iterator[LightTerm]:
        """On the other side, where that is seen."""
        if not coefficients.translucent.any():
            return
        at = Interaction(paths, np.zeros(1, np.intp), surface, coefficients)
        other = other_side(self.stage, at, depth)
        for term in self._lights(other.surface, other.coefficients, paths):
            yield replace(term, behind=True)

    def _rest(
        self, surface: Surface, coefficients: Coefficients, source: Dome, j: int
    ) -> LightTerm:
        """What the directions of a sky leave out."""
        rest = (
            mean_lowered(surface.lowering) * source.rest(surface.x, surface.n, self._sample)[:, 0]
        )
        return LightTerm(
            light=source.light.name,
            sample=j,
            to_light=_numbers(surface.n[:, 0]),
            n_dot_l=1.0,
            n_dot_h=0.0,
            intensity=_numbers(rest),
            distance=np.inf,
            shadow=(1.0, 1.0, 1.0),
            blocker="",
            blocker_distance=np.inf,
            diffuse=_numbers(coefficients.diffuse[:, 0] * rest),
            specular=(0.0, 0.0, 0.0),
            group=self._group(source.light.light_group),
        )

    def _group(self, numbers: Array | int) -> str:
        """The name of a light group; numbers: one, or (1,)."""
        number = int(np.ravel(numbers)[0])
        return self.stage.scene.light_groups[number] if number >= 0 else ""

    def _light(
        self,
        surface: Surface,
        coefficients: Coefficients,
        source: Source,
        narrow: Narrow | None,
        sample: LightSample,
        j: int,
        lighting: Lighting,
    ) -> LightTerm:
        n_dot_l = float(sample.cosine(surface.n)[0])
        intensity = sample.light_of(source)[:, 0]
        glossy = source.has_highlights
        through = coefficients.lets_through() if glossy or coefficients.fibres else False
        sample = replace(sample, leaves=through is not False)
        if glossy:
            through = through | coefficients.turned_to(sample.direction)
        reached = sample.reaches(surface.g, surface.n, through)
        hidden, share = bump_shadow(surface.n, surface.unbent, surface.bump, sample.direction)
        reached &= lighting.lights(source, surface) & ~hidden
        lit = reached[0] and intensity.any()
        specular = sum(
            (
                term.k[:, 0] * self._highlight(surface, sample, term)
                for term in (coefficients.highlights if glossy else ())
            ),
            np.zeros(3),
        )
        seen = np.zeros(1, np.intp)
        specular = specular * (narrow.balance(seen, sample) if narrow else 1.0)
        if coefficients.fibres:
            all_ = fibres(surface, coefficients.fibres, seen, sample.direction, matt=False)
            specular = specular + all_[:, 0]
        even = lighting.even_gloss(source, surface, coefficients)[:, 0]
        low = lowered(surface.lowering, dot(surface.n, sample.direction))
        specular = specular + low * even * max(n_dot_l, 0.0)
        matt = matt_lobes(surface, coefficients, seen, sample.direction)
        diffuse = coefficients.diffuse[:, 0] * max(n_dot_l, 0.0) + matt[:, 0]
        diffuse = low * share * diffuse
        diffuse, specular = source.on_lobes(diffuse, specular)
        shadow, blocker, distance = (
            shadow_of(self.stage, surface, source, sample, coefficients.fibres)
            if lit
            else (np.ones(3), "", np.inf)
        )
        return LightTerm(
            light=source.light.name,
            sample=j,
            to_light=_numbers(sample.direction[:, 0]),
            n_dot_l=n_dot_l,
            n_dot_h=float(dot(surface.n, unit(surface.v + sample.direction))[0]),
            intensity=_numbers(intensity),
            distance=np.inf if sample.end is None else float(length(sample.end - surface.x)[0]),
            shadow=_numbers(shadow),
            blocker=blocker,
            blocker_distance=distance,
            diffuse=_numbers(diffuse * sample.matt_light_of(source)[:, 0] if lit else np.zeros(3)),
            specular=_numbers(specular * intensity if lit else np.zeros(3)),
            group=self._group(sample.group_of(source)),
            bump_shadow=0.0 if hidden[0] else float(share[0]),
            lowered=float(low[0]),
        )

    def _highlight(self, surface: Surface, sample: LightSample, term: Term) -> float:
        return float(evaluate(term, slice(None), surface.n, surface.v, sample.direction)[0])


def _numbers(values: Array) -> Numbers:
    return tuple(float(value) for value in values)
