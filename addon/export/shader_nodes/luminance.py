"""How a colour becomes a number: by the luminance of the working space."""

from __future__ import annotations

from ....engine.program.graph import Graph, Value
from ....engine.program.operations_vector import VectorMeasure
from ....engine.program.table import BY_NAME
from ..images.colorspace import LUMA, luma


def luminance_of(graph: Graph, color: Value) -> Value:
    """A number."""
    shares = luma()
    if shares is LUMA:
        return graph.apply(BY_NAME["rgb_to_bw"], color)[0]
    how = {"measure": int(VectorMeasure.DOT_PRODUCT)}
    return graph.apply(BY_NAME["vector_measure"], color, graph.constant(shares), **how)[0]
