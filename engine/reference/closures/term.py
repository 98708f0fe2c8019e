"""A lobe at points of surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...closures import CLOSURES
from ...evaluation.surface import Surface
from ...linear.columns import pick
from ...scene import Lobe

Array = np.ndarray


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

    @property
    def has_width(self) -> bool:
        """Whether it is a highlight whose masking is its width."""
        return self.lobe.kind == "SPECULAR" and self.lobe.distribution != "BLINN_PHONG"

    @property
    def is_matt(self) -> bool:
        return CLOSURES[self.lobe.kind].counts == "MATT"

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


def taken(number: Array | float, chosen: Array | slice) -> Array | float:
    """The places `chosen` of a number that differs from point to point, or the one for all."""
    return number[chosen] if isinstance(number, np.ndarray) else number
