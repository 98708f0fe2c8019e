"""Directions sampled from the lobes of strands (semantics/bounces.md)."""

from __future__ import annotations

import numpy as np

from ..evaluation.surface import Surface
from ..linear.columns import basis_around, dot, pick
from .closures import Term
from .closures.fibre import Sampler
from .coefficients import Coefficients

Array = np.ndarray


def sampled(
    surface: Surface,
    coefficients: Coefficients,
    weight: Array,
    chosen: Array,
    disc: Array,
    number: Array,
    fibres_alone: bool = False,
) -> tuple[Array, Array, Array]:
    """Where rays go on from the points `chosen` (m,) of strands: each from one lobe, chosen by how
    much of T = weight (3, n) it gives back; what is even gives evenly over the front's half of the
    sphere. disc: (2, m) of the unit disc. number: (m,) that chooses, of [0, 1). fibres_alone: what
    is even gives nothing. Returns (3, m) unit directions in the world, 0 for none, (m,) the pdf of
    all lobes together there, a steradian, and (m,) what is left of the numbers, of [0, 1).
    """
    place = np.full(len(surface), -1)
    place[chosen] = np.arange(len(chosen))
    rounds = [
        (term, *_placed(term, place), _size(weight, term))
        for term in coefficients.fibres
        if not term.is_matt
    ]
    even, total = np.abs(weight * coefficients.diffuse).sum(0)[chosen], np.zeros(len(chosen))
    for _term, own, at, size in rounds:
        total[at] += size[own]
    for term in coefficients.fibres:
        if term.is_matt:
            own, at = _placed(term, place)
            even[at] += _size(weight, term)[own]
    others = np.zeros(len(chosen), bool)
    for term in coefficients.sheens:
        own, at = _placed(term, place)
        others[at] |= _size(weight, term)[own] > 0
    for term in coefficients.highlights:
        if term.lobe.kind == "TOON_SPECULAR":
            own, at = _placed(term, place)
            others[at] |= _size(weight, term)[own] > 0
    even = np.zeros(len(chosen)) if fibres_alone else even + np.where(others, total, 0.0)
    even = np.where(even + total > 0, even, 1.0)
    total = even + total
    n, asked = pick(surface.n, chosen), number * total
    first, second = basis_around(n)
    x, y = disc
    rest = np.maximum(1 - x * x - y * y, 0.0)
    direction = rest * n + np.sqrt(1 + rest) * (x * first + y * second)
    with np.errstate(divide="ignore", invalid="ignore"):
        left = np.where(even > 0, asked / even, 0.0)
    before = even.copy()
    for term, own, at, size in rounds:
        some = size[own]
        here = (asked[at] >= before[at]) & (some > 0)
        told = Sampler(surface, term, own).sample(disc[:, at])
        direction[:, at] = np.where(here, told, direction[:, at])
        with np.errstate(divide="ignore", invalid="ignore"):
            rest_of = np.minimum((asked[at] - before[at]) / some, 1 - 2.0**-53)
        left[at] = np.where(here, rest_of, left[at])
        before[at] += some
    pdf = np.where(dot(n, direction) > 0, even / (2 * np.pi), 0.0)
    for term, own, at, size in rounds:
        pdf[at] += size[own] * Sampler(surface, term, own).pdf(direction[:, at])
    return direction, pdf / total, left


def _placed(term: Term, place: Array) -> tuple[Array, Array]:
    """Which of the term's points are chosen, and where among these."""
    at = place[term.index]
    own = np.flatnonzero(at >= 0)
    return own, at[own]


def _size(weight: Array, term: Term) -> Array:
    """(m,) what a lobe gives of T, over the channels."""
    return np.abs(weight[:, term.index] * term.k).sum(0)
