"""Roughness that may vary over the surface: what follows from it, as sums and as lobes' numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ....engine.program.graph import Value
from .expressions import Expressions
from .roughness import SMALLEST, highlights, width
from .terms import RGB, Sum, constant

MIRROR_ROUGHNESS = 0.05
"""Up to here a glossy lobe is an ideal mirror: GGX's α = 0.0025 blurs a reflection by 0.14°, a
pixel or two of usual pictures.
"""
MOST_HIGHLIGHTS = 4
"""Lobes that stand for one of GGX."""
ROWS = 512
"""Of tables over roughness: linear in between, exponents are then right to 0.4 %."""


class Roughness:
    """One number from 0 to 1, or a program's value.

    number, color: what a function of roughness comes to, as a sum.
    """

    def __init__(self, value: float | Value, expressions: Expressions | None = None) -> None:
        self.value, self._expressions = value, expressions

    @property
    def varies(self) -> bool:
        return isinstance(self.value, Value)

    def mirrored(self) -> Sum:
        """1 where the surface is a mirror, else 0."""
        return self.number(lambda r: float(r <= MIRROR_ROUGHNESS))

    def rough(self) -> Sum:
        """1 where it is none."""
        return self.number(lambda r: float(r > MIRROR_ROUGHNESS))

    def is_mirror(self) -> bool:
        """Everywhere, for all that is known."""
        return not self.varies and self.value <= MIRROR_ROUGHNESS

    def number(self, of: Callable[[float], float]) -> Sum:
        if not self.varies:
            return constant(of(self.value))
        return self._expressions.sum_of(self._looked_up(of))

    def color(self, of: Callable[[float], RGB]) -> Sum:
        if not self.varies:
            return constant(of(self.value))
        parts = [self._looked_up(lambda r, c=c: of(r)[c]) for c in range(3)]
        return self._expressions.sum_of(self._expressions.apply("combine_xyz", *parts))

    def exponent(self, of: Callable[[float], float]) -> dict[str, Any]:
        """The exponent of a lobe, as `LobeKey` takes it."""
        return self._key("exponent", of)

    def highlights(self) -> list[tuple[dict[str, Any], Sum]]:
        """Exponent and masking of the lobes that stand for GGX, and what each is times."""
        masking = self._key("masking", width)
        if not self.varies:
            return [({"exponent": p, **masking}, constant(s)) for p, s in highlights(self.value)]

        def part(k: int, which: int) -> Callable[[float], float]:
            def of(r: float) -> float:
                lobes = highlights(max(r, MIRROR_ROUGHNESS))
                return lobes[k][which] if k < len(lobes) else 0.0

            return of

        return [
            ({**self.exponent(part(k, 0)), **masking}, self.number(part(k, 1)))
            for k in range(MOST_HIGHLIGHTS)
        ]

    def _key(self, name: str, of: Callable[[float], float]) -> dict[str, Any]:
        if not self.varies:
            return {name: of(self.value)}
        output = self._expressions.output(self._looked_up(of))
        return {name: max(map(of, _PLACES)), f"{name}_output": output}

    def _looked_up(self, of: Callable[[float], float]) -> Value:
        table = tuple(x for r in _PLACES for x in (0.0, 0.0, 0.0, float(of(r))))
        return self._expressions.looked_up(self.value, table)


_PLACES = [max(k / (ROWS - 1), SMALLEST) for k in range(ROWS)]
