"""What a program computes of one material: sums as graph values, values as factors of sums."""

from __future__ import annotations

from dataclasses import fields, replace

from ....engine.program.graph import Graph, Value
from ....engine.program.operations_math import MathOperation
from ....engine.program.program import compile_program
from ....engine.program.table import BY_NAME
from ....engine.scene import Input, Lobe, Material
from ..shader_nodes.luminance import luminance_of
from .products import Product, Products, number_in
from .terms import RGB, Sum, Term, constant, from_input


class Expressions:
    """The graph of one material, and which of its values are outputs of the program."""

    def __init__(self) -> None:
        self.graph = Graph()
        self._outputs: dict[Value, int] = {}
        self._products = Products(self.graph)

    def apply(self, name: str, /, *arguments: Value, **settings) -> Value:
        """The first output of the table's operation of this name."""
        return self.graph.apply(BY_NAME[name], *arguments, **settings)[0]

    def constant(self, value: float | RGB) -> Value:
        return self.graph.constant(value)

    def vector(self, value: Value) -> Value:
        """The value as a vector; a number fills it."""
        return self._products.vector(value)

    def number(self, value: Value) -> Value:
        """The value as a number: a colour by its luminance."""
        return value if value.width == 1 else luminance_of(self.graph, value)

    def parts(self, vector: Value) -> tuple[Value, ...]:
        """The three numbers of a vector."""
        number = number_in(vector)
        if number is not None:
            return (number,) * 3
        return self.graph.apply(BY_NAME["separate_xyz"], vector)

    def math(self, operation: str, *numbers: Value | float) -> Value:
        """An operation of the Math node on values and Python's own numbers."""
        given = [self.constant(x) if isinstance(x, (int, float)) else x for x in numbers]
        given += [self.constant(0.0)] * (3 - len(given))
        return self.apply("math", *given, operation=MathOperation[operation], clamp=0)

    def output(self, value: Value) -> int:
        """The number of the output that holds the value, which is no constant."""
        return self._outputs.setdefault(value, len(self._outputs))

    def value_at(self, output: int) -> Value:
        """The value that an output holds."""
        return next(value for value, number in self._outputs.items() if number == output)

    def sum_of(self, value: Value) -> Sum:
        """A value as a sum of one term."""
        value = self.vector(value)
        if value.constant is not None:
            return constant(value.constant)
        return from_input(Input(output=self.output(value)))

    def value_of(self, terms: Sum) -> Value:
        """A sum as a vector."""
        return self._products.value(map(self._product, terms))

    def looked_up(self, number: Value, table: tuple[float, ...]) -> Value:
        """A table at a number: values evenly from 0 to 1, straight in between."""
        return self._products.looked_up(number, table)

    def bounded(self, value: Value, low: float, high: float) -> Value:
        """A vector with each channel from low to high."""
        products = self._products
        return products.value([products.bounded(products.of(value), low, high)])

    def with_program(self, material: Material) -> Material:
        """The material, whose inputs name outputs of this graph, with the program that computes
        those and no others.
        """
        values = list(self._outputs)
        used = sorted(_outputs_of(material) - {-1})
        if not used:
            return material
        numbers = {-1: -1, **{old: new for new, old in enumerate(used)}}
        lobes = tuple(_renumbered(lobe, numbers) for lobe in material.lobes)
        program = compile_program(self.graph, [values[k] for k in used])
        return replace(
            material,
            lobes=lobes,
            program=program,
            normal_output=numbers[material.normal_output],
            base_normal_output=numbers[material.base_normal_output],
        )

    def _product(self, term: Term) -> Product:
        product = Product(term.value)
        for factor in term.factors:
            product = product * self._factor(factor)
        return product

    def _factor(self, factor: Input) -> Product:
        """One factor, all that it may have worked out in its order."""
        products = self._products
        product = Product(factor.value)
        if factor.texture >= 0:
            product = product * products.of(self._image(factor))
        if factor.attribute:
            color, alpha = self.graph.apply(
                BY_NAME["attribute"], attribute=factor.attribute, shift=0
            )
            channel = self._channel(factor.attribute_channel, color, alpha)
            product = product * products.of(channel)
        if factor.output >= 0:
            product = product * products.of(list(self._outputs)[factor.output])
        if not factor.is_plain:
            product = products.plus(product, factor.offset)
            product = products.bounded(product, factor.low, factor.high)
        return products.complement(product) if factor.complement else product

    def _image(self, factor: Input) -> Value:
        uv = self.apply("uv", attribute=factor.uv, shift=0)
        color, alpha = self.graph.apply(
            BY_NAME["image"], self._transformed(uv, factor.uv_transform), texture=factor.texture
        )
        return self._channel(factor.channel, color, alpha)

    def _channel(self, channel: str, color: Value, alpha: Value) -> Value:
        if channel == "COLOR":
            return color
        return alpha if channel == "ALPHA" else self.number(color)

    def _transformed(self, uv: Value, transform: tuple[RGB, RGB]) -> Value:
        """(u', v', 0) of a 2 × 3 matrix over u, v, 1."""
        if transform == Input().uv_transform:
            return uv
        u, v, _ = self.graph.apply(BY_NAME["separate_xyz"], uv)
        columns = [self.constant((a, d, 0.0)) for a, d in zip(*transform, strict=True)]
        moved = self.apply("scaled_sum", columns[1], v, columns[2])
        return self.apply("scaled_sum", columns[0], u, moved)


_OUTPUTS = tuple(given.name for given in fields(Lobe) if given.name.endswith("_output"))


def _outputs_of(material: Material) -> set[int]:
    named = {material.normal_output, material.base_normal_output}
    for lobe in material.lobes:
        named |= {getattr(lobe, name) for name in _OUTPUTS}
        named |= {f.output for f in lobe.factors}
    return named


def _renumbered(lobe: Lobe, numbers: dict[int, int]) -> Lobe:
    return replace(
        lobe,
        factors=tuple(replace(f, output=numbers[f.output]) for f in lobe.factors),
        **{name: numbers[getattr(lobe, name)] for name in _OUTPUTS},
    )


def has_output(terms: Sum) -> bool:
    """Whether a program computes some of the sum."""
    return any(factor.output >= 0 for term in terms for factor in term.factors)
