"""The notes' coefficients at points of surfaces, k_a, k_d, k_s and the rest, and the lobes that
cannot be summed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..linear.columns import add_at, dot, pick
from .closures import Term, albedo

Array = np.ndarray

BOUNCED_EXPONENT, THROWN_EXPONENT = 8.0, 2.0
"""Largest exponent of gloss at what rays of bounced light meet: few would find a narrower lobe's
light, and show it as dots. Cycles' Filter Glossy of 1 comes to as much. That of mirrors there,
whose shape is lost in any case.
"""


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Sums (3, n) of the lobes of n points, and the terms that cannot be summed.

    thrown: what mirrors are to light that goes on to what is matt, highlights.
    below: (3, n) what of the diffuse light comes out elsewhere, radius: (3, n) how far away, world
    units; None for nothing.
    """

    ambient: Array
    diffuse: Array
    translucent: Array
    emission: Array
    transparent: Array
    holdout: Array
    highlights: list[Term]
    mirrors: list[Term]
    refractions: list[Term]
    sheens: list[Term]
    fibres: list[Term]
    below: Array | None = None
    radius: Array | None = None
    thrown: list[Term] = field(default_factory=list)

    def without_thrown(self) -> Coefficients:
        """Without mirrors among the highlights."""
        return replace(self, highlights=[x for x in self.highlights if not x.is_thrown])

    def matt(self) -> Array:
        """(3, n): about what of even light all but these, mirrors and glass give back."""
        total = self.diffuse.copy()
        for term in (*self.sheens, *self.fibres):
            if term.is_matt:
                add_at(total, term.index, albedo(term) * term.k)
        return total

    def glossy(self) -> Array:
        """(3, n): about what of even light the highlights give back."""
        total = np.zeros_like(self.diffuse)
        for term in self.highlights:
            add_at(total, term.index, albedo(term) * term.k)
        return total + self.round_fibres()

    def round_fibres(self) -> Array:
        """(3, n): about what of even light FIBRE lobes but matt ones give back."""
        total = np.zeros_like(self.diffuse)
        for term in self.fibres:
            if not term.is_matt:
                add_at(total, term.index, term.k)
        return total

    def lets_through(self) -> Array:
        """(n,) bool: where light from behind is seen through fibres."""
        found = np.zeros(self.diffuse.shape[1], bool)
        for term in self.fibres:
            if term.lobe.kind == "FIBRE_TRANSMISSION":
                found[term.index] |= term.k.any(0)
        return found

    def turned_to(self, direction: Array) -> Array:
        """(n,) bool: where highlights with normals of their own see what is in these directions
        (3, n).
        """
        found = np.zeros(self.diffuse.shape[1], bool)
        for term in self.highlights:
            if term.normal is not None:
                is_before = dot(term.normal, pick(direction, term.index)) > 0
                found[term.index] |= is_before & term.k.any(0)
        return found

    def albedo(self) -> Array:
        """(3, n): about what of even light the points give back; mirrors and glass without what
        Fresnel says.
        """
        total = self.diffuse + self.translucent + self.glossy()
        matt = [term for term in self.fibres if term.is_matt]
        for term in (*self.mirrors, *self.refractions, *self.sheens, *matt):
            add_at(total, term.index, albedo(term) * term.k)
        return total
