"""What lobes give of light from one direction, summed over the terms of a surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from . import stretching
from .coefficients import Coefficients, Term, taken
from .lights import LightSample
from .optics import (
    blinn_phong,
    fibre_diffuse,
    fibre_highlight,
    gloss,
    lost_once,
    oren_nayar,
    sheen,
    toon,
)
from .surface import Surface
from .terminator import lowered
from .vectors import add_at, dot, length, pick, unit

Array = np.ndarray


def highlight(
    term: Term,
    chosen: Array | slice,
    n: Array,
    v: Array,
    l: Array,  # noqa: E741, the notes' letter
) -> Array:
    """(m,) max(0, n·h)^p of a SPECULAR lobe with all that it is times, at the places `chosen` (m,)
    of the term's points; 0 where n·l is not above 0. n: the points', where it has none of its own.
    """
    lobe = term.lobe
    n = n if term.normal is None else term.normal[:, chosen]
    if lobe.kind == "TOON_SPECULAR":
        return _toon_highlight(term, chosen, n, v, l)
    power = blinn_phong(n, v, l, taken(term.exponent, chosen)) * gloss(
        n,
        v,
        l,
        taken(term.masking, chosen),
        taken(term.ior, chosen),
        lobe.fresnel,
        lobe.schlick,
        lobe.edge,
    )
    if term.stretch is not None:
        t = term.stretch[:, chosen]
        factor = stretching.power(n, t, v + l, taken(term.exponent, chosen), 4)
        factor = factor * stretching.masking(n, t, v, l, taken(term.masking, chosen))
        ior = taken(term.ior, chosen)
        factor = factor * gloss(n, v, l, 0.0, ior, lobe.fresnel, lobe.schlick, lobe.edge)
        power = np.where(t.any(0), factor, power)
    if term.lowering is not None:
        power = power * lowered(term.lowering[chosen], dot(n, l))
    return np.where(dot(n, l) > 0, power, 0.0)


def is_toon(term: Term) -> bool:
    return term.lobe.kind.startswith("TOON")


def _toon_highlight(term: Term, chosen: Array | slice, n: Array, v: Array, l: Array) -> Array:  # noqa: E741
    """Round the mirrored ray."""
    mirrored = 2 * dot(n, v) * dot(n, l) - dot(v, l)
    power = toon(mirrored, **term.numbers_at(chosen))
    if term.lowering is not None:
        power = power * lowered(term.lowering[chosen], dot(n, l))
    return np.where((dot(n, l) > 0) & (dot(n, v) > 0), power, 0.0)


def highlights(surface: Surface, terms: list[Term], seen: Array, direction: Array) -> Array:
    """Σ k_s max(0, n·h)^p at the points `seen` (m,) of the surface, of light from `direction`
    (3, m).
    """
    return _summed(highlight, surface, terms, seen, direction)


def matt_lobes(
    surface: Surface, coefficients: Coefficients, seen: Array, direction: Array
) -> Array:
    """The same of SHEEN, TOON_DIFFUSE, OREN_NAYAR and FIBRE_DIFFUSE lobes."""
    total = _sheens(surface, coefficients.sheens, seen, direction)
    if not coefficients.fibres:
        return total
    return total + fibres(surface, coefficients.fibres, seen, direction, matt=True)


def ways_through(
    surface: Surface, terms: list[Term], seen: Array, sample: LightSample
) -> Array | None:
    """(m,) how far light goes through fibres at the points `seen` that let it through: chords of
    cylinders; 0 where it comes from before. None where nothing lets any through.
    """
    found = None
    for term in (term for term in terms if term.lobe.kind == "FIBRE_TRANSMISSION"):
        thick = np.zeros((3, len(surface)))
        thick[:, term.index] = term.fibre
        t, l = pick(thick, seen), sample.direction  # noqa: E741, the notes' letter
        behind = np.maximum(-dot(pick(surface.n, seen), l), 0.0)
        way = length(t) * behind / np.maximum(1 - dot(unit(t), l) ** 2, 1 / 64)
        way = np.where(way < 2.0**60, way, 0.0)
        found = way if found is None else np.maximum(found, way)
    return found


def fibres(surface: Surface, terms: list[Term], seen: Array, direction: Array, matt: bool) -> Array:
    """The same of FIBRE_DIFFUSE lobes, or of the others."""

    def lobe(term: Term, chosen: Array, n: Array, v: Array, l: Array) -> Array:  # noqa: E741
        assert term.fibre is not None
        cosine, t = dot(n, l), pick(term.fibre, chosen)
        if matt:
            return np.where(cosine > 0, fibre_diffuse(t, l), 0.0)
        behind = term.lobe.kind == "FIBRE_TRANSMISSION"
        given = fibre_highlight(t, v, l, behind=behind, **term.numbers_at(chosen))
        return np.where((cosine < 0) if behind else (cosine > 0), given, 0.0)

    chosen = [term for term in terms if (term.lobe.kind == "FIBRE_DIFFUSE") == matt]
    return _summed(lobe, surface, chosen, seen, direction)


def _sheens(surface: Surface, terms: list[Term], seen: Array, direction: Array) -> Array:
    def lobe(term: Term, chosen: Array, n: Array, v: Array, l: Array) -> Array:  # noqa: E741
        return np.where(dot(n, l) > 0, _matt(term, chosen, n, v, l), 0.0)

    return _summed(lobe, surface, terms, seen, direction)


def _matt(term: Term, chosen: Array | slice, n: Array, v: Array, l: Array) -> Array:  # noqa: E741
    kind, nl = term.lobe.kind, dot(n, l)
    if kind == "OREN_NAYAR":
        return oren_nayar(n, v, l)
    if kind == "OREN_NAYAR_MULTIPLE":
        return nl * lost_once(nl) * lost_once(dot(n, v))
    numbers = term.numbers_at(chosen)
    return toon(nl, **numbers) if kind == "TOON_DIFFUSE" else sheen(n, v, l, **numbers)


def _summed(
    lobe: Callable[[Term, Array, Array, Array, Array], Array],
    surface: Surface,
    terms: list[Term],
    seen: Array,
    direction: Array,
) -> Array:
    total = np.zeros((3, len(seen)))
    if not terms or not len(seen):
        return total
    place = np.full(seen.max() + 1, -1)
    place[seen] = np.arange(len(seen))
    for term in terms:
        known = term.index <= seen.max()
        chosen = np.flatnonzero(known)[place[term.index[known]] >= 0]
        here, at = term.index[chosen], place[term.index[chosen]]
        k = term.k if term.k.shape[1] == 1 else pick(term.k, chosen)
        n, v = pick(surface.n, here), pick(surface.v, here)
        add_at(total, at, k * lobe(term, chosen, n, v, pick(direction, at)))
    return total


def is_apart(term: Term, surface: Surface) -> Array | bool:
    """(m,) bool: where a lobe is of a fibre, has an edge, another normal than the point, or is
    stretched.
    """
    if term.fibre is not None or is_toon(term):
        return True
    other = (term.normals(surface) != pick(surface.n, term.index)).any(0)
    return other if term.stretch is None else other | term.stretch.any(0)
