"""Rays on their way from a pixel: what they weigh, where they go on from a surface (notes, section
4.17).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..evaluation.surface import Surface
from ..linear.columns import add_at, dot, pick
from ..program.execute.inputs import fresnel_dielectric
from ..settings import Settings
from .bumps import lifted
from .closures import Term
from .closures.microfacet import drawn_size, facets_shown, reflectance, sample
from .coefficients import BOUNCED_EXPONENT, Coefficients
from .lights import LightPoint
from .optics import reflected, refracted
from .rays import IncoherentRays, Rays
from .resolve import MIRRORED, REFRACTED

if TYPE_CHECKING:
    from .stage import Stage

Array = np.ndarray
MOST_STRAIGHT = 128
"""Surfaces in a row that a ray passes and that let only some of it through."""
MOST_REFRACTIONS = 31
"""That are counted."""
COLUMNS = ("pixel", "straight", "skyless", "widest", "refractions", "refracted", "share")
"""(n,) each, of `Paths`."""


SPLITS, LEAST_WEIGHT = 2, 1 / 8
"""Mirror and glass send all of their rays after so many bounces; then those that weigh less than
that by chance.
"""
GOLDEN, BY_DEPTH, BY_GLASS = 0.6180339887498949, 0.7548776662466927, 0.5698402909980532
"""Steps of numbers that are spread evenly (Roberts 2018, The unreasonable effectiveness of
quasirandom sequences).
"""


@dataclass(frozen=True, eq=False)
class Paths:
    """n rays of one depth. weight: (3, n) T. pixel: (n,). straight: (n,) surfaces passed in a row
    that dim it. reflections: how often they were reflected by rough surfaces; from the first time
    on they see no lights: these have highlights there, and points of them in mirrors beyond would
    be dots. skyless: (n,) bool, they do not see the surroundings, which the shadow rays of the
    rough surface that they come from do. widest: (n,) the largest exponent of highlights that they
    meet, that of the narrowest lobe of the roughest surface on their way. refractions: (n,) how
    many of their bounces were refractions, refracted: (n,) bool, the last one was. share: (n,) the
    probability with which mirrors and glass would send them, if each chose one ray. transmitted:
    the first surface that they left refracted them, where passes ask for that. through_glass: they
    obey `visible_transmission`, where that is not `visible_mirror` of all instances and lights.
    gathers: what is matt scattered them last: they look for surfaces that throw light on. bounced:
    how often it did so far. in_medium: a medium did so first. caught: they bring light to a catcher
    of shadows, "with all" things there or "alone", as if catchers were the only ones. comes_out:
    they end where light comes out that went below other points.
    """

    rays: Rays
    weight: Array
    pixel: Array
    straight: Array
    depth: int
    skyless: Array
    widest: Array
    refractions: Array
    refracted: Array
    share: Array
    reflections: int = 0
    transmitted: bool = False
    gathers: bool = False
    bounced: int = 0
    through_glass: bool = False
    in_medium: bool = False
    caught: str = ""
    comes_out: bool = False

    def __len__(self) -> int:
        return len(self.pixel)

    def take(self, index: Array) -> Paths:
        """Those at these places."""
        some = {name: getattr(self, name)[index] for name in COLUMNS}
        return replace(self, rays=self.rays.take(index), weight=self.weight[:, index], **some)

    @property
    def kind(self) -> str:
        """As programs and lights have it."""
        return "mirror" if self.depth else "camera"

    @property
    def visibility(self) -> str:
        """Which flag of an object they obey."""
        if self.gathers:
            return "diffuse"
        return "transmission" if self.through_glass else self.kind

    def image(self, is_rough_glass: Array) -> Array:
        """(n,) of `resolve.IMAGES` what shows the light that they bring by way of others, "" where
        that is blurred. is_rough_glass: (n,) bool, their pixels look through what is not clear.
        """
        if self.is_gloss:
            return np.full(is_rough_glass.shape, "")
        if self.transmitted:
            return np.where(is_rough_glass, "", REFRACTED)
        return np.full(is_rough_glass.shape, MIRRORED)

    @property
    def is_gloss(self) -> bool:
        """Whether rough surfaces reflected them."""
        return self.reflections > self.bounced

    def past(self, some: Array) -> Array:
        """(4, m) what programs read of these rays: bounces, surfaces that dim passed since,
        refractions among the bounces, 1 where the last was one.
        """
        columns = (self.straight, np.minimum(self.refractions, MOST_REFRACTIONS), self.refracted)
        past = [np.full(len(some), self.depth), *(column[some] for column in columns)]
        return np.array(past, np.float64)

    def part(self, name: str) -> str:
        """The part of the picture that they add to."""
        if self.gathers and self.depth == self.bounced:
            return "Diffuse"
        return "Mirror" if self.depth else name


def held_share(settings: Settings, paths: Paths, light: Array) -> Array:
    """(n,) what is left of the light (3, n) that rays of n pixels bring, one each at most, where it
    is more than they may.
    """
    share, total = np.ones(light.shape[1]), np.abs(light).sum(0)
    share[paths.pixel] = paths.share
    most = 3 * settings.clamp_indirect * share
    over = (total > most) & np.isfinite(total)
    is_near = not paths.depth or (paths.depth == 1 and not paths.reflections)
    if not settings.clamp_indirect or is_near or paths.caught or paths.comes_out:
        over = np.zeros_like(over)
    return np.where(over, most / np.where(over, total, 1.0), 1.0)


@dataclass(frozen=True, eq=False)
class Interaction:
    """m points at which rays meet surfaces, and what their lobes do there. hit: (m,) which of
    `paths` meet them.
    """

    paths: Paths
    hit: Array
    surface: Surface
    coefficients: Coefficients

    @property
    def weight(self) -> Array:
        """(3, m) T of the rays."""
        return pick(self.paths.weight, self.hit)

    @property
    def pixel(self) -> Array:
        """(m,)"""
        return self.paths.pixel[self.hit]


def camera_paths(rays: Rays, seen: Array) -> Paths:
    """Camera rays, one for each pixel. seen: (n,) their weights."""
    n = len(rays)
    zero = np.zeros(n, np.intp)
    no, widest = np.zeros(n, bool), np.full(n, np.inf)
    one = np.ones(n)
    return Paths(rays, np.tile(seen, (3, 1)), np.arange(n), zero, 0, no, widest, zero, no, one)


def met(paths: Paths, hit: Array, surface: Surface) -> Surface:
    """The surface that the rays `hit` meet, with what programs read of these."""
    return replace(surface, past=paths.past(hit))


def joined(paths: list[Paths]) -> Paths:
    """Paths of one depth and past as one."""
    parts = [p.rays for p in paths]
    origin, direction = (
        np.concatenate([getattr(b, name) for b in parts], 1) for name in ("origin", "direction")
    )
    near, far = (np.concatenate([getattr(b, name) for b in parts]) for name in ("near", "far"))
    rays = IncoherentRays.of(origin, direction, near, far)
    weight = np.concatenate([p.weight for p in paths], 1)
    columns = {name: np.concatenate([getattr(p, name) for p in paths]) for name in COLUMNS}
    return replace(paths[0], rays=rays, weight=weight, **columns)


def straight_on(at: Interaction, depth: Array, wanted: Array) -> Paths | None:
    """The same rays beyond transparent surfaces. wanted: (m,) bool, go on for data."""
    paths, hit, surface, k = at.paths, at.hit, at.surface, at.coefficients.transparent
    weight = at.weight * k
    go = np.flatnonzero(
        (weight.any(0) | (wanted & k.any(0))) & (paths.straight[hit] < MOST_STRAIGHT)
    )
    if not len(go):
        return None
    mine = hit[go]
    gone = paths.take(mine)
    return replace(
        gone,
        rays=beyond(gone.rays, surface.take(go), depth[go]),
        weight=pick(weight, go),
        straight=gone.straight + (pick(k, go) != 1).any(0),
    )


def beyond(rays: Rays, surface: Surface, depth: Array) -> Rays:
    """The rays (m,) that meet `surface` at `depth`, clear of it on the other side."""
    _, d = rays.lines(np.arange(len(rays)))
    incline = np.abs(dot(surface.g, d))
    return replace(
        rays, near=depth + surface.offset / np.maximum(incline, 1e-6 * np.sqrt(dot(d, d)))
    )


def bounced(stage: Stage, at: Interaction, sample: int) -> list[Paths]:
    """Mirror and refraction rays, one bounce deeper, but for those that weigh less than the
    cutoff.
    """
    cutoff, held = stage.settings.cutoff, stage.settings.clamp_indirect > 0
    mirrored: list[Paths] = list(_mirrored(at, cutoff, held))
    through: list[Paths] = []
    for paths in _refracted(stage, at, sample, cutoff, held):
        (through if paths.refracted.all() else mirrored).append(paths)
    if stage.glass_differs:
        through = [replace(paths, through_glass=True) for paths in through]
    if stage.interleaving > 1:
        mirrored = [_going_on(paths, sample, refracted=False) for paths in mirrored]
        through = [_going_on(paths, sample, refracted=True) for paths in through]
    return [paths for paths in (*mirrored, *through) if len(paths)]


def sent(stage: Stage, at: Interaction) -> list[Paths]:
    """All refraction rays, then all mirror rays, lobe by lobe, whatever they weigh."""
    return [*_refracted(stage, at, 0, 0.0, False), *_mirrored(at, 0.0, False)]


def _going_on(paths: Paths, sample: int, *, refracted: bool) -> Paths:
    """All of them after few bounces; then those that weigh enough, and of others a part, which
    stands for them all (Russian roulette: Arvo, Kirk 1990), by a number of the sample and of how
    each came to the surface. What that mirrors and what goes through count from opposite ends, so
    that of two halves just one goes on.
    """
    if paths.depth <= SPLITS:
        return paths
    glass = np.minimum(paths.refractions - int(refracted), MOST_REFRACTIONS)
    at = GOLDEN * sample + BY_DEPTH * paths.depth + BY_GLASS * glass
    at = at - np.floor(at)
    share = np.minimum(np.abs(paths.weight).max(0) / LEAST_WEIGHT, 1.0)
    goes = at < share if refracted else at >= 1 - share
    # fewer rays bring as much, and are held as much less
    paths = replace(paths, weight=paths.weight / share, share=paths.share / share)
    return paths.take(np.flatnonzero(goes))


def _mirrored(at: Interaction, cutoff: float, shares: bool) -> Iterator[Paths]:
    """Rays that mirrors reflect, those round each normal together. shares: with `Paths.share`."""
    surface, mirrors = at.surface, at.coefficients.mirrors
    past = replace(at.paths, skyless=np.zeros(len(at.paths), bool))
    for output in dict.fromkeys(term.lobe.normal_output for term in mirrors):
        k, n = np.zeros((3, len(surface))), surface.n.copy()
        for term in mirrors:
            if term.lobe.normal_output == output:
                add_at(k, term.index, term.k * _reflectance(surface, term))
                n[:, term.index] = _lifted(surface, term)
        go = np.flatnonzero(k.any(0))
        some, n = surface.take(go), pick(n, go)
        d = reflected(-some.v, n)
        share = _shares(at, go, pick(k, go)) if shares else 1.0
        yield leaving(past, at.hit[go], some, d, pick(k, go), cutoff, share)


def _shares(at: Interaction, index: Array, k: Array) -> Array:
    """(m,) which part k (3, m) is of what the points of that index give back: largest channels."""
    coefficients = at.coefficients
    weight = _largest(at.weight)
    diffuse = _largest(at.weight * coefficients.diffuse)
    total = diffuse / np.where(weight > 0, weight, 1.0) + _largest(coefficients.transparent)
    for term in (*coefficients.mirrors, *coefficients.refractions):
        some, part = at.surface.take(term.index), _largest(term.k)
        if (term.lobe.fresnel or term.lobe.schlick) and not term.lobe.is_rough_glass:
            mirrored = _reflected_share(term, some, np.abs(dot(some.v, some.n)))
            part = part * (mirrored if term.lobe.kind == "MIRROR" else 1 - mirrored)
        np.add.at(total, term.index, part)
    own = _largest(k)
    return own / np.maximum(np.maximum(own, total[index]), 1e-300)


def _largest(color: Array) -> Array:
    return np.abs(color).max(0)


def _refracted(
    stage: Stage, at: Interaction, sample: int, cutoff: float, shares: bool
) -> Iterator[Paths]:
    """Rays that go through glass, and those that its facets mirror inside."""
    paths, surface = at.paths, at.surface
    skyless = np.zeros(len(paths), bool)
    past = replace(paths, skyless=skyless.copy())
    # shadow rays saw the surroundings through these materials
    skyless[at.hit] = paths.skyless[at.hit] & stage.shader.is_transparent(surface.material)
    transmitted = paths.transmitted or (stage.splits and paths.depth == 0)
    paths = replace(paths, skyless=skyless, transmitted=transmitted)
    point = stage.lobe_point(sample, paths.depth)
    for term in at.coefficients.refractions:
        some, n = surface.take(term.index), _lifted(surface, term)
        index = relative_index(some, term.ior)
        rough = np.broadcast_to(np.asarray(term.exponent) > 0, n[0].shape)
        m = np.where(rough, facet_normal(some.v, n, term, point), n)
        d, passes = refracted(-some.v, m, index)
        back = fresnel_dielectric(dot(some.v, m), index) if term.lobe.fresnel else 0.0
        # what goes to the wrong side of the face is lost, as in Cycles
        through = np.where(passes & (dot(d, some.g) < 0), 1 - back, 0.0)
        shown = np.where(rough, facets_shown(n, some.v, m, d, -1.0, term), 1.0)
        ways = [(paths, d, shown * through * term.k)]
        if term.lobe.fresnel and term.lobe.is_rough_glass:
            # what is mirrored inside goes on as well; from outside highlights do that
            d = reflected(-some.v, m)
            inside = rough & ~some.outside & (dot(d, n) > 0) & (dot(d, some.g) > 0)
            shown = facets_shown(n, some.v, m, d, 1.0, term)
            ways.append((past, d, np.where(inside, shown * back, 0.0) * term.k))
        for before, d, k in ways:
            go = np.flatnonzero(k.any(0))
            own, k = term.index[go], pick(k, go)
            share = _shares(at, own, k) if shares else 1.0
            gone = leaving(before, at.hit[own], some.take(go), pick(d, go), k, cutoff, share)
            yield gone if before is past else _counted(gone)


def gives(surface: Surface, coefficients: Coefficients) -> tuple[Array, Array, Array]:
    """(3, n) each: what of the light behind them mirrors and glass send on, with what Fresnel
    says, and of the latter what is not rough.
    """
    mirrored, refracted, clear = np.zeros((3, 3, len(surface)))
    for term in coefficients.mirrors:
        add_at(mirrored, term.index, term.k * _reflectance(surface, term))
    for term in coefficients.refractions:
        lost = _reflectance(surface, term) if term.lobe.fresnel else 0.0
        through = term.k * (1 - lost)
        add_at(refracted, term.index, through)
        is_rough = term.lobe.is_rough_glass & (np.asarray(term.exponent) > 0)
        add_at(clear, term.index, np.where(is_rough, 0.0, through))
    return mirrored, refracted, clear


def facet_normal(v: Array, n: Array, term: Term, point: LightPoint) -> Array:
    """(3, n) the half vector at the point of a rough lobe, on the viewer's side: of GGX as they are
    seen, else the facet of a V-shaped groove that is (Heitz, d'Eon 2014).
    """
    share = min(float(np.square(point.disc).sum()), 1 - 2.0**-53)
    h = sample(n, v, point, share, term.exponent, distribution=term.lobe.distribution)
    return np.where(dot(v, h) > 0, h, 2 * dot(n, h) * n - h)


def widened(coefficients: Coefficients, widest: Array) -> Coefficients:
    """With highlights whose exponents are at most `widest` (n,) at each point, and as bright in
    all: narrower ones would show points of lights as dots.
    """
    terms = []
    for term in coefficients.highlights:
        if term.lobe.kind != "SPECULAR":
            terms.append(term)
            continue
        own = np.broadcast_to(np.asarray(term.exponent, np.float64), term.index.shape)
        least = np.minimum(own, widest[term.index])
        wide = term.with_numbers(exponent=least)
        terms.append(replace(wide, k=term.k * (drawn_size(wide) / drawn_size(term))))
    return replace(coefficients, highlights=terms)


def relative_index(surface: Surface, ior: Array | float) -> Array:
    """Index of refraction beyond the surface over that before it; ior: that of its inside."""
    return np.where(surface.outside, ior, 1 / ior)


def _lifted(surface: Surface, term: Term) -> Array:
    """(3, m) normals of a lobe that sends rays on: mirrored at them these leave the surface."""
    some = surface.take(term.index)
    return lifted(term.normals(surface), some.g, some.v)


def _reflectance(surface: Surface, term: Term) -> Array | float:
    if not (term.lobe.fresnel or (term.lobe.kind == "MIRROR" and term.lobe.schlick)):
        return 1.0
    some = surface.take(term.index)
    return _reflected_share(term, some, dot(some.v, _lifted(surface, term)))


def _reflected_share(term: Term, some: Surface, cosine: Array) -> Array | float:
    """(m,) Fresnel factor of a lobe that sends rays on, at its points `some` and these cosines."""
    lobe = term.lobe
    index = term.ior if lobe.both_sides else relative_index(some, term.ior)
    return reflectance(cosine, index, lobe.fresnel, lobe.schlick, False)


def leaving(
    paths: Paths,
    hit: Array,
    surface: Surface,
    d: Array,
    k: Array,
    cutoff: float,
    share: Array | float = 1.0,
) -> Paths:
    """Rays from the surface along d, started clear of it on the side that d points to. share: (m,)
    of those that may leave, which they are.
    """
    weight = pick(paths.weight, hit) * k
    go = np.flatnonzero(weight.any(0) & ~(np.abs(weight).max(0) < cutoff))
    d = pick(d, go)
    side = np.where(dot(d, pick(surface.g, go)) < 0, -1.0, 1.0)
    origin = pick(surface.x, go) + side * surface.offset[go] * pick(surface.g, go)
    zero = np.zeros(len(go))
    rays = IncoherentRays.of(origin, d, zero, zero + np.inf)
    return Paths(
        rays,
        pick(weight, go),
        paths.pixel[hit[go]],
        np.zeros(len(go), np.intp),
        paths.depth + 1,
        paths.skyless[hit[go]],
        paths.widest[hit[go]],
        paths.refractions[hit[go]],
        np.zeros(len(go), bool),
        paths.share[hit[go]] * np.broadcast_to(share, hit.shape)[go],
        paths.reflections,
        transmitted=paths.transmitted,
        bounced=paths.bounced,
        in_medium=paths.in_medium,
        caught=paths.caught,
    )


def thrown_on(gone: Paths) -> Paths:
    """Rays from what paths met, as those along which light bounced."""
    return replace(
        gone,
        skyless=np.ones(len(gone), bool),
        widest=np.minimum(gone.widest, BOUNCED_EXPONENT),
        reflections=gone.reflections + 1,
        bounced=gone.bounced + 1,
        gathers=True,
    )


def _counted(paths: Paths) -> Paths:
    """One refraction more."""
    return replace(
        paths,
        refractions=paths.refractions + 1,
        refracted=np.ones(len(paths), bool),
    )
