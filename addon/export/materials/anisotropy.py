"""Highlights that are wider along one direction of the surface than across it, as brushed metal has
them.
"""

from __future__ import annotations

from dataclasses import replace

from ....engine.program.graph import Value
from .closures import Closure
from .evaluator import NodeView
from .terms import Sum, constant_value, is_constant
from .varying import Roughness

TURN = 6.283185307179586
LEAST = 1e-4
"""Anisotropy that counts for none, as in Cycles."""
MOST = 0.99
"""The Glossy node's, either way."""


class Brush:
    """What the anisotropy of a node makes of its highlights. GGX's widths along the tangent and
    across it are at most 1 each, as in Cycles.

    is_signed: of the Glossy node, of which the wider way is across the tangent where it is above 0.
    roughness: of highlights as wide all round that have as much of a surface's slopes.
    """

    def __init__(self, view: NodeView, roughness: Roughness, is_signed: bool = False) -> None:
        self._view, self.roughness = view, roughness
        self._size: Value | None = None  # of the width across over that along, the root
        terms = view.number("Anisotropy" if view.input("Anisotropy") else "Anisotropic")
        if not terms or (is_constant(terms) and abs(constant_value(terms)[0]) <= LEAST):
            return
        expressions = view.evaluator.expressions
        do, amount = expressions.math, self._number(terms)
        size = self._signed(amount) if is_signed else self._unsigned(amount)
        own = roughness.value if roughness.varies else expressions.constant(roughness.value)
        alpha = do("MULTIPLY", own, own)
        along = do("MINIMUM", do("DIVIDE", alpha, size), 1.0)
        across = do("MINIMUM", do("MULTIPLY", alpha, size), 1.0)
        mean = do("SQRT", do("SQRT", do("MULTIPLY", along, across)))
        self._size = do("SQRT", do("DIVIDE", across, along))
        if mean.constant is not None:
            self.roughness = Roughness(float(mean.constant[0]))
        else:
            self.roughness = Roughness(mean, expressions)

    def on(self, closure: Closure) -> Closure:
        """The closure of such a roughness with its highlights so."""
        if self._size is None or not any(key.kind == "SPECULAR" for key in closure):
            return closure
        expressions = self._view.evaluator.expressions
        zero = expressions.constant((0.0, 0.0, 0.0))
        along = expressions.apply("scaled_sum", self._tangent(), self._size, zero)
        if along.constant is not None:  # which have no outputs
            none = expressions.constant(0.0)
            along = expressions.apply("scaled_sum", expressions.apply("normal"), none, along)
        output = expressions.output(along)
        return {
            replace(key, stretch_output=output) if key.kind == "SPECULAR" else key: weight
            for key, weight in closure.items()
        }

    def _number(self, terms: Sum) -> Value:
        expressions = self._view.evaluator.expressions
        return expressions.number(expressions.value_of(terms))

    def _unsigned(self, amount: Value) -> Value:
        """Principled's aspect: the root of 1 - 0.9 of it."""
        do = self._view.evaluator.expressions.math
        held = do("MINIMUM", do("MAXIMUM", amount, 0.0), 1.0)
        return do("SQRT", do("MULTIPLY_ADD", held, -0.9, 1.0))

    def _signed(self, amount: Value) -> Value:
        """1 + it where it is below 0, else 1 / (1 - it)."""
        do = self._view.evaluator.expressions.math
        held = do("MINIMUM", do("MAXIMUM", amount, -MOST), MOST)
        below, above = (do(name, held, 0.0) for name in ("MINIMUM", "MAXIMUM"))
        return do("DIVIDE", do("ADD", 1.0, below), do("SUBTRACT", 1.0, above))

    def _tangent(self) -> Value:
        """Unit, turned round the normal."""
        view, expressions = self._view, self._view.evaluator.expressions
        tangent = view.evaluator.tangent_at(view.input("Tangent"))
        terms = view.number("Rotation" if view.input("Rotation") else "Anisotropic Rotation")
        if terms:
            turn = expressions.math("MULTIPLY", self._number(terms), TURN)
            sine, cosine = (expressions.math(name, turn) for name in ("SINE", "COSINE"))
            normal = view.evaluator.normal_at(view.input("Normal"))
            zero = expressions.constant((0.0, 0.0, 0.0))
            tangent = expressions.apply("rotate_around_axis", tangent, zero, normal, sine, cosine)
        return expressions.apply("vector_normalized", tangent)
