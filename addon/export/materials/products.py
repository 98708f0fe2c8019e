"""Sums of products as values of a graph. What is the same on all channels is worked out as one
number, and what follows from one number alone is one table over it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from ....engine.program.graph import Graph, Value
from ....engine.program.operations_math import ClampType, MathOperation
from ....engine.program.table import BY_NAME
from .terms import RGB, times

BLACK = (0.0, 0.0, 0.0)
WHITE = (1.0, 1.0, 1.0)

Place = tuple[Value, int]
"""Where tables are read that may be one: at a number, of so many rows."""


@dataclass(frozen=True)
class Product:
    """share × each vector × each number × each table.

    tables: (rows,) float64 each, values evenly over numbers from 0 to 1 and straight in between.
    """

    share: RGB = WHITE
    vectors: tuple[Value, ...] = ()
    numbers: tuple[Value, ...] = ()
    tables: dict[Place, np.ndarray] = field(default_factory=dict)

    @property
    def is_grey(self) -> bool:
        """Whether it is the same on all channels."""
        return not self.vectors and _is_grey(self.share)

    @property
    def is_one_table(self) -> bool:
        return self.is_grey and len(self.tables) == 1 and not self.numbers

    def __mul__(self, other: Product) -> Product:
        tables = dict(self.tables)
        for place, table in other.tables.items():
            tables[place] = tables[place] * table if place in tables else table
        return Product(
            times(self.share, other.share),
            self.vectors + other.vectors,
            self.numbers + other.numbers,
            tables,
        )


class Products:
    """Products and sums of a graph's values, as values."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph

    def of(self, value: Value) -> Product:
        """A value as a product."""
        if value.constant is not None:
            return Product(value.constant * (3 // value.width))
        number = number_in(value)
        if number is None:
            return Product(vectors=(value,))
        if number.call.operation.name != "lookup" or number.call.settings[0] != 0:
            return Product(numbers=(number,))
        table = self._graph.meant(number.call.operation, number.call.settings)["table"]
        return Product(tables={(number.call.arguments[0], len(table)): np.array(table)})

    def bounded(self, product: Product, low: float, high: float) -> Product:
        """It with each channel from low to high."""
        if product.is_one_table:
            ((place, table),) = product.tables.items()
            return Product(tables={place: np.clip(product.share[0] * table, low, high)})
        if product.is_grey:
            number, ends = self._number(product), map(self._graph.constant, (low, high))
            return self.of(self._apply("clamp", number, *ends, clamp_type=ClampType.MINMAX))
        ends = (self._graph.constant((x,) * 3) for x in (low, high))
        return self.of(self._apply("bounded", self.value([product]), *ends))

    def plus(self, product: Product, offset: RGB) -> Product:
        """It and an offset."""
        if product.is_one_table and _is_grey(offset):
            ((place, table),) = product.tables.items()
            return Product(tables={place: product.share[0] * table + offset[0]})
        return self.of(self.value([product, Product(offset)]))

    def complement(self, product: Product) -> Product:
        """1 - it."""
        return self.plus(replace(product, share=times(product.share, (-1.0,) * 3)), WHITE)

    def value(self, products: Iterable[Product]) -> Value:
        """Their sum as a vector."""
        grey, total = self._graph.constant(0.0), self._graph.constant(BLACK)
        for product in _joined(products):
            number = self._number(product)
            if product.is_grey:
                grey = self._added(grey, number)
                continue
            vector = self._vector(product)
            if total.constant == BLACK and number.constant == (1.0,):
                total = vector
            else:
                total = self._apply("scaled_sum", vector, number, total)
        if total.constant == BLACK:
            return self.vector(grey)
        if grey.constant == (0.0,):
            return total
        return self._apply("scaled_sum", self.vector(grey), self._graph.constant(1.0), total)

    def vector(self, value: Value) -> Value:
        """The value as a vector; a number fills it."""
        return value if value.width == 3 else self._apply("combine_xyz", value, value, value)

    def _number(self, product: Product) -> Value:
        """What it has on all channels alike."""
        total = self._graph.constant(1.0)
        for number in product.numbers:
            total = self._times(total, number)
        for (place, _), table in product.tables.items():
            total = self._times(total, self.looked_up(place, tuple(table.tolist())))
        if _is_grey(product.share):
            total = self._times(total, self._graph.constant(product.share[0]))
        return total

    def looked_up(self, number: Value, table: tuple[float, ...]) -> Value:
        """A table at a number, as Product has them."""
        return self._apply("lookup", number, last=0, table=table)

    def _vector(self, product: Product) -> Value:
        shares = () if _is_grey(product.share) else (self._graph.constant(product.share),)
        first, *rest = *product.vectors, *shares
        for vector in rest:
            first = self._apply("product", first, vector)
        return first

    def _times(self, a: Value, b: Value) -> Value:
        if a.constant == (1.0,):
            return b
        return a if b.constant == (1.0,) else self._math(MathOperation.MULTIPLY, a, b)

    def _added(self, a: Value, b: Value) -> Value:
        return b if a.constant == (0.0,) else self._math(MathOperation.ADD, a, b)

    def _math(self, operation: MathOperation, a: Value, b: Value) -> Value:
        return self._apply("math", a, b, self._graph.constant(0.0), operation=operation, clamp=0)

    def _apply(self, name: str, /, *arguments: Value, **settings) -> Value:
        return self._graph.apply(BY_NAME[name], *arguments, **settings)[0]


def _joined(products: Iterable[Product]) -> Iterable[Product]:
    """With one for those that differ in a table or in their share alone."""
    found: dict[tuple, Product] = {}
    for product in products:
        key = _what_it_has(product)
        before = found.get(key)
        found[key] = product if before is None else _sum(before, product)
    return found.values()


def _what_it_has(product: Product) -> tuple:
    """The same for products whose sum is one product too."""
    is_one = len(product.tables) < 2 and (_is_grey(product.share) or not product.tables)
    return (product.vectors, product.numbers, *product.tables) if is_one else (id(product),)


def _sum(a: Product, b: Product) -> Product:
    if not a.tables:
        return replace(a, share=tuple(x + y for x, y in zip(a.share, b.share, strict=True)))
    (place,) = a.tables
    tables = (product.share[0] * product.tables[place] for product in (a, b))
    return replace(a, share=WHITE, tables={place: sum(tables)})


def _is_grey(rgb: RGB) -> bool:
    return rgb[0] == rgb[1] == rgb[2]


def number_in(value: Value) -> Value | None:
    """The number that a value is, or is on all channels; None of what differs on these."""
    if value.width == 1:
        return value
    if value.call is None or value.call.operation.name != "combine_xyz":
        return None
    first, *rest = value.call.arguments
    return first if all(other is first for other in rest) else None
