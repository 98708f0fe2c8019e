"""Directions sampled from the lobes of strands (SEMANTICS.md, Bounces)."""

from __future__ import annotations

import numpy as np

from .coefficients import Coefficients, Term, taken
from .optics import FibreAngles, sine
from .surface import Surface
from .vectors import basis_around, cross, dot, pick, unit

Array = np.ndarray


class FibreSampler:
    """Directions sampled from a FIBRE_SPECULAR or FIBRE_TRANSMISSION lobe at m points of its own:
    along the strand the tangent of half the angle to the mirrored cone is Student's of two degrees
    of freedom, round it that of half the angle to the viewer, or to behind, Cauchy's. Both have
    closed inverses, and tails above any power of a cosine, so that no weight is without bound
    (docs/decisions/0068-strands-by-paths.md).
    """

    def __init__(self, surface: Surface, term: Term, own: Array) -> None:
        """own: (m,) which of the term's points."""
        assert term.fibre is not None
        self._t, self._v = unit(pick(term.fibre, own)), pick(surface.v, term.index[own])
        self._tilt = term.numbers["tilt"]
        self._way = -1.0 if term.lobe.kind == "FIBRE_TRANSMISSION" else 1.0
        fan = np.asarray(taken(term.numbers["fan"], own), float)
        self._along2 = 1 / (np.asarray(taken(term.exponent, own)) + 1)
        self._round2 = 1 / (2 / np.where(fan > 0, fan, 1.0) + 1)

    def sample(self, disc: Array) -> Array:
        """(3, m) unit, at points (2, m) of the unit disc; 0 where that leads beyond the strand's
        end.
        """
        x, y = disc
        tilt, to_v = self._tilt, dot(self._t, self._v)
        across_v = sine(to_v)
        u = np.clip(x * x + y * y, 2.0**-40, 1 - 2.0**-40)
        tan = np.sqrt(self._along2 / (2 * u * (1 - u))) * (2 * u - 1)
        size = 1 / ((1 + tan * tan) * (1 + tilt * tilt))
        up = size * (2 * tan * (1 - tilt * tilt) - 2 * tilt * (1 - tan * tan))
        out = size * ((1 - tan * tan) * (1 - tilt * tilt) + 4 * tan * tilt)
        to_l, across_l = up * across_v - out * to_v, out * across_v + up * to_v
        aside = np.where(np.abs(y) > 2.0**-40, y, 2.0**-40)
        turn = np.sqrt(self._round2) * (np.sqrt(u) + x) / aside
        seen = across_v > 2.0**-20
        towards = (self._v - to_v * self._t) / np.where(seen, across_v, 1.0)
        first = np.where(seen, towards, basis_around(self._t)[0])
        part = self._way * across_l / (1 + turn * turn)
        beside = (1 - turn * turn) * first + 2 * turn * cross(self._t, first)
        return np.where(across_l > 0, to_l * self._t + part * beside, 0.0)

    def pdf(self, direction: Array) -> Array:
        """(m,) a steradian, of unit directions (3, m)."""
        along2, round2 = self._along2, self._round2
        at = FibreAngles(self._t, self._tilt, self._v, direction)
        a2, c2 = at.along * at.along, at.across * at.across
        far = 2 * along2 * c2 + a2
        c = self._way * np.clip(at.turned, -1.0, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            around = np.sqrt(round2) / (np.pi * (round2 * (1 + c) + (1 - c)))
            pdf = around * along2 * at.across * (c2 + a2) / (2 * far * np.sqrt(far) * at.across_l)
        return np.where((at.across > 0) & (at.across_l > 0), pdf, 0.0)


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
        if term.lobe.kind != "FIBRE_DIFFUSE"
    ]
    even, total = np.abs(weight * coefficients.diffuse).sum(0)[chosen], np.zeros(len(chosen))
    for _term, own, at, size in rounds:
        total[at] += size[own]
    for term in coefficients.fibres:
        if term.lobe.kind == "FIBRE_DIFFUSE":
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
        told = FibreSampler(surface, term, own).sample(disc[:, at])
        direction[:, at] = np.where(here, told, direction[:, at])
        with np.errstate(divide="ignore", invalid="ignore"):
            rest_of = np.minimum((asked[at] - before[at]) / some, 1 - 2.0**-53)
        left[at] = np.where(here, rest_of, left[at])
        before[at] += some
    pdf = np.where(dot(n, direction) > 0, even / (2 * np.pi), 0.0)
    for term, own, at, size in rounds:
        pdf[at] += size[own] * FibreSampler(surface, term, own).pdf(direction[:, at])
    return direction, pdf / total, left


def _placed(term: Term, place: Array) -> tuple[Array, Array]:
    """Which of the term's points are chosen, and where among these."""
    at = place[term.index]
    own = np.flatnonzero(at >= 0)
    return own, at[own]


def _size(weight: Array, term: Term) -> Array:
    """(m,) what a lobe gives of T, over the channels."""
    return np.abs(weight[:, term.index] * term.k).sum(0)
