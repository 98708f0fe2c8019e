"""Roughness and indices of refraction that may vary over the surface: what follows from them, as
sums and as lobes' numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from ....engine.program.graph import Value
from .expressions import Expressions
from .fresnel import ior_from_reflectance, normal_reflectance
from .roughness import SMALLEST, width
from .terms import RGB, Sum, constant, constant_value, is_constant, multiply, scale

MIRROR_ROUGHNESS = 0.05
"""Up to here a glossy lobe is an ideal mirror: GGX's α = 0.0025 blurs a reflection by 0.14°, a
pixel or two of usual pictures.
"""
ROWS = 512
"""Of tables over roughness: linear in between, exponents are then right to 0.4 %."""


@dataclass(frozen=True)
class Of:
    """A function of roughness that many materials share: `what` of its arguments and that."""

    what: Callable[..., float]
    arguments: tuple[Any, ...] = ()

    def __call__(self, roughness: float) -> float:
        return self.what(*self.arguments, roughness)


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
        return self.number(Of(_is_mirror))

    def rough(self) -> Sum:
        """1 where the surface is no mirror, else 0."""
        return self.number(Of(_is_rough))

    def is_mirror(self) -> bool:
        """Whether the surface is known to be a mirror everywhere."""
        return not self.varies and self.value <= MIRROR_ROUGHNESS

    def number(self, of: Callable[[float], float]) -> Sum:
        if not self.varies:
            return constant(of(self.value))
        return self._expressions.sum_of(self._looked_up(of))

    def color(self, of: Callable[[float], RGB]) -> Sum:
        if not self.varies:
            return constant(of(self.value))
        columns = zip(*map(of, _PLACES), strict=True)
        found = (self._expressions.looked_up(self.value, tuple(map(float, c))) for c in columns)
        return self._expressions.sum_of(self._expressions.apply("combine_xyz", *found))

    def exponent(self, of: Callable[[float], float]) -> dict[str, Any]:
        """The exponent of a lobe, as `LobeKey` takes it."""
        return self._key("exponent", of)

    def microfacets(self) -> dict[str, Any]:
        """Distribution and width of a highlight, as `LobeKey` takes them."""
        return {"distribution": "GGX", **self._key("masking", Of(width))}

    def _key(self, name: str, of: Callable[[float], float]) -> dict[str, Any]:
        if not self.varies:
            return {name: of(self.value)}
        table = _table_of(of)
        return self._named(name, max(table), self._expressions.looked_up(self.value, table))

    def _named(self, name: str, most: float, value: Value) -> dict[str, Any]:
        return {name: most, f"{name}_output": self._expressions.output(value)}

    def _looked_up(self, of: Callable[[float], float]) -> Value:
        return self._expressions.looked_up(self.value, _table_of(of))


def _is_mirror(roughness: float) -> float:
    return float(roughness <= MIRROR_ROUGHNESS)


def _is_rough(roughness: float) -> float:
    return float(roughness > MIRROR_ROUGHNESS)


def _table(of: Callable[[float], float]) -> tuple[float, ...]:
    """A function's values at `_PLACES`."""
    return tuple(float(of(place)) for place in _PLACES)


_shared_table = lru_cache(maxsize=256)(_table)
"""Of functions that many materials share."""


def _table_of(of: Callable[[float], float]) -> tuple[float, ...]:
    return _shared_table(of) if isinstance(of, Of) else _table(of)


class Ior:
    """An index of refraction: one number above 0, or a program's value.

    number: the one; of what varies NOMINAL, by which shares of a uniform world go.  f0: the
    reflectance at normal incidence, as a sum.
    """

    NOMINAL = 1.5

    def __init__(self, value: float | Value, expressions: Expressions | None = None) -> None:
        self.varies = isinstance(value, Value)
        self.number = self.NOMINAL if isinstance(value, Value) else value
        self._value, self._expressions = value, expressions

    @property
    def value(self) -> Value:
        """The index, of which something is worked out."""
        return self._value if self.varies else self._expressions.constant(self.number)

    @property
    def key(self) -> dict[str, Any]:
        """The index of a lobe, as `LobeKey` takes it."""
        if not self.varies:
            return {"ior": self.number}
        return {"ior": self.number, "ior_output": self._expressions.output(self._value)}

    @property
    def f0(self) -> Sum:
        if not self.varies:
            return constant(normal_reflectance(self.number))
        return self._expressions.sum_of(self._f0())

    def over_rest(self, terms: Sum) -> Sum:
        """A sum over 1 - F0."""
        if not self.varies:
            return scale(terms, 1 / (1 - normal_reflectance(self.number)))
        do = self._expressions.math
        rest = do("MAXIMUM", do("SUBTRACT", 1.0, self._f0()), 1e-6)
        return multiply(terms, self._expressions.sum_of(do("DIVIDE", 1.0, rest)))

    def with_level(self, level: Sum) -> Ior:
        """That whose F0 is 2 level times this one's, as the specular level scales it."""
        if not self.varies and is_constant(level):
            amount = max(constant_value(level)[0], 0.0)
            if amount == 0.5:
                return self
            return Ior(ior_from_reflectance(normal_reflectance(self.number) * 2 * amount))
        do = self._expressions.math
        number = self._expressions.parts(self._expressions.value_of(level))[0]
        f0 = self._f0() if self.varies else normal_reflectance(self.number)
        scaled = do("MULTIPLY", do("MULTIPLY", f0, 2.0), number)
        held = do("MINIMUM", do("MAXIMUM", scaled, 0.0), 0.99)
        root = do("SQRT", held)
        ior = do("DIVIDE", do("ADD", 1.0, root), do("SUBTRACT", 1.0, root))
        return Ior(ior, self._expressions)

    def _f0(self) -> Value:
        do = self._expressions.math
        share = do("DIVIDE", do("SUBTRACT", self._value, 1.0), do("ADD", self._value, 1.0))
        return do("MULTIPLY", share, share)


_PLACES = [max(k / (ROWS - 1), SMALLEST) for k in range(ROWS)]
