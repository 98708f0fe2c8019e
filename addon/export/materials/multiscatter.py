"""Light that the microfacets of metals scatter more than once: its share of what they send out."""

from __future__ import annotations

from ....engine.program.operations_vector import VectorOperation
from .evaluator import NodeView
from .fresnel import EDGE_MEAN
from .roughness import scattered, specular_albedo
from .terms import RGB, ZERO, Sum, add, constant, is_constant, scale
from .varying import Of, Roughness

MEANT = 0.4
"""Up to this roughness the share of a colour's mean is right within 2 % of what is sent out."""
GRAZING = 1 / 21
"""The share of what a metal absorbs head-on that it reflects, on average (Schlick)."""


def share_of(mean: RGB, roughness: Roughness, grazing: float = 0.0, lack: RGB = (0.0,) * 3) -> Sum:
    """That of a surface that reflects `mean` head-on, of the rest the share `grazing`, and less by
    `lack` near grazing angles.
    """
    reflected = [f + (1 - f) * grazing - EDGE_MEAN * x for f, x in zip(mean, lack, strict=True)]
    return roughness.color(lambda r: tuple(scattered(f, r) for f in reflected))


def _lost_albedo(roughness: float) -> float:
    return specular_albedo(roughness) - 1


def share_at(
    view: NodeView, color: Sum, roughness: Roughness, grazing: float = 0.0, lack: Sum = ZERO
) -> Sum:
    """The same of colours that may vary over the surface."""
    evaluator, expressions = view.evaluator, view.evaluator.expressions
    is_smooth = not roughness.varies and roughness.value <= MEANT
    if is_smooth or (is_constant(color) and is_constant(lack)):
        return share_of(evaluator.mean(color), roughness, grazing, evaluator.mean(lack))
    do, value_of, number = expressions.apply, expressions.value_of, expressions.constant
    reflected = value_of(add(scale(color, 1 - grazing), constant(grazing), scale(lack, -EDGE_MEAN)))
    first = do("product", reflected, value_of(roughness.number(Of(specular_albedo))))
    lost = value_of(roughness.number(Of(_lost_albedo)))
    kept = do("product", expressions.bounded(reflected, -1e30, 1.0), lost)
    rest = do("scaled_sum", kept, number(1.0), number((1.0, 1.0, 1.0)))
    operation = VectorOperation.DIVIDE
    share = do("vector_math", first, rest, rest, number(1.0), operation=operation)
    return expressions.sum_of(share)
