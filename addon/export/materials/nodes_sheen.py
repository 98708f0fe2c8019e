"""Sheen, a shader by itself and on top of Principled, as closures."""

from __future__ import annotations

import numpy as np

from ....engine.program.graph import Value
from ....engine.program.operations_vector import VectorMeasure
from .closures import Closure, LobeKey
from .evaluator import CLOSURE_NODES, NodeView
from .expressions import Expressions
from .sheen import ROUGHNESS, sheen_table
from .terms import Sum, multiply
from .varying import Roughness


class Fibres:
    """The sheen of a node, as values of its program.

    share: of a uniform world, by the view, as a sum.
    """

    def __init__(
        self, view: NodeView, roughness: Roughness, distribution: str = "MICROFIBER"
    ) -> None:
        do, expressions = view.evaluator.expressions.apply, view.evaluator.expressions
        seen = (do("incoming"), view.evaluator.bend(view.input("Normal")))
        cosine = do("vector_measure", *seen, measure=VectorMeasure.DOT_PRODUCT)
        given = ROUGHNESS if roughness.varies else (roughness.value,)
        tables = [sheen_table(number, distribution) for number in given]
        found = [do("ramp", cosine, interpolates=1, table=_rows_of(table)) for table in tables]
        whole = _in_between(expressions, roughness.value, found) if roughness.varies else found[0]
        width, lean, share = expressions.parts(whole)
        self._most = np.max([table.max(0) for table in tables], 0)
        self._outputs = expressions.output(width), expressions.output(lean)
        self.share = expressions.sum_of(share)

    def closure(self, color: Sum) -> Closure:
        """Fibres that reflect a colour."""
        width, lean = self._outputs
        lobe = LobeKey(
            "SHEEN",
            width=float(self._most[0]),
            lean=float(self._most[1]),
            width_output=width,
            lean_output=lean,
        )
        seen = multiply(color, self.share)
        return {lobe: seen, LobeKey("AMBIENT"): seen}


def _rows_of(table: np.ndarray) -> tuple[float, ...]:
    """What a ramp reads."""
    return tuple(x for row in table for x in (*map(float, row), 1.0))


def _in_between(expressions: Expressions, roughness: Value, found: list[Value]) -> Value:
    """What is found at the roughnesses of the tables, linear in between."""
    do, math = expressions.apply, expressions.math
    black, total = expressions.constant((0.0, 0.0, 0.0)), found[0]
    for low, high, after in zip(ROUGHNESS, ROUGHNESS[1:], found[1:], strict=False):
        way = math("MULTIPLY", math("SUBTRACT", roughness, low), 1 / (high - low))
        way = math("MINIMUM", math("MAXIMUM", way, 0.0), 1.0)
        rest = do("scaled_sum", total, math("SUBTRACT", 1.0, way), black)
        total = do("scaled_sum", after, way, rest)
    return total


def _sheen(view: NodeView) -> Closure:
    fibres = Fibres(view, view.roughness(), view.node.distribution)
    return fibres.closure(view.reflectance("Color"))


CLOSURE_NODES["ShaderNodeBsdfSheen"] = _sheen
