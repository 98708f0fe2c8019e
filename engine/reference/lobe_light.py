"""What lobes give of light from one direction, summed over the terms of a surface."""

from __future__ import annotations

import numpy as np

from ..evaluation.surface import Surface
from ..linear.columns import add_at, dot, length, pick, unit
from .closures import Term, evaluate
from .coefficients import Coefficients
from .lights import LightSample

Array = np.ndarray


def highlights(surface: Surface, terms: list[Term], seen: Array, direction: Array) -> Array:
    """(3, m) Σ k times what the lobes give at the points `seen` (m,) of the surface, of light from
    `direction` (3, m).
    """
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
        add_at(total, at, k * evaluate(term, chosen, n, v, pick(direction, at)))
    return total


def matt_lobes(
    surface: Surface, coefficients: Coefficients, seen: Array, direction: Array
) -> Array:
    """The same of SHEEN, TOON_DIFFUSE, OREN_NAYAR and FIBRE_DIFFUSE lobes."""
    total = highlights(surface, coefficients.sheens, seen, direction)
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
    chosen = [term for term in terms if term.is_matt == matt]
    return highlights(surface, chosen, seen, direction)


def is_toon(term: Term) -> bool:
    return term.lobe.kind.startswith("TOON")


def is_apart(term: Term, surface: Surface) -> Array | bool:
    """(m,) bool: where a lobe is of a fibre, has an edge, another normal than the point, or is
    stretched.
    """
    if term.fibre is not None or is_toon(term):
        return True
    other = (term.normals(surface) != pick(surface.n, term.index)).any(0)
    return other if term.stretch is None else other | term.stretch.any(0)
