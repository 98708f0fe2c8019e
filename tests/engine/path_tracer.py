"""A plain slow path tracer: the truth that tests hold both tracers to (Kajiya 1986, The rendering
equation).

Each path goes from the camera through a random point of its pixel, asks one random point of every
lamp at each surface, and goes on in one random direction of that surface's lobes, until it meets
nothing, or Russian roulette ends it. Things that glow and the sky are found by being met. Nothing
is shared between pixels, nothing is tabled, nothing is left out or clamped: what it gives is right
but for noise, whose size it tells. Of the reference tracer it takes what rays meet, and what
materials are there; lamps, skies and all sampling are its own (`path_lamps`).

Letters: T weight of a path, l direction to the light, G what lobes give of light from l, times π
(what semantics/lobes.md's table has for I = 1).
"""

from __future__ import annotations

import numpy as np

from glint.engine.evaluation.attributes import Attributes
from glint.engine.evaluation.geometry import ULPS, gather
from glint.engine.evaluation.surface import Surface
from glint.engine.linear.columns import add_at, dot, length, pick, transform, unit
from glint.engine.reference.cancellation import Cancellation
from glint.engine.reference.materials import Shader
from glint.engine.reference.rays import IncoherentRays, Rays
from glint.engine.reference.shadows import arriving, bent
from glint.engine.reference.surface import spot_at, surface_at
from glint.engine.reference.terminator import start_towards
from glint.engine.reference.visibility import NOTHING, Passed, Visibility
from glint.engine.sampling.motion import is_moving
from glint.engine.scene import EVERYTHING, Camera, Light, Material, Scene
from path_lamps import Lamp, Surroundings
from path_lobes import (
    Leave,
    Met,
    Paths,
    given,
    mirrored,
    scatter,
    straight_on,
    thrown,
    transmitted,
)

Array = np.ndarray

KINDS = {
    "camera": ("camera", "camera"),
    "mirror": ("mirror", "mirror"),
    "transmission": ("transmission", "mirror"),
    "scattered": ("diffuse", "scattered"),
}
"""Kind of path → which flag of objects it obeys, what programs are told."""
COVERED = (
    "AMBIENT",
    "DIFFUSE",
    "SPECULAR",
    "MIRROR",
    "REFRACTION",
    "TRANSPARENT",
    "EMISSION",
    "HOLDOUT",
    "SHEEN",
    "TOON_DIFFUSE",
    "TOON_SPECULAR",
    "OREN_NAYAR",
    "OREN_NAYAR_MULTIPLE",
)
"""Lobes. AMBIENT ones stand for light that is followed here, and give nothing."""
AT_ONCE = 1 << 14
"""Paths that are followed together."""
LONGEST = 256
"""Surfaces on a path."""
CERTAIN = 3
"""Scatterings, from which on Russian roulette ends paths."""
LIKELIEST = 0.95
"""Odds of a path to go on beyond that, at most."""


def trace_paths(
    scene: Scene,
    samples: int,
    *,
    seed: int = 0,
    bounces: int | None = None,
    filter_width: float = 1.0,
) -> tuple[Array, Array]:
    """The picture of `scene`, (h, w, 3) float64 means over so many paths a pixel, row 0 at the
    bottom, and their standard errors, (h, w, 3).

    bounces: how often at most light is scattered on its way to the surface that is seen; None for
    as often as it is. filter_width: of the squares, in pixels, that paths are even over; 0 for the
    middles of pixels. Raises ValueError for a scene with things that no path follows here, naming
    them.
    """
    missing = uncovered(scene)
    if missing:
        names = ", ".join(missing)
        raise ValueError(f"the path tracer does not follow {names}: leave it out of the scene")
    tracer = _PathTracer(scene, np.random.default_rng(seed), bounces, filter_width)
    width, height = scene.camera.resolution
    total, squares = np.zeros((2, 3, width * height))
    at_once = max(AT_ONCE // (width * height), 1)
    for first in range(0, samples, at_once):
        found = tracer.sample(min(at_once, samples - first))
        total += found.sum(1)
        squares += (found * found).sum(1)
    mean = total / samples
    variance = np.maximum(squares / samples - mean * mean, 0.0) / max(samples - 1, 1)
    shape = height, width, 3
    return mean.T.reshape(shape), np.sqrt(variance).T.reshape(shape)


def uncovered(scene: Scene) -> list[str]:
    """What of a scene no path follows here."""
    camera, lights, materials = scene.camera, scene.lights, scene.materials
    found = {
        "panoramas": camera.kind == "PANORAMA",
        "lenses": camera.lens is not None,
        "eyes of a pair": camera.eye is not None,
        "clip planes": bool(camera.clip_planes),
        "motion": is_moving(scene) or camera.motion is not None,
        "media": any(m is not None for m in (scene.world.medium, *(x.medium for x in materials))),
        "nodes that ask for rays": scene.most_asked > 0,
        "programs of lamps": any(light.program is not None for light in lights),
        "linked lights": any(_is_linked(light) for light in lights),
        "shadow catchers": any(block.catcher for block in scene.instances),
        "lights that tracers make": any(
            light.kind in ("MESH", "BOUNCED", "MEDIUM") for light in lights
        ),
    }
    lobes = dict.fromkeys(name for material in materials for name in _uncovered_lobes(material))
    return [name for name, is_there in found.items() if is_there] + list(lobes)


def _is_linked(light: Light) -> bool:
    """Whether it is for some things or lobes alone."""
    all_lobes = light.lights_matt and light.lights_gloss
    return not all_lobes or light.receivers != EVERYTHING or light.blockers != EVERYTHING


def _uncovered_lobes(material: Material) -> list[str]:
    named = {"REFRACTION": "rough glass", "DIFFUSE": "light below surfaces"}
    odd = [lobe for lobe in material.lobes if lobe.is_rough_glass or lobe.goes_below]
    others = [lobe.kind for lobe in material.lobes if lobe.kind not in COVERED]
    return [named[lobe.kind] for lobe in odd] + others


class _PathTracer:
    """The scene made ready, relative to the eye."""

    def __init__(
        self, scene: Scene, random: np.random.Generator, bounces: int | None, filter_width: float
    ) -> None:
        self._scene, self._random, self._bounces = scene, random, bounces
        self._filter_width = filter_width
        self._eye = np.asarray(scene.camera.world_from_camera, np.float64)[:, 3]
        self._never = Cancellation(lambda: False)
        self._geometry = gather(scene, self._eye)
        self._attributes = Attributes(scene)
        self._shader = Shader(scene, self._attributes, self._geometry)
        opaque = ~self._shader.is_transparent(self._geometry.material)
        self._visibility = Visibility(self._geometry, opaque, self._never)
        self._lamps = [Lamp(light, self._eye) for light in scene.lights if light.kind != "DOME"]
        self._surroundings = Surroundings(scene)

    def sample(self, count: int) -> Array:
        """(3, count, pixels): the light that so many paths of each pixel find."""
        width, height = self._scene.camera.resolution
        light = np.zeros((3, count * width * height))
        offsets = self._filter_width * (self._random.random((2, light.shape[1])) - 0.5)
        under_way = {"camera": camera_paths(self._scene.camera, offsets)}
        for _ in range(LONGEST):
            children: dict[str, list[Paths]] = {}
            for kind, paths in under_way.items():
                for next_kind, child in self._follow(kind, paths, light):
                    if len(child):
                        children.setdefault(next_kind, []).append(child)
            if not children:
                break
            under_way = {kind: Paths.together(parts) for kind, parts in children.items()}
        return light.reshape(3, count, -1)

    def _follow(self, kind: str, paths: Paths, light: Array) -> list[tuple[str, Paths]]:
        """Adds what the paths find to `light`; where they go on, by kind."""
        flag, _ = KINDS[kind]
        hits = self._visibility.closest(paths.rays, flag)
        self._add_seen(kind, paths, hits.depth, light)
        hit = np.flatnonzero(hits.primitive != NOTHING)
        if not len(hit):
            return []
        met = self._meet(kind, paths.take(hit), hits.primitive[hit], hits.depth[hit])
        add_light(light, met.paths, met.coefficients.emission)
        add_light(light, met.paths, self._lamplight(met))
        return self._onwards(kind, met)

    def _add_seen(self, kind: str, paths: Paths, depth: Array, light: Array) -> None:
        """Adds the surroundings where nothing is met, and the shapes of lamps before what is."""
        _, told = KINDS[kind]
        missed = np.flatnonzero(np.isinf(depth))
        some = paths.take(missed)
        add_light(light, some, self._surroundings.seen(some.d, told))
        for lamp in self._lamps:
            if lamp.is_seen(kind):
                t, radiance = lamp.seen(paths.o, paths.d)
                reached = (t > paths.near) & ((t < depth) | (np.isinf(t) & np.isinf(depth)))
                add_light(light, paths, np.where(reached, radiance, 0.0))

    def _meet(self, kind: str, paths: Paths, primitive: Array, depth: Array) -> Met:
        _, told = KINDS[kind]
        every = np.arange(len(paths))
        surface = surface_at(
            self._geometry, self._attributes, paths.rays, every, primitive, depth, self._never
        )
        surface = self._shader.bent(surface, told)
        return Met(paths, depth, surface, self._shader.coefficients(surface, told))

    # --- lamps

    def _lamplight(self, met: Met) -> Array:
        """(3, m): what the points give back of a random point of each lamp."""
        total = np.zeros((3, len(met)))
        for lamp in self._lamps:
            drawn = lamp.draw(met.surface.x, self._random)
            light = drawn.light * given(met, drawn.direction)
            lit = np.flatnonzero(light.any(0))
            if lamp.light.cast_shadow and len(lit):
                direction = pick(drawn.direction, lit)
                open_ = self._open(met.surface.take(lit), direction, drawn.distance[lit])
                light[:, lit] *= open_
            total += light
        return total

    def _open(self, surface: Surface, direction: Array, distance: Array) -> Array:
        """(3, m): what of light from these directions and distances arrives at the points."""
        start = start_towards(surface, np.arange(len(surface)), direction)
        end = surface.x + np.where(np.isfinite(distance), distance, 0.0) * direction
        start = start + np.where(dot(surface.g, direction) < 0, -1.0, 1.0) * (
            surface.offset * surface.g
        )
        far = np.where(np.isfinite(distance), length(end - start), np.inf)
        way = np.where(np.isfinite(distance), unit(end - start), direction)
        margin = ULPS * (np.abs(end).max(0) + np.abs(surface.x).max(0))
        rays = IncoherentRays.of(start, way, np.zeros(len(far)), far - margin)
        passed = self._visibility.blocked(rays, self._passed, self._geometry.visible["shadow"])
        return arriving(passed, True).T

    def _passed(self, rays: Rays, ray: Array, primitive: Array, depth: Array) -> Passed:
        """As `Visibility.blocked` takes it."""
        if self._shader.reads_surfaces:
            spot = surface_at(
                self._geometry, self._attributes, rays, ray, primitive, depth, self._never
            )
            passed = self._shader.transmittance(spot)
            return Passed(passed, bent(spot, passed[:, 3]))
        passed = self._shader.transmittance(spot_at(self._geometry, rays, ray, primitive))
        return Passed(passed, np.zeros((len(ray), 3)))

    # --- onwards

    def _onwards(self, kind: str, met: Met) -> list[tuple[str, Paths]]:
        """One way for each path, chosen by how much of even light the lobes give back."""
        ways = self._ways(kind, met)
        size = np.array([np.abs(k).max(0) for _, k, _ in ways])
        whole = size.sum(0)
        choice = (self._random.random(len(whole)) * whole >= np.cumsum(size, 0)).sum(0)
        found = []
        for number, (next_kind, _, leave) in enumerate(ways):
            index = np.flatnonzero(choice == number)
            if len(index):
                child = leave(met, index).weighed(whole[index] / size[number, index])
                found.append((next_kind, self._survivors(child)))
        return found

    def _ways(self, kind: str, met: Met) -> list[tuple[str, Array, Leave]]:
        """How paths may go on: as what, what is given of light from there, (3, m), and how."""
        coefficients, scattered = met.coefficients, thrown(met)
        if self._bounces is not None:
            scattered = np.where(met.paths.scattered < self._bounces, scattered, 0.0)
        return [
            ("scattered", scattered, scatter(self._random)),
            (kind, coefficients.transparent, straight_on),
            *(("mirror", *mirrored(met, term)) for term in coefficients.mirrors),
            *(("transmission", *transmitted(met, term)) for term in coefficients.refractions),
        ]

    def _survivors(self, paths: Paths) -> Paths:
        """Those that Russian roulette leaves."""
        size = np.abs(paths.weight).max(0)
        odds = np.where(paths.scattered > CERTAIN, np.minimum(size, LIKELIEST), 1.0)
        go = np.flatnonzero((size > 0) & (self._random.random(len(size)) < odds))
        return paths.take(go).weighed(1 / odds[go])


def camera_paths(camera: Camera, offsets: Array) -> Paths:
    """Through the pixels, row by row from the bottom, again and again, at these offsets (2, n) from
    their middles.
    """
    width, height = camera.resolution
    left, right, bottom, top = camera.window
    row, column = np.divmod(np.arange(offsets.shape[1]) % (width * height), width)
    u = left + (column + 0.5 + offsets[0]) * (right - left) / width
    v = bottom + (row + 0.5 + offsets[1]) * (top - bottom) / height
    axes = np.asarray(camera.world_from_camera, np.float64)[:, :3]
    one, zero = np.ones_like(u), np.zeros_like(u)
    is_parallel = camera.kind == "ORTHOGRAPHIC"
    start = np.stack([u, v, zero]) if is_parallel else np.zeros((3, len(u)))
    along = np.stack([zero, zero, -one]) if is_parallel else np.stack([u, v, -one])
    d = transform(axes, along)
    size = length(d)
    near, far = camera.clip_start * size, camera.clip_end * size
    pixel = np.arange(len(u))
    weight = np.ones((3, len(u)))
    return Paths(transform(axes, start), d / size, near, far, weight, pixel, 0 * pixel)


def add_light(light: Array, paths: Paths, radiance: Array) -> None:
    """Adds T times radiance (3, n) to the pixels of the paths."""
    add_at(light, paths.pixel, paths.weight * radiance)
