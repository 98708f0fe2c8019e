"""What surfaces do with paths: what lobes give of a light, where paths go on from them, and with
which weight.

Letters as in `path_tracer`: G what lobes give of light from l, times π; n m points, k coefficients.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np

from glint.engine.evaluation.surface import Surface
from glint.engine.linear.columns import add_at, dot, pick
from glint.engine.program.execute.inputs import fresnel_dielectric as fresnel
from glint.engine.reference.bumps import bump_shadow, lifted
from glint.engine.reference.closures import Term, taken
from glint.engine.reference.coefficients import Coefficients
from glint.engine.reference.lobe_light import highlights, matt_lobes
from glint.engine.reference.optics import reflected, refracted
from glint.engine.reference.rays import IncoherentRays
from glint.engine.reference.terminator import lowered
from path_lamps import around

Array = np.ndarray

MOST_GLOSSY = 0.9
"""Share of the directions that highlights draw where all of a surface shines."""


@dataclass(frozen=True, eq=False)
class Paths:
    """n paths on their way. o, d: (3, n) the last point and the unit direction; hits count where
    near < t < far, (n,) each.  weight: (3, n) T.  pixel: (n,).  scattered: (n,) how often so far.
    """

    o: Array
    d: Array
    near: Array
    far: Array
    weight: Array
    pixel: Array
    scattered: Array

    def __len__(self) -> int:
        return len(self.pixel)

    def take(self, index: Array) -> Paths:
        """Those at these places."""
        return Paths(*(getattr(self, f.name).take(index, -1) for f in fields(self)))

    def weighed(self, k: Array) -> Paths:
        """With T times k, (n,) or (3, n)."""
        return replace(self, weight=self.weight * k)

    @property
    def rays(self) -> IncoherentRays:
        return IncoherentRays.of(self.o, self.d, self.near, self.far)

    @staticmethod
    def together(parts: list[Paths]) -> Paths:
        """All of them."""
        columns = ([getattr(part, f.name) for part in parts] for f in fields(Paths))
        return Paths(*(np.concatenate(column, -1) for column in columns))


@dataclass(frozen=True, eq=False)
class Met:
    """m points at which paths meet surfaces. paths: those, one for each point.  depth: (m,)."""

    paths: Paths
    depth: Array
    surface: Surface
    coefficients: Coefficients

    def __len__(self) -> int:
        return len(self.paths)


Leave = Callable[[Met, Array], Paths]
"""How the paths at some of the points (k,) go on, weighed by what is given of light from there."""


def given(met: Met, direction: Array) -> Array:
    """(3, m) G of unit directions (3, m) to light, one for each point."""
    surface, coefficients = met.surface, met.coefficients
    every, cosine = np.arange(len(met)), dot(surface.n, direction)
    matt = coefficients.diffuse * np.maximum(cosine, 0.0)
    matt = matt + matt_lobes(surface, coefficients, every, direction)
    hidden, share = bump_shadow(surface.n, surface.unbent, surface.bump, direction)
    shine = highlights(surface, coefficients.highlights, every, direction)
    low = lowered(surface.lowering, cosine)
    return np.where(hidden, 0.0, low * share * matt + shine)


def thrown(met: Met) -> Array:
    """(3, m) about what of even light the points scatter."""
    return met.coefficients.matt() + met.coefficients.glossy()


def scatter(random: np.random.Generator) -> Leave:
    """In a direction drawn from the cosine or from a highlight, weighed by G over π and over how
    densely such directions fall, a steradian (one-sample balance heuristic, Veach 1997).
    """

    def leave(met: Met, index: Array) -> Paths:
        some = taken_points(met, index)
        shares = glossy_shares(some)
        l = _drawn(some, shares, random)  # noqa: E741, the notes' letter
        density = _density(some, shares, l)
        k = given(some, l) / np.pi / np.where(density > 0, density, 1.0)
        good = (density > 0) & (dot(some.surface.g, l) > 0)
        child = leaving(some, l).weighed(np.where(good, k, 0.0))
        return replace(child, scattered=child.scattered + 1)

    return leave


def taken_points(met: Met, index: Array) -> Met:
    """The points at these places, in rising order."""
    return Met(
        met.paths.take(index),
        met.depth[index],
        met.surface.take(index),
        _some(met.coefficients, index),
    )


def _some(coefficients: Coefficients, index: Array) -> Coefficients:
    """Of the points at these places: what scatters."""
    diffuse = pick(coefficients.diffuse, index)
    none = np.zeros_like(diffuse)
    shine, sheens = (
        [_some_of_term(term, index) for term in terms]
        for terms in (coefficients.highlights, coefficients.sheens)
    )
    return Coefficients(none, diffuse, none, none, none, none, shine, [], [], sheens, [])


def _some_of_term(term: Term, index: Array) -> Term:
    at = np.searchsorted(index, term.index)
    is_there = (at < len(index)) & (index[np.minimum(at, len(index) - 1)] == term.index)
    place = np.flatnonzero(is_there)
    return replace(term.take(place), index=at[place])


def glossy_shares(met: Met) -> Array:
    """(t, m) share of the directions that each highlight draws; the cosine draws the others."""
    terms = met.coefficients.highlights
    size = np.zeros((len(terms), len(met)))
    for row, term in zip(size, terms, strict=True):
        row[term.index] = np.abs(term.k).max(0) * 8 / (_drawn_exponent(term) + 2)
    glossy, matt = size.sum(0), np.abs(met.coefficients.matt()).max(0)
    whole = np.where(glossy > 0, glossy, 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(glossy > 0, np.minimum(glossy / (glossy + matt), MOST_GLOSSY), 0.0)
    return size / whole * share


def _drawn_exponent(term: Term) -> Array | float:
    """Of the half vectors that a highlight draws: any way, where it has none."""
    return term.numbers.get("exponent", 0.0)


def _drawn(met: Met, shares: Array, random: np.random.Generator) -> Array:
    """(3, m) unit directions."""
    surface = met.surface
    u, v, choice = random.random((3, len(met)))
    l = around(surface.n, np.sqrt(1 - u), v)  # noqa: E741, the notes' letter
    ends = np.cumsum(shares, 0)
    for term, end, share in zip(met.coefficients.highlights, ends, shares, strict=True):
        at = np.flatnonzero((choice < end)[term.index] & (choice >= end - share)[term.index])
        if not len(at):
            continue
        points, p = term.index[at], taken(_drawn_exponent(term), at)
        h = around(pick(term.normals(surface), at), (1 - u[points]) ** (1 / (p + 1)), v[points])
        l[:, points] = reflected(-pick(surface.v, points), h)
    return l


def _density(met: Met, shares: Array, l: Array) -> Array:  # noqa: E741, the notes' letter
    """(m,) how densely, a steradian, `_drawn` gives the directions l (3, m)."""
    surface = met.surface
    density = (1 - shares.sum(0)) * np.maximum(dot(surface.n, l), 0.0) / np.pi
    for term, share in zip(met.coefficients.highlights, shares, strict=True):
        k, n, p = term.index, term.normals(surface), _drawn_exponent(term)
        h = pick(surface.v, k) + pick(l, k)
        size = np.sqrt(dot(h, h))
        with np.errstate(divide="ignore", invalid="ignore"):
            nh = np.clip(dot(n, h) / size, 0.0, 1.0)
            own = (p + 1) / (2 * np.pi) * nh**p / (2 * size)  # v·h is half of |v + l|
        density[k] += share[k] * np.where(size > 0, own, 0.0)
    return density


def leaving(met: Met, d: Array) -> Paths:
    """All paths along unit d (3, m), clear of the surface on the side that d points to."""
    surface, paths = met.surface, met.paths
    side = np.where(dot(d, surface.g) < 0, -1.0, 1.0)
    origin = surface.x + side * surface.offset * surface.g
    zero = np.zeros(len(met))
    return replace(paths, o=origin, d=d, near=zero, far=zero + np.inf)


def straight_on(met: Met, index: Array) -> Paths:
    """The same rays beyond transparent surfaces."""
    paths, surface = met.paths.take(index), met.surface.take(index)
    incline = np.maximum(np.abs(dot(surface.g, paths.d)), 1e-6)
    further = replace(paths, near=met.depth[index] + surface.offset / incline)
    return further.weighed(pick(met.coefficients.transparent, index))


# --- mirrors and glass


def mirrored(met: Met, term: Term) -> tuple[Array, Leave]:
    """(3, m) what of a MIRROR lobe's light is given, and how paths go on."""
    surface, n = _of_term(met, term)
    k = np.zeros((3, len(met)))
    add_at(k, term.index, term.k * _reflectance(surface, n, term))
    return k, _along(term, reflected(-surface.v, n), k)


def transmitted(met: Met, term: Term) -> tuple[Array, Leave]:
    """The same of a clear REFRACTION lobe, nothing at total reflection."""
    surface, n = _of_term(met, term)
    d, passes = refracted(-surface.v, n, _relative_index(surface, term))
    share = 1 - _reflectance(surface, n, term) if term.lobe.fresnel else 1.0
    k = np.zeros((3, len(met)))
    add_at(k, term.index, np.where(passes, term.k * share, 0.0))
    return k, _along(term, d, k)


def _of_term(met: Met, term: Term) -> tuple[Surface, Array]:
    """Its points, and normals that mirror what is above the surface."""
    surface = met.surface.take(term.index)
    return surface, lifted(term.normals(met.surface), surface.g, surface.v)


def _along(term: Term, d: Array, k: Array) -> Leave:
    """d: (3, t) for the points of the term."""

    def leave(met: Met, index: Array) -> Paths:
        some = taken_points(met, index)
        directions = pick(d, np.searchsorted(term.index, index))
        return leaving(some, directions).weighed(pick(k, index))

    return leave


def _reflectance(surface: Surface, n: Array, term: Term) -> Array | float:
    if not term.lobe.fresnel:
        return 1.0
    return fresnel(dot(surface.v, n), _relative_index(surface, term))


def _relative_index(surface: Surface, term: Term) -> Array:
    """Beyond the surface over before it."""
    return np.where(surface.outside, term.ior, 1 / np.asarray(term.ior))
