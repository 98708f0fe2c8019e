"""Directions drawn from highlights that are narrower than the light (semantics/lights.md), where
its points alone would show as dots.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..evaluation.surface import Surface
from ..linear.columns import add_at, dot, length, pick
from .closures import Term, microfacet, taken, toon
from .coefficients import Coefficients
from .lights import LightPoint, LightSample, Source
from .terminator import mean_lowered, mean_lowered_gloss

Array = np.ndarray


class Reflections:
    """What draws one direction from lobes of any width, as a light does."""

    draws = 1.0

    def least_exponent(self, x: Array) -> Array:
        return np.zeros(x.shape[1])


def reflecting(terms: list[Term], which: str) -> list[Term]:
    """Those of the highlights that reflect other surfaces, as much of them as rays show: of metals,
    or of all that have GGX's masking. which: "METALS", "ALL" or "OFF".
    """
    if which == "OFF":
        return []
    chosen = [t for t in terms if (t.lobe.is_metallic if which == "METALS" else t.lobe.is_glossy)]
    return [replace(t, k=np.where(np.asarray(t.masking) > 0, t.k, 0.0)) for t in chosen]


def even_gloss(seen: Array, terms: list[Term], which: str = "OFF") -> Array:
    """(3, n) about what the highlights of dielectrics give back of even light at points that are
    seen at the cosines (n,): within 8 % down to 17 degrees off the surface, for roughnesses of 0.2
    to 0.6. Wide lobes are as if seen from less aslant. which: less what `reflecting` has of them;
    "NONE": of metals, too, where no rays show anything.
    TOON_SPECULAR ones give all that they do.
    """
    total = np.zeros((3, len(seen)))
    for term in terms:
        if term.lobe.kind == "TOON_SPECULAR":
            add_at(total, term.index, toon.directional_albedo(term) * term.k)
    for term in () if which == "ALL" else terms:
        if term.lobe.is_glossy and (term.lobe.fresnel or which == "NONE"):
            add_at(
                total, term.index, microfacet.directional_albedo(term, seen[term.index]) * term.k
            )
    return total


def ambient_seen(surface: Surface, coefficients: Coefficients) -> Array:
    """(3, n) AMBIENT lobes' k, less what surfaces that see light lower do not give back: gloss sees
    it aslant where it is seen so.
    """
    given, lowering = coefficients.ambient, surface.lowering
    if not (lowering > 1).any():
        return given
    of_gloss, left = np.zeros_like(given), np.zeros_like(given)
    for term in coefficients.highlights:
        if term.lobe.is_glossy:
            seen = dot(surface.n, surface.v)[term.index]
            k = microfacet.directional_albedo(term, seen) * term.k
            add_at(of_gloss, term.index, k)
            low = mean_lowered_gloss(lowering[term.index], seen, np.asarray(term.masking))
            add_at(left, term.index, low * k)
    whole = np.maximum(given, of_gloss)
    mean = mean_lowered(lowering)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(whole > 0, (left + mean * (whole - of_gloss)) / whole, mean)
    return np.where(lowering > 1, share, 1.0) * given


class Narrow:
    """Of n points of the surface the highlights narrower than a light. weight: (3, n) T of the rays
    that see the points. evenly: directions weigh by squares, as if one were drawn for each sample
    of the light, and are drawn from wider lobes too.
    """

    def __init__(
        self,
        surface: Surface,
        terms: list[Term],
        weight: Array,
        source: Source | Reflections,
        evenly: bool = False,
    ) -> None:
        self._surface, self._terms = surface, []
        self._draws, self._evenly = source.draws, evenly
        self._total = np.zeros(len(surface))
        least = source.least_exponent(surface.x) * (1 / 8 if evenly else 1.0)
        for term in (term for term in terms if term.lobe.kind == "SPECULAR"):
            k = np.where(
                term.exponent >= least[term.index],
                np.abs(term.k * pick(weight, term.index)).sum(0),
                0.0,
            )
            if k.any():
                self._terms.append((term, k, term.normals(surface)))
                self._total[term.index] += k / microfacet.drawn_size(term)

    def __bool__(self) -> bool:
        return bool(self._terms)

    def balance(self, seen: Array, sample: LightSample) -> Array:
        """(m,) the share of a highlight that the sample stands for, drawn or on the light: by how
        densely each of them falls there.
        """
        density = self.density(seen, sample.direction)
        if not self._evenly:
            return 1 / (1 + density * sample.spread)
        times = density / self._draws * sample.spread
        if not sample.drawn:
            return 1 / (1 + times * times)
        with np.errstate(divide="ignore"):
            return 1 / self._draws / (times + 1 / times)

    def density(self, seen: Array, direction: Array) -> Array:
        """(m,) how densely, a steradian and for each sample of the light, directions are drawn
        where `direction` (3, m) is from the points `seen` (m,).
        """
        towards, density = self._surface.v.copy(), np.zeros(len(self._surface))
        towards[:, seen] = direction
        for term, k, n in self._terms:
            l, v = pick(towards, term.index), pick(self._surface.v, term.index)  # noqa: E741
            density[term.index] += k * microfacet.density(term, n, v, l)
        size = length(self._surface.v + towards) * self._total
        spread = 4 * np.pi * size
        found = np.divide(density, spread, out=np.zeros_like(size), where=size > 0)[seen]
        return found * self._draws

    def draw(self, point: LightPoint) -> tuple[Array, Array, Array]:
        """(3, n) the direction in which the half vector at `point` of the lobes mirrors the ray,
        (n,) bool where there is one, and (n,) the largest exponent of these lobes.
        """
        x, y = point.disc
        at = (x * x + y * y) * self._total
        before, rest, exponent, narrowest = np.zeros((4, len(at)))
        axis, stretch = self._surface.n.copy(), np.zeros_like(self._surface.n)
        distribution = np.full(len(at), "BLINN_PHONG")
        for term, k, n in self._terms:
            index, p = term.index, term.exponent
            part = k / microfacet.drawn_size(term)
            here = (part > 0) & (at[index] >= before[index])
            chosen = index[here]
            rest[chosen] = (at[chosen] - before[chosen]) / part[here]
            exponent[chosen], axis[:, chosen] = taken(p, here), n[:, here]
            distribution[chosen] = term.lobe.distribution
            stretch[:, chosen] = 0.0 if term.stretch is None else term.stretch[:, here]
            before[index] += part
            narrowest[index] = np.maximum(narrowest[index], np.where(part > 0, p, 0.0))
        v = self._surface.v
        share = np.minimum(rest, 1 - 2.0**-53)
        h = microfacet.sample(axis, v, point, share, exponent, stretch, distribution)
        cosine = dot(v, h)
        return 2 * cosine * h - v, (self._total > 0) & (cosine > 0), narrowest
