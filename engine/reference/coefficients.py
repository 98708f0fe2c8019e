"""The notes' coefficients at points of surfaces, k_a, k_d, k_s and the rest, and the lobes that
cannot be summed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..scene import Lobe
from .optics import NEVER_LOST
from .surface import Surface
from .vectors import add_at, dot, pick

Array = np.ndarray

BOUNCED_EXPONENT, THROWN_EXPONENT = 8.0, 2.0
"""Largest exponent of gloss at what rays of bounced light meet: few would find a narrower lobe's
light, and show it as dots. Cycles' Filter Glossy of 1 comes to as much. That of mirrors there,
whose shape is lost in any case.
"""


@dataclass(frozen=True, eq=False)
class Term:
    """A lobe that needs a ray or a highlight, at m of the points: index (m,), k (3, m).

    numbers: the parameters of its kind by name (`engine.closures`), (m,) where the material's
    program gives them, else the lobe's own.  fibre: (3, m) the tangents of a FIBRE lobe, not 0.
    normal: (3, m) normals of its own, None where they are those of the points.  stretch: (3, m)
    what it is stretched along, across its normals, 0 where it is not; None for nowhere.
    lowering: (m,) as of `Surface`, of what gives back lamps' light; None for 1.  is_thrown: of a
    mirror, by which it throws light on.
    """

    index: Array
    k: Array
    lobe: Lobe
    numbers: Mapping[str, Array | float]
    fibre: Array | None = None
    normal: Array | None = None
    stretch: Array | None = None
    lowering: Array | None = None
    is_thrown: bool = False

    @property
    def exponent(self) -> Array | float:
        return self.numbers["exponent"]

    @property
    def masking(self) -> Array | float:
        return self.numbers["masking"]

    @property
    def ior(self) -> Array | float:
        return self.numbers["ior"]

    def with_numbers(self, **numbers: Array | float) -> Term:
        """With others in their places."""
        return replace(self, numbers={**self.numbers, **numbers})

    def numbers_at(self, chosen: Array | slice) -> dict[str, Array | float]:
        """Those at the places `chosen` of its points."""
        return {name: taken(number, chosen) for name, number in self.numbers.items()}

    def take(self, chosen: Array | slice) -> Term:
        """At the places `chosen` of its points alone, with these numbers of points."""

        def some(values: Array | None) -> Array | None:
            return None if values is None else values[..., chosen]

        return replace(
            self,
            index=self.index[chosen],
            k=self.k if self.k.shape[1] == 1 else self.k[:, chosen],
            numbers=self.numbers_at(chosen),
            fibre=some(self.fibre),
            normal=some(self.normal),
            stretch=some(self.stretch),
            lowering=some(self.lowering),
        )

    def normals(self, surface: Surface) -> Array:
        """(3, m) shading normals at its points."""
        return pick(surface.n, self.index) if self.normal is None else self.normal


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
            if term.lobe.kind not in ("FIBRE_SPECULAR", "FIBRE_TRANSMISSION"):
                add_at(total, term.index, _OF_COLOR.get(term.lobe.kind, 1.0) * term.k)
        return total

    def glossy(self) -> Array:
        """(3, n): about what of even light the highlights give back."""
        total = np.zeros_like(self.diffuse)
        for term in self.highlights:
            is_toon = term.lobe.kind == "TOON_SPECULAR"
            add_at(total, term.index, (1.0 if is_toon else 8 / (term.exponent + 2)) * term.k)
        return total + self.round_fibres()

    def round_fibres(self) -> Array:
        """(3, n): about what of even light FIBRE lobes but matt ones give back."""
        total = np.zeros_like(self.diffuse)
        for term in self.fibres:
            if term.lobe.kind != "FIBRE_DIFFUSE":
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
        matt = [term for term in self.fibres if term.lobe.kind == "FIBRE_DIFFUSE"]
        for term in (*self.mirrors, *self.refractions, *self.sheens, *matt):
            add_at(total, term.index, _OF_COLOR.get(term.lobe.kind, 1.0) * term.k)
        return total


_OF_COLOR = {"OREN_NAYAR": NEVER_LOST, "OREN_NAYAR_MULTIPLE": 0.0}
"""What of k counts as the colour of a surface: with its DIFFUSE lobe it is that of a smooth one."""


def taken(number: Array | float, chosen: Array | slice) -> Array | float:
    """The places `chosen` of a number that differs from point to point, or the one for all."""
    return number[chosen] if isinstance(number, np.ndarray) else number
